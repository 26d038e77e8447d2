//! Baud rate and character format.

#[cfg(test)]
use alloc::string::ToString;
use core::{fmt, num::NonZeroU32, str::FromStr};

/// Bits per second on the line.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct Baud(NonZeroU32);

impl Baud {
    /// A rate, unless it is 0.
    #[must_use]
    pub const fn new(bits_per_second: u32) -> Option<Self> {
        match NonZeroU32::new(bits_per_second) {
            Some(rate) => Some(Baud(rate)),
            None => None,
        }
    }

    /// Bits per second.
    #[must_use]
    pub const fn get(self) -> u32 {
        self.0.get()
    }

    /// How long `bits` bits take, in ns, rounded to the nearest.
    #[must_use]
    pub const fn bits_ns(self, bits: u32) -> u64 {
        let rate = self.0.get() as u64;
        (bits as u64 * 1_000_000_000 + rate / 2) / rate
    }
}

impl fmt::Display for Baud {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// How the parity bit follows from the data bits.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ParityRule {
    /// There is no parity bit.
    None,
    /// The number of ones, parity bit included, is even.
    Even,
    /// The number of ones, parity bit included, is odd.
    Odd,
    /// Always one.
    Mark,
    /// Always zero.
    Space,
}

impl ParityRule {
    /// The parity bit that belongs to these data bits; `None` where the format has none.
    #[must_use]
    pub const fn bit(self, data: u16) -> Option<bool> {
        match self {
            ParityRule::None => None,
            ParityRule::Even => Some(data.count_ones() % 2 == 1),
            ParityRule::Odd => Some(data.count_ones().is_multiple_of(2)),
            ParityRule::Mark => Some(true),
            ParityRule::Space => Some(false),
        }
    }

    const fn letter(self) -> char {
        match self {
            ParityRule::None => 'N',
            ParityRule::Even => 'E',
            ParityRule::Odd => 'O',
            ParityRule::Mark => 'M',
            ParityRule::Space => 'S',
        }
    }
}

/// A character's format, written as technicians do: `8E1`.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Format {
    data_bits: u8,
    parity: ParityRule,
    stop_bits: u8,
}

impl Format {
    /// The format of IEC FT1.2 that SLIN uses: 8 data bits, even parity, 1 stop bit
    /// (Baumer SLIN §3.1, TR SLIN §1).
    pub const FT12: Format = Format { data_bits: 8, parity: ParityRule::Even, stop_bits: 1 };

    /// A format with 5 to 9 data bits and 1 or 2 stop bits.
    #[must_use]
    pub const fn new(data_bits: u8, parity: ParityRule, stop_bits: u8) -> Option<Self> {
        if data_bits >= 5 && data_bits <= 9 && stop_bits >= 1 && stop_bits <= 2 {
            Some(Format { data_bits, parity, stop_bits })
        } else {
            None
        }
    }

    /// Data bits, 5 to 9.
    #[must_use]
    pub const fn data_bits(self) -> u8 {
        self.data_bits
    }

    /// The parity rule.
    #[must_use]
    pub const fn parity(self) -> ParityRule {
        self.parity
    }

    /// Stop bits, 1 or 2.
    #[must_use]
    pub const fn stop_bits(self) -> u8 {
        self.stop_bits
    }

    /// Bits of a whole character: start bit, data bits, parity bit, stop bits.
    #[must_use]
    pub const fn bits(self) -> u32 {
        let parity = if matches!(self.parity, ParityRule::None) { 0 } else { 1 };
        1 + self.data_bits as u32 + parity + self.stop_bits as u32
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}{}", self.data_bits, self.parity.letter(), self.stop_bits)
    }
}

/// The text is not a character format.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct FormatError;

impl fmt::Display for FormatError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(
            "not a character format: 5 to 9 data bits, N E O M or S, 1 or 2 stop bits, as in 8E1",
        )
    }
}

impl core::error::Error for FormatError {}

impl FromStr for Format {
    type Err = FormatError;

    fn from_str(text: &str) -> Result<Self, FormatError> {
        let [data, parity, stop] = text.as_bytes() else { return Err(FormatError) };
        let digit = |byte: &u8| byte.is_ascii_digit().then(|| byte - b'0').ok_or(FormatError);
        let parity = match parity.to_ascii_uppercase() {
            b'N' => ParityRule::None,
            b'E' => ParityRule::Even,
            b'O' => ParityRule::Odd,
            b'M' => ParityRule::Mark,
            b'S' => ParityRule::Space,
            _ => return Err(FormatError),
        };
        Format::new(digit(data)?, parity, digit(stop)?).ok_or(FormatError)
    }
}

/// What is known of how characters travel on a bus: enough to tell how long one takes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Wire {
    baud: Option<Baud>,
    format: Format,
    /// Computed once: they are asked for with every character.
    bit_ns: Option<i64>,
    character_ns: Option<i64>,
}

impl Wire {
    /// Characters of this format, at this rate if it is known.
    #[must_use]
    pub fn new(baud: Option<Baud>, format: Format) -> Self {
        let bits_ns = |bits| baud.map(|baud| baud.bits_ns(bits).cast_signed());
        Wire { baud, format, bit_ns: bits_ns(1), character_ns: bits_ns(format.bits()) }
    }

    /// The rate, where it is known.
    #[must_use]
    pub const fn baud(self) -> Option<Baud> {
        self.baud
    }

    /// The format.
    #[must_use]
    pub const fn format(self) -> Format {
        self.format
    }

    /// Duration of a bit in ns, where the rate is known.
    #[must_use]
    pub const fn bit_ns(self) -> Option<i64> {
        self.bit_ns
    }

    /// Duration of a character in ns, where the rate is known.
    #[must_use]
    pub const fn character_ns(self) -> Option<i64> {
        self.character_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_what_it_writes() {
        for text in ["8E1", "7O2", "9N1", "8M1", "5S2"] {
            assert_eq!(text.parse::<Format>().unwrap().to_string(), text);
        }
        assert_eq!("8e1".parse::<Format>(), Ok(Format::FT12));
        for text in ["", "8E", "8E11", "4N1", "8X1", "8E0", "8E3", "é1"] {
            assert_eq!(text.parse::<Format>(), Err(FormatError), "{text}");
        }
    }

    #[test]
    fn a_slin_character_has_eleven_bits() {
        assert_eq!(Format::FT12.bits(), 11);
        // 11 bits at 115200 Bd: 95.486 µs; at 9600 Bd: 1145.833 µs.
        assert_eq!(Baud::new(115_200).unwrap().bits_ns(11), 95_486);
        assert_eq!(Baud::new(9_600).unwrap().bits_ns(11), 1_145_833);
    }

    #[test]
    fn parity_bits_follow_their_rule() {
        // 80h has one 1: even parity makes it two.
        assert_eq!(ParityRule::Even.bit(0x80), Some(true));
        assert_eq!(ParityRule::Odd.bit(0x80), Some(false));
        assert_eq!(ParityRule::Mark.bit(0x80), Some(true));
        assert_eq!(ParityRule::Space.bit(0x80), Some(false));
        assert_eq!(ParityRule::None.bit(0x80), None);
    }
}
