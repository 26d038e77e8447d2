//! `interbus-diagnostic`: what a master or a coupler reports, as CSV.
//!
//! A header `time,status,parameter` (the diagnostic registers), `time,device,slave` (the byte that a
//! coupler keeps of a slave), or `time,message` (the words of a host message with blanks between).
//! One table may hold them all: a cell that is empty says nothing.

use super::super::outbox::{Outbox, Reader};
use super::super::{Input, SourceError, SourceOptions};
use super::layout::Layout;
use super::log::device;
use super::stamps::{Stamps, wrong};
use super::table::{Cells, Header, Table};
use super::words::Words;
use super::{BUS, announce};
use dissectors::interbus::{Content, Row};

/// What the format is called in messages.
const NAME: &str = "a diagnostic log";

/// Whether a source begins with a header of this format. `status` and `message` alone are names
/// that anybody uses: the first line behind them decides.
pub fn is_header(head: &[u8]) -> bool {
    let Some(header) = Header::peek(head) else { return false };
    let has_words = || {
        let line = head.split(|byte| *byte == b'\n').nth(1).unwrap_or_default();
        let last = line.rsplit(|byte| b",;\t".contains(byte)).next();
        let text = last.unwrap_or_default().trim_ascii();
        let is_word = |word: &[u8]| word.len() == 4 && word.iter().all(u8::is_ascii_hexdigit);
        text.split(|byte| *byte == b' ').all(is_word)
    };
    header.has(&["time", "status", "parameter"])
        || header.has(&["time", "device", "slave"])
        || (header.has(&["time", "status"]) || header.has(&["time", "message"])) && has_words()
}

/// A log of diagnostics.
pub struct Registers {
    table: Table,
    columns: Columns,
    words: Words,
    stamps: Stamps,
    rows: Vec<Row>,
    is_announced: bool,
}

/// Where what stands.
struct Columns {
    date: Option<usize>,
    time: Option<usize>,
    device: Option<usize>,
    status: Option<usize>,
    parameter: Option<usize>,
    slave: Option<usize>,
    message: Option<usize>,
}

impl Registers {
    /// Reads diagnostics from this input.
    ///
    /// # Errors
    /// Another channel was asked for, or the header does not fit.
    pub fn new(input: Input, options: &SourceOptions) -> Result<Self, SourceError> {
        options.choose_only(BUS, &input.name)?;
        let layout = &options.interbus;
        let mut table = Table::new(input);
        let header = table.header()?;
        let columns = Columns::of(&header, layout).map_err(|what| table.error(what))?;
        let (words, mut rows) = (Words::new(layout), Vec::new());
        let mut stamps = Stamps::new(layout.time_unit, table.delimiter());
        let is_row = |cells: Cells<'_>| columns.take(cells, &words, &mut stamps, &mut rows).is_ok();
        if !(layout.is_by_number() && table.first_is(is_row)) {
            table.skip_header();
        }
        rows.clear();
        stamps.rewind();
        Ok(Registers { table, columns, words, stamps, rows, is_announced: false })
    }
}

impl Reader for Registers {
    fn read_on(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
        let Registers { table, columns, words, stamps, rows, is_announced } = self;
        if !std::mem::replace(is_announced, true) {
            announce(columns.time.is_some(), None, false, out);
        }
        while !out.is_full() {
            let has_more = table.read(out, |cells| columns.take(cells, words, stamps, rows))?;
            rows.drain(..).for_each(|row| out.row(0, row));
            if !has_more {
                table.finish(NAME, out)?;
                return Ok(false);
            }
            if table.may_wait() {
                break;
            }
        }
        Ok(true)
    }
}

impl Columns {
    fn of(header: &Header, layout: &Layout) -> Result<Self, String> {
        let find = |name| header.find(name, &layout.columns);
        let columns = Columns {
            date: find("date")?,
            time: find("time")?,
            device: find("device")?,
            status: find("status")?,
            parameter: find("parameter")?,
            slave: find("slave")?,
            message: find("message")?,
        };
        let is_there = [columns.status, columns.slave.and(columns.device), columns.message];
        match is_there.iter().any(Option::is_some) {
            true => Ok(columns),
            false => Err(format!(
                "no column is named status, slave (with device) or message: {}; expected \
                 time,status,parameter, or time,device,slave, or time,message; say which is which, \
                 such as --columns time=Timestamp,status=MD5,parameter=3 (a name, or a number from \
                 1)",
                header.told()
            )),
        }
    }

