//! `interbus-id`: the ID words of a ring, as a bus scan lists them.
//!
//! A header `device,id` (the word, in hex) or `device,ident,length` (ident and length code, in
//! decimal as manuals print them), perhaps with `time`; or no header, and a word a line, the first
//! device first.

use super::super::outbox::{Outbox, Reader};
use super::super::{Input, SourceError, SourceOptions};
use super::layout::{Layout, LengthCodes, Radix};
use super::log::device;
use super::stamps::{Stamps, wrong};
use super::table::{Cells, Header, Table};
use super::words::{Words, number};
use super::{BUS, announce};
use dissectors::interbus::identification::Length;
use dissectors::interbus::{Content, Device, Row};

/// What the format is called in messages.
const NAME: &str = "a list of ID words";

/// Whether a source begins with a header of this format.
pub fn is_header(head: &[u8]) -> bool {
    let forms = [&["device", "id"][..], &["device", "ident", "length"]];
    Header::peek(head).is_some_and(|header| forms.iter().any(|names| header.has(names)))
}

/// A list of ID words.
pub struct List {
    table: Table,
    columns: Columns,
    reading: Reading,
    stamps: Stamps,
    /// Devices so far, for lists that do not number them.
    devices: u16,
    is_announced: bool,
}

/// Where what stands.
struct Columns {
    time: Option<usize>,
    device: Option<usize>,
    word: Site,
}

/// Where the parts of an ID word stand.
#[derive(Clone, Copy)]
enum Site {
    Word(usize),
    /// Ident and length code.
    Parts(usize, usize),
}

/// How the parts of an ID word are written.
#[derive(Clone, Copy)]
struct Reading {
    words: Words,
    parts: Radix,
    length_codes: LengthCodes,
}

impl List {
    /// Reads ID words from this input.
    ///
    /// # Errors
    /// Another channel was asked for, or the header does not fit.
    pub fn new(input: Input, options: &SourceOptions) -> Result<Self, SourceError> {
        options.choose_only(BUS, &input.name)?;
        let layout = &options.interbus;
        let mut table = Table::new(input);
        let header = table.header()?;
        let reading = Reading::new(layout);
        let is_word = |cells: Cells<'_>| Site::Word(0).read(cells, reading).is_ok();
        let is_bare = layout.format().is_none()
            && table.first_is(|cells| cells.count() == 1 && is_word(cells));
        let columns = match is_bare {
            true => Columns { time: None, device: None, word: Site::Word(0) },
            false => Columns::of(&header, layout).map_err(|what| table.error(what))?,
        };
        let is_row = |cells: Cells<'_>| columns.word.read(cells, reading).is_ok();
        let has_no_header = is_bare || layout.is_by_number() && table.first_is(is_row);
        if !has_no_header {
            table.skip_header();
        }
        let stamps = Stamps::new(layout.time_unit, table.delimiter());
        Ok(List { table, columns, reading, stamps, devices: 0, is_announced: false })
    }
}

impl Reader for List {
    fn read_on(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
        let List { table, columns, reading, stamps, devices, is_announced } = self;
        if !std::mem::replace(is_announced, true) {
            announce(columns.time.is_some(), None, false, out);
        }
        while !out.is_full() {
            let mut row = None;
            let has_more = table.read(out, |cells| {
                let next = devices.saturating_add(1);
                row = Some(columns.row(cells, *reading, stamps, next)?);
                *devices = next;
                Ok(())
            })?;
            row.into_iter().for_each(|row| out.row(0, row));
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
        let word = match (find("id")?, find("ident")?, find("length")?) {
            (Some(column), _, _) => Site::Word(column),
            (None, Some(ident), Some(length)) => Site::Parts(ident, length),
            _ => {
                let told = header.told();
                return Err(format!(
                    "no column is named id, or ident and length: {told}; expected device,id or \
                     device,ident,length, or a word a line; say which is which, such as --columns \
                     device=Pos,id=Code (a name, or a number from 1)"
                ));
            }
        };
        Ok(Columns { time: find("time")?, device: find("device")?, word })
    }

    /// The row of a line. A list without device numbers is in the order of the ring.
    fn row(
        &self,
        cells: Cells<'_>,
        reading: Reading,
        stamps: &mut Stamps,
        next: u16,
    ) -> Result<Row, &'static str> {
        let word = self.word.read(cells, reading)?;
        let device = match self.device {
            Some(column) => device(cells.get(column).unwrap_or_default()),
            None => Device::new(next),
        };
        let device = device.ok_or("there is no such device: 1 to 512")?;
        let time = self.time.and_then(|column| cells.get(column)).unwrap_or_default();
        let (start, uncertainty) = stamps.read(b"", time).ok_or_else(|| wrong(b"", time))?;
        Ok(Row::new(Some(device), Content::Identification(word)).at(start, uncertainty))
    }
}

