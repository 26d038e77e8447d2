//! ID words: what a device says of itself in an ID cycle.
//!
//! ```text
//! 15 14 13 | 12 11 10 9 8 | 7 6 5 4 3 2 1 0
//! messages | length code  | ident code, whose bits 1 and 0 are the direction
//! ```
//!
//! The layout is in WAGO 750-344 p. 62 and VIPA 200V p. 4-13. An ident code is a class of devices;
//! it never tells maker or product.

use core::fmt;
use nom::number::complete::be_u16;
use nom::{IResult, Parser};

/// An ID word.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct IdWord {
    /// Bits 15 to 13: what the device reports while it runs. Which bit is which is not published.
    pub messages: u8,
    /// How much process data it has.
    pub length: Length,
    /// Its class.
    pub ident: u8,
}

/// An ID word: its two bytes, high byte first.
///
/// # Errors
/// There are fewer.
pub fn id_word(input: &[u8]) -> IResult<&[u8], IdWord> {
    be_u16.map(IdWord::of).parse(input)
}

impl IdWord {
    /// The parts of a word.
    #[must_use]
    pub const fn of(word: u16) -> Self {
        IdWord {
            messages: (word >> 13) as u8,
            length: Length::of((word >> 8) as u8),
            ident: word as u8,
        }
    }

    /// Which way its process data goes.
    #[must_use]
    pub const fn direction(self) -> Direction {
        match self.ident & 3 {
            0 => Direction::None,
            1 => Direction::Out,
            2 => Direction::In,
            _ => Direction::Both,
        }
    }

    /// Whether a TR-Electronic encoder with two words in and out says this, an LA-66 among them. So
    /// does any analog module of two words.
    #[must_use]
    pub const fn fits_la66(self) -> bool {
        self.ident == 0x33 && matches!(self.length.bits(), Some(32))
    }
}

/// Which way process data goes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Direction {
    /// There is none.
    None,
    /// From the master.
    Out,
    /// To the master.
    In,
    /// Both ways.
    Both,
}

impl Direction {
    /// The names that records carry.
    pub const NAMES: [&'static str; 4] = ["none", "OUT", "IN", "IN+OUT"];

    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }
}

/// The five bits that tell how much process data a device has.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Length(u8);

/// What each code means, in bits; `None` is reserved (Phoenix Contact IBS SUPI 3, p. 3-22, tables
/// 3-11 and 3-12). 03 to 05 stand on a page that was not at hand: they are the lengths that no other
/// code has. 06 is eight words, not six.
const BITS: [Option<u16>; 32] = {
    const fn words(count: u16) -> Option<u16> {
        Some(16 * count)
    }
    let mut bits = [None; 32];
    bits[0x00] = words(0);
    bits[0x01] = words(1);
    bits[0x02] = words(2);
    bits[0x03] = words(3);
    bits[0x04] = words(4);
    bits[0x05] = words(5);
    bits[0x06] = words(8);
    bits[0x07] = words(9);
    bits[0x08] = Some(4);
    bits[0x09] = Some(8);
    bits[0x0B] = Some(24);
    bits[0x0D] = Some(2);
    bits[0x0E] = words(6);
    bits[0x0F] = words(7);
    bits[0x11] = words(26);
    bits[0x12] = words(16);
    bits[0x13] = words(24);
    bits[0x14] = words(32);
    bits[0x15] = words(10);
    bits[0x16] = words(12);
    bits[0x17] = words(14);
    bits
};

impl Length {
    /// The code in the low five bits.
    #[must_use]
    pub const fn of(bits: u8) -> Self {
        Length(bits & 0x1F)
    }

    /// The code as a number; `None` where it has more than five bits.
    #[must_use]
    pub const fn new(code: u8) -> Option<Self> {
        if code <= 0x1F { Some(Length(code)) } else { None }
    }

    /// That of the eight-bit code which data sheets are reported to print (unverified): the unit in
    /// bits 7 and 6 (words, nibbles, bytes, bits), and how many. `None` where no ID word can say it.
    #[must_use]
    pub fn from_data_sheet(code: u8) -> Option<Self> {
        let unit = match code >> 6 {
            0 => 16,
            1 => 4,
            2 => 8,
            _ => 1,
        };
        let bits = u16::from(code & 0x3F) * unit;
        let code = BITS.iter().position(|known| *known == Some(bits))?;
        Some(Length(code as u8))
    }

    /// The code.
    #[must_use]
    pub const fn code(self) -> u8 {
        self.0
    }

    /// How many bits it stands for; `None` if it is reserved.
    #[must_use]
    pub const fn bits(self) -> Option<u16> {
        BITS[(self.0 & 0x1F) as usize]
    }
}

impl fmt::Display for Length {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.bits() {
            None => write!(f, "reserved length code {:02X}h", self.0),
            Some(4) => f.write_str("1 nibble"),
            Some(16) => f.write_str("1 word"),
            Some(bits) if bits % 16 == 0 => write!(f, "{} words", bits / 16),
            Some(8) => f.write_str("1 byte"),
            Some(bits) if bits % 8 == 0 => write!(f, "{} bytes", bits / 8),
            Some(bits) => write!(f, "{bits} bits"),
        }
    }
}

