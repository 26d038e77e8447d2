//! CSV: a header row, then a row a record (RFC 4180).

use super::{Columns, Export};
use dissectors::record::{Record, Sink};
use std::io::{self, Write};

/// Writes records as CSV. Cells are written where they will stand in the row: to hand them to a
/// writer one by one would take a third of the time of a record.
pub struct Csv<W: Write> {
    out: W,
    columns: Columns,
    result: io::Result<()>,
    has_header: bool,
    row: String,
}

impl<W: Write> Csv<W> {
    /// Writes these columns to `out`.
    pub fn new(out: W, columns: Columns) -> Self {
        Csv { out, columns, result: Ok(()), has_header: false, row: String::new() }
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
        columns.begin(record);
        row.clear();
        for column in columns.indexes() {
            if column > 0 {
                row.push(',');
            }
            let start = row.len();
            columns.write(column, record, row);
            if columns.has_text(column) {
                quote(row, start);
            }
        }
        if row.is_empty() {
            // One cell with nothing in it; an empty line would be no row.
            row.push_str("\"\"");
        }
        row.push('\n');
        out.write_all(row.as_bytes())
    }
}

/// Puts quotes around the cell that begins there, if it cannot stand without.
fn quote(row: &mut String, start: usize) {
    let cell = &row.as_bytes()[start..];
    if !cell.iter().any(|byte| matches!(byte, b',' | b'"' | b'\n' | b'\r')) {
        return;
    }
    if cell.contains(&b'"') {
        let doubled = row[start..].replace('"', "\"\"");
        row.truncate(start);
        row.push_str(&doubled);
    }
    row.insert(start, '"');
    row.push('"');
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
    fn only_cells_that_need_them_have_quotes() {
        for (cell, written) in [
            ("", ""),
            ("42C#01", "42C#01"),
            ("frame 42Ch, 5 bytes", "\"frame 42Ch, 5 bytes\""),
            ("the \"left\" plug", "\"the \"\"left\"\" plug\""),
            ("two\nlines", "\"two\nlines\""),
        ] {
            let mut row = format!("7,{cell}");
            quote(&mut row, 2);
            assert_eq!(row, format!("7,{written}"));
        }
    }
}
