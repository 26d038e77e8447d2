//! The line: what is driven onto it, as the spans of time in which it is low.
//!
//! An idle line is high, and whoever sends pulls it low, bit by bit. Noise, breaks and collisions
//! are spans like any other; where two senders overlap, low wins.

use crate::simulate::level::Low;
use crate::simulate::time::{Clock, Ps};

/// How the parity bit follows from the data bits.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Parity {
    /// There is none: characters have ten bits.
    None,
    /// The ones of data and parity bit are even in number: the format of IEC FT1.2.
    Even,
    /// They are odd.
    Odd,
}

impl Parity {
    /// The parity bit that belongs to a byte.
    pub fn bit(self, byte: u8) -> Option<bool> {
        let is_odd = byte.count_ones() % 2 == 1;
        match self {
            Parity::None => None,
            Parity::Even => Some(is_odd),
            Parity::Odd => Some(!is_odd),
        }
    }
}

/// The number that [`Character::flipped`] has for the parity bit.
pub const PARITY_BIT: u8 = 8;

/// How long a torn stop bit is low, in bits: beyond its middle, and short of the next start bit.
const TORN: f64 = 0.7;

/// A character as it goes over the line.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Character {
    /// What was to be sent.
    pub byte: u8,
    /// The bit that is wrong on the line: data bit 0 to 7, or [`PARITY_BIT`].
    pub flipped: Option<u8>,
    /// Whether the stop bit begins low.
    pub is_stop_torn: bool,
}

impl Character {
    /// An intact character.
    pub const fn new(byte: u8) -> Self {
        Character { byte, flipped: None, is_stop_torn: false }
    }

    /// The byte that arrives.
    pub fn arriving(self) -> u8 {
        match self.flipped {
            Some(bit) if bit < PARITY_BIT => self.byte ^ 1 << bit,
            _ => self.byte,
        }
    }

    /// Start bit, data bits with the lowest first, and parity bit, as levels.
    fn levels(self, parity: Parity) -> impl Iterator<Item = bool> {
        let arriving = self.arriving();
        let data = (0..8).map(move |bit| arriving >> bit & 1 == 1);
        let flipped = self.flipped == Some(PARITY_BIT);
        let parity = parity.bit(self.byte).map(|bit| bit ^ flipped);
        std::iter::once(false).chain(data).chain(parity)
    }
}

/// What is on the line, in no particular order.
#[derive(Clone, Default, Debug)]
pub struct Line(Vec<Low>);

impl Line {
    /// Pulls the line low.
    pub fn pull(&mut self, from: Ps, to: Ps) {
        self.0.push(Low { from, to });
    }

    /// Sends a character. Returns the end of its stop bit.
    pub fn send(&mut self, character: Character, start: Ps, clock: Clock, parity: Parity) -> Ps {
        let mut bits = 0.0;
        for level in character.levels(parity) {
            if !level {
                self.pull(start + clock.bits(bits), start + clock.bits(bits + 1.0));
            }
            bits += 1.0;
        }
        if character.is_stop_torn {
            self.pull(start + clock.bits(bits), start + clock.bits(bits + TORN));
        }
        start + clock.bits(bits + 1.0)
    }

    /// The spans in order, those that touch or overlap made one.
    pub fn spans(mut self) -> Vec<Low> {
        self.0.sort_unstable();
        self.0.dedup_by(|later, earlier| {
            let touches = later.from <= earlier.to;
            if touches {
                earlier.to = earlier.to.max(later.to);
            }
            touches
        });
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn levels(character: Character, parity: Parity) -> String {
        character.levels(parity).map(|level| if level { '1' } else { '0' }).collect()
    }

    #[test]
    fn characters_are_sent_lowest_bit_first_with_even_parity() {
        // 1Ah = 0001 1010b has three ones, 3Ah = 0011 1010b four.
        assert_eq!(levels(Character::new(0x1A), Parity::Even), "0010110001");
        assert_eq!(levels(Character::new(0x3A), Parity::Even), "0010111000");
        assert_eq!(levels(Character::new(0x3A), Parity::Odd), "0010111001");
        assert_eq!(levels(Character::new(0x3A), Parity::None), "001011100");
    }

    #[test]
    fn a_flipped_bit_leaves_the_parity_bit_as_it_was() {
        let data = Character { flipped: Some(3), ..Character::new(0x1A) };
        assert_eq!((levels(data, Parity::Even), data.arriving()), ("0010010001".into(), 0x12));
        let parity = Character { flipped: Some(PARITY_BIT), ..Character::new(0x1A) };
        assert_eq!((levels(parity, Parity::Even), parity.arriving()), ("0010110000".into(), 0x1A));
    }

    #[test]
    fn low_wins_where_spans_overlap() {
        let mut line = Line::default();
        for (from, to) in [(50, 60), (0, 10), (10, 20), (15, 17), (30, 40)] {
            line.pull(from, to);
        }
        let low = |from, to| Low { from, to };
        assert_eq!(line.spans(), [low(0, 20), low(30, 40), low(50, 60)]);
    }

    #[test]
    fn a_character_takes_eleven_bits_and_ends_high() {
        let clock = Clock::exact(1_000_000_000);
        let mut line = Line::default();
        // 1 ns a bit. 80h: start bit and seven zeros are one span of 8 bits; then 1, parity 1,
        // stop 1.
        assert_eq!(line.send(Character::new(0x80), 0, clock, Parity::Even), 11_000);
        assert_eq!(line.spans(), [Low { from: 0, to: 8_000 }]);
    }
}
