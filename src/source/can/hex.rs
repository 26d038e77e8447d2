//! Numbers and bytes as logs write them.

use dissectors::can::Identifier;

/// Data bytes of a line: as many as the longest frame has.
#[derive(Clone, Copy, Debug)]
pub struct Bytes {
    bytes: [u8; 64],
    count: usize,
}

impl Bytes {
    /// None.
    pub const fn new() -> Self {
        Bytes { bytes: [0; 64], count: 0 }
    }

    /// One more; false where no frame has so many.
    pub fn push(&mut self, byte: u8) -> bool {
        let Some(free) = self.bytes.get_mut(self.count) else { return false };
        *free = byte;
        self.count += 1;
        true
    }

    /// The other way round.
    pub fn reverse(&mut self) {
        self.bytes[..self.count].reverse();
    }

    /// The bytes.
    pub fn as_slice(&self) -> &[u8] {
        &self.bytes[..self.count]
    }
}

/// The value of a hex digit.
pub fn digit(byte: u8) -> Option<u8> {
    match byte {
        b'0'..=b'9' => Some(byte - b'0'),
        b'a'..=b'f' => Some(byte - b'a' + 10),
        b'A'..=b'F' => Some(byte - b'A' + 10),
        _ => None,
    }
}

/// A byte as exactly two hex digits.
pub fn pair(text: &[u8]) -> Option<u8> {
    match text {
        [high, low] => Some(digit(*high)? << 4 | digit(*low)?),
        _ => None,
    }
}

/// A number of at most eight hex digits.
pub fn number(text: &[u8]) -> Option<u32> {
    if text.is_empty() || text.len() > 8 {
        return None;
    }
    text.iter().try_fold(0, |value, byte| Some(value << 4 | u32::from(digit(*byte)?)))
}

/// A number of at most nine decimal digits.
pub fn decimal(text: &[u8]) -> Option<u32> {
    std::str::from_utf8(text)
        .ok()
        .filter(|text| text.bytes().all(|b| b.is_ascii_digit()))?
        .parse()
        .ok()
}

/// An identifier whose width, not its value, tells its kind.
pub fn identifier(value: u32, is_extended: bool) -> Option<Identifier> {
    if is_extended { Identifier::extended(value) } else { Identifier::standard(value) }
}

/// The parts of a line between blanks.
pub fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> + Clone {
    line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}
