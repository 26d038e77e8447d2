//! The program.

use fieldtap::{cli, commands, extcap};
use std::process::ExitCode;

fn main() -> ExitCode {
    match extcap::Call::of(std::env::args_os().skip(1)) {
        Some(call) => extcap::answer(&call),
        None => commands::run(&cli::parse()),
    }
}
