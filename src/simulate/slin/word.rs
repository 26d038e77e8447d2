//! The words of SLIN as their senders build them, straight from the makers' manuals.

use clap::ValueEnum;

/// Data words that the manuals know (Baumer SLIN §3.2: "max. 4 data bytes").
pub const MAX_DATA_WORDS: usize = 4;

/// The readings of the checksum (Baumer SLIN §3.3, TR SLIN §7).
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub enum Checksum {
    /// Baumer's listing: plain additions.
    Add,
    /// TR's recipe: the carry out of the first three words goes into the fourth.
    Addc,
    /// An 8051 that adds the carry of each addition to the next, over the words it sends.
    AddcSent,
}

impl Checksum {
    /// All readings of the manuals.
    pub const ALL: [Checksum; 3] = [Checksum::Add, Checksum::Addc, Checksum::AddcSent];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Checksum::Add => "add",
            Checksum::Addc => "addc",
            Checksum::AddcSent => "addc-sent",
        }
    }

    /// Bits 4 to 6 of the sum of the data words, as a number from 0 to 7.
    pub fn of(self, words: &[u8]) -> u8 {
        let sum = match self {
            Checksum::Add => words.iter().fold(0, |sum: u8, word| sum.wrapping_add(*word)),
            Checksum::Addc => add_with_carry(words, MAX_DATA_WORDS.max(words.len())),
            Checksum::AddcSent => add_with_carry(words, words.len()),
        };
        (sum & 0b0111_0000) >> 4
    }
}

/// The ADDC instruction again and again: `count` words, those that are not there being 0. The
/// carry of the last addition is not used.
fn add_with_carry(words: &[u8], count: usize) -> u8 {
    let zeros = std::iter::repeat(&0);
    let mut sum = 0_u8;
    let mut carry = false;
    for word in words.iter().chain(zeros).take(count) {
        let wide = u16::from(sum) + u16::from(*word) + u16::from(carry);
        carry = wide > 0xFF;
        sum = (wide & 0xFF) as u8;
    }
    sum
}

/// The master's request: bit 7 high, bits 3 to 6 low (Baumer SLIN §3.2, TR SLIN §6).
pub fn request(address: u8) -> u8 {
    0b1000_0000 | address
}

/// The word that ends an answer: bit 7, three bits of checksum, bit 3, the address.
pub fn footer(address: u8, bit3: bool, checksum: u8) -> u8 {
    0b1000_0000 | checksum << 4 | u8::from(bit3) << 3 | address
}

/// The data words of a position of `bits` bits: seven bits each, the lowest first, "until no
/// relevant data are present" (TR SLIN §6). An encoder of fixed length keeps the zero words.
pub fn data(position: u32, bits: u32, is_length_fixed: bool) -> Vec<u8> {
    let relevant = 32 - position.leading_zeros();
    let bits = if is_length_fixed { bits } else { relevant };
    let words = bits.div_ceil(7).max(1);
    (0..words).map(|word| (position >> (7 * word) & 0x7F) as u8).collect()
}

/// The position that data words say.
pub fn position(words: &[u8]) -> u32 {
    words.iter().rev().fold(0, |position, word| position << 7 | u32::from(word & 0x7F))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worked_telegrams_of_the_tr_manual() {
        // TR SLIN §6: 0 0000 1001 1010b is 001 1010b, then 000001b filled with 0. Sum 1Bh: bits
        // 4 to 6 are 001b.
        let words = data(0b1001_1010, 13, false);
        assert_eq!(words, [0x1A, 0x01]);
        assert_eq!(footer(0, false, Checksum::Addc.of(&words)), 0x90);
        assert_eq!(footer(0, true, Checksum::Add.of(&words)), 0x98);
        // 0 0000 0011 1010b: "It is sent only one data word". 3Ah: 011b.
        let words = data(0b0011_1010, 13, false);
        assert_eq!(words, [0x3A]);
        assert_eq!(footer(0, false, Checksum::Addc.of(&words)), 0xB0);
        assert_eq!(request(0), 0x80);
    }

    #[test]
    fn word_boundaries() {
        assert_eq!(data(0, 25, false), [0]);
        assert_eq!(data(127, 25, false), [0x7F]);
        assert_eq!(data(128, 25, false), [0, 1]);
        assert_eq!(data((1 << 25) - 1, 25, false), [0x7F, 0x7F, 0x7F, 0x0F]);
        assert_eq!(data(154, 25, true), [0x1A, 0x01, 0, 0]);
        assert_eq!(data(0, 13, true), [0, 0]);
        for shown in [0, 1, 127, 128, 16_383, 16_384, (1 << 28) - 1] {
            assert_eq!(position(&data(shown, 28, false)), shown);
        }
    }

    #[test]
    fn add_and_addc_differ_first_at_294911() {
        // 294911 = 7Fh + 7Fh·2^7 + 11h·2^14. The sum is 10Fh: ADD leaves 0Fh; with the carry on the
        // fourth word, 0, it is 10h.
        let words = data(294_911, 25, false);
        assert_eq!(words, [0x7F, 0x7F, 0x11]);
        assert_eq!(Checksum::ALL.map(|rule| rule.of(&words)), [0, 1, 0]);
        for position in 0..294_911 {
            let words = data(position, 25, false);
            assert_eq!(Checksum::Add.of(&words), Checksum::Addc.of(&words), "{position}");
        }
    }

    #[test]
    fn with_four_words_both_carries_are_one() {
        // 7Fh + 7Fh + 02h = 100h; + 0Fh: ADD 0Fh, ADDC 10h.
        let words = [0x7F, 0x7F, 0x02, 0x0F];
        assert_eq!(Checksum::ALL.map(|rule| rule.of(&words)), [0, 1, 1]);
        // 7Fh + 40h + 30h + 20h = 10Fh: the carry of the last addition is not used.
        let words = [0x7F, 0x40, 0x30, 0x20];
        assert_eq!(Checksum::ALL.map(|rule| rule.of(&words)), [0, 0, 0]);
    }
}
