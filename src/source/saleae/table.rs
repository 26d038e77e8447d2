//! Characters that Logic's Async Serial analyzer found, as a table.
//!
//! The data table, with the columns `name,type,start_time,duration,"data"` and sometimes `"error"`,
//! may hold several analyzers; its column order is not fixed. The analyzer's own export has
//! `Time [s],Value,Parity Error,Framing Error`. Times are those of the start edge.

use super::super::outbox::{Outbox, Reader};
use super::super::rows::{Quotes, Rows, shown, without_mark};
use super::super::selection::Selection;
use super::super::{Input, SourceError, SourceOptions};
use super::time::Time;
use super::value::{Display, is_number, value};
use csv::ByteRecord;
use dissectors::bus::WireFacts;
use dissectors::event::Clock;
use dissectors::record::BusInfo;
use dissectors::uart::{Character, Parity};

/// Characters handed over at once.
const BATCH: usize = 1024;

/// Most analyzers that are believed.
const MOST_ANALYZERS: usize = 256;

/// The bus of exports that name no analyzer.
const BUS: &str = "Async Serial";

/// Whether a line is the header of such a file.
pub fn is_header(line: &[u8]) -> bool {
    let has = |name: &[u8]| line.windows(name.len()).any(|part| part == name);
    line.starts_with(EXPORT_HEADER) || (has(b"start_time") && has(b"data"))
}

const EXPORT_HEADER: &[u8] = b"Time [s],Value,Parity Error,Framing Error";

/// A table of characters.
pub struct Table {
    rows: Rows,
    display: Display,
    selection: Selection,
    columns: Option<Columns>,
    analyzers: Vec<Analyzer>,
    buses: usize,
    batch: Vec<Character>,
    /// The bus of the batch.
    bus: usize,
    /// The finest resolution seen in a time, in ns: zeros at the end may have been left out.
    resolution: u32,
    has_warned: bool,
}

struct Analyzer {
    /// As it stands in the table.
    name: Vec<u8>,
    /// `None` if it is not asked for.
    bus: Option<usize>,
}

/// Where what stands.
#[derive(Clone, Copy, Debug)]
struct Columns {
    count: usize,
    time: usize,
    value: usize,
    name: Option<usize>,
    kind: Option<usize>,
    /// `parity` or `framing`.
    error: Option<usize>,
    /// `Error` or nothing.
    parity: Option<usize>,
    framing: Option<usize>,
}

impl Table {
    /// Reads characters from this input.
    pub fn new(input: Input, options: &SourceOptions) -> Self {
        let display = display(input.head());
        // The analyzer's own export writes a quote as it is.
        let is_export = without_mark(input.head()).starts_with(EXPORT_HEADER);
        Table {
            rows: Rows::new(input, if is_export { Quotes::None } else { Quotes::Used }),
            display,
            selection: Selection::new(options),
            columns: None,
            analyzers: Vec::new(),
            buses: 0,
            batch: Vec::with_capacity(BATCH),
            bus: 0,
            resolution: u32::MAX,
            has_warned: false,
        }
    }

    fn next_row(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
        if !self.rows.find()? {
            self.selection.check(self.rows.name())?;
            return Ok(false);
        }
        let Some(columns) = self.columns else {
            self.columns = Some(Columns::of(self.rows.row()).ok_or_else(|| {
                let what = "not a table of characters: expected the columns name, type, \
                            start_time, duration and data, or Time [s], Value, Parity Error and \
                            Framing Error";
                self.rows.error(what)
            })?);
            return Ok(true);
        };
        self.row(columns, out)?;
        Ok(true)
    }

