//! `convert`: write a capture in another container.

use crate::cli::Decoding;
use crate::decode::{FAILED, USAGE, decode, settings};
use crate::export::{Candump, Chars, Columns, Csv, Export, Json, PcapNg, Rows};
use crate::output::Output;
use crate::say;
use crate::stdout::Stdout;
use clap::{Args, ValueEnum};
use std::ffi::OsStr;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// From where, to where.
#[derive(Args, Debug)]
pub struct Arguments {
    /// The capture: a file, or - for standard input.
    #[arg(value_name = "IN")]
    input: String,

    /// Where to write: its ending names the form. - for standard output.
    #[arg(value_name = "OUT")]
    output: PathBuf,

    /// Form of the output, instead of what the ending says.
    #[arg(long, value_name = "FORM", help_heading = "Output")]
    output_format: Option<Form>,

    #[command(flatten)]
    decoding: Decoding,
}

/// Forms that can be written.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum Form {
    /// pcapng, with sentences and findings as comments: for Wireshark.
    Pcapng,
    /// Characters as text.
    Chars,
    /// CAN frames, as candump and all of can-utils read them.
    Candump,
    /// Process words of an INTERBUS ring, a row a line: time,device,out,in
    InterbusLog,
    /// Decoded records, comma-separated.
    Csv,
    /// Decoded records, one JSON object a line.
    Json,
}

impl Form {
    fn of(path: &Path) -> Option<Form> {
        match path.extension().and_then(OsStr::to_str)?.to_ascii_lowercase().as_str() {
            "pcapng" => Some(Form::Pcapng),
            "chars" => Some(Form::Chars),
            "log" | "candump" => Some(Form::Candump),
            "csv" => Some(Form::Csv),
            "json" | "jsonl" => Some(Form::Json),
            _ => None,
        }
    }

    fn export<'a>(self, out: impl Write + 'a) -> io::Result<Box<dyn Export + 'a>> {
        Ok(match self {
            Form::Pcapng => Box::new(PcapNg::new(out)?),
            Form::Chars => Box::new(Chars::new(out)),
            Form::Candump => Box::new(Candump::new(out)),
            Form::InterbusLog => Box::new(Rows::new(out)),
            Form::Csv => Box::new(Csv::new(out, Columns::default())),
            Form::Json => Box::new(Json::new(out)),
        })
    }
}

/// Writes it.
pub fn run(arguments: &Arguments) -> ExitCode {
    let Some(form) = arguments.output_format.or_else(|| Form::of(&arguments.output)) else {
        say!(
            "fieldtap: {}: the ending names no form that can be written (.pcapng, .chars, .log, \
             .csv, .json): say it with --output-format",
            arguments.output.display()
        );
        return ExitCode::from(USAGE);
    };
    match convert(arguments, form) {
        Ok(code) => code,
        Err(error) => {
            say!("fieldtap: {error:#}");
            ExitCode::from(FAILED)
        }
    }
}

fn convert(arguments: &Arguments, form: Form) -> anyhow::Result<ExitCode> {
    let settings = match settings(&arguments.decoding) {
        Ok(settings) => settings,
        Err(error) => {
            say!("fieldtap: {error:#}");
            return Ok(ExitCode::from(USAGE));
        }
    };
    let sources = std::slice::from_ref(&arguments.input);
    let output = &arguments.output;
    if output == Path::new("-") {
        let mut export = form.export(BufWriter::new(Stdout::new()))?;
        let outcome = decode(&arguments.decoding, sources, settings, &mut *export);
        outcome.report();
        return Ok(outcome.exit_code());
    }
    let file = Output::create(output)?;
    let mut export = form.export(BufWriter::new(file.file()))?;
    let outcome = decode(&arguments.decoding, sources, settings, &mut *export);
    drop(export);
    if outcome.is_whole() {
        file.replace()?;
    } else if outcome.has_written()
        && outcome.pipeline.records() > 0
        && !file.keep_unless_there()?
    {
        say!("fieldtap: {}: left as it was, for this is not all of the source", output.display());
    }
    outcome.report();
    Ok(outcome.exit_code())
}
