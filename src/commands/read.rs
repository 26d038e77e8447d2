//! `read`: print the decoded trace of a capture.

use crate::cli::Decoding;
use crate::decode::decode;
use crate::export::{Export, Json};
use clap::{Args, ValueEnum};
use std::io::{self, BufWriter};
use std::process::ExitCode;

/// What to read and how to print it.
#[derive(Args, Debug)]
pub struct Arguments {
    #[command(flatten)]
    decoding: Decoding,

    /// Form of the trace.
    #[arg(long, value_name = "FORM", default_value = "text", help_heading = "Output")]
    format: Form,
}

/// The forms of a trace.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum Form {
    /// A table for people.
    Text,
    /// Comma-separated values.
    Csv,
    /// One JSON object a line.
    Json,
}

/// Prints the trace.
pub fn run(arguments: &Arguments) -> ExitCode {
    let out = BufWriter::with_capacity(64 * 1024, io::stdout().lock());
    let mut export: Box<dyn Export> = match arguments.format {
        Form::Text | Form::Csv | Form::Json => Box::new(Json::new(out)),
    };
    decode(&arguments.decoding, &mut *export).exit_code()
}
