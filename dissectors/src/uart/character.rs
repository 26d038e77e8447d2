//! One character as a tap hears it.

use crate::event::Moment;

/// What is known of a character's parity bit.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[repr(u8)]
pub enum Parity {
    /// It fits the data bits.
    Ok = 0,
    /// It does not.
    Error = 1,
    /// The adapter marks whole packets: this or another character of the packet was bad.
    Suspect = 2,
    /// The source does not tell.
    Unknown = 3,
    /// The format has no parity bit.
    None = 4,
}

impl Parity {
    /// The word that records carry.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Parity::Ok => "ok",
            Parity::Error => "error",
            Parity::Suspect => "suspect",
            Parity::Unknown => "unknown",
            Parity::None => "none",
        }
    }
}

const PARITY: u8 = 0b0000_0111;
const FRAMING_ERROR: u8 = 0b0000_1000;
const INTERPOLATED: u8 = 0b0001_0000;

/// What an adapter marks when it sees a parity error.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ParityMarks {
    /// The character.
    Character,
    /// Every character that came in the same packet.
    Packet,
    /// Nothing: parity is not known.
    None,
}

impl ParityMarks {
    /// The word that captures carry.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            ParityMarks::Character => "character",
            ParityMarks::Packet => "packet",
            ParityMarks::None => "none",
        }
    }
}

/// A character: its data bits, when its start bit began, and what was wrong with it. Sixteen
/// bytes, so that millions of them pass quickly.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Character {
    /// When the start bit began.
    pub start: Moment,
    /// ± of `start` against other stamps of the same source, in ns.
    pub uncertainty: u32,
    value: u16,
    marks: u8,
}

impl Character {
    /// A character of up to nine data bits without a framing error.
    #[must_use]
    pub const fn new(start: Moment, uncertainty: u32, value: u16, parity: Parity) -> Self {
        Character { start, uncertainty, value: value & 0x1FF, marks: parity as u8 }
    }

    /// The same with a framing error: its stop bit was not there.
    #[must_use]
    pub const fn with_framing_error(mut self) -> Self {
        self.marks |= FRAMING_ERROR;
        self
    }

    /// The same with a time that was spread back from one read.
    #[must_use]
    pub const fn interpolated(mut self) -> Self {
        self.marks |= INTERPOLATED;
        self
    }

    /// The same with another verdict on the parity bit.
    #[must_use]
    pub const fn with_parity(mut self, parity: Parity) -> Self {
        self.marks = self.marks & !PARITY | parity as u8;
        self
    }

    /// All data bits, up to nine.
    #[must_use]
    pub const fn value(&self) -> u16 {
        self.value
    }

    /// The low eight data bits.
    #[must_use]
    pub const fn byte(&self) -> u8 {
        self.value.to_le_bytes()[0]
    }

    /// What is known of the parity bit.
    #[must_use]
    pub const fn parity(&self) -> Parity {
        match self.marks & PARITY {
            0 => Parity::Ok,
            1 => Parity::Error,
            2 => Parity::Suspect,
            3 => Parity::Unknown,
            _ => Parity::None,
        }
    }

    /// Whether the stop bit was missing.
    #[must_use]
    pub const fn has_framing_error(&self) -> bool {
        self.marks & FRAMING_ERROR != 0
    }

    /// Whether the time was spread back from one read.
    #[must_use]
    pub const fn is_interpolated(&self) -> bool {
        self.marks & INTERPOLATED != 0
    }

    /// Whether parity or framing say for certain that a bit of it is wrong.
    #[must_use]
    pub const fn is_damaged(&self) -> bool {
        self.marks & (PARITY | FRAMING_ERROR) == Parity::Error as u8 || self.has_framing_error()
    }
}

impl core::fmt::Debug for Character {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{:02X}", self.value)?;
        match self.parity() {
            Parity::Ok | Parity::None => {}
            other => write!(f, " parity {}", other.name())?,
        }
        if self.has_framing_error() {
            write!(f, " framing error")?;
        }
        match self.start.ns() {
            Some(ns) => write!(f, " @{ns}±{}", self.uncertainty),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stays_at_sixteen_bytes() {
        assert_eq!(size_of::<Character>(), 16);
    }

    #[test]
    fn marks_do_not_disturb_each_other() {
        let plain = Character::new(Moment::UNKNOWN, 0, 0x1FF, Parity::Suspect);
        assert!(!plain.is_damaged() && !plain.has_framing_error() && !plain.is_interpolated());
        let marked = plain.with_framing_error().interpolated().with_parity(Parity::Error);
        assert_eq!((marked.parity(), marked.value()), (Parity::Error, 0x1FF));
        assert!(marked.is_damaged() && marked.has_framing_error() && marked.is_interpolated());
        assert!(
            !marked.with_parity(Parity::None).interpolated().with_parity(Parity::Ok).eq(&plain)
        );
    }
}
