//! `convert`: write a capture in another container.

use crate::cli::Decoding;
use crate::decode::{FAILED, USAGE, decode, settings};
use crate::export::{Candump, Chars, Columns, Csv, Export, Json, PcapNg, Rows};
use crate::output::Output;
use crate::record::is_name_of_recording;
use crate::say;
use crate::stdout::Stdout;
use clap::{Args, ValueEnum};
use std::ffi::OsStr;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::process::ExitCode;

/// From where, to where.
#[derive(Args, Debug)]
#[command(override_usage = "fieldtap convert [OPTIONS] <IN>... <OUT>")]
pub struct Arguments {
    /// The captures, files or - for standard input: several are one stream, in this order. And last
    /// where to write: its ending names the form, - is standard output.
    #[arg(value_name = "FILE", required = true)]
    files: Vec<String>,

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
    let [inputs @ .., output] = &arguments.files[..] else { return ExitCode::from(USAGE) };
    let output = Path::new(output);
    if inputs.is_empty() {
        say!("fieldtap: {}: and where to write? convert IN... OUT", output.display());
        return ExitCode::from(USAGE);
    }
    let Some(form) = arguments.output_format.or_else(|| Form::of(output)) else {
        say!(
            "fieldtap: {}: the ending names no form that can be written (.pcapng, .chars, .log, \
             .csv, .json): say it with --output-format",
            output.display()
        );
        return ExitCode::from(USAGE);
    };
    if may_be_a_source(inputs, output) {
        say!(
            "fieldtap: {}: is there already, and may be meant to be read: the last name is where to \
             write; remove it first if it is to be written anew",
            output.display()
        );
        return ExitCode::from(USAGE);
    }
    match convert(&arguments.decoding, inputs, output, form) {
        Ok(code) => code,
        Err(error) => {
            say!("fieldtap: {error:#}");
            ExitCode::from(FAILED)
        }
    }
}

/// Whether the name of what to write may have been forgotten, as in `convert tape/*.pcapng`: then
/// the last recording would be lost.
fn may_be_a_source(inputs: &[String], output: &Path) -> bool {
    let name = output.file_name().and_then(OsStr::to_str);
    let is_recording = name.is_some_and(is_name_of_recording);
    (inputs.len() > 1 || is_recording) && output.is_file()
}

fn convert(
    decoding: &Decoding,
    sources: &[String],
    output: &Path,
    form: Form,
) -> anyhow::Result<ExitCode> {
    let settings = match settings(decoding) {
        Ok(settings) => settings,
        Err(error) => {
            say!("fieldtap: {error:#}");
            return Ok(ExitCode::from(USAGE));
        }
    };
    if output == Path::new("-") {
        let mut export = form.export(BufWriter::new(Stdout::new()))?;
        let outcome = decode(decoding, sources, settings, &mut *export);
        outcome.report();
        return Ok(outcome.exit_code());
    }
    let file = Output::create(output)?;
    let mut export = form.export(BufWriter::new(file.file()))?;
    let outcome = decode(decoding, sources, settings, &mut *export);
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
