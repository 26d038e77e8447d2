//! An LA-66: parameters in its EEPROM, and its side of the handshake (manual §2 to §4).

use super::word::{
    ADJUST, DATA, DIRECTION, ERROR, LENGTH, MAGNET, PRESET, SERVICE, STATUS, WRITE, service,
};
use crate::simulate::chance::Chance;

/// What an encoder does wrong with the next service.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Slip {
    /// It acknowledges another service.
    OtherService,
    /// It gives back other data.
    OtherData,
    /// It does not acknowledge.
    Silent,
    /// It takes so many bus cycles longer.
    Slow(u64),
    /// It does not withdraw its acknowledgement for so many bus cycles.
    Holds(u64),
}

/// How far a service is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum State {
    /// The position is shown.
    Normal,
    /// It will be done in this bus cycle.
    Working(u64),
    /// It is done, and this tells so.
    Done(u32),
    /// The request is withdrawn, and the acknowledgement will be in this cycle.
    Releasing(u64, u32),
}

/// An LA-66.
pub struct Encoder {
    decreasing: bool,
    /// Measuring length in steps.
    pub length: u32,
    /// What the external input sets.
    pub preset: u32,
    /// What is added to the steps on the rod.
    offset: u32,
    /// The magnet is outside the measuring range.
    pub is_magnet_outside: bool,
    /// The error bit, which stands until the status is read.
    has_error: bool,
    /// What it will do wrong.
    pub slip: Option<Slip>,
    state: State,
    /// Bus cycles in a millisecond.
    cycles_per_ms: f64,
    chance: Chance,
}

impl Encoder {
    /// An encoder with parameters from somebody before.
    pub fn new(length: u32, cycles_per_ms: f64, mut chance: Chance) -> Self {
        let preset = chance.between(1 << 18, (1 << 24) - (1 << 18)) as u32;
        Encoder {
            decreasing: false,
            length,
            preset,
            offset: 0,
            is_magnet_outside: false,
            has_error: false,
            slip: None,
            state: State::Normal,
            cycles_per_ms,
            chance,
        }
    }

    /// The bus cycle of this number: what it sends, when it has this output data from the cycle
    /// before and the magnet is at this place of the rod.
    pub fn answer(&mut self, cycle: u64, out: u32, place: f64) -> u32 {
        self.has_error |= self.is_magnet_outside;
        let is_asked = out & SERVICE != 0;
        match self.state {
            State::Normal if is_asked => {
                self.state = State::Working(cycle + self.lag(out));
            }
            State::Working(_) if !is_asked => self.state = State::Normal,
            State::Working(at) if cycle >= at && self.slip != Some(Slip::Silent) => {
                self.state = State::Done(self.serve(out, place));
            }
            State::Done(word) if !is_asked => {
                let lag = match self.slip.take() {
                    Some(Slip::Holds(cycles)) => cycles,
                    _ => self.chance.below(2),
                };
                self.state = State::Releasing(cycle + lag, word);
            }
            _ => {}
        }
        match self.state {
            State::Done(word) => word,
            State::Releasing(at, word) if cycle < at => word,
            State::Releasing(..) => {
                self.state = State::Normal;
                self.shown(place)
            }
            _ => self.shown(place),
        }
    }

    /// Sets the position, as the external preset input does.
    pub fn adjust(&mut self, value: u32, place: f64) {
        self.offset = value.wrapping_sub(self.steps(place)) & DATA;
    }

    /// The position is off by so much from now on.
    pub fn shift(&mut self, steps: i32) {
        self.offset = self.offset.wrapping_add_signed(steps) & DATA;
    }

    /// The position that is shown with the magnet at this place.
    pub fn position(&self, place: f64) -> u32 {
        self.steps(place).wrapping_add(self.offset) & DATA
    }

    /// Normal mode: the position, and the error bit.
    fn shown(&self, place: f64) -> u32 {
        let error = if self.has_error { ERROR } else { 0 };
        self.position(place) | error
    }

    fn steps(&self, place: f64) -> u32 {
        let steps = (place * f64::from(self.length)) as u32;
        if self.decreasing { self.length - steps } else { steps }
    }

    /// How many cycles a service takes: an EEPROM takes milliseconds to write.
    fn lag(&mut self, out: u32) -> u64 {
        let is_stored = out & WRITE != 0 && service(out) != ADJUST;
        let most = if is_stored { 20.0 * self.cycles_per_ms } else { 3.0 };
        let slower = match self.slip {
            Some(Slip::Slow(cycles)) => cycles,
            _ => 0,
        };
        self.chance.below(most as u64 + 1) + slower
    }

