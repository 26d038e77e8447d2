//! CSV: a header row, then a row a record (RFC 4180).

use super::{Columns, Export};
use dissectors::record::{Record, Sink};
use std::io::{self, Write};

/// Writes records as CSV.
pub struct Csv<W: Write> {
    writer: csv::Writer<W>,
    columns: Columns,
    result: io::Result<()>,
    has_header: bool,
    cell: String,
}

impl<W: Write> Csv<W> {
    /// Writes these columns to `out`.
    pub fn new(out: W, columns: Columns) -> Self {
        Csv {
            writer: csv::WriterBuilder::new().buffer_capacity(64 * 1024).from_writer(out),
            columns,
            result: Ok(()),
            has_header: false,
            cell: String::new(),
        }
    }

    fn write_header(&mut self) -> io::Result<()> {
        self.has_header = true;
        self.writer.write_record(self.columns.names()).map_err(io::Error::from)
    }

    fn write(&mut self, record: &Record<'_>) -> io::Result<()> {
        if !self.has_header {
            self.write_header()?;
        }
        self.columns.begin(record);
        for column in self.columns.indexes() {
            self.cell.clear();
            self.columns.write(column, record, &mut self.cell);
            self.writer.write_field(&self.cell)?;
        }
        self.writer.write_record(None::<&[u8]>)?;
        Ok(())
    }
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
        self.writer.flush()
    }
}
