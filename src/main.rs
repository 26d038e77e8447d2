//! fieldtap: protocol analyzer and passive bus sniffer for encoder field buses.

#![forbid(unsafe_code)]

mod cli;
mod clock;
mod commands;
mod decode;
mod export;
mod interrupt;
mod pipeline;
mod simulate;
mod source;
mod stations;
mod tally;
mod verdict;

use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    commands::run(&cli::Cli::parse())
}
