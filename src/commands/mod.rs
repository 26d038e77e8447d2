//! The subcommands, one file each.

pub mod read;
pub mod simulate;

use crate::cli::{Cli, Command};
use std::process::ExitCode;

/// Does what the user asked for.
pub fn run(cli: &Cli) -> ExitCode {
    match &cli.command {
        Command::Read(arguments) => read::run(arguments),
        Command::Simulate(arguments) => simulate::run(arguments),
    }
}
