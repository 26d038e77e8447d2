//! A table in a text file: a header, and a line a row, divided by commas, semicolons or tabs.

use super::super::lines::Lines;
use super::super::outbox::Outbox;
use super::super::recognize::UTF_16;
use super::super::rows::{shown, without_mark};
use super::super::{Input, Place, SourceError};
use super::layout::{Column, Mapping};
use std::io::{self, Read};

/// Most lines that are told of one by one.
const MOST_TOLD: u64 = 20;

/// Most columns that a message names.
const MOST_NAMED: usize = 16;

/// A table that is being read.
pub struct Table {
    lines: Lines<Ends>,
    source: String,
    /// The first bytes, to be looked at before anything is read.
    head: Vec<u8>,
    delimiter: u8,
    /// The first line, where it is a row and not a header.
    first: Option<Vec<u8>>,
    split: Split,
    good: u64,
    bad: u64,
}

/// The bytes of a table. Some programs end lines with CR alone: there it stands for LF.
struct Ends {
    input: Input,
    is_cr_alone: bool,
}

impl Read for Ends {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.input.read(buffer)?;
        if self.is_cr_alone {
            end_lines(&mut buffer[..count]);
        }
        Ok(count)
    }
}

fn end_lines(text: &mut [u8]) {
    text.iter_mut().filter(|byte| **byte == b'\r').for_each(|byte| *byte = b'\n');
}

/// A line divided into cells. By hand: the csv crate takes as long to divide a row of process words
/// as all the rest that is done with it, 0.1 µs.
#[derive(Default)]
struct Split {
    /// The line without its quotes, if it had any.
    text: Vec<u8>,
    spans: Vec<(u32, u32)>,
}

/// The cells of a line.
#[derive(Clone, Copy)]
pub struct Cells<'a> {
    text: &'a [u8],
    spans: &'a [(u32, u32)],
}

impl<'a> Cells<'a> {
    /// The cell in this column, from 0, without blanks around it.
    pub fn get(&self, column: usize) -> Option<&'a [u8]> {
        let (from, to) = *self.spans.get(column)?;
        Some(self.text.get(from as usize..to as usize)?.trim_ascii())
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.spans.len()
    }

    /// The last one.
    pub fn last(&self) -> &'a [u8] {
        self.get(self.spans.len().saturating_sub(1)).unwrap_or_default()
    }
}

impl Split {
    fn of<'a>(&'a mut self, line: &'a [u8], delimiter: u8) -> Option<Cells<'a>> {
        self.spans.clear();
        if line.contains(&b'"') {
            return self.of_quoted(line, delimiter);
        }
        let mut from = 0;
        for (at, byte) in (0..).zip(line) {
            if *byte == delimiter {
                self.spans.push((from, at));
                from = at + 1;
            }
        }
        self.spans.push((from, line.len() as u32));
        Some(Cells { text: line, spans: &self.spans })
    }

    /// RFC 4180: a cell in quotes may hold the delimiter, and a quote that is written twice.
    fn of_quoted(&mut self, line: &[u8], delimiter: u8) -> Option<Cells<'_>> {
        let Split { text, spans } = self;
        text.clear();
        let (mut from, mut is_quoted) = (0, false);
        let mut bytes = line.iter().peekable();
        while let Some(byte) = bytes.next() {
            match *byte {
                b'"' if is_quoted && bytes.peek() == Some(&&b'"') => {
                    bytes.next();
                    text.push(b'"');
                }
                b'"' => is_quoted = !is_quoted,
                byte if byte == delimiter && !is_quoted => {
                    spans.push((from, text.len() as u32));
                    from = text.len() as u32;
                }
                byte => text.push(byte),
            }
        }
        spans.push((from, text.len() as u32));
        (!is_quoted).then_some(Cells { text, spans })
    }
}

impl Table {
    /// Nothing was read yet.
    pub fn new(input: Input) -> Self {
        let source = input.name.clone();
        let mut head = input.head().to_vec();
        // Of CR and LF, the latter may only not have come in yet: then a line that holds nothing
        // follows each, and is passed over.
        let is_cr_alone = head.contains(&b'\r') && !head.contains(&b'\n');
        if is_cr_alone {
            end_lines(&mut head);
        }
        Table {
            lines: Lines::new(&source, Ends { input, is_cr_alone }),
            source,
            head,
            delimiter: b',',
            first: None,
            split: Split::default(),
            good: 0,
            bad: 0,
        }
    }

    /// The first line that holds anything, as a header. Finds out what divides the columns.
    pub fn header(&mut self) -> Result<Header, SourceError> {
        while let Some(line) = self.lines.next_line()? {
            if line.starts_with(b"\xFF\xFE") || line.starts_with(b"\xFE\xFF") {
                return Err(self.lines.error(UTF_16));
            }
            let line = without_mark(line);
            if is_blank(line) {
                continue;
            }
            self.delimiter = delimiter_of(line);
            self.first = Some(line.to_vec());
            let Some(header) = Header::of(line, &mut self.split) else {
                return Err(self.lines.error("a quote in the header has no end"));
            };
            return Ok(header);
        }
        Ok(Header::default())
    }

