//! Words in a cell, as controllers and people write them.

use super::super::can::hex::digit;
use super::layout::{Layout, Order, Radix};

/// The base, and what may stand before it: nothing, or a type.
const MARK: &[u8] = b"16#";
const KINDS: [&[u8]; 7] = [b"", b"B#", b"W#", b"DW#", b"BYTE#", b"WORD#", b"DWORD#"];

/// How words are to be read.
#[derive(Clone, Copy, Debug)]
pub struct Words {
    radix: Radix,
    word_order: Order,
    byte_order: Order,
}

impl Words {
    /// As the user says.
    pub fn new(layout: &Layout) -> Self {
        Words {
            radix: layout.words.unwrap_or(Radix::Hex),
            word_order: layout.word_order,
            byte_order: layout.byte_order,
        }
    }

    /// The same words in another radix.
    pub fn in_radix(self, radix: Radix) -> Self {
        Words { radix, ..self }
    }

    /// A word of 32 bits in one cell.
    pub fn long(&self, cell: &[u8]) -> Option<u32> {
        let word = number(cell, self.radix, 32)?;
        Some(self.arrange((word >> 16) as u16, word as u16))
    }

    /// A word of 32 bits in two cells.
    pub fn pair(&self, first: &[u8], second: &[u8]) -> Option<u32> {
        let word = |cell| Some(number(cell, self.radix, 16)? as u16);
        Some(self.arrange(word(first)?, word(second)?))
    }

    /// A word of 16 bits.
    pub fn short(&self, cell: &[u8]) -> Option<u16> {
        Some(self.in_order(number(cell, self.radix, 16)? as u16))
    }

    /// A byte.
    pub fn byte(&self, cell: &[u8]) -> Option<u8> {
        Some(number(cell, self.radix, 8)? as u8)
    }

    /// Whether a cell is a word in either radix.
    pub fn is_word(&self, cell: &[u8]) -> bool {
        [Radix::Hex, Radix::Decimal].iter().any(|radix| number(cell, *radix, 32).is_some())
    }

    /// What is wrong with a cell that is no word.
    pub const fn wrong(&self) -> &'static str {
        match self.radix {
            Radix::Hex => {
                "a word is no hex digits, or too many: if words are decimal, say --words decimal"
            }
            Radix::Decimal => "a word is no decimal number, or too large",
        }
    }

    fn arrange(&self, first: u16, second: u16) -> u32 {
        let (first, second) = (self.in_order(first), self.in_order(second));
        let (high, low) = match self.word_order {
            Order::HighFirst => (first, second),
            Order::LowFirst => (second, first),
        };
        u32::from(high) << 16 | u32::from(low)
    }

    const fn in_order(&self, word: u16) -> u16 {
        match self.byte_order {
            Order::HighFirst => word,
            Order::LowFirst => word.swap_bytes(),
        }
    }
}

/// A number of so many bits.
pub fn number(cell: &[u8], radix: Radix, bits: u32) -> Option<u32> {
    let plain = match radix {
        Radix::Hex => hex(cell, bits),
        Radix::Decimal => decimal(cell, bits),
    };
    plain.or_else(|| marked(cell, bits))
}

/// Whether a cell can only be hex: it is marked so, filled up with zeros, or has a digit above 9.
pub fn is_surely_hex(cell: &[u8]) -> bool {
    let is_filled = cell.len() > 1 && cell.starts_with(b"0");
    is_filled || cell.iter().any(|byte| !byte.is_ascii_digit() && *byte != b'-')
}

fn hex(cell: &[u8], bits: u32) -> Option<u32> {
    let most = bits as usize / 4;
    let cell = if cell.len() > most { without_zeros(cell) } else { cell };
    if cell.is_empty() || cell.len() > most {
        return None;
    }
    cell.iter().try_fold(0, |word, byte| Some(word << 4 | u32::from(digit(*byte)?)))
}

/// Zeros in front of a number add nothing, however many there are.
fn without_zeros(cell: &[u8]) -> &[u8] {
    let zeros = cell.iter().take_while(|byte| **byte == b'0').count();
    &cell[zeros.min(cell.len().saturating_sub(1))..]
}

