//! A cell of a table: how values are written, and what must not stand in it as it is.

use crate::clock::Exact;
use crate::terminal::clean_from;
use dissectors::field::Value;
use dissectors::record::Record;
use std::fmt;
use std::io::Write;

/// What was written into a cell.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Cell {
    /// Nothing that means anything to a table: it can stand as it is.
    Plain,
    /// Commas, quotes or line ends are in it.
    Quoted,
}

/// Digits in pairs: 00 to 99.
static PAIRS: [[u8; 2]; 100] = {
    let mut pairs = [[0; 2]; 100];
    let mut number = 0;
    while number < 100 {
        pairs[number] = [b'0' + (number / 10) as u8, b'0' + (number % 10) as u8];
        number += 1;
    }
    pairs
};

/// What a byte may be to a table, or to the terminal that shows it.
mod mark {
    /// It cannot stand in a cell without quotes.
    pub const SPECIAL: u8 = 1;
    /// A control character.
    pub const STEERS: u8 = 2;
    /// With a byte of [`TAIL`] behind it, a character that steers; see [`crate::terminal`].
    pub const LEAD: u8 = 4;
    pub const TAIL: u8 = 8;
}

/// Which of these each byte is. Every byte of every text is looked at, and only once: to compare it
/// with each of them would take three times as long.
static MARKS: [u8; 256] = {
    let mut marks = [0; 256];
    let mut control = 0;
    while control < 0x20 {
        marks[control] = mark::STEERS;
        marks[0x80 + control] = mark::TAIL;
        control += 1;
    }
    marks[0x7F] = mark::STEERS;
    marks[0xC2] = mark::LEAD;
    marks[0xD8] = mark::LEAD;
    marks[0xE2] = mark::LEAD;
    marks[b',' as usize] = mark::SPECIAL;
    marks[b'"' as usize] = mark::SPECIAL;
    marks
};

pub fn value(value: Value<'_>, cell: &mut Vec<u8>) -> Cell {
    match value {
        Value::Absent => {}
        Value::Bool(value) => word(if value { "true" } else { "false" }, cell),
        Value::Int(value) => integer(value, cell),
        Value::Float(value) => show(value, cell),
        Value::Text(words) => return text(words, cell),
        Value::Byte(byte) => show(format_args!("{byte:02X}"), cell),
        Value::Hex(bytes) => bytes.iter().for_each(|byte| hex(*byte, cell)),
        Value::List(list) => {
            return several(list.len(), cell, |index, cell| self::value(list.get(index), cell));
        }
        // Of a table, its second field says most: the byte.
        Value::Rows(rows) => {
            return several(rows.len(), cell, |row, cell| self::value(rows.get(row, 1), cell));
        }
    }
    Cell::Plain
}

/// So many values, with spaces between.
fn several(
    count: usize,
    cell: &mut Vec<u8>,
    mut write: impl FnMut(usize, &mut Vec<u8>) -> Cell,
) -> Cell {
    let mut all = Cell::Plain;
    for index in 0..count {
        word(if index == 0 { "" } else { " " }, cell);
        if write(index, cell) == Cell::Quoted {
            all = Cell::Quoted;
        }
    }
    all
}

/// Words that are known beforehand.
pub fn word(word: &str, cell: &mut Vec<u8>) {
    cell.extend_from_slice(word.as_bytes());
}

/// Such words, with spaces between.
pub fn join<'a>(words: impl Iterator<Item = &'a str>, cell: &mut Vec<u8>) {
    for (index, name) in words.enumerate() {
        word(if index == 0 { "" } else { " " }, cell);
        word(name, cell);
    }
}

fn show(value: impl fmt::Display, cell: &mut Vec<u8>) {
    // It fits in memory.
    let _ = write!(cell, "{value}");
}

pub fn integer(value: i64, cell: &mut Vec<u8>) {
    match value {
        // Addresses of stations and positions at rest.
        0..10 => cell.push(b'0' + value as u8),
        _ => word(itoa::Buffer::new().format(value), cell),
    }
}

pub fn optional(value: Option<i64>, cell: &mut Vec<u8>) {
    if let Some(value) = value {
        integer(value, cell);
    }
}