    fn row(&mut self, columns: Columns, out: &mut Outbox) -> Result<(), SourceError> {
        let row = self.rows.row();
        let Some(row) = Cells::new(row, &columns) else {
            return Err(self.rows.wrong_length(columns.count));
        };
        if row.value.is_empty() {
            // Of an analyzer that has other columns.
            return Ok(());
        }
        if row.kind.is_some_and(|kind| kind != b"data") {
            if !std::mem::replace(&mut self.has_warned, true) {
                let kind = shown(row.kind.unwrap_or_default());
                let what = format!("rows of type {kind} are no characters: they are left out");
                out.warning(self.rows.error(what));
            }
            return Ok(());
        }
        let (time, character) =
            row.character(self.display).map_err(|what| self.rows.error(what))?;
        let known = self.analyzers.iter().position(|known| known.name == row.name);
        let analyzer = match known {
            Some(known) => known,
            None => {
                let name = row.name.to_vec();
                self.appear(name, out)?
            }
        };
        if let Some(bus) = self.analyzers[analyzer].bus {
            if bus != self.bus || self.batch.len() >= BATCH {
                self.hand_over(out);
            }
            self.bus = bus;
            self.resolution = self.resolution.min(time.resolution);
            self.batch.push(character);
        }
        Ok(())
    }

    /// A new analyzer. Returns its number.
    fn appear(&mut self, name: Vec<u8>, out: &mut Outbox) -> Result<usize, SourceError> {
        if self.analyzers.len() >= MOST_ANALYZERS {
            return Err(self.rows.error("more analyzers than anybody has: this is another table"));
        }
        let shown = String::from_utf8_lossy(&name).into_owned();
        let bus = self.selection.takes(&shown).then_some(self.buses);
        if bus.is_some() {
            self.hand_over(out);
            self.buses += 1;
            out.bus(BusInfo::new(shown, Some(Clock::Sample)), WireFacts::default());
        }
        self.analyzers.push(Analyzer { name, bus });
        Ok(self.analyzers.len() - 1)
    }

    fn hand_over(&mut self, out: &mut Outbox) {
        let uncertainty = self.resolution;
        out.characters(
            self.bus,
            self.batch.drain(..).map(|mut character| {
                character.uncertainty = uncertainty;
                character
            }),
        );
    }
}

impl Reader for Table {
    fn read_on(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
        let read = self.next_row(out);
        if !matches!(read, Ok(true)) {
            self.hand_over(out);
        }
        read
    }
}

impl Columns {
    fn of(header: &ByteRecord) -> Option<Columns> {
        let column = |names: &[&[u8]]| {
            header.iter().position(|field| names.contains(&without_mark(field).trim_ascii()))
        };
        Some(Columns {
            count: header.len(),
            time: column(&[b"start_time", b"Time [s]"])?,
            value: column(&[b"data", b"Value"])?,
            name: column(&[b"name"]),
            kind: column(&[b"type"]),
            error: column(&[b"error"]),
            parity: column(&[b"Parity Error"]),
            framing: column(&[b"Framing Error"]),
        })
    }
}

/// The cells of a row.
struct Cells<'a> {
    time: &'a [u8],
    value: &'a [u8],
    name: &'a [u8],
    kind: Option<&'a [u8]>,
    error: Option<&'a [u8]>,
    parity: Option<&'a [u8]>,
    framing: Option<&'a [u8]>,
}

impl<'a> Cells<'a> {
    /// `None` if there are more or fewer than the header has.
    fn new(row: &'a ByteRecord, columns: &Columns) -> Option<Self> {
        // A comma that stands there as it is makes one field into two empty ones.
        let is_comma = row.len() == columns.count + 1
            && row.get(columns.value) == Some(b"")
            && row.get(columns.value + 1) == Some(b"");
        if row.len() != columns.count && !is_comma {
            return None;
        }
        let cell = |column: Option<usize>| {
            let column = column?;
            row.get(if is_comma && column > columns.value { column + 1 } else { column })
        };
        Some(Cells {
            time: cell(Some(columns.time))?,
            value: if is_comma { b"," } else { cell(Some(columns.value))? },
            name: cell(columns.name).unwrap_or(BUS.as_bytes()),
            kind: cell(columns.kind),
            error: cell(columns.error),
            parity: cell(columns.parity),
            framing: cell(columns.framing),
        })
    }

