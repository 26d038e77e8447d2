//! `interbus-log`: process words as CSV.
//!
//! A header `time,out,in` (words of 32 bits) or `time,out1,out2,in1,in2` (of 16), perhaps with
//! `device` and `date`; then a line a row. Where columns have other names, the user maps them.

use super::super::outbox::{Outbox, Reader};
use super::super::{Input, SourceError, SourceOptions};
use super::columns::Columns;
use super::join::Join;
use super::layout::{Layout, Mapping, Radix};
use super::stamps::{Base, Stamps, wrong};
use super::table::{Cells, Header, Table};
use super::words::{Words, is_surely_hex};
use super::{BUS, announce};
use dissectors::interbus::word::Word;
use dissectors::interbus::{Content, Device, Row, can_be};

/// What the format is called in messages.
const NAME: &str = "a log of process words";

/// Words in the first lines that must be there before anything is said of how they look.
const ENOUGH: usize = 16;

/// Whether a source begins with a header of this format.
pub fn is_header(head: &[u8]) -> bool {
    let sides = [&["time", "out"][..], &["time", "in"], &["time", "out1"], &["time", "in1"]];
    Header::peek(head).is_some_and(|header| sides.iter().any(|names| header.has(names)))
}

/// A log of process words, or two that are joined.
pub struct Log {
    first: File,
    join: Option<Join>,
    rows: Vec<Row>,
    is_announced: bool,
}

impl Log {
    /// Reads rows from this input.
    ///
    /// # Errors
    /// Another channel was asked for, or the header does not fit.
    pub fn new(input: Input, options: &SourceOptions) -> Result<Self, SourceError> {
        options.choose_only(BUS, &input.name)?;
        let layout = &options.interbus;
        let first = File::new(input, &layout.columns, layout)?;
        let join = match &layout.join {
            Some(path) => {
                let input = Input::open(&path.to_string_lossy())?;
                let mapping = layout.join_columns.as_ref().unwrap_or(&layout.columns);
                Some(Join::new(File::new(input, mapping, layout)?))
            }
            None => None,
        };
        Ok(Log { first, join, rows: Vec::new(), is_announced: false })
    }

    fn announce(&mut self, out: &mut Outbox) {
        let files: Vec<&File> =
            [&self.first].into_iter().chain(self.join.as_ref().map(Join::second)).collect();
        let is_open = files.iter().any(|file| file.look == Look::Open);
        announce(self.first.columns.time.is_some(), self.first.base(), is_open, out);
        for file in files {
            let what = match file.look {
                Look::Hex => continue,
                Look::Decimal => {
                    "its words are read as decimal: as hex, some of the first lines would be no \
                     words, or none that an encoder sends; if they are hex, say --words hex"
                }
                Look::Open => {
                    "its words may be hex or decimal, no digit is above 9: they are read as hex; \
                     say --words decimal, or --words hex"
                }
            };
            out.warning(file.table.error(what));
        }
    }
}

impl Reader for Log {
    fn read_on(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
        if !std::mem::replace(&mut self.is_announced, true) {
            self.announce(out);
        }
        while !out.is_full() {
            let has_more = match &mut self.join {
                Some(join) => join.read(&mut self.first, &mut self.rows, out)?,
                None => self.first.read(&mut self.rows, out)?,
            };
            self.rows.drain(..).for_each(|row| out.row(0, row));
            if !has_more {
                self.first.table.finish(NAME, out)?;
                self.join.iter().try_for_each(|join| join.second().table.finish(NAME, out))?;
                return Ok(false);
            }
            if self.join.is_none() && self.first.table.may_wait() {
                break;
            }
        }
        Ok(true)
    }
}

/// One file of process words.
pub struct File {
    table: Table,
    columns: Columns,
    words: Words,
    stamps: Stamps,
    /// Characters of the last line's last cell.
    width: usize,
    /// Words are filled up with zeros, so that a shorter one is not all there.
    is_padded: bool,
    look: Look,
}

