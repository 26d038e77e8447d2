//! Where records go: one file a form.

mod candump;
mod cell;
mod changes;
mod chars;
mod columns;
mod csv;
mod json;
pub mod pcapng;
mod rows;
pub mod schema;
mod text;

pub use candump::Candump;
pub use changes::Changes;
pub use chars::Chars;
pub use columns::Columns;
pub use csv::Csv;
pub use json::Json;
pub use pcapng::PcapNg;
pub use rows::Rows;
pub use text::Text;

use dissectors::event::Moment;
use dissectors::protocol::Medium;
use dissectors::record::{BusInfo, Record, Sink};
use std::fmt;
use std::io;

/// A form that records are written in.
pub trait Export: Sink {
    /// The run has records from this time on, shown or not.
    fn begin(&mut self, _time: Moment) {}

    /// Whether this record is one of those to be shown. Each is asked for once.
    fn wants(&mut self, _record: &Record<'_>) -> bool {
        true
    }

    /// Somebody's comment on what was heard on a bus at this time. Forms without comments leave it
    /// out.
    fn comment(&mut self, _bus: &BusInfo, _time: Moment, _text: &str) {}

    /// What is to be known of a source that goes on. It is said on standard error too, unless that
    /// shall be quiet.
    fn note(&mut self, _line: &str) {}

    /// The capture of a bus ended here, if the source told.
    fn end(&mut self, _bus: &BusInfo, _end: Moment) {}

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

/// The forms that hold what a bus of this medium carries, besides that which does not.
fn forms(medium: Medium) -> &'static str {
    match medium {
        Medium::Serial => "write pcapng, chars, CSV or JSON",
        Medium::Can => "write pcapng, candump, CSV or JSON",
        Medium::Words => {
            "write CSV or JSON, or process words of a log with --output-format interbus-log"
        }
    }
}

/// Bytes as hex digits.
pub struct Hex<'a>(pub &'a [u8]);

impl fmt::Display for Hex<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02X}"))
    }
}
