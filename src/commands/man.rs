//! `man`: the manual page, and those of the subcommands.

use crate::cli;
use crate::decode::FAILED;
use crate::say;
use clap::Args;
use std::path::PathBuf;
use std::process::ExitCode;

/// Where to.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Write a page for the program and for each of its commands into this directory, instead of
    /// printing the program's.
    #[arg(long, value_name = "DIR")]
    to: Option<PathBuf>,
}

/// Prints or writes them.
pub fn run(arguments: &Arguments) -> ExitCode {
    let result = match &arguments.to {
        Some(directory) => clap_mangen::generate_to(cli::command(), directory),
        None => {
            let mut page = Vec::new();
            match clap_mangen::Man::new(cli::command()).render(&mut page) {
                Ok(()) => return super::print_bytes(&page),
                Err(error) => Err(error),
            }
        }
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            say!("fieldtap: the manual page cannot be written: {error}");
            ExitCode::from(FAILED)
        }
    }
}
