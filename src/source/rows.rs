//! Rows of a table in a text file, one at a time.

use super::{Input, Place, SourceError};
use csv::ByteRecord;
use std::io::{self, Read};

/// Longest row that is read, in bytes; no format comes near it.
const LONGEST: usize = 1024 * 1024;

/// Whether fields may stand in quotes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Quotes {
    /// A field in quotes may contain commas and line breaks.
    Used,
    /// A quote is a character like any other.
    None,
}

/// A reader of rows that never holds more than one.
pub struct Rows {
    source: String,
    reader: csv::Reader<Bounded>,
    row: ByteRecord,
}

/// Ends a row that does not end.
struct Bounded {
    input: Input,
    left: usize,
}

impl Read for Bounded {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.left == 0 {
            return Err(io::ErrorKind::InvalidData.into());
        }
        let count = self.input.read(buffer)?;
        self.left = self.left.saturating_sub(count);
        Ok(count)
    }
}

impl Rows {
    /// Rows of this input.
    pub fn new(input: Input, quotes: Quotes) -> Self {
        let source = input.name.clone();
        let reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .quoting(quotes == Quotes::Used)
            .buffer_capacity(64 * 1024)
            .from_reader(Bounded { input, left: LONGEST });
        Rows { source, reader, row: ByteRecord::new() }
    }

    /// The source, as the user named it.
    pub fn name(&self) -> &str {
        &self.source
    }

    /// Goes on to the next row that is not empty. False at the end.
    ///
    /// # Errors
    /// The source cannot be read, or a row is longer than any format has.
    pub fn find(&mut self) -> Result<bool, SourceError> {
        self.reader.get_mut().left = LONGEST;
        self.reader.read_byte_record(&mut self.row).map_err(|error| {
            let place = Place::Line(self.reader.position().line());
            match error.into_kind() {
                csv::ErrorKind::Io(cause) if cause.kind() == io::ErrorKind::InvalidData => {
                    let what = "the row has no end: this is not a table";
                    SourceError::new(&self.source, place, what)
                }
                csv::ErrorKind::Io(cause) => SourceError::io(&self.source, place, cause),
                other => SourceError::new(&self.source, place, format!("{other:?}")),
            }
        })
    }

    /// The row.
    pub fn row(&self) -> &ByteRecord {
        &self.row
    }

    /// An error in the row.
    pub fn error(&self, what: impl Into<String>) -> SourceError {
        let line = self.row.position().map_or(0, csv::Position::line);
        SourceError::new(&self.source, Place::Line(line), what)
    }

    /// The error of a row that has not as many fields as the first one.
    pub fn wrong_length(&mut self, expected: usize) -> SourceError {
        let there = self.row.len();
        let is_last = matches!(self.reader.read_byte_record(&mut ByteRecord::new()), Ok(false));
        if there < expected && is_last {
            return self.error("the file ends inside this row: it was cut");
        }
        self.error(format!("{there} fields, where the first row has {expected}"))
    }
}

/// A field as people may read it in a message: bounded, and without control characters.
pub fn shown(field: &[u8]) -> String {
    const MOST: usize = 40;
    let text = String::from_utf8_lossy(field);
    let short: String = text.chars().take(MOST).collect();
    let dots = if short.len() < text.len() { "…" } else { "" };
    format!("{:?}{dots}", short)
}

/// Text without the mark that some programs put before UTF-8.
pub fn without_mark(text: &[u8]) -> &[u8] {
    text.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(text)
}
