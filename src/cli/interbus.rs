//! The options that only INTERBUS has.

use crate::source::Layout;
use clap::Args;
use dissectors::interbus::{ReadEcho, Settings};

/// How logs of a ring are written, and what is known of it.
#[derive(Args, Debug)]
#[command(next_help_heading = "INTERBUS")]
pub struct Interbus {
    /// The log has a row for every bus cycle: states that it does not show were skipped.
    #[arg(long)]
    pub every_cycle: bool,

    /// What an LA-66 answers to a read service: its manual says "the requested data" (§2.3) and
    /// "the OUT data" (§4).
    #[arg(long, value_name = "WHAT", default_value = "value", value_parser = super::named(&ReadEcho::NAMES))]
    pub read_echo: ReadEcho,
}

impl Interbus {
    /// How its logs are written.
    pub fn layout(&self) -> Layout {
        Layout {}
    }

    /// What the ring is judged by.
    pub fn settings(&self) -> Settings {
        Settings { every_cycle: self.every_cycle, read_echo: self.read_echo, ..Settings::default() }
    }
}
