//! fieldtap: protocol analyzer and passive bus sniffer for encoder field buses.

#![forbid(unsafe_code)]

mod cli;
mod commands;
mod decode;
mod export;
mod pipeline;
mod source;

use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    commands::run(&cli::Cli::parse())
}