    /// The character; its uncertainty is still open.
    fn character(&self, display: Display) -> Result<(Time, Character), String> {
        let Some(time) = Time::parse(self.time) else {
            return Err(format!("{} is not a time", shown(self.time)));
        };
        let Some(value) = value(self.value, display) else {
            return Err(format!(
                "{} is not a character of up to nine bits: export with hexadecimal display",
                shown(self.value)
            ));
        };
        let character = Character::new(time.moment(), 0, value, self.parity());
        let is_framed = self.framing.unwrap_or_default().is_empty()
            && self.error.is_none_or(|error| error != b"framing");
        Ok((time, if is_framed { character } else { character.with_framing_error() }))
    }

    fn parity(&self) -> Parity {
        match (self.error, self.parity) {
            (Some(b""), _) => Parity::Ok,
            (Some(b"parity"), _) => Parity::Error,
            // Of two errors only one is told.
            (Some(_), _) => Parity::Unknown,
            (None, Some(b"")) => Parity::Ok,
            (None, Some(_)) => Parity::Error,
            // The column is there only if there was an error, or parity was not looked at.
            (None, None) => Parity::Unknown,
        }
    }
}

/// How values are displayed in a table that begins like this: as text, if one of the first is in
/// quotes or cannot be a number.
fn display(head: &[u8]) -> Display {
    let whole = head.iter().rposition(|byte| *byte == b'\n').map_or(head, |end| &head[..end]);
    let rows = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .quoting(false)
        .from_reader(whole);
    let mut rows = rows.into_byte_records().map_while(Result::ok);
    let header = rows.next().unwrap_or_default();
    let is_value = |field: &[u8]| matches!(field, b"data" | b"\"data\"" | b"Value");
    let Some(column) = header.iter().position(is_value) else { return Display::Numbers };
    let is_text = |row: ByteRecord| {
        let value = if row.len() == header.len() { &row[column] } else { b"" };
        !value.is_empty() && !is_number(value)
    };
    if rows.any(is_text) { Display::Text } else { Display::Numbers }
}

#[cfg(test)]
mod tests {
    use super::super::super::InputFormat;
    use super::super::super::damage::survive;
    use super::super::super::transcript::transcript;
    use super::*;

    fn read(text: &str) -> Vec<String> {
        transcript(InputFormat::SaleaeTable, text.as_bytes(), &SourceOptions::default())
    }

    #[test]
    fn the_data_table_by_the_names_of_its_columns() {
        let said = read(
            "name,type,start_time,duration,\"data\"\n\
             \"Async Serial\",\"data\",0.000679248,0.000082464,0x84\n\
             \"Async Serial\",\"data\",2.00000068e-03,0.000082464,0x15\n",
        );
        assert_eq!(
            said,
            [
                "bus Async Serial sample",
                "0: 84 parity unknown @679248±1, 15 parity unknown @2000001±1"
            ]
        );
        let said = read(
            "\"data\",start_time,\"error\",name,type,duration\n\
                         0x84,0.1,\"\",A,data,0\n0x15,0.2,\"parity\",A,data,0\n\
                         0x17,0.3,\"framing\",A,data,0\n",
        );
        assert_eq!(
            said[1],
            "0: 84 @100000000±100000000, 15 parity error @200000000±100000000, 17 parity unknown \
             framing error @300000000±100000000"
        );
    }

    #[test]
    fn analyzers_are_buses() {
        let text = "name,type,start_time,duration,data\nTX,data,0.1,0,0x01\nRX,data,0.2,0,0x02\n\
                    RX,data,0.3,0,0x03\nI2C,start,0.35,0,\nSPI,result,0.36,0,0x07\nTX,data,0.4,0,0x04\n";
        assert_eq!(
            read(text),
            [
                "bus TX sample",
                "0: 01 parity unknown @100000000±100000000",
                "bus RX sample",
                "warning: test: line 6: rows of type \"result\" are no characters: they are left out",
                "1: 02 parity unknown @200000000±100000000, 03 parity unknown @300000000±100000000",
                "0: 04 parity unknown @400000000±100000000"
            ]
        );
        let channels = vec!["RX".to_owned()];
        let options = SourceOptions { channels, ..SourceOptions::default() };
        let said = transcript(InputFormat::SaleaeTable, text.as_bytes(), &options);
        assert_eq!(said[0], "bus RX sample");
        let channels = vec!["Z".to_owned()];
        let options = SourceOptions { channels, ..SourceOptions::default() };
        let said = transcript(InputFormat::SaleaeTable, text.as_bytes(), &options);
        assert_eq!(said.last().unwrap(), "test: there is no channel Z: there is TX, RX");
    }