    /// Takes the rows of a line: one for each thing that it tells. All or none are taken.
    fn take(
        &self,
        cells: Cells<'_>,
        words: &Words,
        stamps: &mut Stamps,
        rows: &mut Vec<Row>,
    ) -> Result<(), &'static str> {
        let cell = |column: Option<usize>| match column {
            Some(column) => cells.get(column).ok_or("columns are missing"),
            None => Ok(&b""[..]),
        };
        let (date, time) = (cell(self.date)?, cell(self.time)?);
        let (start, uncertainty) = stamps.read(date, time).ok_or_else(|| wrong(date, time))?;
        let of_status = |status| -> Result<Row, &'static str> {
            let status = words.short(status).ok_or("the status is not a word of 16 bits")?;
            let parameter = match cell(self.parameter)? {
                b"" => None,
                cell => Some(words.short(cell).ok_or("the parameter is not a word of 16 bits")?),
            };
            Ok(Row::new(None, Content::Diagnostic { status, parameter }))
        };
        let of_slave = |slave| -> Result<Row, &'static str> {
            let device = device(cell(self.device)?).ok_or("there is no such device: 1 to 512")?;
            let byte = words.byte(slave).ok_or("the state of a slave is not a byte")?;
            Ok(Row::new(Some(device), Content::SlaveDiagnostic(byte)))
        };
        let said = |column| cell(column).map(|cell| Some(cell).filter(|cell| !cell.is_empty()));
        let told = [
            said(self.status)?.map(of_status).transpose()?,
            said(self.slave)?.map(of_slave).transpose()?,
            said(self.message)?.map(|cell| message(cell, words)).transpose()?,
        ];
        rows.extend(told.into_iter().flatten().map(|row| row.at(start, uncertainty)));
        Ok(())
    }
}

fn message(cell: &[u8], words: &Words) -> Result<Row, &'static str> {
    let parts = || cell.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    if parts().any(|word| words.short(word).is_none()) {
        return Err("a message is words of 16 bits with blanks between them");
    }
    Ok(Row::message(parts().filter_map(|word| words.short(word))))
}

#[cfg(test)]
mod tests {
    use super::super::super::InputFormat;
    use super::super::super::damage::survive;
    use super::super::super::transcript::transcript;
    use super::super::{Mapping, Radix};
    use super::*;

    fn read_as(text: &str, layout: Layout) -> Vec<String> {
        let options = SourceOptions { interbus: layout, ..SourceOptions::default() };
        transcript(InputFormat::InterbusDiagnostic, text.as_bytes(), &options)
    }

    fn read(text: &str) -> Vec<String> {
        read_as(text, Layout::default())
    }

    #[test]
    fn registers_slaves_and_messages() {
        let fault = "0: Diagnostic { status: E2, parameter: Some(301) } @500000000±100000000";
        assert_eq!(read("time,status,parameter\n0.5,00E2,0301\n"), ["bus ring log", fault]);
        let columns = Mapping::parse("time=1,status=2,parameter=3").unwrap();
        let layout = Layout { columns, words: Some(Radix::Decimal), ..Layout::default() };
        // E2h = 226, 0301h = 769.
        assert_eq!(read_as("0,5;226;769\n", layout), ["bus ring log", fault]);
        assert_eq!(
            read("time,status\n0.5,00E0\n")[1],
            "0: Diagnostic { status: E0, parameter: None } @500000000±100000000"
        );
        assert_eq!(
            read("time,device,slave\n0.5,3,02\n")[1],
            "0: 3 SlaveDiagnostic(2) @500000000±100000000"
        );
        assert_eq!(
            read("time,message\n0.5,0081 0003 0002 2116 0000\n")[1],
            "0: Message @500000000±100000000"
        );
    }

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        let said = read("time,device,status,slave,message\n0,,E0,,\n1,,X,,\n2,,,1,\n3,,,,81 G\n");
        assert!(said[2].contains("line 3: the status is not a word"), "{said:?}");
        assert!(said[3].contains("line 4: there is no such device"));
        assert!(said[4].contains("line 5: a message is words"));
        assert!(read("time,slave\n")[0].contains("no column is named status, slave (with device)"));
    }

    #[test]
    fn headers_are_recognised() {
        for head in [
            "time,status,parameter\n",
            "time,device,slave\n",
            "time;status\n0,5;00E0\n",
            "time,message\n0.5,0081 0003\r\n",
        ] {
            assert!(is_header(head.as_bytes()), "{head}");
        }
        for head in ["time,message\n0.5,motor started\n", "time,message\n", "time,status\n0,ok\n"] {
            assert!(!is_header(head.as_bytes()), "{head}");
        }
    }

    #[test]
    fn no_damage_stops_the_reader_in_disorder() {
        let good =
            b"time,device,status,parameter,slave,message\n0.1,2,00E2,0301,02,0081 0001 0002\n";
        survive(InputFormat::InterbusDiagnostic, good);
    }
}
