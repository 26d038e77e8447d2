//! CSV: a header row, then a row a record (RFC 4180).

use super::Export;
use super::cell::Cell;
use super::columns::Columns;
use dissectors::record::{Record, Sink};
use std::io::{self, Write};

/// Writes records as CSV. Cells are written where they will stand in the row: to hand them to a
/// writer one by one would take a third of the time of a record.
pub struct Csv<W: Write> {
    out: W,
    columns: Columns,
    result: io::Result<()>,
    has_header: bool,
    row: Vec<u8>,
}

impl<W: Write> Csv<W> {
    /// Writes these columns to `out`.
    pub fn new(out: W, columns: Columns) -> Self {
        Csv { out, columns, result: Ok(()), has_header: false, row: Vec::new() }
    }

    fn write_header(&mut self) -> io::Result<()> {
        self.has_header = true;
        let mut header = csv::Writer::from_writer(&mut self.out);
        header.write_record(self.columns.names()).map_err(io::Error::from)?;
        header.flush()
    }

    fn write(&mut self, record: &Record<'_>) -> io::Result<()> {
        if !self.has_header {
            self.write_header()?;
        }
        let Csv { columns, row, out, .. } = self;
        let delta = columns.begin(record);
        row.clear();
        for (index, column) in columns.iter().enumerate() {
            if index > 0 {
                row.push(b',');
            }
            let start = row.len();
            if column.write(record, delta, row) == Cell::Quoted {
                quote(row, start);
            }
        }
        if row.is_empty() {
            // One cell with nothing in it; an empty line would be no row.
            row.extend(b"\"\"");
        }
        row.push(b'\n');
        out.write_all(row)
    }
}

/// Puts quotes around the cell that begins there, and doubles those in it.
fn quote(row: &mut Vec<u8>, start: usize) {
    if row[start..].contains(&b'"') {
        let cell = row.split_off(start);
        for byte in cell {
            row.extend((byte == b'"').then_some(b'"'));
            row.push(byte);
        }
    }
    row.insert(start, b'"');
    row.push(b'"');
}

impl<W: Write> Sink for Csv<W> {
    fn record(&mut self, record: &Record<'_>) {
        if self.result.is_ok() {
            self.result = self.write(record);
        }
    }
}

impl<W: Write> Export for Csv<W> {
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

#[cfg(test)]
mod tests {
    use super::quote;

    #[test]
    fn quotes_in_a_cell_are_doubled() {
        for (cell, written) in [
            ("frame 42Ch, 5 bytes", "\"frame 42Ch, 5 bytes\""),
            ("the \"left\" plug", "\"the \"\"left\"\" plug\""),
        ] {
            let mut row = format!("7,{cell}").into_bytes();
            quote(&mut row, 2);
            assert_eq!(String::from_utf8(row), Ok(format!("7,{written}")));
        }
    }
}
