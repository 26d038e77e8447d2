//! The options that only INTERBUS has.

mod line_profile;

use crate::source::Layout;
use clap::Args;
use dissectors::interbus::Settings;
use line_profile::Named;
use std::path::PathBuf;

/// How logs of a ring are written, and what is known of it.
#[derive(Args, Debug)]
#[command(next_help_heading = "INTERBUS")]
pub struct Interbus {
    /// The log has a row for every bus cycle: states that it does not show were skipped.
    #[arg(long)]
    pub every_cycle: bool,

    /// What is known of the format of the line (TOML): flags, loopback word, checksum, the devices
    /// of the ring. What it leaves out is found out. Experimental.
    #[arg(long, value_name = "FILE")]
    pub line_profile: Option<PathBuf>,
}

impl Interbus {
    /// How its logs are written.
    pub fn layout(&self) -> Layout {
        Layout {}
    }

    /// What the ring is judged by, and the devices that the profile of its line names.
    ///
    /// # Errors
    /// The profile cannot be used.
    pub fn settings(&self) -> anyhow::Result<(Settings, Named)> {
        let (line, named) = match &self.line_profile {
            Some(path) => line_profile::read(path)?,
            None => Default::default(),
        };
        Ok((Settings { every_cycle: self.every_cycle, line, ..Settings::default() }, named))
    }
}
