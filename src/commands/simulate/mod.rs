//! `simulate`: write a bus with chosen faults as a capture.

mod devicenet;
mod slin;

use crate::say;
use crate::simulate::{MS, Ps, seconds};
use anyhow::{Context, Result};
use clap::{Args, Subcommand};
use devicenet::Devicenet;
use slin::Slin;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::process::ExitCode;

/// Which bus to simulate.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Which bus.
    #[command(subcommand)]
    pub bus: Bus,
}

/// The buses that can be simulated.
#[derive(Subcommand, Debug)]
pub enum Bus {
    /// Absolute encoders on RS485.
    Slin(Box<Slin>),
    /// A scanner and absolute encoders on CAN.
    Devicenet(Box<Devicenet>),
}

/// 2026-01-01 00:00:00 UTC.
const NEW_YEAR: u32 = 1_767_225_600;

/// Writes the capture.
pub fn run(arguments: &Arguments) -> ExitCode {
    match &arguments.bus {
        Bus::Slin(slin) => slin.run(),
        Bus::Devicenet(devicenet) => devicenet.run(),
    }
}

/// What was ordered cannot be.
fn refuse(error: &anyhow::Error) -> ExitCode {
    say!("fieldtap: {error:#}");
    ExitCode::from(2)
}

/// Says how it went. Who closes the pipe has read enough.
fn end<S>(written: Result<S>, tell: impl FnOnce(S)) -> ExitCode {
    match written {
        Ok(summary) => {
            tell(summary);
            ExitCode::SUCCESS
        }
        Err(error) if is_closed_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            say!("fieldtap: {error:#}");
            ExitCode::from(3)
        }
    }
}

fn file(path: &Path) -> Result<File> {
    File::create(path).with_context(|| format!("cannot create {}", path.display()))
}

fn create(path: &Path) -> Result<Box<dyn Write>> {
    if path == Path::new("-") {
        return Ok(Box::new(BufWriter::new(io::stdout())));
    }
    Ok(Box::new(BufWriter::new(file(path)?)))
}

fn is_closed_pipe(error: &anyhow::Error) -> bool {
    let is_broken = |cause: &(dyn std::error::Error + 'static)| {
        let cause = cause.downcast_ref::<io::Error>();
        cause.is_some_and(|error| error.kind() == io::ErrorKind::BrokenPipe)
    };
    error.chain().any(is_broken)
}

fn number(text: &str, most: f64) -> Option<f64> {
    text.parse().ok().filter(|number| (0.0..=most).contains(number))
}

fn percent(text: &str) -> Result<f64, String> {
    number(text.strip_suffix('%').unwrap_or(text), 2.0)
        .ok_or("0 to 2 percent: a receiver cannot follow a clock that is further off".to_owned())
}

fn duration(text: &str) -> Result<Ps, String> {
    number(text, 86_400.0).map(seconds).ok_or("0 to 86400 seconds".to_owned())
}

fn milliseconds(text: &str) -> Result<Ps, String> {
    number(text, 10_000.0)
        .map(|number| (number * MS as f64) as Ps)
        .ok_or("0 to 10000 milliseconds".to_owned())
}

fn speed(text: &str) -> Result<f64, String> {
    number(text, 1e9).ok_or("0 to 1000000000 steps a second".to_owned())
}

fn frequency(text: &str) -> Result<u64, String> {
    crate::source::frequency(text)
        .filter(|rate| *rate <= 1_000_000_000)
        .ok_or_else(|| "not a frequency up to 1 GHz, such as 4M, 500k or 12000000".to_owned())
}

fn channel(text: &str) -> Result<String, String> {
    let is_plain = !text.is_empty() && text.chars().all(|letter| letter.is_ascii_graphic());
    if is_plain { Ok(text.to_owned()) } else { Err("letters, digits and signs only".to_owned()) }
}
