//! Columns of a table: which fields of a record, and how they are written.

use crate::clock::Exact;
use dissectors::field::{FieldId, Role, Value};
use dissectors::protocol::{PROTOCOLS, Protocol};
use dissectors::record::Record;
use std::fmt::Write;
use std::ops::Range;

/// The columns that are written where the user names none.
const DEFAULT: [&str; 14] = [
    "n",
    "time",
    "delta",
    "bus",
    "protocol",
    "kind",
    "station",
    "source",
    "destination",
    "position",
    "response_time",
    "raw",
    "summary",
    "findings",
];

/// Columns in their order, and the time of the record before.
pub struct Columns {
    columns: Vec<Column>,
    last_ns: Option<i64>,
    delta: Option<i64>,
}

struct Column {
    name: String,
    what: What,
}

#[derive(Clone, Copy)]
enum What {
    Number,
    /// Seconds with nine decimals.
    Time,
    Delta,
    /// The same two in ns.
    TimeNs,
    DeltaNs,
    DurationNs,
    UncertaintyNs,
    Clock,
    Interpolated,
    Bus,
    Protocol,
    Kind,
    About,
    Station,
    Lost,
    Summary,
    Raw,
    Findings,
    Withheld,
    /// Whatever plays this role in the record's protocol.
    Role(Role),
    /// The field of this name, wherever each protocol has it.
    Field([Option<FieldId>; PROTOCOLS.len()]),
}

impl Default for Columns {
    fn default() -> Self {
        let columns = DEFAULT.iter().filter_map(|name| Column::named(name)).collect();
        Columns { columns, last_ns: None, delta: None }
    }
}

impl Columns {
    /// The columns of these names.
    ///
    /// # Errors
    /// A name that is no field: it.
    pub fn named(names: &[String]) -> Result<Columns, String> {
        let columns: Result<Vec<Column>, String> =
            names.iter().map(|name| Column::named(name).ok_or_else(|| name.clone())).collect();
        Ok(Columns { columns: columns?, ..Columns::default() })
    }

    /// Their names.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.columns.iter().map(|column| column.name.as_str())
    }

    /// Their indexes.
    pub fn indexes(&self) -> Range<usize> {
        0..self.columns.len()
    }

    /// Whether anything may stand in a column, and not only numbers, hex digits and fixed words.
    pub fn has_text(&self, column: usize) -> bool {
        let what = self.columns[column].what;
        matches!(what, What::Bus | What::Summary | What::Role(_) | What::Field(_))
    }

    /// Takes note of the next record's time.
    pub fn begin(&mut self, record: &Record<'_>) {
        let ns = record.start.ns();
        self.delta = ns.zip(self.last_ns).map(|(now, last)| now.saturating_sub(last));
        self.last_ns = ns.or(self.last_ns);
    }

    /// Writes a record's cell behind what stands there. What does not apply leaves it empty.
    pub fn write(&self, column: usize, record: &Record<'_>, cell: &mut String) {
        match self.columns[column].what {
            What::Number => integer(record.n as i64, cell),
            What::Time => seconds(record.start.ns(), cell),
            What::Delta => seconds(self.delta, cell),
            What::TimeNs => optional(record.start.ns(), cell),
            What::DeltaNs => optional(self.delta, cell),
            What::DurationNs => optional(record.duration.map(|ns| ns as i64), cell),
            What::UncertaintyNs => {
                optional(record.start.ns().map(|_| i64::from(record.uncertainty)), cell);
            }
            What::Clock => cell.push_str(record.bus.clock.map_or("", |clock| clock.name())),
            What::Interpolated => cell.push_str(if record.interpolated { "true" } else { "" }),
            What::Bus => text(&record.bus.name, cell),
            What::Protocol => cell.push_str(record.protocol.name),
            What::Kind => cell.push_str(record.kind),
            What::About => optional(record.about.map(|n| n as i64), cell),
            What::Station => optional(record.station.map(i64::from), cell),
            What::Lost => optional(record.lost().map(|count| count as i64), cell),
            What::Summary => {
                let start = cell.len();
                // A String takes any text.
                let _ = record.summarize(cell);
                make_harmless(cell, start);
            }
            What::Raw => {
                record.bytes().for_each(|byte| hex(byte, cell));
            }
            What::Findings => join(record.findings.iter().map(|f| f.code.name), cell),
            What::Withheld => join(record.withheld.iter().map(|code| code.name), cell),
            What::Role(Role::ResponseTime) => match record.by_role(Role::ResponseTime) {
                Value::Int(ns) => seconds(Some(ns), cell),
                other => value(other, cell),
            },
            What::Role(role) => value(record.by_role(role), cell),
            What::Field(places) => {
                let place = PROTOCOLS.iter().zip(places).find(|(p, _)| **p == record.protocol);
                if let Some((_, Some(field))) = place {
                    value(record.get(field), cell);
                }
            }
        }
    }
}