/// Seconds with nine decimals.
pub fn seconds(ns: Option<i64>, cell: &mut Vec<u8>) {
    const NS: i64 = 1_000_000_000;
    match ns {
        None => {}
        Some(ns @ 0..NS) => {
            cell.push(b'0');
            cell.extend(decimals(ns as u32));
        }
        Some(ns) if ns < 0 => show(Exact(ns), cell),
        Some(ns) => {
            integer(ns / NS, cell);
            cell.extend(decimals((ns % NS) as u32));
        }
    }
}

/// A point, and nine digits of less than a second.
fn decimals(ns: u32) -> [u8; 10] {
    let pair = |number: u32| PAIRS[(number % 100) as usize];
    let (high, low) = (ns / 10_000, ns % 10_000);
    let [_, first] = pair(high / 10_000);
    let ([a, b], [c, d]) = (pair(high / 100), pair(high));
    let ([e, f], [g, h]) = (pair(low / 100), pair(low));
    [b'.', first, a, b, c, d, e, f, g, h]
}

pub fn hex(byte: u8, cell: &mut Vec<u8>) {
    const DIGITS: &[u8; 16] = b"0123456789ABCDEF";
    cell.extend([DIGITS[usize::from(byte >> 4)], DIGITS[usize::from(byte & 0xF)]]);
}

/// What the text view says of a record.
pub fn sentence(record: &Record<'_>, cell: &mut Vec<u8>) -> Cell {
    let start = cell.len();
    // It fits in memory.
    let _ = record.summarize(&mut Sentence(cell));
    make_harmless(cell, start)
}

/// Text from outside.
pub fn text(words: &str, cell: &mut Vec<u8>) -> Cell {
    let start = cell.len();
    word(words, cell);
    make_harmless(cell, start)
}

/// A terminal obeys control characters, and a spreadsheet runs a cell that begins in one of these
/// ways as a formula.
fn make_harmless(cell: &mut Vec<u8>, start: usize) -> Cell {
    const LED: u8 = mark::LEAD | mark::TAIL;
    let marks = cell[start..].iter().fold(0, |marks, byte| marks | MARKS[usize::from(*byte)]);
    if marks & mark::STEERS != 0 || marks & LED == LED {
        clean_from(cell, start);
    }
    if matches!(cell.get(start), Some(b'=' | b'+' | b'-' | b'@')) {
        cell.insert(start, b'\'');
    }
    if marks & mark::SPECIAL != 0 { Cell::Quoted } else { Cell::Plain }
}

/// Takes a sentence into a cell.
struct Sentence<'a>(&'a mut Vec<u8>);

impl fmt::Write for Sentence<'_> {
    fn write_str(&mut self, words: &str) -> fmt::Result {
        word(words, self.0);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(write: impl Fn(&mut Vec<u8>) -> Cell) -> (String, Cell) {
        let mut row = Vec::from(b"7,");
        let cell = write(&mut row);
        (String::from_utf8(row).expect("text"), cell)
    }

    #[test]
    fn seconds_have_nine_decimals() {
        for (ns, expected) in [
            (0, "0.000000000"),
            (1, "0.000000001"),
            (123_456_789, "0.123456789"),
            (999_999_999, "0.999999999"),
            (1_000_000_000, "1.000000000"),
            (1_700_000_000_000_158_805, "1700000000.000158805"),
            (-5, "-0.000000005"),
        ] {
            let mut cell = Vec::new();
            seconds(Some(ns), &mut cell);
            assert_eq!(String::from_utf8(cell), Ok(expected.to_owned()));
        }
    }

    /// What steers is cut out, so that no line end is left that would need quotes.
    #[test]
    fn what_needs_quotes_is_told_and_what_steers_is_gone() {
        for (outside, inside, cell) in [
            ("can0", "can0", Cell::Plain),
            ("1 answers in 187 µs ± 3", "1 answers in 187 µs ± 3", Cell::Plain),
            ("left, right", "left, right", Cell::Quoted),
            ("a \"b\"", "a \"b\"", Cell::Quoted),
            ("two\r\nlines", "two··lines", Cell::Plain),
            ("Größe → Ω", "Größe → Ω", Cell::Plain),
            ("can\u{9B}0,", "can·0,", Cell::Quoted),
            ("can\u{61C}0", "can·0", Cell::Plain),
            ("can\u{202E}0", "can·0", Cell::Plain),
            ("can\u{2066}0", "can·0", Cell::Plain),
            ("=1+1", "'=1+1", Cell::Plain),
        ] {
            assert_eq!(written(|row| text(outside, row)), (format!("7,{inside}"), cell));
        }
    }
}
