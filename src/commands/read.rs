//! `read`: print the decoded trace of a capture.

use crate::cli::Decoding;
use crate::clock::Clock;
use crate::decode::{USAGE, decode, settings};
use crate::export::{Changes, Columns, Csv, Export, Json, Text};
use crate::stdout::Stdout;
use crate::{say, terminal};
use clap::{Args, ValueEnum};
use std::io::{self, BufWriter};
use std::process::ExitCode;

/// What to read and how to print it.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Captures: files, or - for standard input; several are read as one stream. Or a live tap,
    /// such as serial:/dev/ttyUSB0, can:can0 or slcan:/dev/ttyACM0.
    #[arg(value_name = "SOURCE", required = true)]
    sources: Vec<String>,

    #[command(flatten)]
    decoding: Decoding,

    /// Form of the trace.
    #[arg(long, value_name = "FORM", default_value = "text", help_heading = "Output")]
    format: Form,

    /// Only what is new: findings, and positions that differ from the one before.
    #[arg(long, help_heading = "Selection")]
    changes: bool,

    /// CSV: this field as a column instead of the usual ones (repeatable, or divided by commas).
    #[arg(
        short = 'e',
        long = "field",
        value_name = "FIELD",
        value_delimiter = ',',
        help_heading = "Output"
    )]
    columns: Vec<String>,
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
    let decoding = &arguments.decoding;
    if !arguments.columns.is_empty() && arguments.format != Form::Csv {
        say!("fieldtap: -e chooses columns of CSV: add --format csv");
        return ExitCode::from(USAGE);
    }
    let out = BufWriter::with_capacity(64 * 1024, Stdout::new());
    let mut export: Box<dyn Export> = match arguments.format {
        Form::Text => {
            let has_colour = has_colour(decoding.color);
            let text = Text::new(out, Clock::new(decoding.time), has_colour, decoding.verbose);
            Box::new(text.within(terminal::width()))
        }
        Form::Csv if arguments.columns.is_empty() => Box::new(Csv::new(out, Columns::default())),
        Form::Csv => match Columns::named(&arguments.columns) {
            Ok(columns) => Box::new(Csv::new(out, columns)),
            Err(name) => {
                say!("fieldtap: there is no field {name}: `fieldtap fields` lists them");
                return ExitCode::from(USAGE);
            }
        },
        Form::Json => Box::new(Json::new(out)),
    };
    if arguments.changes {
        export = Box::new(Changes::new(export));
    }
    let settings = match settings(decoding) {
        Ok(settings) => settings,
        Err(error) => {
            say!("fieldtap: {error:#}");
            return ExitCode::from(USAGE);
        }
    };
    let outcome = decode(decoding, &arguments.sources, settings, &mut *export);
    outcome.report();
    outcome.exit_code()
}

/// Whether standard output takes colour, and the user wants it.
fn has_colour(choice: clap::ColorChoice) -> bool {
    match choice {
        clap::ColorChoice::Always => true,
        clap::ColorChoice::Never => false,
        clap::ColorChoice::Auto => {
            anstream::AutoStream::choice(&io::stdout()) != anstream::ColorChoice::Never
        }
    }
}
