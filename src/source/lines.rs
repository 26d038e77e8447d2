//! Lines of a text capture, one at a time, with their numbers.

use super::{Place, SourceError};
use std::io::{BufRead, BufReader, Read};

/// Longest line that is read; no format comes near it.
const LONGEST: usize = 64 * 1024;

/// A reader of lines that never holds more than one.
pub struct Lines<R> {
    source: String,
    reader: BufReader<R>,
    line: Vec<u8>,
    number: u64,
}

impl<R: Read> Lines<R> {
    /// Lines of this reader.
    pub fn new(source: &str, reader: R) -> Self {
        Lines {
            source: source.to_owned(),
            reader: BufReader::with_capacity(256 * 1024, reader),
            line: Vec::new(),
            number: 0,
        }
    }

    /// The next line without its end, or `None` at the end of the source.
    ///
    /// # Errors
    /// The source cannot be read, or a line is longer than any format has.
    pub fn next_line(&mut self) -> Result<Option<&[u8]>, SourceError> {
        self.line.clear();
        self.number += 1;
        let limit = LONGEST as u64 + 1;
        let count = (&mut self.reader)
            .take(limit)
            .read_until(b'\n', &mut self.line)
            .map_err(|cause| SourceError::io(&self.source, self.place(), cause))?;
        if count == 0 {
            return Ok(None);
        }
        if count > LONGEST {
            return Err(self.error("the line has no end: this is not a text capture"));
        }
        let line = self.line.strip_suffix(b"\n").unwrap_or(&self.line);
        Ok(Some(line.strip_suffix(b"\r").unwrap_or(line)))
    }

    /// Whether the last line had an end, or the source ended inside it.
    pub fn has_end(&self) -> bool {
        self.line.ends_with(b"\n")
    }

    /// Whether the next line may have to be waited for.
    pub fn may_wait(&self) -> bool {
        self.reader.buffer().is_empty()
    }

    /// Where the last line stands.
    pub fn place(&self) -> Place {
        Place::Line(self.number)
    }

    /// An error in the last line.
    pub fn error(&self, what: impl Into<String>) -> SourceError {
        SourceError::new(&self.source, self.place(), what)
    }
}
