//! JSON Lines: one record a line, with the keys of the protocols' field tables.

use super::Export;
use dissectors::field::{Field, Rows, Value};
use dissectors::finding::{Finding, State};
use dissectors::record::{Heard, Record, Sink};
use serde::ser::{Serialize, SerializeMap, SerializeSeq, Serializer};
use std::fmt;
use std::io::{self, Write};

/// Writes records as JSON Lines.
pub struct Json<W> {
    out: W,
    result: io::Result<()>,
    sentence: String,
}

impl<W: Write> Json<W> {
    /// Writes to `out`.
    pub fn new(out: W) -> Self {
        Json { out, result: Ok(()), sentence: String::new() }
    }

    fn write(&mut self, record: &Record<'_>) -> io::Result<()> {
        self.sentence.clear();
        // A String takes any text.
        let _ = record.summarize(&mut self.sentence);
        let object = Object { record, sentence: &self.sentence };
        serde_json::to_writer(&mut self.out, &object).map_err(io::Error::from)?;
        self.out.write_all(b"\n")
    }
}

impl<W: Write> Sink for Json<W> {
    fn record(&mut self, record: &Record<'_>) {
        if self.result.is_ok() {
            self.result = self.write(record);
        }
    }
}

impl<W: Write> Export for Json<W> {
    fn status(&mut self) -> io::Result<()> {
        std::mem::replace(&mut self.result, Ok(()))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

struct Object<'a> {
    record: &'a Record<'a>,
    sentence: &'a str,
}

impl Serialize for Object<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let record = self.record;
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("n", &record.n)?;
        if let Some(ns) = record.start.ns() {
            map.serialize_entry("time_ns", &ns)?;
        }
        if let Some(ns) = record.duration {
            map.serialize_entry("duration_ns", &ns)?;
        }
        if let (Some(clock), true) = (record.bus.clock, record.start.is_known()) {
            map.serialize_entry("uncertainty_ns", &record.uncertainty)?;
            map.serialize_entry("clock", clock.name())?;
        }
        if record.interpolated {
            map.serialize_entry("interpolated", &true)?;
        }
        map.serialize_entry("bus", &record.bus.name)?;
        map.serialize_entry("protocol", record.protocol.name)?;
        map.serialize_entry("kind", record.kind)?;
        if let Some(number) = record.about {
            map.serialize_entry("about", &number)?;
        }
        if let Some(station) = record.station {
            map.serialize_entry("station", &station)?;
        }
        if let Some(count) = record.lost() {
            map.serialize_entry("lost", &count)?;
        }
        map.serialize_entry("summary", self.sentence)?;
        if let Heard::Characters(_) = record.heard {
            map.serialize_entry("raw", &Shown(&Raw(record)))?;
        }
        objects(record, &mut map)?;
        map.serialize_entry("findings", &Findings(record))?;
        if !record.withheld.is_empty() {
            let names = record.withheld.iter().map(|code| code.name);
            map.serialize_entry("withheld", &Seq(names.collect()))?;
        }
        map.end()
    }
}

/// The protocol's objects: consecutive fields whose names share what stands before the dot.
fn objects<M: SerializeMap>(record: &Record<'_>, map: &mut M) -> Result<(), M::Error> {
    let fields = record.protocol.fields;
    let mut first = 0;
    for group in fields.chunk_by(|a, b| a.object() == b.object()) {
        let layer = Layer { record, fields: group, first };
        if (first..first + group.len()).any(|id| !matches!(record.get(id), Value::Absent)) {
            map.serialize_entry(group[0].object(), &layer)?;
        }
        first += group.len();
    }
    Ok(())
}

struct Layer<'a> {
    record: &'a Record<'a>,
    fields: &'static [Field],
    first: usize,
}

impl Serialize for Layer<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for (id, field) in (self.first..).zip(self.fields) {
            entry(field, self.record.get(id), &mut map)?;
        }
        map.end()
    }
}

fn entry<M: SerializeMap>(
    field: &'static Field,
    value: Value<'_>,
    map: &mut M,
) -> Result<(), M::Error> {
    let key = field.key();
    match value {
        Value::Absent => Ok(()),
        Value::Bool(value) => map.serialize_entry(key, &value),
        Value::Int(value) => map.serialize_entry(key, &value),
        Value::Float(value) => map.serialize_entry(key, &value),
        Value::Text(text) => map.serialize_entry(key, text),
        Value::Byte(byte) => map.serialize_entry(key, &Shown(&format_args!("{byte:02X}"))),
        Value::Hex(bytes) => map.serialize_entry(key, &Shown(&super::Hex(bytes))),
        Value::Rows(rows) => {
            let dissectors::field::Kind::Rows(fields) = field.kind else { return Ok(()) };
            map.serialize_entry(key, &Table { rows, fields })
        }
    }
}

struct Table<'a> {
    rows: &'a dyn Rows,
    fields: &'static [Field],
}

impl Serialize for Table<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut seq = serializer.serialize_seq(Some(self.rows.len()))?;
        for row in 0..self.rows.len() {
            seq.serialize_element(&Row { table: self, row })?;
        }
        seq.end()
    }
}

struct Row<'a> {
    table: &'a Table<'a>,
    row: usize,
}

impl Serialize for Row<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for (id, field) in self.table.fields.iter().enumerate() {
            entry(field, self.table.rows.get(self.row, id), &mut map)?;
        }
        map.end()
    }
}

struct Findings<'a>(&'a Record<'a>);

impl Serialize for Findings<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let record = self.0;
        let mut seq = serializer.serialize_seq(Some(record.findings.len()))?;
        for finding in record.findings {
            seq.serialize_element(&OneFinding { finding, record })?;
        }
        seq.end()
    }
}

struct OneFinding<'a> {
    finding: &'a Finding,
    record: &'a Record<'a>,
}

impl Serialize for OneFinding<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let finding = self.finding;
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("code", finding.code.name)?;
        map.serialize_entry("severity", finding.severity().name())?;
        map.serialize_entry("message", &Shown(self))?;
        for (key, value) in
            [("expected", finding.expected), ("actual", finding.actual), ("limit", finding.limit)]
        {
            if let Some(value) = value {
                map.serialize_entry(key, &value)?;
            }
        }
        match finding.state {
            Some(State::Begin) => map.serialize_entry("state", "begin")?,
            Some(State::End(_)) => map.serialize_entry("state", "end")?,
            None => {}
        }
        map.end()
    }
}

impl fmt::Display for OneFinding<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.finding.say(self.record, f)
    }
}

/// The bytes of a record.
struct Raw<'a>(&'a Record<'a>);

impl fmt::Display for Raw<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.characters().iter().try_for_each(|character| write!(f, "{:02X}", character.byte()))
    }
}

/// What is shown, as a JSON string without a detour over an owned one.
struct Shown<T>(T);

impl<T: fmt::Display> Serialize for Shown<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&self.0)
    }
}

struct Seq(Vec<&'static str>);

impl Serialize for Seq {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(serializer)
    }
}
