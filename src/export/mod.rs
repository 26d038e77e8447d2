//! Where records go: one file a form.

mod columns;
mod csv;
mod json;
pub mod schema;
mod text;

pub use columns::Columns;
pub use csv::Csv;
pub use json::Json;
pub use text::Text;

use dissectors::record::Sink;
use std::fmt;
use std::io;

/// A form that records are written in.
pub trait Export: Sink {
    /// What became of the records so far: the first error of writing them, once.
    ///
    /// # Errors
    /// They could not be written.
    fn status(&mut self) -> io::Result<()>;

    /// Writes what is still held.
    ///
    /// # Errors
    /// It could not be written.
    fn flush(&mut self) -> io::Result<()>;
}

/// Bytes as hex digits.
pub struct Hex<'a>(pub &'a [u8]);

impl fmt::Display for Hex<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02X}"))
    }
}