    /// The source, as the user named it.
    pub fn name(&self) -> &str {
        &self.source
    }

    /// What divides the columns.
    pub fn delimiter(&self) -> u8 {
        self.delimiter
    }

    /// Whether the line that was taken for the header is what somebody takes it for.
    pub fn first_is(&mut self, what: impl FnOnce(Cells<'_>) -> bool) -> bool {
        let Table { first, split, delimiter, .. } = self;
        let cells = first.as_ref().and_then(|line| split.of(line, *delimiter));
        cells.is_some_and(what)
    }

    /// The line that was taken for the header is one: it is no row.
    pub fn skip_header(&mut self) {
        self.first = None;
    }

    /// The whole lines that were looked at before anything was read.
    pub fn look_ahead(&self, mut at: impl FnMut(Cells<'_>)) {
        let whole = self.head.iter().rposition(|byte| *byte == b'\n').unwrap_or(0);
        let mut split = Split::default();
        for line in self.head[..whole].split(|byte| *byte == b'\n') {
            if let Some(cells) = split.of(line, self.delimiter) {
                at(cells);
            }
        }
    }

    /// Goes on to the next line that holds anything, and takes a row from it, or hears what is
    /// wrong with it: that is told, and the line left out. False at the end.
    ///
    /// # Errors
    /// The source cannot be read, or ends inside a line.
    pub fn read(
        &mut self,
        out: &mut Outbox,
        take: impl FnOnce(Cells<'_>) -> Result<(), &'static str>,
    ) -> Result<bool, SourceError> {
        let Table { lines, split, delimiter, .. } = self;
        let taken = match self.first.take() {
            Some(line) => take_line(&line, split, *delimiter, take),
            None => loop {
                let Some(line) = lines.next_line()? else { return Ok(false) };
                if !is_blank(line) {
                    break take_line(line, split, *delimiter, take);
                }
            },
        };
        match taken {
            Ok(()) => self.good += 1,
            Err(_) if !self.lines.has_end() => return Err(self.cut()),
            Err(what) => self.reject(what, out),
        }
        Ok(true)
    }

    /// The error of a file that ends inside its last line.
    pub fn cut(&self) -> SourceError {
        self.lines.error("the file ends inside this line: it was cut")
    }

    /// Whether the last line had an end.
    pub fn has_end(&self) -> bool {
        self.lines.has_end()
    }

    /// Whether the next line may have to be waited for.
    pub fn may_wait(&self) -> bool {
        self.lines.may_wait()
    }

    /// An error in the last line.
    pub fn error(&self, what: impl Into<String>) -> SourceError {
        self.lines.error(what)
    }

    fn reject(&mut self, what: &str, out: &mut Outbox) {
        self.bad += 1;
        if self.bad <= MOST_TOLD {
            out.warning(self.lines.error(format!("{what}: left out")).leaving_out(1));
        }
    }

    /// Tells what was left out. A table of which no line could be read is another.
    ///
    /// # Errors
    /// It is.
    pub fn finish(&self, name: &str, out: &mut Outbox) -> Result<(), SourceError> {
        let whole = |what: String| SourceError::new(&self.source, Place::Whole, what);
        if self.good == 0 && self.bad > 0 {
            return Err(whole(format!("no line of it is of {name}")));
        }
        if self.good == 0 {
            out.warning(whole("there is nothing in it but a header: no row was logged".to_owned()));
        }
        if let more @ 1.. = self.bad.saturating_sub(MOST_TOLD) {
            let what = format!("{more} more lines are wrong: left out");
            out.warning(whole(what).leaving_out(more));
        }
        Ok(())
    }
}

fn take_line(
    line: &[u8],
    split: &mut Split,
    delimiter: u8,
    take: impl FnOnce(Cells<'_>) -> Result<(), &'static str>,
) -> Result<(), &'static str> {
    take(split.of(line, delimiter).ok_or("a quote has no end")?)
}

/// A line that holds nothing: none at all, a remark, or the delimiter for Excel.
fn is_blank(line: &[u8]) -> bool {
    line.trim_ascii().is_empty() || line.starts_with(b"#") || line.starts_with(b"sep=")
}

/// What divides the columns of this line.
fn delimiter_of(line: &[u8]) -> u8 {
    let count = |delimiter: &u8| line.iter().filter(|byte| *byte == delimiter).count();
    // Where it is even, the comma is in a number.
    b",;\t".iter().copied().max_by_key(count).filter(|best| count(best) > 0).unwrap_or(b',')
}

/// The names of a table's columns.
#[derive(Default, Debug)]
pub struct Header(Vec<String>);

impl Header {
    fn of(line: &[u8], split: &mut Split) -> Option<Header> {
        let cells = split.of(line, delimiter_of(line))?;
        let name = |column| String::from_utf8_lossy(cells.get(column).unwrap_or_default());
        Some(Header((0..cells.count()).map(|column| name(column).into_owned()).collect()))
    }

    /// That of a source that begins like this, as far as it has come in.
    pub fn peek(head: &[u8]) -> Option<Header> {
        let lines = without_mark(head).split(|byte| matches!(byte, b'\n' | b'\r'));
        let line = lines.map(<[u8]>::trim_ascii_end).find(|line| !is_blank(line))?;
        Header::of(line, &mut Split::default())
    }

    /// Whether there are columns of all these names.
    pub fn has(&self, names: &[&str]) -> bool {
        names.iter().all(|name| self.named(name).is_some())
    }

    fn named(&self, name: &str) -> Option<usize> {
        self.0.iter().position(|known| known.eq_ignore_ascii_case(name))
    }

    /// Where the column stands that this name is mapped to, or that has this name; `None` where
    /// there is neither.
    ///
    /// # Errors
    /// It is mapped to a column that is not there.
    pub fn find(&self, name: &str, mapping: &Mapping) -> Result<Option<usize>, String> {
        match mapping.column(name) {
            Some(column) => self.place(column).map(Some),
            None => Ok(self.named(name)),
        }
    }

    /// Where a column stands.
    ///
    /// # Errors
    /// It is not there.
    pub fn place(&self, column: &Column) -> Result<usize, String> {
        match column {
            Column::Name(name) => self
                .named(name)
                .ok_or_else(|| format!("there is no column {name}: {}", self.told())),
            Column::Number(number) if *number <= self.0.len() => Ok(number - 1),
            Column::Number(number) => Err(format!("there is no column {number}: {}", self.told())),
        }
    }

    /// The columns that are there, in words.
    pub fn told(&self) -> String {
        let names = self.0.iter().take(MOST_NAMED).map(|name| shown(name.as_bytes()));
        let names: Vec<String> = names.collect();
        let more = if self.0.len() > MOST_NAMED { " …" } else { "" };
        format!("the columns are {}{more}", names.join(" "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cells(line: &str, delimiter: u8) -> Option<Vec<String>> {
        let mut split = Split::default();
        let cells = split.of(line.as_bytes(), delimiter)?;
        let cell = |column| String::from_utf8(cells.get(column).unwrap().to_vec()).unwrap();
        Some((0..cells.count()).map(cell).collect())
    }

    #[test]
    fn cells_with_and_without_quotes() {
        let expect = |cells: &[&str]| Some(cells.iter().map(|cell| (*cell).to_owned()).collect());
        assert_eq!(cells("1.5, 00C2 ,", b','), expect(&["1.5", "00C2", ""]));
        assert_eq!(cells("\"1,5\",\"a \"\"b\"\"\",c", b','), expect(&["1,5", "a \"b\"", "c"]));
        assert_eq!(cells("\"1,5", b','), None);
    }

    #[test]
    fn lines_may_end_with_cr_alone() {
        assert!(Header::peek(b"time,out,in\r1.0,0,0\r").is_some_and(|header| header.has(&["in"])));
        let text = &b"time,in\r\r1.0,5\r1.5,x\r2.0,6"[..];
        let mut table = Table::new(Input::of("test", text).unwrap());
        assert!(table.header().unwrap().has(&["time", "in"]));
        table.skip_header();
        let (mut out, mut cells) = (Outbox::default(), Vec::new());
        let mut take = |it: Cells<'_>| {
            cells.push(String::from_utf8_lossy(it.last()).into_owned());
            Ok(())
        };
        while table.read(&mut out, &mut take).unwrap() {}
        assert_eq!(cells, ["5", "x", "6"]);
    }

    #[test]
    fn what_divides_columns_is_what_there_is_most_of() {
        assert_eq!(delimiter_of(b"time,out,in"), b',');
        assert_eq!(delimiter_of(b"time;out;in"), b';');
        assert_eq!(delimiter_of(b"1,5;0;0"), b';');
        assert_eq!(delimiter_of(b"1,5;0"), b';');
        assert_eq!(delimiter_of(b"a\tb, c\td"), b'\t');
        assert_eq!(delimiter_of(b"0233"), b',');
    }

    #[test]
    fn columns_are_found_by_name_and_number() {
        let header = Header::peek(b"\xEF\xBB\xBFsep=;\r\n# notes\nTime;\"QD;10\"\r\n1").unwrap();
        assert!(header.has(&["time", "QD;10"]), "{}", header.told());
        let mapping = Mapping::parse("out=2,in=3").unwrap();
        assert_eq!(header.find("out", &mapping), Ok(Some(1)));
        assert_eq!(header.find("device", &mapping), Ok(None));
        let error = header.find("in", &mapping).unwrap_err();
        assert!(error.starts_with("there is no column 3: the columns are"), "{error}");
    }
}
