//! Columns of a table: which fields of a record, and how they are written.

use super::cell::{Cell, hex, integer, join, optional, seconds, sentence, text, value, word};
use dissectors::field::{FieldId, Role, Value};
use dissectors::protocol::{PROTOCOLS, Protocol};
use dissectors::record::Record;

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
}

/// One of them.
pub struct Column {
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
        Columns { columns, last_ns: None }
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

    /// All of them.
    pub fn iter(&self) -> std::slice::Iter<'_, Column> {
        self.columns.iter()
    }

    /// Takes note of the next record's time. Returns how much later it is than the one before, in
    /// ns.
    pub fn begin(&mut self, record: &Record<'_>) -> Option<i64> {
        let ns = record.start.ns();
        let delta = ns.zip(self.last_ns).map(|(now, last)| now.saturating_sub(last));
        self.last_ns = ns.or(self.last_ns);
        delta
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

    /// Writes a record's cell behind what stands there, given how much later it is than the one
    /// before. What does not apply leaves it empty.
    #[inline]
    pub fn write(&self, record: &Record<'_>, delta: Option<i64>, cell: &mut Vec<u8>) -> Cell {
        match self.what {
            What::Number => integer(record.n as i64, cell),
            What::Time => seconds(record.start.ns(), cell),
            What::Delta => seconds(delta, cell),
            What::TimeNs => optional(record.start.ns(), cell),
            What::DeltaNs => optional(delta, cell),
            What::DurationNs => optional(record.duration.map(|ns| ns as i64), cell),
            What::UncertaintyNs => {
                optional(record.start.ns().map(|_| i64::from(record.uncertainty)), cell);
            }
            What::Clock => word(record.bus.clock.map_or("", |clock| clock.name()), cell),
            What::Interpolated => word(if record.interpolated { "true" } else { "" }, cell),
            What::Bus => return text(&record.bus.name, cell),
            What::Protocol => word(record.protocol.name, cell),
            What::Kind => word(record.kind, cell),
            What::About => optional(record.about.map(|n| n as i64), cell),
            What::Station => optional(record.station.map(i64::from), cell),
            What::Lost => optional(record.lost().map(|count| count as i64), cell),
            What::Summary => return sentence(record, cell),
            What::Raw => record.bytes().for_each(|byte| hex(byte, cell)),
            What::Findings => join(record.findings.iter().map(|f| f.code.name), cell),
            What::Withheld => join(record.withheld.iter().map(|code| code.name), cell),
            What::Role(Role::ResponseTime) => match record.by_role(Role::ResponseTime) {
                Value::Int(ns) => seconds(Some(ns), cell),
                other => return value(other, cell),
            },
            What::Role(role) => return value(record.by_role(role), cell),
            What::Field(places) => {
                let place = PROTOCOLS.iter().zip(places).find(|(p, _)| **p == record.protocol);
                let field = place.and_then(|(_, field)| field);
                return field.map_or(Cell::Plain, |field| value(record.get(field), cell));
            }
        }
        Cell::Plain
    }
}