/// How the first words look.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Look {
    /// As hex, or the user said so, or there are too few to tell.
    Hex,
    /// As decimal numbers that make no sense in hex.
    Decimal,
    /// As either.
    Open,
}

/// What words would be in either radix.
#[derive(Clone, Copy, Default)]
struct Sense {
    is_none: bool,
    is_odd: bool,
}

impl Sense {
    fn take(&mut self, columns: &Columns, cells: Cells<'_>, words: Words) {
        for member in &columns.members {
            match member.sides(cells, &words) {
                Ok((out, input)) => {
                    self.is_odd |= !can_be(out.map(Word::new), input.map(Word::new));
                }
                Err(_) => self.is_none = true,
            }
        }
    }
}

impl File {
    fn new(input: Input, mapping: &Mapping, layout: &Layout) -> Result<Self, SourceError> {
        let mut table = Table::new(input);
        let header = table.header()?;
        let columns = Columns::of(&header, mapping, layout).map_err(|what| table.error(what))?;
        let stamps = Stamps::new(layout.time_unit, table.delimiter());
        let words = Words::new(layout);
        let mut file =
            File { table, columns, words, stamps, width: 0, is_padded: false, look: Look::Hex };
        if !layout.is_by_number() || !file.begins_with_a_row() {
            file.table.skip_header();
        }
        file.look = file.look_ahead(layout);
        if file.look == Look::Decimal {
            file.words = file.words.in_radix(Radix::Decimal);
        }
        Ok(file)
    }

    /// Whether what was taken for the header is a row.
    fn begins_with_a_row(&mut self) -> bool {
        let File { table, columns, words, stamps, .. } = self;
        let is_row =
            table.first_is(|cells| take(columns, words, stamps, cells, &mut Vec::new()).is_ok());
        stamps.rewind();
        is_row
    }

    /// Looks at the first lines: how fine times are, and how words are written.
    fn look_ahead(&mut self, layout: &Layout) -> Look {
        let File { table, columns, words, stamps, is_padded, .. } = self;
        let (mut count, mut is_hex) = (0, layout.words.is_some());
        let [mut hex, mut decimal] = [Sense::default(); 2];
        table.look_ahead(|cells| {
            let cell = |column: Option<usize>| cells.get(column?);
            let (date, time) = (cell(columns.date), cell(columns.time));
            let _ = stamps.read(date.unwrap_or_default(), time.unwrap_or_default());
            let is_word = |cell: &&[u8]| words.is_word(cell);
            for cell in columns.cells(cells).filter(is_word) {
                count += usize::from(cell != b"0");
                is_hex |= is_surely_hex(cell);
                *is_padded |= matches!(cell, [b'0', b'0'..=b'9' | b'a'..=b'f' | b'A'..=b'F', ..]);
            }
            if columns.cells(cells).any(|cell| words.is_word(cell)) {
                hex.take(columns, cells, words.in_radix(Radix::Hex));
                decimal.take(columns, cells, words.in_radix(Radix::Decimal));
            }
        });
        stamps.rewind();
        match (hex, decimal) {
            _ if is_hex || count < ENOUGH || decimal.is_none => Look::Hex,
            // A device of another kind may send anything: only what both can be is compared.
            (Sense { is_none: true, .. }, _) => Look::Decimal,
            (Sense { is_odd: true, .. }, Sense { is_odd: false, .. }) => Look::Decimal,
            (Sense { is_odd: false, .. }, Sense { is_odd: true, .. }) => Look::Hex,
            _ => Look::Open,
        }
    }

    /// Where its last time is counted from.
    pub fn base(&self) -> Option<Base> {
        self.stamps.base()
    }

    /// What the user calls it.
    pub fn name(&self) -> &str {
        self.table.name()
    }

    /// An error in the last line.
    pub fn error(&self, what: impl Into<String>) -> SourceError {
        self.table.error(what)
    }