/// The class that an ident code stands for. What makers' documents do not say is marked.
#[must_use]
pub const fn class(ident: u8) -> Option<&'static str> {
    Some(match ident {
        // Beckhoff BC4000, WAGO 750-344.
        1..=3 => "digital remote-bus device",
        49..=51 => "analog or byte-oriented remote-bus device",
        60 => "WAGO coupler before it has scanned its modules",
        54 => "ENCOM encoder K2 (reported, unverified)",
        55 => "ENCOM encoder K3 (reported, unverified)",
        56 => "microprocessor not ready (reported, unverified)",
        125..=127 => "analog local-bus module (reported, unverified)",
        189..=191 => "digital local-bus module (reported, unverified)",
        227..=255 => "DRIVECOM or other PCP device (reported, unverified)",
        _ => return None,
    })
}

impl fmt::Display for IdWord {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.direction() {
            Direction::None => write!(f, "{}, no process data", self.length)?,
            direction => write!(f, "{} {}", self.length, direction.name())?,
        }
        write!(f, ", ident {0} ({0:02X}h)", self.ident)?;
        match class(self.ident) {
            Some(class) => write!(f, ": {class}")?,
            None => f.write_str(": no class known")?,
        }
        if self.fits_la66() {
            f.write_str("; may be an LA-66, which no ID word proves")?;
        }
        if self.messages != 0 {
            write!(f, "; message bits 15 to 13: {:03b}", self.messages)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::{String, ToString};

    #[test]
    fn the_table_of_length_codes() {
        let table = [
            "0 words", "1 word", "2 words", "3 words", "4 words", "5 words", "8 words", "9 words",
            "1 nibble", "1 byte", "", "3 bytes", "", "2 bits", "6 words", "7 words", "",
            "26 words", "16 words", "24 words", "32 words", "10 words", "12 words", "14 words",
        ];
        for code in 0..32 {
            let expected = table.get(usize::from(code)).copied().unwrap_or_default();
            let length = Length::of(code);
            match expected {
                "" => assert!(length.bits().is_none(), "{code}"),
                text => assert_eq!(length.to_string(), text, "{code}"),
            }
        }
        assert_eq!(Length::of(0x0A).to_string(), "reserved length code 0Ah");
        assert_eq!(Length::new(0x20), None);
        assert_eq!(Length::of(0x06).bits(), Some(128));
        assert_eq!(Length::of(0x0D).bits(), Some(2));
    }

    /// 02: two words, 81: one byte, 41: one nibble, C2: two bits; 82 is 16 bits, one word.
    #[test]
    fn codes_of_data_sheets() {
        let code = |data_sheet| Length::from_data_sheet(data_sheet).map(Length::code);
        assert_eq!(code(0x02), Some(0x02));
        assert_eq!(code(0x81), Some(0x09));
        assert_eq!(code(0x41), Some(0x08));
        assert_eq!(code(0xC2), Some(0x0D));
        assert_eq!(code(0x82), Some(0x01));
        assert_eq!(code(0x08), Some(0x06));
        assert_eq!(code(0x0B), None);
    }

    fn said(word: u16) -> String {
        IdWord::of(word).to_string()
    }

    #[test]
    fn worked_words() {
        assert_eq!(
            said(0x0233),
            "2 words IN+OUT, ident 51 (33h): analog or byte-oriented remote-bus device; may be an \
             LA-66, which no ID word proves"
        );
        assert_eq!(said(0x0203), "2 words IN+OUT, ident 3 (03h): digital remote-bus device");
        assert_eq!(
            said(0x0132),
            "1 word IN, ident 50 (32h): analog or byte-oriented remote-bus device"
        );
        assert!(said(0x1533).starts_with("10 words IN+OUT, ident 51 (33h)"));
        assert!(said(0x8233).ends_with("; message bits 15 to 13: 100"));
        assert!(said(0x2233).ends_with("; message bits 15 to 13: 001"));
        assert_eq!(
            said(0x003C),
            "0 words, no process data, ident 60 (3Ch): WAGO coupler before it has scanned its \
             modules"
        );
        assert_eq!(
            said(0x0237),
            "2 words IN+OUT, ident 55 (37h): ENCOM encoder K3 (reported, unverified)"
        );
        assert_eq!(id_word(&[0x02, 0x33]).unwrap().1, IdWord::of(0x0233));
        assert_eq!(IdWord::of(0x8233).messages, 0b100);
    }

    #[test]
    fn a_hint_is_given_only_where_both_fit() {
        assert!(IdWord::of(0x0233).fits_la66() && IdWord::of(0x8233).fits_la66());
        assert!(!IdWord::of(0x0133).fits_la66() && !IdWord::of(0x0203).fits_la66());
    }
}
