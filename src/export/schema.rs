//! The JSON Schema of the records, made from the tables of fields and codes.

use dissectors::field::{Field, Kind};
use dissectors::finding::Severity;
use dissectors::protocol::{PROTOCOLS, codes};
use dissectors::record::COMMON;
use serde_json::{Map, Value, json};

/// Fields that JSON does not have: text and CSV show them.
const NOT_IN_JSON: [&str; 1] = ["delta_ns"];

/// The schema of what `read --format json` prints, line by line.
pub fn of_records() -> Value {
    let mut properties = Map::new();
    for field in COMMON.iter().filter(|field| !NOT_IN_JSON.contains(&field.name)) {
        properties.insert(field.name.to_owned(), of_field(field));
    }
    let protocols: Vec<&str> = PROTOCOLS.iter().map(|protocol| protocol.name).collect();
    properties.insert("protocol".to_owned(), json!({"enum": protocols}));
    properties.insert("findings".to_owned(), json!({"type": "array", "items": finding()}));
    let names: Vec<&str> = codes().map(|code| code.name).collect();
    properties.insert("withheld".to_owned(), json!({"type": "array", "items": {"enum": names}}));
    for protocol in PROTOCOLS {
        insert(protocol.fields, 0, &mut properties);
    }
    let kinds: Vec<Value> = PROTOCOLS
        .iter()
        .map(|protocol| {
            json!({
                "if": {"properties": {"protocol": {"const": protocol.name}}},
                "then": {"properties": {"kind": {"enum": protocol.kinds}}},
            })
        })
        .collect();
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "fieldtap record (JSON Lines)",
        "type": "object",
        "required": ["n", "bus", "protocol", "kind", "summary", "findings"],
        "properties": properties,
        "additionalProperties": false,
        "allOf": kinds,
    })
}

/// Describes fields that share the objects before this depth.
fn insert(fields: &[Field], depth: usize, properties: &mut Map<String, Value>) {
    for group in fields.chunk_by(|a, b| a.shares_object(b, depth)) {
        match group[0].object(depth) {
            Some(name) => properties.insert(name.to_owned(), object(group, depth + 1)),
            None => properties.insert(group[0].key().to_owned(), of_field(&group[0])),
        };
    }
}

fn object(fields: &[Field], depth: usize) -> Value {
    let mut properties = Map::new();
    insert(fields, depth, &mut properties);
    json!({"type": "object", "properties": properties, "additionalProperties": false})
}

fn of_kind(kind: Kind) -> Value {
    match kind {
        Kind::Bool => json!({"type": "boolean"}),
        Kind::Int(i64::MIN, i64::MAX) => json!({"type": "integer"}),
        Kind::Int(min, i64::MAX) => json!({"type": "integer", "minimum": min}),
        Kind::Int(min, max) => json!({"type": "integer", "minimum": min, "maximum": max}),
        Kind::Float => json!({"type": "number"}),
        Kind::Text => json!({"type": "string"}),
        Kind::OneOf(words) => json!({"enum": words}),
        Kind::AnyOf(words) => {
            let one = words.join("|");
            json!({"type": "string", "pattern": format!("^(none|({one})(\\+({one}))*)$")})
        }
        Kind::Byte => json!({"type": "string", "pattern": "^[01]?[0-9A-F]{2}$"}),
        Kind::Hex => json!({"type": "string", "pattern": "^[0-9A-F]*$"}),
        Kind::Rows(fields) => json!({"type": "array", "items": object(fields, 0)}),
        Kind::List(item) => json!({"type": "array", "items": of_kind(*item)}),
        Kind::Any => json!({"type": ["boolean", "integer", "number", "string", "array"]}),
    }
}

fn of_field(field: &Field) -> Value {
    let mut schema = of_kind(field.kind);
    let unit = if field.unit.is_empty() { String::new() } else { format!(" ({})", field.unit) };
    schema["description"] = format!("{}{unit}", field.meaning).into();
    schema
}

fn finding() -> Value {
    let severities = [Severity::Error, Severity::Warning, Severity::Info].map(|severity| {
        let names: Vec<&str> =
            codes().filter(|code| code.severity == severity).map(|code| code.name).collect();
        json!({"properties": {"code": {"enum": names}, "severity": {"const": severity.name()}}})
    });
    let end = json!({
        "properties": {"state": {"const": "end"}, "severity": {"const": "info"}},
        "required": ["state"],
    });
    let names: Vec<&str> = codes().map(|code| code.name).collect();
    let anything: Vec<Value> = severities.into_iter().chain([end]).collect();
    json!({
        "type": "object",
        "required": ["code", "severity", "message"],
        "properties": {
            "code": {"enum": names},
            "severity": {"enum": ["error", "warning", "info"]},
            "message": {"type": "string", "minLength": 8},
            "expected": {"type": "integer"},
            "actual": {"type": "integer"},
            "limit": {"type": "integer"},
            "state": {"enum": ["begin", "end"]},
        },
        "additionalProperties": false,
        "anyOf": anything,
    })
}