    /// Reads the next line, and puts its rows behind those that are there. False at the end.
    ///
    /// # Errors
    /// The file cannot be read, or it was cut.
    pub fn read(&mut self, rows: &mut Vec<Row>, out: &mut Outbox) -> Result<bool, SourceError> {
        let File { table, columns, words, stamps, width, is_padded, .. } = self;
        let (before, mut is_shorter) = (rows.len(), false);
        let has_more = table.read(out, |cells| {
            let last = cells.last().len();
            is_shorter = last < std::mem::replace(width, last);
            take(columns, words, stamps, cells, rows)
        })?;
        if is_shorter && has_more && *is_padded && !table.has_end() {
            rows.truncate(before);
            return Err(table.cut());
        }
        Ok(has_more)
    }
}

/// Takes the rows of a line: one for each device. All or none are taken.
fn take(
    columns: &Columns,
    words: &Words,
    stamps: &mut Stamps,
    cells: Cells<'_>,
    rows: &mut Vec<Row>,
) -> Result<(), &'static str> {
    let cell = |column: Option<usize>| match column {
        Some(column) => cells.get(column).ok_or("columns are missing"),
        None => Ok(&b""[..]),
    };
    let (date, time) = (cell(columns.date)?, cell(columns.time)?);
    let (start, uncertainty) = stamps.read(date, time).ok_or_else(|| wrong(date, time))?;
    let named = match cell(columns.device)? {
        b"" => None,
        cell => Some(device(cell).ok_or("there is no such device: 1 to 512")?),
    };
    let before = rows.len();
    for member in &columns.members {
        match member.sides(cells, words) {
            Ok((None, None)) => {}
            Ok((out, input)) => {
                let device = Some(named.unwrap_or(member.device));
                let content = Content::Process { out, input };
                rows.push(Row::new(device, content).at(start, uncertainty));
            }
            Err(what) => {
                rows.truncate(before);
                return Err(what);
            }
        }
    }
    Ok(())
}

/// A device number, always in decimal.
pub fn device(cell: &[u8]) -> Option<Device> {
    Device::new(std::str::from_utf8(cell).ok()?.parse().ok()?)
}

#[cfg(test)]
mod tests {
    use super::super::super::InputFormat;
    use super::super::super::damage::survive;
    use super::super::super::transcript::transcript;
    use super::super::{Order, RingMap, TimeUnit};
    use super::*;

    fn read_as(text: &str, layout: Layout) -> Vec<String> {
        let options = SourceOptions { interbus: layout, ..SourceOptions::default() };
        transcript(InputFormat::InterbusLog, text.as_bytes(), &options)
    }

    fn read(text: &str) -> Vec<String> {
        read_as(text, Layout::default())
    }

    fn columns(text: &str) -> Layout {
        Layout { columns: Mapping::parse(text).unwrap(), ..Layout::default() }
    }

    /// A row as transcripts have it: C2001388h written, 00000100h received, at 1 s ± 0.1 s.
    const ROW: &str = "1 Process { out: Some(C2001388), input: Some(100) } @1000000000±100000000";

    #[test]
    fn words_of_32_bits_and_of_16() {
        let said = read("time,out,in\n1.0,C2001388,00000100\n");
        assert_eq!(said, ["bus ring log".to_owned(), format!("0: {ROW}")]);
        let same = |text: &str| assert_eq!(read(text), said, "{text}");
        same("time,out1,out2,in1,in2\n1.0,C200,1388,0000,0100\n");
        same("\u{FEFF}sep=;\r\nTime;OUT;IN\r\n1,0;0xC2001388;16#100\r\n");
        same("\"in\"\t\"out\"\t\"time\"\n\"00000100\"\t\"C2001388\"\t\"1,0\"\n");
        same("# a remark\n\ntime,out,in\n1.0,C2001388h,100h\n\n");
    }

