//! `extcap`: fieldtap as a capture source of Wireshark.

use crate::decode::FAILED;
use crate::extcap::place;
use crate::say;
use anyhow::Context;
use clap::{Args, Subcommand};
use std::path::PathBuf;
use std::process::ExitCode;

/// What to do. The calls that Wireshark makes are not for clap: see `extcap::Call`.
#[derive(Args, Debug)]
pub struct Arguments {
    #[command(subcommand)]
    action: Action,
}

#[derive(Subcommand, Debug)]
enum Action {
    /// Put fieldtap where this Wireshark looks for programs that capture.
    Install(Install),
}

#[derive(Args, Debug)]
struct Install {
    /// Take it out again.
    #[arg(long)]
    uninstall: bool,

    /// The extcap folder, instead of asking Wireshark for the user's own.
    #[arg(long, value_name = "DIR")]
    dir: Option<PathBuf>,
}

/// Installs it, or takes it out.
pub fn run(arguments: &Arguments) -> ExitCode {
    let Action::Install(install) = &arguments.action;
    match change(install) {
        Ok(told) => super::print(&told),
        Err(error) => {
            say!("fieldtap: {error:#}");
            ExitCode::from(FAILED)
        }
    }
}

fn change(install: &Install) -> anyhow::Result<String> {
    let folder = match &install.dir {
        Some(folder) => folder.clone(),
        None => place::folder()?,
    };
    if install.uninstall {
        return Ok(match place::uninstall(&folder)? {
            Some(place) => format!("removed {}\n", place.display()),
            None => format!("fieldtap is not in {}\n", folder.display()),
        });
    }
    let program = std::env::current_exe().context("where this program is cannot be told")?;
    let place = place::install(&folder, &program)?;
    Ok(format!(
        "{} is {}\nWireshark lists fieldtap's interfaces when it is started anew; `tshark -D` \
         shows them now.\n",
        place.display(),
        program.display()
    ))
}
