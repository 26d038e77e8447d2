//! What is not known of the line's format: every question, what the user says about it, and what
//! was concluded.
//!
//! No norm was at hand, so that nothing here is taken for granted. Defaults are what is told where
//! the wire cannot decide: other answers would give the same bits.

use super::crc::Form;
use alloc::{string::String, vec::Vec};

/// What the user says about the line. What is left open is found, or stays undecided.
#[derive(Clone, Default, PartialEq, Eq, Debug)]
pub struct Profile {
    /// Bit/s: 500,000, or 2,000,000 with some devices.
    pub bitrate: Option<u32>,
    /// The level between characters.
    pub idle_level: Option<bool>,
    /// What the three flags are, in the order they are sent.
    pub flag_order: Option<[Flag; 3]>,
    /// The value of [`Flag::Select`] in ID cycles.
    pub id_value: Option<bool>,
    /// The value of [`Flag::Control`] in the check phase.
    pub check_value: Option<bool>,
    /// The value of [`Flag::Type`] in status telegrams.
    pub status_value: Option<bool>,
    /// In which order the bits of a byte are sent.
    pub data_bit_order: Option<BitOrder>,
    /// Stop bits that are looked at: 1 or 2.
    pub stop_bits_min: Option<u8>,
    /// The loopback word.
    pub loopback: Option<Loopback>,
    /// The checksum.
    pub crc: CrcProfile,
    /// Bytes of the control word, behind the checksum: 0 to 4.
    pub cntr_bytes: Option<u8>,
    /// Silence that resets all devices, in ms.
    pub silence_reset_ms: Option<u32>,
    /// The devices, the first from the master first; none to take them from an ID cycle.
    pub ring: Vec<RingDevice>,
}

/// One of the three flags of a character.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Flag {
    /// ID cycle or data cycle (SL).
    Select,
    /// Data phase or check phase (CR).
    Control,
    /// Status telegram or data telegram.
    Type,
}

impl Flag {
    /// All, in the order they are taken to be sent.
    pub const USUAL: [Flag; 3] = [Flag::Select, Flag::Control, Flag::Type];

    /// Its name in profiles.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Flag::Select => "SL",
            Flag::Control => "CR",
            Flag::Type => "TYPE",
        }
    }

    /// The flag of that name.
    #[must_use]
    pub fn named(name: &str) -> Option<Flag> {
        Flag::USUAL.into_iter().find(|flag| flag.name() == name)
    }
}

/// The order in which the bits of a byte are sent.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub enum BitOrder {
    /// The highest first.
    #[default]
    Msb,
    /// The lowest first.
    Lsb,
}

impl BitOrder {
    /// Its name in profiles.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            BitOrder::Msb => "msb",
            BitOrder::Lsb => "lsb",
        }
    }
}

/// A loopback word: its value where the mask is 1. The other bits change from cycle to cycle.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Loopback {
    /// The bits that stay.
    pub value: u16,
    /// Which they are.
    pub mask: u16,
}

impl Loopback {
    /// Whether this may be the word.
    #[must_use]
    pub const fn fits(self, word: u16) -> bool {
        (word ^ self.value) & self.mask == 0
    }
}

/// What the user says about the checksum.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct CrcProfile {
    /// The start value.
    pub init: Option<u16>,
    /// Bytes go in with their lowest bit first.
    pub refin: Option<bool>,
    /// It comes out with its lowest bit first.
    pub refout: Option<bool>,
    /// The final XOR.
    pub xorout: Option<u16>,
    /// Its low byte is sent first.
    pub is_low_first: Option<bool>,
    /// The loopback word is covered too.
    pub covers_loopback: Option<bool>,
}

impl CrcProfile {
    /// Whether a form agrees with what is said, where bytes are read like that.
    pub(super) fn allows(&self, form: Form) -> bool {
        self.refin.is_none_or(|refin| refin == form.refin)
            && self.refout.is_none_or(|refout| refout == form.refout)
            && self.is_low_first.is_none_or(|order| order == form.is_low_first)
    }
}

/// A device of a ring that the user describes.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct RingDevice {
    /// The width of its register.
    pub width_bits: u16,
    /// What the user calls it.
    pub name: Option<String>,
}