    #[test]
    fn columns_of_other_names() {
        let said = vec!["bus ring log".to_owned(), format!("0: {ROW}")];
        let text = "Timestamp;QD10;ID10\n1,0;C2001388;00000100\n";
        assert_eq!(read_as(text, columns("time=timestamp,out=QD10,in=ID10")), said);
        assert_eq!(read_as(text, columns("time=1,out=2,in=3")), said);
        // Without a header.
        assert_eq!(read_as("1.0,C2001388,00000100\n", columns("time=1,out=2,in=3")), said);
        let decimal = Layout { words: Some(Radix::Decimal), ..columns("time=1,out=2,in=3") };
        assert_eq!(read_as("1.0,-1040182392,256\n", decimal), said);
        let swapped = Layout {
            word_order: Order::LowFirst,
            byte_order: Order::LowFirst,
            time_unit: TimeUnit::Ms,
            ..Layout::default()
        };
        let said = read_as("time,out,in\n1000,881300C2,00010000\n", swapped);
        assert_eq!(said[1], format!("0: {}", ROW.replace("±100000000", "±1000000")));
    }

    #[test]
    fn several_devices_in_rows_of_their_own_and_in_one() {
        let said = read("time,device,out,in\n0.1,1,0,5\n0.1,2,0,6\n0.2,2,,7\n");
        assert_eq!(
            said[1],
            "0: 1 Process { out: Some(0), input: Some(5) } @100000000±100000000, \
             2 Process { out: Some(0), input: Some(6) } @100000000±100000000, \
             2 Process { out: None, input: Some(7) } @200000000±100000000"
        );
        let ring = RingMap::parse("1=a/b,7=/c+d").unwrap();
        let said =
            read_as("time,a,b,c,d\n0.1,1,2,0003,0004\n", Layout { ring, ..Layout::default() });
        assert_eq!(
            said[1],
            "0: 1 Process { out: Some(1), input: Some(2) } @100000000±100000000, \
             7 Process { out: None, input: Some(30004) } @100000000±100000000"
        );
    }

