//! Logs of process words, as a controller writes them: CSV, a row for every device.

use super::ring::Data;
use crate::simulate::time::{Ps, US};
use anyhow::Result;
use std::io::Write;

/// How the words are written.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Columns {
    /// A column for the device.
    pub has_device: bool,
    /// Two words of 16 bits in place of one of 32.
    pub is_split: bool,
}

/// A log.
pub struct Log<W> {
    out: W,
    columns: Columns,
    /// What is added to every time, in s.
    start: i64,
}

impl<W: Write> Log<W> {
    /// Begins a log.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn new(mut out: W, columns: Columns, start: i64) -> Result<Self> {
        let device = if columns.has_device { "device," } else { "" };
        let words = if columns.is_split { "out1,out2,in1,in2" } else { "out,in" };
        writeln!(out, "time,{device}{words}")?;
        Ok(Log { out, columns, start })
    }

    /// A row.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn row(&mut self, at: Ps, data: &Data) -> Result<()> {
        let micros = self.start * 1_000_000 + at / US;
        write!(self.out, "{}.{:06}", micros / 1_000_000, micros % 1_000_000)?;
        if self.columns.has_device {
            write!(self.out, ",{}", data.device)?;
        }
        let size = if self.columns.is_split { 2 } else { 4 };
        for word in data.out.chunks(size).chain(data.input.chunks(size)) {
            write!(self.out, ",{}", crate::simulate::hex(word.iter().copied()))?;
        }
        writeln!(self.out)?;
        Ok(())
    }

    /// The log ends here.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn end(mut self) -> Result<()> {
        self.out.flush()?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::time::MS;

    fn row(columns: Columns, start: i64) -> String {
        let mut text = Vec::new();
        let mut log = Log::new(&mut text, columns, start).unwrap();
        let (out, input) = (vec![0xC2, 0, 0x13, 0x88], vec![0, 1, 0x23, 0x45]);
        log.row(1_002 * MS, &Data { device: 3, out, input, ..Data::default() }).unwrap();
        log.end().unwrap();
        String::from_utf8(text).unwrap()
    }

    #[test]
    fn words_are_of_32_bits_or_of_16() {
        let columns = |has_device, is_split| Columns { has_device, is_split };
        assert_eq!(row(columns(false, false), 0), "time,out,in\n1.002000,C2001388,00012345\n");
        assert_eq!(
            row(columns(true, true), 5),
            "time,device,out1,out2,in1,in2\n6.002000,3,C200,1388,0001,2345\n"
        );
    }
}
