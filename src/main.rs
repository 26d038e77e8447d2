//! The program.

use clap::Parser;
use fieldtap::{cli::Cli, commands, extcap};
use std::process::ExitCode;

fn main() -> ExitCode {
    match extcap::Call::of(std::env::args_os().skip(1)) {
        Some(call) => extcap::answer(&call),
        None => commands::run(&Cli::parse()),
    }
}
