//! The program.

use clap::Parser;
use fieldtap::{cli::Cli, commands};
use std::process::ExitCode;

fn main() -> ExitCode {
    commands::run(&Cli::parse())
}