impl Site {
    /// The ID word of a line.
    fn read(self, cells: Cells<'_>, reading: Reading) -> Result<u16, &'static str> {
        let cell = |column| cells.get(column).ok_or("columns are missing");
        match self {
            Site::Word(column) => reading.words.short(cell(column)?).ok_or("not a word of 16 bits"),
            Site::Parts(ident, length) => reading.word(cell(ident)?, cell(length)?),
        }
    }
}

impl Reading {
    fn new(layout: &Layout) -> Self {
        let parts = layout.words.unwrap_or(Radix::Decimal);
        Reading { words: Words::new(layout), parts, length_codes: layout.length_codes }
    }

    /// The ID word of an ident and a length code: no device reports anything in it.
    fn word(self, ident: &[u8], length: &[u8]) -> Result<u16, &'static str> {
        let what = "the ident code is no number up to 255: mark hex as 33h, or say --words hex";
        let ident = number(ident, self.parts, 8).ok_or(what)?;
        let length = match self.length_codes {
            LengthCodes::Chip => {
                let code = number(length, self.parts, 8).and_then(|code| Length::new(code as u8));
                code.ok_or(
                    "the length code is no number up to 31: mark hex as 0Ah, or say --words hex; \
                     if it is of eight bits, say --length-codes data-sheet",
                )?
            }
            // Data sheets print them in hex.
            LengthCodes::DataSheet => {
                let code = number(length, Radix::Hex, 8).ok_or("the length code is no hex byte")?;
                Length::from_data_sheet(code as u8).ok_or("no ID word has this length")?
            }
        };
        Ok(u16::from(length.code()) << 8 | ident as u16)
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::InputFormat;
    use super::super::super::damage::survive;
    use super::super::super::transcript::transcript;
    use super::super::Mapping;
    use super::*;

    fn read_as(text: &str, layout: Layout) -> Vec<String> {
        let options = SourceOptions { interbus: layout, ..SourceOptions::default() };
        transcript(InputFormat::InterbusId, text.as_bytes(), &options)
    }

    fn read(text: &str) -> Vec<String> {
        read_as(text, Layout::default())
    }

    /// 51 and 2 are 33h and 02h: 0233h.
    const RING: &str = "0: 1 Identification(203) ±0, 2 Identification(233) ±0";

    #[test]
    fn words_or_their_parts() {
        let ring = ["bus ring", &RING.replace(") ±", ")±")];
        assert_eq!(read("device,id\n1,0203\n2,0233\n"), ring);
        assert_eq!(read("device;ident;length\n1;3;2\n2;33h;2\n"), ring);
        assert_eq!(read("0203\n0233\n"), ring);
        assert_eq!(read("# scan\n0x0203\n\n16#233"), ring);
        let columns = Mapping::parse("device=2,id=1").unwrap();
        assert_eq!(read_as("0203;1\n0233;2\n", Layout { columns, ..Layout::default() }), ring);
        let length_codes = LengthCodes::DataSheet;
        let said = read_as(
            "device,ident,length\n1,3,02\n2,51,02\n3,2,81\n",
            Layout { length_codes, ..Layout::default() },
        );
        // One byte is code 09h.
        assert!(said[1].ends_with(", 3 Identification(902)±0"), "{said:?}");
    }

    #[test]
    fn times_where_there_are_some() {
        let said = read("time,device,id\n1.5,1,0233\n");
        assert_eq!(said, ["bus ring log", "0: 1 Identification(233) @1500000000±100000000"]);
    }

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        let said = read("device,ident,length\n1,51,2\n2,33x,2\n3,51,129\n0,51,2\n");
        assert!(said[2].starts_with("warning: test: line 3: the ident code"), "{said:?}");
        assert!(said[3].contains("line 4: the length code is no number up to 31"));
        assert!(said[4].contains("line 5: there is no such device"));
        assert!(read("pos,code\n")[0].contains("the columns are \"pos\" \"code\""));
    }

    #[test]
    fn headers_are_recognised() {
        assert!(is_header(b"device,id\n") && is_header(b"Device;Ident;Length"));
        assert!(!is_header(b"device,out\n") && !is_header(b"0233\n"));
    }

    #[test]
    fn no_damage_stops_the_reader_in_disorder() {
        survive(InputFormat::InterbusId, b"time,device,ident,length\n0.010,1,51,2\n1,2,3,4\n");
        survive(InputFormat::InterbusId, b"0233\n0203\n");
    }
}