    /// Does what it is asked for, and tells what it acknowledges with: with what it was sent if it
    /// was told to write, with the value if it was to read (manual §2.3).
    fn serve(&mut self, out: u32, place: f64) -> u32 {
        let acknowledged = match self.value(out, place) {
            Some(value) => out & !DATA | value,
            None if out & WRITE != 0 => out | ERROR,
            None => out & !DATA | ERROR,
        };
        match self.slip {
            Some(Slip::OtherService) => {
                self.slip = None;
                acknowledged ^ (service(acknowledged) ^ (service(acknowledged) % 8 + 1)) << 24
            }
            Some(Slip::OtherData) => {
                self.slip = None;
                acknowledged ^ (1 + self.chance.below(0xFF) as u32)
            }
            _ => acknowledged,
        }
    }

    /// The data of an acknowledgement; none if it refuses.
    fn value(&mut self, out: u32, place: f64) -> Option<u32> {
        let (is_write, data) = (out & WRITE != 0, out & DATA);
        match (service(out), is_write) {
            (DIRECTION, true) if data <= 1 => self.decreasing = data == 1,
            (DIRECTION, false) => return Some(u32::from(self.decreasing)),
            (LENGTH, true) => self.length = data,
            (LENGTH, false) => return Some(self.length),
            (PRESET, true) => self.preset = data,
            (PRESET, false) => return Some(self.preset),
            (ADJUST, true) => self.adjust(data, place),
            (STATUS, false) => {
                self.has_error = self.is_magnet_outside;
                return Some(if self.is_magnet_outside { MAGNET } else { 0 });
            }
            _ => return None,
        }
        Some(data)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What it sends in the cycles in which it is sent these words, up to the first change.
    fn answers(encoder: &mut Encoder, outs: &[u32]) -> Vec<u32> {
        let mut cycle = 0;
        let mut answers = Vec::new();
        for out in outs {
            let before = encoder.answer(cycle, *out, 0.5);
            let mut answer = before;
            for _ in 0..50 {
                cycle += 1;
                answer = encoder.answer(cycle, *out, 0.5);
            }
            answers.push(answer);
        }
        answers
    }

    fn encoder() -> Encoder {
        Encoder::new(50_000, 1.0, Chance::new(1, 1))
    }

    #[test]
    fn a_handshake_of_the_manual() {
        // LA-66 manual §4: OUT 42001388, C2001388, IN C2001388, OUT 42001388, position again. The middle
        // of the rod is 25000 of 50000 steps, and 2500 of 5000.
        let mut encoder = encoder();
        assert_eq!(
            answers(&mut encoder, &[0, 0x4200_1388, 0xC200_1388, 0x4200_1388]),
            [25_000, 25_000, 0xC200_1388, 2_500]
        );
        assert_eq!(answers(&mut encoder, &[0x8200_0000, 0]), [0x8200_1388, 2_500]);
        // Counting the other way: read 81000000, 81000001.
        assert_eq!(answers(&mut encoder, &[0xC100_0001, 0]), [0xC100_0001, 2_500]);
        assert_eq!(answers(&mut encoder, &[0x8100_0000, 0]), [0x8100_0001, 2_500]);
        // The position is set to 100.
        assert_eq!(answers(&mut encoder, &[0xC600_0064, 0]), [0xC600_0064, 100]);
    }

    #[test]
    fn the_error_bit_stands_until_the_status_is_read() {
        let mut encoder = encoder();
        encoder.is_magnet_outside = true;
        assert_eq!(
            answers(&mut encoder, &[0, 0x8800_0000, 0]),
            [ERROR | 25_000, 0x8800_0020, ERROR | 25_000]
        );
        encoder.is_magnet_outside = false;
        assert_eq!(
            answers(&mut encoder, &[0, 0x8800_0000, 0]),
            [ERROR | 25_000, 0x8800_0000, 25_000]
        );
    }

    #[test]
    fn what_cannot_be_done_is_refused_with_the_error_bit() {
        // Service 6 cannot be read, 8 not written, 3 is none, a direction is 0 or 1.
        for (out, answer) in [
            (0x8600_0000, 0xA600_0000),
            (0xC800_0000, 0xE800_0000),
            (0x8300_0000, 0xA300_0000),
            (0xC100_0002, 0xE100_0002),
        ] {
            assert_eq!(answers(&mut encoder(), &[out, 0]), [answer, 25_000]);
        }
    }

    #[test]
    fn slips_are_what_they_are_called() {
        for slip in [Slip::OtherService, Slip::OtherData, Slip::Silent] {
            let mut encoder = encoder();
            encoder.slip = Some(slip);
            let answer = answers(&mut encoder, &[0xC400_0064])[0];
            match slip {
                Slip::OtherService => assert_eq!(answer, 0xC500_0064),
                Slip::OtherData => {
                    assert_eq!(answer & !DATA, 0xC400_0000);
                    assert_ne!(answer & DATA, 0x64);
                }
                _ => assert_eq!(answer, 25_000),
            }
        }
        let mut encoder = encoder();
        encoder.slip = Some(Slip::Holds(80));
        let held = [0x8400_0000 | encoder.preset; 2];
        assert_eq!(answers(&mut encoder, &[0x8400_0000, 0]), held);
        assert_eq!(answers(&mut encoder, &[0]), [held[0]]);
    }
}
