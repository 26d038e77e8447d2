//! `interbus-log`: process words as CSV, a row each: `time,device,out,in`.

use super::Export;
use crate::clock::Exact;
use dissectors::interbus::{Content, Device, Row};
use dissectors::record::{Heard, Record, Sink};
use std::fmt::Write as _;
use std::io::{self, Write};

/// Writes the rows of records, one a line.
pub struct Rows<W> {
    out: W,
    result: io::Result<()>,
    has_header: bool,
    line: String,
}

impl<W: Write> Rows<W> {
    /// Writes to `out`.
    pub fn new(out: W) -> Self {
        Rows { out, result: Ok(()), has_header: false, line: String::new() }
    }

    fn write_header(&mut self) -> io::Result<()> {
        self.has_header = true;
        self.out.write_all(b"time,device,out,in\n")
    }

    fn write(&mut self, record: &Record<'_>) -> io::Result<()> {
        match record.heard {
            Heard::Row(row) => self.write_row(row, record),
            // What was concluded is concluded anew from the rows; what a cycle carried for a device
            // is a row of its own.
            Heard::Nothing | Heard::Lost(_) | Heard::Cycle(_) => Ok(()),
            Heard::Characters(_) | Heard::Frame(_) | Heard::Break(_) => {
                Err(refused(record, "is no ring whose words were logged"))
            }
        }
    }

    /// A String takes any text.
    fn write_row(&mut self, row: &Row, record: &Record<'_>) -> io::Result<()> {
        let Content::Process { out, input } = row.content else {
            return Err(refused(record, "has more than process words"));
        };
        if !self.has_header {
            self.write_header()?;
        }
        self.line.clear();
        self.push_stamp(row);
        let _ = write!(self.line, ",{}", row.device.unwrap_or(Device::FIRST).number());
        for word in [out, input] {
            self.line.push(',');
            if let Some(word) = word {
                let _ = write!(self.line, "{word:08X}");
            }
        }
        self.line.push('\n');
        self.out.write_all(self.line.as_bytes())
    }

    /// Seconds with as many decimals as the stamp is worth: that is how its ± is read back.
    fn push_stamp(&mut self, row: &Row) {
        let Some(ns) = row.start.ns() else { return };
        let _ = write!(self.line, "{}", Exact(ns));
        let mut unit = 1_i64;
        for _ in 0..9 {
            unit *= 10;
            if i64::from(row.uncertainty) < unit || ns % unit != 0 {
                return;
            }
            self.line.pop();
        }
        // The point stands behind whole seconds.
        self.line.pop();
    }
}

fn refused(record: &Record<'_>, why: &str) -> io::Error {
    let name = &record.bus.name;
    let what = format!("{name} {why}, and interbus-log holds these: write CSV or JSON");
    io::Error::new(io::ErrorKind::Unsupported, what)
}

impl<W: Write> Sink for Rows<W> {
    fn record(&mut self, record: &Record<'_>) {
        if self.result.is_ok() {
            self.result = self.write(record);
        }
    }
}

impl<W: Write> Export for Rows<W> {
    fn status(&mut self) -> io::Result<()> {
        std::mem::replace(&mut self.result, Ok(()))
    }

    fn flush(&mut self) -> io::Result<()> {
        if !self.has_header {
            self.write_header()?;
        }
        self.out.flush()
    }
}
