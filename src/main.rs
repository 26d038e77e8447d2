//! The program.

use fieldtap::{cli, commands, extcap, interrupt};
use std::process::ExitCode;

fn main() -> ExitCode {
    interrupt::outlive_limits();
    match extcap::Call::of(std::env::args_os().skip(1)) {
        Some(call) => extcap::answer(&call),
        None => commands::run(&cli::parse()),
    }
}