    /// The bytes of the characters alone.
    fn bytes(text: &str) -> String {
        let said = read(text).join(" ").replace(" parity unknown", "");
        let words = said.split([' ', ',']).collect::<Vec<_>>();
        let bytes = words.windows(2).filter(|pair| pair[1].starts_with('@')).map(|pair| pair[0]);
        bytes.collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn values_in_every_radix() {
        let table = |values: &[&str]| {
            let rows = values.iter().map(|value| format!("A,data,0.1,0.001,{value}\n"));
            bytes(&format!("name,type,start_time,duration,data\n{}", rows.collect::<String>()))
        };
        assert_eq!(table(&["0x36", "0x1FF"]), "36 1FF");
        assert_eq!(table(&["0b00110110", "0b1"]), "36 01");
        assert_eq!(table(&["54", "7", "255"]), "36 07 FF");
        let text =
            ["\"7\"", "\"\n\"", "\",\"", "\"\"\"\"", "\"\\0\"", "\" \"", "\"\\x9B\"", "\"µ\""];
        assert_eq!(table(&text), "37 0A 2C 22 00 20 9B B5");
    }

    #[test]
    fn the_analyzers_own_export() {
        let export = |rows: &str| format!("Time [s],Value,Parity Error,Framing Error\n{rows}");
        let said = read(&export(
            "0.042909760000000,0x00,,Error\n0.042980320000000,0xD4,Error,\n\
                                 0.042990240000000,0x81,,\n",
        ));
        assert_eq!(
            said,
            [
                "bus Async Serial sample",
                "0: 00 framing error @42909760±1, D4 parity error @42980320±1, 81 @42990240±1"
            ]
        );
        // As text, what cannot be seen is spelled out, and nothing is in quotes.
        let text =
            "0.1,o,,\n0.2,',,\n0.3, ,,\n0.4,\\r,,\n0.5,\",,\n0.6,,,,\n0.7,COMMA,,\n0.8,7,,\n";
        assert_eq!(bytes(&export(text)), "6F 27 20 0D 22 2C 2C 37");
    }

    #[test]
    fn damage_is_told_with_its_line_behind_what_is_good() {
        let wrong = |row: &str| {
            let said =
                read(&format!("name,type,start_time,duration,data\nA,data,0.1,0,0x01\n{row}"));
            assert_eq!(said[1], "0: 01 parity unknown @100000000±100000000");
            said[2].clone()
        };
        assert_eq!(wrong("A,data,0.2"), "test: line 3: the file ends inside this row: it was cut");
        assert_eq!(wrong("A,data,x,0,0x02\n"), "test: line 3: \"x\" is not a time");
        assert_eq!(
            wrong("A,data,0.2,0,0x12345\n"),
            "test: line 3: \"0x12345\" is not a character of up to nine bits: export with \
             hexadecimal display"
        );
        assert_eq!(
            read("name,type\n"),
            ["test: line 1: not a table of characters: expected the columns name, type, \
              start_time, duration and data, or Time [s], Value, Parity Error and Framing Error"]
        );
    }

    #[test]
    fn no_damage_stops_the_reader_for_good() {
        let table = "name,type,start_time,duration,\"data\",\"error\"\nA,data,0.1,0,0x01,\n\
                     B,data,0.2,0,\"\n\",\"parity\"\nA,data,0.3,0,\"\\0\",\n";
        survive(InputFormat::SaleaeTable, table.as_bytes());
        let export =
            "Time [s],Value,Parity Error,Framing Error\n0.1,0x00,,Error\n0.2,,,,\n0.3,',,\n";
        survive(InputFormat::SaleaeTable, export.as_bytes());
    }
}
