//! `simulate`: write a bus with chosen faults as a capture.

mod destination;
mod devicenet;
mod interbus;
mod slin;

use crate::decode::INTERRUPTED;
use crate::interrupt;
use crate::say;
use crate::simulate::{MS, Orderable, Ps, seconds};
use anyhow::Result;
use clap::{Args, Subcommand};
use devicenet::Devicenet;
use interbus::Interbus;
use slin::Slin;
use std::collections::BTreeMap;
use std::io::{self, Write};
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
    /// Linear encoders and other devices in an INTERBUS ring.
    Interbus(Box<Interbus>),
}

/// 2026-01-01 00:00:00 UTC.
const NEW_YEAR: u32 = 1_767_225_600;

/// Writes the capture.
pub fn run(arguments: &Arguments) -> ExitCode {
    match &arguments.bus {
        Bus::Slin(slin) => slin.run(),
        Bus::Devicenet(devicenet) => devicenet.run(),
        Bus::Interbus(interbus) => interbus.run(),
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
        Err(_) if interrupt::came() => {
            say!("fieldtap: interrupted: nothing is kept of what was not all written");
            ExitCode::from(INTERRUPTED)
        }
        Err(error) => {
            say!("fieldtap: {error:#}");
            ExitCode::from(3)
        }
    }
}

/// Says what took place, such as `60 exchanges`, and how often each fault struck.
fn tell(what: &str, duration: Ps, faults: &BTreeMap<String, u64>) {
    let duration = duration as f64 / seconds(1.0) as f64;
    let faults: Vec<String> =
        faults.iter().map(|(name, times)| format!("{times} x {name}")).collect();
    let faults = if faults.is_empty() { "no fault".to_owned() } else { faults.join(", ") };
    say!("{what} in {duration:.3} s: {faults}");
}

/// Lists the faults of a bus, with the finding that each must raise.
fn list_faults<F: Orderable>(code: impl Fn(&F) -> &'static str) -> ExitCode {
    let mut out = io::stdout().lock();
    for fault in F::value_variants() {
        // Who closes the pipe has read enough.
        let _ = writeln!(out, "{:24} {:34} {}", fault.name(), code(fault), fault.meaning());
    }
    ExitCode::SUCCESS
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
