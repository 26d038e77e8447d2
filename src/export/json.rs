//! JSON Lines: one record a line, with the keys of the protocols' field tables.

use super::Export;
use dissectors::field::{Field, FieldId, Kind, List, Rows, Value};
use dissectors::finding::{Finding, State};
use dissectors::protocol::PROTOCOLS;
use dissectors::record::{Record, Sink};
use serde::ser::{Serialize, SerializeMap, SerializeSeq, Serializer};
use std::fmt;
use std::io::{self, Write};
use std::ops::Range;

/// Writes records as JSON Lines.
pub struct Json<W> {
    out: W,
    result: io::Result<()>,
    sentence: String,
    /// By protocol.
    layouts: [Vec<Node>; PROTOCOLS.len()],
}

/// Where a field stands in the objects of its protocol.
enum Node {
    /// Here, with this key.
    Field(FieldId, &'static str),
    /// In an object of this name, with others. They follow each other in the table.
    Object(&'static str, Range<FieldId>, Vec<Node>),
}

/// How fields stand, the first of which has this number, below the objects of so many dots.
fn layout(fields: &'static [Field], first: FieldId, depth: usize) -> Vec<Node> {
    let mut id = first;
    let groups = fields.chunk_by(|a, b| a.shares_object(b, depth));
    let node = |group: &'static [Field]| {
        let ids = id..id + group.len();
        id = ids.end;
        match group[0].object(depth) {
            Some(name) => Node::Object(name, ids.clone(), layout(group, ids.start, depth + 1)),
            None => Node::Field(ids.start, group[0].key()),
        }
    };
    groups.map(node).collect()
}

impl<W: Write> Json<W> {
    /// Writes to `out`.
    pub fn new(out: W) -> Self {
        let layouts = PROTOCOLS.map(|protocol| layout(protocol.fields, 0, 0));
        Json { out, result: Ok(()), sentence: String::new(), layouts }
    }

    fn write(&mut self, record: &Record<'_>) -> io::Result<()> {
        self.sentence.clear();
        // A String takes any text.
        let _ = record.summarize(&mut self.sentence);
        let protocol = PROTOCOLS.iter().position(|protocol| *protocol == record.protocol);
        let nodes = protocol.map_or(&[][..], |index| &self.layouts[index]);
        let object = Object { record, sentence: &self.sentence, nodes };
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
    nodes: &'a [Node],
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
        if record.has_bytes() {
            map.serialize_entry("raw", &Shown(&Raw(record)))?;
        }
        for node in self.nodes {
            // What carries bytes has the object of its protocol, be it empty.
            if let Node::Object(name, _, nodes) = node
                && record.has_bytes()
                && *name == record.protocol.name
            {
                map.serialize_entry(name, &Layer { record, nodes })?;
            } else {
                node.entry(record, &mut map)?;
            }
        }
        map.serialize_entry("findings", &Findings(record))?;
        if !record.withheld.is_empty() {
            let names = record.withheld.iter().map(|code| code.name);
            map.serialize_entry("withheld", &Seq(names.collect()))?;
        }
        map.end()
    }
}

impl Node {
    /// Writes what is not absent.
    fn entry<M: SerializeMap>(&self, record: &Record<'_>, map: &mut M) -> Result<(), M::Error> {
        match self {
            Node::Field(id, key) => {
                entry(key, record.protocol.fields[*id].kind, record.get(*id), map)
            }
            Node::Object(name, ids, nodes) => {
                match ids.clone().any(|id| !record.get(id).is_absent()) {
                    true => map.serialize_entry(name, &Layer { record, nodes }),
                    false => Ok(()),
                }
            }
        }
    }
}

/// What stands in an object.
struct Layer<'a> {
    record: &'a Record<'a>,
    nodes: &'a [Node],
}

impl Serialize for Layer<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        self.nodes.iter().try_for_each(|node| node.entry(self.record, &mut map))?;
        map.end()
    }
}

fn entry<M: SerializeMap>(
    key: &'static str,
    kind: Kind,
    value: Value<'_>,
    map: &mut M,
) -> Result<(), M::Error> {
    match (value, kind) {
        (Value::Absent, _) => Ok(()),
        (Value::Rows(rows), Kind::Rows(fields)) => {
            map.serialize_entry(key, &Table { rows, fields })
        }
        (value, _) => map.serialize_entry(key, &Item(value)),
    }
}

struct Items<'a>(&'a dyn List);

impl Serialize for Items<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq((0..self.0.len()).map(|index| Item(self.0.get(index))))
    }
}

/// A value without a key.
struct Item<'a>(Value<'a>);

impl Serialize for Item<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            Value::Absent | Value::Rows(_) => serializer.serialize_none(),
            Value::Bool(value) => serializer.serialize_bool(value),
            Value::Int(value) => serializer.serialize_i64(value),
            Value::Float(value) => serializer.serialize_f64(value),
            Value::Text(text) => serializer.serialize_str(text),
            Value::Byte(byte) => serializer.collect_str(&format_args!("{byte:02X}")),
            Value::Hex(bytes) => serializer.collect_str(&super::Hex(bytes)),
            Value::List(list) => Items(list).serialize(serializer),
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
            entry(field.key(), field.kind, self.table.rows.get(self.row, id), &mut map)?;
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
        self.0.bytes().try_for_each(|byte| write!(f, "{byte:02X}"))
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