    #[test]
    fn two_logs_are_joined_by_time() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(&file, "time,in\n0.1,5\n0.3,6\n0.4,7\n").unwrap();
        let join = Some(file.path().to_owned());
        let layout = Layout { join, ..Layout::default() };
        let said = read_as("time,out\n0.2,A\n0.3,B\n", layout.clone());
        assert_eq!(
            said[1],
            "0: 1 Process { out: None, input: Some(5) } @100000000±100000000, \
             1 Process { out: Some(A), input: Some(5) } @200000000±100000000, \
             1 Process { out: Some(B), input: Some(6) } @300000000±100000000, \
             1 Process { out: Some(B), input: Some(7) } @400000000±100000000"
        );
        // Neither counters and dates nor times that do not overlap can be joined.
        std::fs::write(&file, "time,in\n2024-05-03 10:41:07.1,5\n").unwrap();
        let said = read_as("time,out\n0.2,A\n", layout.clone());
        assert_eq!(said.len(), 2, "{said:?}");
        assert!(said[1].contains("its times are dates, those of test are numbers"), "{said:?}");
        std::fs::write(&file, "time,in\n7.1,5\n").unwrap();
        let said = read_as("time,out\n0.2,A\n0.3,A\n", layout.clone());
        assert!(said[2].contains("one log begins after the other has ended"), "{said:?}");
        std::fs::write(&file, "time,in\n").unwrap();
        let said = read_as("time,out\n0.2,A\n", layout.clone());
        assert!(said[2].contains("there is nothing in it but a header"), "{said:?}");
        // Both call their words alike.
        std::fs::write(&file, "time,value\n0.1,5\n").unwrap();
        let mapping = |text: &str| Mapping::parse(text).unwrap();
        let (columns, join_columns) = (mapping("out=value"), Some(mapping("in=value")));
        let said = read_as("time,value\n0.1,A\n", Layout { columns, join_columns, ..layout });
        assert_eq!(said[1], "0: 1 Process { out: Some(A), input: Some(5) } @100000000±100000000");
    }

    #[test]
    fn a_bad_line_is_told_and_the_rest_is_read() {
        let said = read(
            "time,out,in\n1.0,C2001388,00000100\nx,0,0\n1.2,G,0\n1.3,0\n1.0,C2001388,00000100\n",
        );
        assert_eq!(
            said,
            [
                "bus ring log".to_owned(),
                format!("0: {ROW}"),
                "warning: test: line 3: the time is neither a number nor a date: left out".into(),
                "warning: test: line 4: a word is no hex digits, or too many: if words are decimal, \
                 say --words decimal: left out"
                    .into(),
                "warning: test: line 5: columns are missing: left out".into(),
                format!("0: {ROW}"),
            ]
        );
        let said = read("time,out,in\nx,0,0\n");
        assert_eq!(said.last().unwrap(), "test: no line of it is of a log of process words");
    }

    #[test]
    fn a_header_that_does_not_fit_is_told_with_its_columns() {
        let said = read("Stamp,QD10\n1.0,0\n");
        assert!(
            said[0].starts_with(
                "test: line 1: no column is named out or in: the columns are \"Stamp\" \"QD10\"; \
                 expected time,out,in or "
            ) && said[0].contains("--columns time=Timestamp"),
            "{said:?}"
        );
        let said = read_as("time,a\n", columns("out=b"));
        assert!(said[0].contains("there is no column b: the columns are \"time\" \"a\""));
        let said = read("time,out1\n");
        assert!(said[0].contains("out1 and out2 belong together"));
        assert!(read("stamp,out\n")[0].contains("no column is named time"));
    }

    #[test]
    fn a_file_that_was_cut_is_told() {
        let cut = "test: line 3: the file ends inside this line: it was cut";
        for end in ["1.1,C200", "1.1,C2001388,0000", "1.1,C2001388,", "1."] {
            let said = read(&format!("time,out,in\n1.0,C2001388,00000100\n{end}"));
            assert_eq!(said, ["bus ring log".to_owned(), format!("0: {ROW}"), cut.into()], "{end}");
        }
        let whole = read("time,out,in\n1.0,C2001388,00000100\n1.1,C2001388,00000100");
        assert!(whole[1].ends_with("@1100000000±100000000"), "{whole:?}");
        // Words that are not filled up with zeros may be of any length.
        let whole = read("time,out,in\n1.0,C2001388,100\n1.1,0,0");
        assert!(whole[1].ends_with("@1100000000±100000000"), "{whole:?}");
    }

    #[test]
    fn words_that_look_decimal_are_told() {
        let rows = |word: &str| format!("time,in\n{}", format!("1.0,{word}\n").repeat(20));
        let is_told = |word: &str| read(&rows(word))[1].contains("say --words decimal");
        assert!(is_told("74565"));
        assert!(!is_told("00074565") && !is_told("1234A") && !is_told("0"));
    }

    /// Zeros at the end may have been left out: the first rows tell how fine times are.
    #[test]
    fn the_resolution_is_that_of_the_finest_time() {
        let said = read("time,in\n0,5\n0.010,6\n");
        assert!(said[1].contains("@0±1000000,"), "{said:?}");
    }

    #[test]
    fn headers_are_recognised() {
        for head in ["time,out,in", "Time;OUT1;OUT2\n", "sep=;\n\"time\";\"in\"\n", "in\ttime\n"] {
            assert!(is_header(head.as_bytes()), "{head}");
        }
        for head in ["time,byte,parity", "Time [s],Channel 0", "out,in", ""] {
            assert!(!is_header(head.as_bytes()), "{head}");
        }
    }

    #[test]
    fn no_damage_stops_the_reader_in_disorder() {
        let good =
            b"time,device,out,in\n0.010,1,C2001388,00000100\n\"2024-05-03 10:41:07,5\",2,,5\n";
        survive(InputFormat::InterbusLog, good);
    }
}
