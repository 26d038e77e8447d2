//! Why a source cannot go on.

use std::fmt;
use std::io;

/// Where in a source something happened.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Place {
    /// The source as a whole.
    Whole,
    /// At this byte, counted from 0.
    Byte(u64),
    /// In this line, counted from 1.
    Line(u64),
}

/// A source that cannot go on: what happened, where, and what to do about it. What came before
/// has been decoded.
#[derive(Debug)]
pub struct SourceError {
    /// The source, as the user named it.
    pub source: String,
    /// Where in it.
    pub place: Place,
    /// What happened, and what to do.
    pub what: String,
    /// The system's own words, if it was the system.
    pub cause: Option<io::Error>,
    /// Lines that could not be read and were left out, where this tells of them.
    pub left_out: u64,
}

impl SourceError {
    /// An error that fieldtap found in what it read.
    pub fn new(source: &str, place: Place, what: impl Into<String>) -> Self {
        SourceError {
            source: source.to_owned(),
            place,
            what: what.into(),
            cause: None,
            left_out: 0,
        }
    }

    /// The same where it tells that so many lines could not be read and were left out.
    pub fn leaving_out(self, lines: u64) -> Self {
        SourceError { left_out: lines, ..self }
    }

    /// An error of the system while it read.
    pub fn io(source: &str, place: Place, cause: io::Error) -> Self {
        let what = match cause.kind() {
            io::ErrorKind::NotFound => "there is no such file",
            io::ErrorKind::PermissionDenied => "this file may not be read: check its permissions",
            io::ErrorKind::IsADirectory => "this is a directory: name a file in it",
            _ => "cannot be read",
        };
        SourceError { cause: Some(cause), ..SourceError::new(source, place, what) }
    }
}

impl fmt::Display for SourceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.source)?;
        match self.place {
            Place::Whole => {}
            Place::Byte(offset) => write!(f, "at byte {offset}: ")?,
            Place::Line(number) => write!(f, "line {number}: ")?,
        }
        f.write_str(&self.what)?;
        match &self.cause {
            Some(cause) => write!(f, " ({cause})"),
            None => Ok(()),
        }
    }
}

impl std::error::Error for SourceError {}