/// What is marked as hex: `0xC200`, `C200h`, and in the notation of IEC 61131-3 and S7 `16#C200`,
/// `W#16#C200`, `DW#16#C200_1388`, in capitals or not.
fn marked(cell: &[u8], bits: u32) -> Option<u32> {
    let at = cell.windows(MARK.len()).position(|part| part == MARK);
    if let Some((kind, digits)) = at.map(|at| (&cell[..at], &cell[at + MARK.len()..])) {
        let is_one = KINDS.iter().any(|known| known.eq_ignore_ascii_case(kind));
        return Some(digits).filter(|_| is_one).and_then(|digits| grouped(digits, bits));
    }
    if let [b'0', b'x' | b'X', digits @ ..] = cell {
        return hex(digits, bits);
    }
    hex(cell.strip_suffix(b"h").or_else(|| cell.strip_suffix(b"H"))?, bits)
}

/// Digits that may be in groups, with an underscore between two of them.
fn grouped(digits: &[u8], bits: u32) -> Option<u32> {
    if !digits.contains(&b'_') {
        return hex(digits, bits);
    }
    let is_whole = digits.split(|byte| *byte == b'_').all(|group| !group.is_empty());
    let plain: Vec<u8> = digits.iter().copied().filter(|byte| *byte != b'_').collect();
    hex(&plain, bits).filter(|_| is_whole)
}

/// Controllers have signed words: -1 is all ones.
fn decimal(cell: &[u8], bits: u32) -> Option<u32> {
    let value: i64 = std::str::from_utf8(cell).ok()?.parse().ok()?;
    let (least, most) = (-(1_i64 << (bits - 1)), (1_i64 << bits) - 1);
    (least..=most).contains(&value).then_some((value & most) as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hex_with_and_without_a_mark() {
        for text in ["C2001388", "c2001388", "0xC2001388", "C2001388h", "16#C2001388"] {
            assert_eq!(number(text.as_bytes(), Radix::Hex, 32), Some(0xC200_1388), "{text}");
        }
        assert_eq!(number(b"DW#16#C2001388", Radix::Decimal, 32), Some(0xC200_1388));
        // S7-SCL's notation of constants: DW#16#0000_0000, dword#...
        for text in ["DW#16#C200_1388", "dw#16#c2001388", "DWORD#16#C200_1388", "16#C200_1388"] {
            assert_eq!(number(text.as_bytes(), Radix::Hex, 32), Some(0xC200_1388), "{text}");
        }
        assert_eq!(number(b"W#16#1388", Radix::Hex, 16), Some(0x1388));
        for wrong in ["DW#16#_C2001388", "16#C2__00", "16#", "W#16#1_1388", "X#16#1388"] {
            assert_eq!(number(wrong.as_bytes(), Radix::Hex, 16), None, "{wrong}");
        }
        assert_eq!(number(b"0000C200", Radix::Hex, 16), Some(0xC200));
        for wrong in ["", "C20013880", "0x", "h", "-1", "G", "X#16#1", "3254784904"] {
            assert_eq!(number(wrong.as_bytes(), Radix::Hex, 32), None, "{wrong}");
        }
    }

    #[test]
    fn decimal_with_and_without_a_sign() {
        // C2001388h = 3254784904, and as a signed number 3254784904 - 2^32 = -1040182392.
        for text in ["3254784904", "-1040182392"] {
            assert_eq!(number(text.as_bytes(), Radix::Decimal, 32), Some(0xC200_1388), "{text}");
        }
        assert_eq!(number(b"-32768", Radix::Decimal, 16), Some(0x8000));
        assert_eq!(number(b"51h", Radix::Decimal, 8), Some(0x51));
        for wrong in ["65536", "-32769", "1.5", "C200", ""] {
            assert_eq!(number(wrong.as_bytes(), Radix::Decimal, 16), None, "{wrong}");
        }
    }

    #[test]
    fn words_and_bytes_in_any_order() {
        let words = |word_order, byte_order| Words { radix: Radix::Hex, word_order, byte_order };
        let (high, low) = (Order::HighFirst, Order::LowFirst);
        assert_eq!(words(high, high).pair(b"C200", b"1388"), Some(0xC200_1388));
        assert_eq!(words(low, high).pair(b"1388", b"C200"), Some(0xC200_1388));
        assert_eq!(words(high, low).pair(b"00C2", b"8813"), Some(0xC200_1388));
        assert_eq!(words(low, low).long(b"881300C2"), Some(0xC200_1388));
        assert_eq!(words(high, low).short(b"E000"), Some(0x00E0));
    }
}
