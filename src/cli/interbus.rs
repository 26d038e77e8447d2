//! The options that only INTERBUS has.

mod line_profile;

use crate::source::interbus::{Layout, LengthCodes, Mapping, Order, Radix, RingMap, TimeUnit};
use clap::Args;
use dissectors::interbus::diagnostic::{self, Generation};
use dissectors::interbus::{Master, ReadEcho, Settings};
use line_profile::Named;
use std::path::PathBuf;

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

    /// Which columns of a log are which, by name or number from 1, such as
    /// time=Timestamp,out=QD10,in=4. Names: time, date, device, out, in (32 bits), out1, out2, in1,
    /// in2 (16 bits); id, ident, length; status, parameter, slave, message.
    #[arg(id = "log_columns", long = "columns", value_name = "NAME=COLUMN,...", value_parser = Mapping::parse)]
    pub columns: Option<Mapping>,

    /// The columns of several devices in one row, such as 1=QD10/ID10,2=QW20+QW22/IW20+IW22.
    #[arg(long, value_name = "DEVICE=OUT/IN,...", value_parser = RingMap::parse)]
    pub ring_map: Option<RingMap>,

    /// How words are written. Default: hex, or decimal where hex makes no sense; ident and length
    /// codes decimal.
    #[arg(long, value_name = "RADIX")]
    pub words: Option<Radix>,

    /// Which word of two is bits 31 to 16.
    #[arg(long, value_name = "ORDER", default_value = "high-first")]
    pub word_order: Order,

    /// Which byte of a word is the first.
    #[arg(long, value_name = "ORDER", default_value = "high-first")]
    pub byte_order: Order,

    /// Unit of times that are bare numbers.
    #[arg(long, value_name = "UNIT", default_value = "s")]
    pub time_unit: TimeUnit,

    /// A second log, joined to the first by time: OUT in one, IN in the other.
    #[arg(long, value_name = "FILE")]
    pub join: Option<PathBuf>,

    /// Columns of the second log, where they are not those of --columns.
    #[arg(long, value_name = "NAME=COLUMN,...", value_parser = Mapping::parse, requires = "join")]
    pub join_columns: Option<Mapping>,

    /// What length codes beside ident codes are: the five bits of an ID word, or the eight that
    /// data sheets are reported to print (unverified).
    #[arg(long, value_name = "KIND", default_value = "chip")]
    pub length_codes: LengthCodes,

    /// Generation of the master, whose registers and messages are logged. Default: 4.
    #[arg(long, value_name = "N", value_parser = generation)]
    pub generation: Option<Generation>,

    /// Which bit is which in the diagnostic register of generation 3, from bit 0 on. It is not
    /// published; the default is a guess: MOD,LB,RB,CTRL,BSA,RUN,BASP,READY
    #[arg(long, value_name = "NAMES", value_parser = third)]
    pub generation_3_bits: Option<diagnostic::Order>,

    /// What is known of the format of the line (TOML): flags, loopback word, checksum, the devices
    /// of the ring. What it leaves out is found out. Experimental.
    #[arg(long, value_name = "FILE")]
    pub line_profile: Option<PathBuf>,
}

impl Interbus {
    /// How its logs are written.
    pub fn layout(&self) -> Layout {
        Layout {
            columns: self.columns.clone().unwrap_or_default(),
            ring: self.ring_map.clone().unwrap_or_default(),
            words: self.words,
            word_order: self.word_order,
            byte_order: self.byte_order,
            time_unit: self.time_unit,
            length_codes: self.length_codes,
            join: self.join.clone(),
            join_columns: self.join_columns.clone(),
        }
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
        let third = self.generation_3_bits.unwrap_or_default();
        let master = Master { generation: self.generation, third };
        let (every_cycle, read_echo) = (self.every_cycle, self.read_echo);
        Ok((Settings { every_cycle, read_echo, master, line, ..Settings::default() }, named))
    }
}

fn generation(text: &str) -> Result<Generation, &'static str> {
    match text {
        "3" => Ok(Generation::Three),
        "4" => Ok(Generation::Four),
        _ => Err("masters are of generation 3 or 4"),
    }
}

fn third(text: &str) -> Result<diagnostic::Order, String> {
    let names = diagnostic::THIRD.join(",");
    diagnostic::Order::parse(text).ok_or_else(|| format!("not all of {names}, in any order"))
}
