//! `fields`: every field of a record, for columns, JSON and scripts.

use crate::export::schema;
use clap::Args;
use dissectors::field::{Field, Kind};
use dissectors::protocol::PROTOCOLS;
use dissectors::record::COMMON;
use std::process::ExitCode;

/// How to list them.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Print the JSON Schema of the records instead.
    #[arg(long)]
    schema: bool,
}

/// Lists them.
pub fn run(arguments: &Arguments) -> ExitCode {
    if arguments.schema {
        return super::print(&format!("{:#}\n", schema::of_records()));
    }
    let protocols = PROTOCOLS.iter().flat_map(|protocol| protocol.fields);
    let lines = COMMON.iter().chain(protocols).map(line);
    super::print(&lines.collect::<String>())
}

fn line(field: &Field) -> String {
    let mut text = entry(field.name, field);
    if let Kind::Rows(columns) = field.kind {
        for column in columns {
            text.push_str(&entry(&format!("{}[].{}", field.name, column.name), column));
        }
    }
    text
}

fn entry(name: &str, field: &Field) -> String {
    let kind = match field.kind {
        Kind::Bool => "bool",
        Kind::Int(..) => "int",
        Kind::Float => "float",
        Kind::Text | Kind::OneOf(_) | Kind::AnyOf(_) => "string",
        Kind::Byte | Kind::Hex => "hex",
        Kind::Rows(_) | Kind::List(_) => "array",
        Kind::Any => "any",
    };
    format!("{name:<28} {kind:<7} {:<8} {}\n", field.unit, field.meaning)
}
