//! What is done with an encoder next: an errand as any PLC has it, or one that goes wrong.

use super::encoder::Slip;
use super::fault::Fault;
use super::master::{Act, Manner};
use super::word::{
    ADJUST, DATA, DIRECTION, LENGTH, PRESET, RESERVE, SERVICE, STATUS, WRITE, read, write,
};
use crate::simulate::chance::Chance;
use crate::simulate::time::{MS, Ps, S};
use std::collections::VecDeque;

/// Values that a preset may have: far enough from both ends that no rod reaches beyond.
const PRESETS: (i64, i64) = (1 << 18, (1 << 24) - (1 << 18));

/// Within this time, the counting direction is not written again: it has two values only, and a
/// PLC that writes one of them all the time wears the EEPROM out.
const DIRECTION_REST: Ps = 20 * S;

/// Who writes the scripts of an encoder.
pub struct Author {
    chance: Chance,
    /// Bus cycles in two seconds: for as long an acknowledgement can be held.
    hold: u64,
    is_decreasing: bool,
    /// When the direction may be written next.
    direction_from: Ps,
    /// The values of the last writes, which no other write repeats.
    last: VecDeque<u32>,
    has_external_presets: bool,
}

fn plain(word: u32) -> Act {
    Act::Serve(word, Manner::Usual, None)
}

impl Author {
    /// An author who lets acknowledgements stand for so many bus cycles, if it comes to that.
    pub fn new(hold: u64, has_external_presets: bool, chance: Chance) -> Self {
        let last = VecDeque::new();
        let (is_decreasing, direction_from) = (false, DIRECTION_REST / 4);
        Author { chance, hold, is_decreasing, direction_from, last, has_external_presets }
    }

    /// What every PLC does first: it reads all there is to read.
    pub fn first(&mut self, pause: Ps) -> Vec<Act> {
        let services = [DIRECTION, LENGTH, PRESET, STATUS];
        let acts =
            services.into_iter().flat_map(|service| [plain(read(service)), Act::Wait(pause)]);
        [Act::Wait(pause)].into_iter().chain(acts).collect()
    }

    /// An errand without a fault. `at_rest`: the carriage does not move.
    pub fn errand(&mut self, now: Ps, is_at_rest: bool) -> Vec<Act> {
        let kind = self.chance.below(100);
        let act = match kind {
            0..5 if self.has_external_presets && is_at_rest => Act::ExternalPreset,
            0..60 => {
                let services = [DIRECTION, LENGTH, PRESET, STATUS];
                plain(read(self.chance.one_of(&services).unwrap_or(STATUS)))
            }
            60..64 if now >= self.direction_from => {
                self.direction_from = now + DIRECTION_REST;
                self.is_decreasing = !self.is_decreasing;
                plain(write(DIRECTION, u32::from(self.is_decreasing)))
            }
            60..72 => plain(write(LENGTH, self.value(1_000, 200_000))),
            72..86 => plain(write(PRESET, self.value(PRESETS.0, PRESETS.1))),
            _ => plain(write(ADJUST, self.value(PRESETS.0, PRESETS.1))),
        };
        vec![act]
    }

    /// An errand that goes wrong.
    pub fn mishap(&mut self, fault: Fault) -> Vec<Act> {
        use Fault::*;
        let served = |word, manner, slip| vec![Act::Serve(word, manner, slip)];
        let status = plain(read(STATUS));
        let magnet = |is_outside| Act::Magnet { is_outside };
        // Slow enough for the PLC to see that it waits.
        let slow = Some(Slip::Slow(self.hold / 20));
        match fault {
            UnrequestedAcknowledge => {
                vec![Act::Garble(SERVICE | read(LENGTH)), Act::Wait(100 * MS)]
            }
            ServiceMismatch => served(self.some_write(), Manner::Usual, Some(Slip::OtherService)),
            EchoMismatch => served(self.some_write(), Manner::Usual, Some(Slip::OtherData)),
            ErrorBit => {
                let rest = [Act::Wait(400 * MS), magnet(false), Act::Wait(100 * MS), status];
                [vec![magnet(true)], rest.to_vec(), vec![Act::Wait(50 * MS)]].concat()
            }
            Magnet => {
                let outside = [magnet(true), Act::Wait(200 * MS), status, Act::Wait(200 * MS)];
                let inside = [magnet(false), Act::Wait(50 * MS), status, Act::Wait(50 * MS)];
                [outside, inside].concat()
            }
            UndefinedService => {
                let services = [0, 3, 5, 7, 9, 10, 11, 12, 13, 14, 15];
                let service = self.chance.one_of(&services).unwrap_or(3);
                // A word that is all zeros would lay nothing out.
                let word = if self.chance.happens(0.5) { read(service) } else { write(service, 1) };
                served(if word == 0 { WRITE } else { word }, Manner::Usual, None)
            }
            Access => {
                let words = [read(ADJUST), write(STATUS, 0)];
                served(self.chance.one_of(&words).unwrap_or(words[0]), Manner::Usual, None)
            }
            ReservedBits => match self.chance.below(3) {
                0 => served(read(LENGTH) | RESERVE, Manner::Usual, None),
                bit => vec![Act::Garble(if bit == 1 { RESERVE } else { 1 << 24 })],
            },
            ValueOutOfRange => {
                served(write(DIRECTION, self.value(2, 1 << 20)), Manner::Usual, None)
            }
            NoAcknowledge => served(self.some_read(), Manner::Usual, Some(Slip::Silent)),
            NoRelease => served(self.some_read(), Manner::Usual, Some(Slip::Holds(self.hold))),
            DataWithServiceBit => served(self.some_write(), Manner::AtOnce, None),
            RequestChanged => served(self.some_stored(), Manner::Changes, slow),
            Withdrawn => served(self.some_stored(), Manner::Withdraws, slow),
            PositionJump => {
                let steps = self.chance.between(20_000, 200_000) as i32;
                let is_spike = self.chance.happens(0.5);
                vec![if is_spike { Act::Spike(steps) } else { Act::Shift(steps) }, Act::Wait(S)]
            }
            RepeatedWrite => {
                let word = self.some_stored();
                (0..10).flat_map(|_| [plain(word), Act::Wait(30 * MS)]).collect()
            }
            Written => served(self.some_stored(), Manner::Usual, None),
            // They are not in the process data.
            Crc | Reset | MissingCharacter | ExtraCharacter | Reconfiguration | ControlWord => {
                Vec::new()
            }
        }
    }

    /// A value that was not written lately.
    fn value(&mut self, low: i64, high: i64) -> u32 {
        let value = loop {
            let value = self.chance.between(low, high) as u32 & DATA;
            if !self.last.contains(&value) {
                break value;
            }
        };
        self.last.truncate(15);
        self.last.push_front(value);
        value
    }

    fn some_read(&mut self) -> u32 {
        read(self.chance.one_of(&[LENGTH, PRESET, STATUS]).unwrap_or(LENGTH))
    }

    fn some_write(&mut self) -> u32 {
        let service = self.chance.one_of(&[PRESET, ADJUST]).unwrap_or(PRESET);
        write(service, self.value(PRESETS.0, PRESETS.1))
    }

    /// Writes the preset value 1, which does not move the position.
    fn some_stored(&mut self) -> u32 {
        write(PRESET, self.value(PRESETS.0, PRESETS.1))
    }
}
