//! The subcommands, one file each.

pub mod completions;
pub mod convert;
pub mod explain;
pub mod extcap;
pub mod fields;
pub mod man;
pub mod ports;
pub mod read;
pub mod record;
pub mod simulate;
pub mod stats;

use crate::cli::{Cli, Command};
use crate::decode::FAILED;
use crate::say;
use crate::stdout::Stdout;
use std::io::{self, Write};
use std::process::ExitCode;

/// Does what the user asked for.
pub fn run(cli: &Cli) -> ExitCode {
    match &cli.command {
        Command::Read(arguments) => read::run(arguments),
        Command::Record(arguments) => record::run(arguments),
        Command::Stats(arguments) => stats::run(arguments),
        Command::Convert(arguments) => convert::run(arguments),
        Command::Simulate(arguments) => simulate::run(arguments),
        Command::Extcap(arguments) => extcap::run(arguments),
        Command::Ports(arguments) => ports::run(arguments),
        Command::Explain(arguments) => explain::run(arguments),
        Command::Fields(arguments) => fields::run(arguments),
        Command::Completions(arguments) => completions::run(arguments),
        Command::Man(arguments) => man::run(arguments),
    }
}

fn print(text: &str) -> ExitCode {
    print_bytes(text.as_bytes())
}

/// Prints to standard output. That nobody reads it to the end is no fault.
fn print_bytes(bytes: &[u8]) -> ExitCode {
    match Stdout::new().write_all(bytes) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => ExitCode::SUCCESS,
        Err(error) => {
            say!("fieldtap: the output cannot be written: {error}");
            ExitCode::from(FAILED)
        }
    }
}
