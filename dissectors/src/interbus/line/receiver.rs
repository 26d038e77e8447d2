//! One wire: line levels in, telegrams out. It walks from edge to edge, never over samples.
//!
//! ```text
//! status  0 f1 f2 f3 1            5 bits: start, three flags, stop
//! data    0 f1 f2 f3 d d d d d d d d 1   13 bits
//! ```
//!
//! Every start edge is a new beginning, and between characters the line may idle as long as it
//! likes.

use crate::event::Levels;

/// Bits before the data: start and flags.
const HEAD: u8 = 4;

/// Bits of data.
const DATA: u8 = 8;

/// So many equal status telegrams in a row are what fills a pause.
const ALIKE: u8 = 8;

/// Fractions of a tick that are reckoned with.
const TICK: i64 = 1 << 12;

/// The longest bit, in ticks.
const SLOWEST: f64 = 1e12;

/// The three flags of a character, the first the highest.
pub type Flags = u8;

/// Which flags mean a status telegram: one flag and its value.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct StatusFlag {
    /// Its place, from 0.
    pub place: u8,
    /// Its value in status telegrams.
    pub value: bool,
}

impl StatusFlag {
    /// All there can be, the likeliest first: the third, which is 0.
    pub const ALL: [StatusFlag; 6] = {
        const fn flag(place: u8, value: bool) -> StatusFlag {
            StatusFlag { place, value }
        }
        [
            flag(2, false),
            flag(2, true),
            flag(1, false),
            flag(1, true),
            flag(0, false),
            flag(0, true),
        ]
    };

    /// Whether a telegram with these flags is a status telegram.
    #[must_use]
    pub const fn is_status(self, flags: Flags) -> bool {
        bit(flags, self.place) == self.value
    }
}

/// The flag at a place.
#[must_use]
pub const fn bit(flags: Flags, place: u8) -> bool {
    flags >> (2 - place) & 1 == 1
}

/// How characters are sent.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Shape {
    /// How long a bit lasts, in ticks.
    pub bit: f64,
    /// The line idles low.
    pub is_inverted: bool,
    /// What may tell status telegrams: places in [`StatusFlag::ALL`], by bit.
    pub status: u8,
    /// Stop bits that are looked at.
    pub stop_bits: u8,
}

/// A character.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Telegram {
    /// The tick of its start edge.
    pub start: u64,
    /// Its flags.
    pub flags: Flags,
    /// What it carries, the bit sent first the highest; `None` of a status telegram.
    pub data: Option<u8>,
    /// The stop bit is one.
    pub is_good: bool,
    /// Such flags are new, and whether it is a status telegram was no more than likely.
    pub is_doubtful: bool,
}

/// What a character with some flags is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Class {
    Status,
    Data,
    /// Such flags were not seen yet, and what was seen does not decide it.
    Open,
}

fn classes(status: u8) -> [Class; 8] {
    let mut classes = [Class::Open; 8];
    for (flags, class) in (0..8).zip(&mut classes) {
        let may_be = |place: &usize| status >> place & 1 == 1;
        let mut says = (0..StatusFlag::ALL.len())
            .filter(may_be)
            .map(|place| StatusFlag::ALL[place].is_status(flags));
        let first = says.next();
        *class = match first {
            Some(first) if says.any(|other| other != first) => Class::Open,
            Some(false) => Class::Data,
            _ => Class::Status,
        };
    }
    classes
}

/// Turns levels into telegrams.
#[derive(Clone, Debug)]
pub struct Receiver {
    bit: i64,
    is_inverted: bool,
    status: u8,
    classes: [Class; 8],
    /// The flags of the last status telegrams that may be data, and how many they are.
    alike: (Flags, u8),
    is_doubtful: bool,
    stop_bits: u8,
    /// The character at hand: its start edge.
    start: Option<u64>,
    /// Its bits so far, and how many they are.
    bits: u16,
    count: u8,
    /// How many it will be.
    due: u8,
    /// Where the next is sampled, in fractions of a tick behind the start edge.
    next: i64,
    /// The line is not idle, and no character: until it idles.
    level: bool,
    is_begun: bool,
    /// The line is known before this tick.
    pub until: u64,
}

impl Receiver {
    /// A receiver of such characters.
    #[must_use]
    pub fn new(shape: Shape) -> Self {
        Receiver {
            bit: (shape.bit.clamp(1.0, SLOWEST) * TICK as f64) as i64,
            is_inverted: shape.is_inverted,
            status: shape.status,
            classes: classes(shape.status),
            alike: (0, 0),
            is_doubtful: false,
            stop_bits: shape.stop_bits.clamp(1, 2),
            start: None,
            bits: 0,
            count: 0,
            due: 0,
            next: 0,
            level: true,
            is_begun: false,
            until: 0,
        }
    }

    /// What may tell status telegrams, by what was seen so far.
    #[must_use]
    pub fn status(&self) -> u8 {
        self.status
    }

    /// The start edge of a character that is not over.
    #[must_use]
    pub fn open(&self) -> Option<u64> {
        self.start
    }

    /// Takes the next piece of line.
    pub fn hear(&mut self, levels: &Levels<'_>, emit: &mut impl FnMut(Telegram)) {
        if !self.is_begun {
            self.is_begun = true;
            self.level = levels.level != self.is_inverted;
        }
        for tick in levels.edges.iter().copied() {
            self.sample(tick, emit);
            self.level = !self.level;
            if !self.level && self.start.is_none() {
                self.start = Some(tick);
                (self.bits, self.count, self.due) = (0, 0, HEAD);
                // The edge was at its tick or up to one before.
                self.next = self.bit / 2 - TICK / 2;
            }
        }
        self.sample(levels.until, emit);
        self.until = self.until.max(levels.until);
    }

