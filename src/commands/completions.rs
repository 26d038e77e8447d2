//! `completions`: shell completions.

use crate::cli;
use clap::Args;
use clap_complete::Shell;
use std::process::ExitCode;

/// For which shell.
#[derive(Args, Debug)]
pub struct Arguments {
    /// The shell.
    shell: Shell,
}

/// Prints them.
pub fn run(arguments: &Arguments) -> ExitCode {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut cli::command(), "fieldtap", &mut script);
    super::print_bytes(&script)
}