impl Column {
    fn named(name: &str) -> Option<Column> {
        let what = match name {
            "n" => What::Number,
            "time" => What::Time,
            "delta" => What::Delta,
            "time_ns" => What::TimeNs,
            "delta_ns" => What::DeltaNs,
            "duration_ns" => What::DurationNs,
            "uncertainty_ns" => What::UncertaintyNs,
            "clock" => What::Clock,
            "interpolated" => What::Interpolated,
            "bus" => What::Bus,
            "protocol" => What::Protocol,
            "kind" => What::Kind,
            "about" => What::About,
            "station" => What::Station,
            "lost" => What::Lost,
            "summary" => What::Summary,
            "raw" => What::Raw,
            "findings" => What::Findings,
            "withheld" => What::Withheld,
            "source" => What::Role(Role::Source),
            "destination" => What::Role(Role::Destination),
            "position" => What::Role(Role::Position),
            "response_time" => What::Role(Role::ResponseTime),
            _ => {
                let place = |protocol: &Protocol| {
                    protocol.fields.iter().position(|field| field.name == name)
                };
                let places = PROTOCOLS.map(place);
                if places.iter().all(Option::is_none) {
                    return None;
                }
                What::Field(places)
            }
        };
        Some(Column { name: name.to_owned(), what })
    }
}

fn value(value: Value<'_>, cell: &mut String) {
    match value {
        Value::Absent => {}
        Value::Bool(value) => cell.push_str(if value { "true" } else { "false" }),
        Value::Int(value) => integer(value, cell),
        Value::Float(value) => {
            let _ = write!(cell, "{value}");
        }
        Value::Text(words) => text(words, cell),
        Value::Byte(byte) => {
            let _ = write!(cell, "{byte:02X}");
        }
        Value::Hex(bytes) => bytes.iter().for_each(|byte| hex(*byte, cell)),
        Value::List(list) => {
            for index in 0..list.len() {
                cell.push_str(if index == 0 { "" } else { " " });
                self::value(list.get(index), cell);
            }
        }
        Value::Rows(rows) => {
            for row in 0..rows.len() {
                cell.push_str(if row == 0 { "" } else { " " });
                // Of a table, its second field says most: the byte.
                self::value(rows.get(row, 1), cell);
            }
        }
    }
}

fn integer(value: i64, cell: &mut String) {
    cell.push_str(itoa::Buffer::new().format(value));
}

fn optional(value: Option<i64>, cell: &mut String) {
    if let Some(value) = value {
        integer(value, cell);
    }
}

fn seconds(ns: Option<i64>, cell: &mut String) {
    let Some(ns) = ns else { return };
    if ns < 0 {
        let _ = write!(cell, "{}", Exact(ns));
        return;
    }
    let mut buffer = itoa::Buffer::new();
    cell.push_str(buffer.format(ns / 1_000_000_000));
    // Nine digits with their leading zeros: those of 1_xxx_xxx_xxx without the first.
    cell.push('.');
    cell.push_str(&buffer.format(1_000_000_000 + ns % 1_000_000_000)[1..]);
}

fn hex(byte: u8, cell: &mut String) {
    const DIGITS: &[u8; 16] = b"0123456789ABCDEF";
    cell.push(char::from(DIGITS[usize::from(byte >> 4)]));
    cell.push(char::from(DIGITS[usize::from(byte & 0xF)]));
}

fn join<'a>(words: impl Iterator<Item = &'a str>, cell: &mut String) {
    for (index, word) in words.enumerate() {
        cell.push_str(if index == 0 { "" } else { " " });
        cell.push_str(word);
    }
}

/// Text from outside.
fn text(words: &str, cell: &mut String) {
    let start = cell.len();
    cell.push_str(words);
    make_harmless(cell, start);
}

/// A spreadsheet runs a cell that begins in one of these ways as a formula.
fn make_harmless(cell: &mut String, start: usize) {
    if matches!(cell.as_bytes().get(start), Some(b'=' | b'+' | b'-' | b'@' | b'\t' | b'\r')) {
        cell.insert(start, '\'');
    }
}