    /// The line is not heard any further, or not for a while.
    pub fn end(&mut self) {
        self.start = None;
        self.is_begun = false;
        self.until = 0;
    }

    /// Samples the bits before a tick.
    fn sample(&mut self, until: u64, emit: &mut impl FnMut(Telegram)) {
        let Some(start) = self.start else { return };
        let ahead = until.saturating_sub(start).min(i64::MAX.unsigned_abs() / TICK.unsigned_abs());
        let ahead = ahead.cast_signed() * TICK;
        while self.next < ahead {
            self.next += self.bit;
            self.bits = self.bits << 1 | u16::from(self.level);
            self.count += 1;
            if self.count == 1 && self.level {
                // The start bit was no more than a pulse.
                self.start = None;
                return;
            }
            if self.count < self.due {
                continue;
            }
            match self.count {
                HEAD => {
                    let class = self.classes[usize::from(self.bits & 7)];
                    let is_data = class == Class::Data;
                    self.is_doubtful = class == Class::Open;
                    self.due = HEAD + self.stop_bits + if is_data { DATA } else { 0 };
                }
                // What has no stop bit there, and may be data, is data.
                count if count == HEAD + self.stop_bits && self.is_open() => self.settle(),
                _ => {
                    self.finish(start, emit);
                    return;
                }
            }
        }
    }

    fn is_open(&self) -> bool {
        let head = usize::from(self.bits >> self.stop_bits & 7);
        let stop = (1 << self.stop_bits) - 1;
        self.classes[head] == Class::Open && self.bits & stop != stop
    }

    /// The character at hand is data.
    fn settle(&mut self) {
        self.due += DATA;
        self.learn((self.bits >> self.stop_bits & 7) as Flags, Class::Data);
    }

    /// Many of the same in a row fill a pause.
    fn count_alike(&mut self, flags: Flags) {
        let (last, count) = self.alike;
        self.alike = (flags, if last == flags { count.saturating_add(1) } else { 1 });
        if self.alike.1 >= ALIKE {
            self.learn(flags, Class::Status);
        }
    }

    fn learn(&mut self, head: Flags, class: Class) {
        self.classes[usize::from(head)] = class;
        let mut left = 0;
        for (place, flag) in StatusFlag::ALL.iter().enumerate() {
            let is_alike = flag.is_status(head) == (class == Class::Status);
            left |= u8::from(is_alike) << place;
        }
        if self.status & left != 0 {
            self.status &= left;
            self.classes = classes(self.status);
        }
    }

    fn finish(&mut self, start: u64, emit: &mut impl FnMut(Telegram)) {
        let stop = (1 << self.stop_bits) - 1;
        let is_good = self.bits & stop == stop;
        let bits = self.bits >> self.stop_bits;
        let is_data = self.count > HEAD + self.stop_bits;
        let data = is_data.then_some(bits as u8);
        let head = if is_data { bits >> DATA } else { bits };
        let (flags, is_doubtful) = ((head & 7) as Flags, self.is_doubtful);
        match is_doubtful && is_good && !is_data {
            true => self.count_alike(flags),
            false => self.alike.1 = 0,
        }
        emit(Telegram { start, flags, data, is_good, is_doubtful });
        self.start = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::{vec, vec::Vec};

    /// Levels of these bits, so many ticks each, behind one idle bit.
    fn heard(bits: &str, ticks: f64, is_inverted: bool) -> Vec<Telegram> {
        let levels: Vec<bool> = "1".chars().chain(bits.chars()).map(|bit| bit == '1').collect();
        let mut edges = Vec::new();
        for (index, pair) in levels.windows(2).enumerate() {
            if pair[0] != pair[1] {
                edges.push(((index + 1) as f64 * ticks) as u64 + 1);
            }
        }
        let until = (levels.len() as f64 * ticks) as u64 + 1;
        let shape = Shape { bit: ticks, is_inverted, status: 1, stop_bits: 1 };
        let mut receiver = Receiver::new(shape);
        let mut telegrams = Vec::new();
        let levels = Levels { edges: &edges, level: !is_inverted, from: 0, until };
        receiver.hear(&levels, &mut |telegram| telegrams.push(telegram));
        telegrams
    }

    /// Data 81h with flags 001, and a status telegram with flags 000.
    #[test]
    fn the_model_character_and_status() {
        for ticks in [8.0, 8.4, 16.0, 100.0] {
            for is_inverted in [false, true] {
                let telegrams = heard("000110000001100001000110000001", ticks, is_inverted);
                let brief: Vec<_> =
                    telegrams.iter().map(|it| (it.flags, it.data, it.is_good)).collect();
                let expected = vec![(1, Some(0x81), true), (0, None, true)];
                assert_eq!(brief, expected, "{ticks} {is_inverted}");
            }
        }
    }

    #[test]
    fn characters_may_be_any_time_apart() {
        let telegrams = heard("0001100000011110001101010101111110000111", 8.0, false);
        let data: Vec<_> = telegrams.iter().map(|it| it.data).collect();
        assert_eq!(data, [Some(0x81), Some(0xAA), None]);
        // 260 µs for ten characters of an LA-66 alone in the ring: 13 bits each, 2 µs a bit.
        assert_eq!(13 * 10 * 2, 260);
    }

    #[test]
    fn a_stop_bit_that_is_none_is_told_and_a_pulse_is_no_character() {
        let telegrams = heard("00011000000100001111", 8.0, false);
        assert_eq!((telegrams[0].data, telegrams[0].is_good), (Some(0x81), false));
    }
}
