//! The characters of a file: UTF-8, or else what Windows made of Latin-1.

use alloc::borrow::Cow;
use alloc::string::String;

/// What Windows-1252 has at 80h to 9Fh, where Latin-1 has control characters. Files are written on
/// Windows: 92h is an apostrophe. A blank stands for what is not defined.
const WINDOWS: [char; 32] = [
    '€', ' ', '‚', 'ƒ', '„', '…', '†', '‡', 'ˆ', '‰', 'Š', '‹', 'Œ', ' ', 'Ž', ' ', ' ', '‘', '’',
    '“', '”', '•', '–', '—', '˜', '™', 'š', '›', 'œ', ' ', 'ž', 'Ÿ',
];

/// The text of a file, without a byte order mark.
pub(super) fn decode(bytes: &[u8]) -> Cow<'_, str> {
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    match core::str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(bytes.iter().map(|byte| character(*byte)).collect::<String>()),
    }
}

fn character(byte: u8) -> char {
    match byte {
        0x80..=0x9F => WINDOWS[usize::from(byte - 0x80)],
        _ => char::from(byte),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_utf_8_is_latin_1_of_windows() {
        assert_eq!(decode(b"MKS\x92 \xB5m"), "MKS’ µm");
        assert_eq!(decode("µm".as_bytes()), "µm");
        assert_eq!(decode(b"\xEF\xBB\xBF[File]"), "[File]");
    }
}
