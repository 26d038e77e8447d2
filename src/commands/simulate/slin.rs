//! `simulate slin`: absolute encoders on RS485.

use super::destination::{self, Destination, Files, Form as _, Levels};
use super::{
    NEW_YEAR, channel, duration, end, list_faults, milliseconds, percent, refuse, speed, tell,
};
use crate::simulate::slin::{
    self, Chars, Checksum, Fault, Length, MAX_BITS, Order, Pcapng, Plan, Profile, Station, Summary,
    Tap, Uart, address,
};
use crate::simulate::{Motion, Orderable, Ps};
use anyhow::{Context, Result, bail, ensure};
use clap::{Args, ValueEnum};
use std::process::ExitCode;

/// A SLIN bus, and where to write it.
#[derive(Args, Debug)]
pub struct Slin {
    /// Where to write it.
    #[command(flatten)]
    destination: Destination<Form>,

    /// What every chance follows from: the same seed makes the same bus, for ever.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,

    /// How many requests the master sends.
    #[arg(long, value_name = "N", default_value_t = 1000)]
    exchanges: u64,

    /// How long the bus is watched, instead of a number of requests.
    #[arg(long, value_name = "SECONDS", value_parser = duration, conflicts_with = "exchanges")]
    duration: Option<Ps>,

    /// Addresses that have an encoder.
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "0,1,2,3", value_parser = address, help_heading = "Bus")]
    encoders: Vec<u8>,

    /// Addresses without an encoder that the master asks now and then.
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = address, help_heading = "Bus")]
    scan: Vec<u8>,

    /// Rate of the line in Bd: the manuals know 9600, 19200, 115200 and 345594.
    #[arg(long, value_name = "N", default_value_t = 115_200, value_parser = clap::value_parser!(u32).range(300..=3_000_000), help_heading = "Bus")]
    baud: u32,

    /// By how many percent the clocks of master and encoders may be off, each its own.
    #[arg(long, value_name = "PERCENT", default_value = "1", value_parser = percent, help_heading = "Bus")]
    clock: f64,

    /// Typical silence before the next request. Default: 2 ms, or 20 characters where that is
    /// longer. 0 is as short as can be.
    #[arg(long, value_name = "MS", value_parser = milliseconds, help_heading = "Bus")]
    pause: Option<Ps>,

    /// Ask as fast as can be: --pause 0
    #[arg(long, conflicts_with = "pause", help_heading = "Bus")]
    full: bool,

    /// Whose encoders these are: baumer, tr, or tr-reserve-high. ADDRESS=PROFILE says it of one of
    /// them (repeatable).
    #[arg(long, value_name = "PROFILE", value_parser = profile, help_heading = "Encoders")]
    profile: Vec<ProfileOf>,

    /// How encoders add up their checksum, instead of what the profile says.
    #[arg(long, value_name = "RULE", help_heading = "Encoders")]
    checksum: Option<Checksum>,

    /// Bits of a position: single-turn, or single-turn+multi-turn.
    #[arg(long, value_name = "BITS", default_value = "13+12", value_parser = bits, help_heading = "Encoders")]
    bits: u32,

    /// How the shafts turn.
    #[arg(long, value_name = "HOW", default_value = "stop-and-go", help_heading = "Encoders")]
    motion: Motion,

    /// How fast they turn at most, in steps a second. Default: as fast as every pause of the master
    /// allows without looking like a jump.
    #[arg(long, value_name = "STEPS", value_parser = speed, help_heading = "Encoders")]
    speed: Option<f64>,

    /// Where they are at first. Default: anywhere.
    #[arg(long, value_name = "N", help_heading = "Encoders")]
    position: Option<u32>,

    /// Keep leading zero words: all answers are equally long.
    #[arg(long, help_heading = "Encoders")]
    fixed_length: bool,

    /// Send position 0 as a footer alone.
    #[arg(long, help_heading = "Encoders")]
    zero_as_footer: bool,

    /// What goes wrong (repeatable): NAME strikes 1 exchange in 100, NAME=PROBABILITY that part of
    /// them, NAME@ADDRESS=PROBABILITY those of one encoder.
    #[arg(long, value_name = "FAULT", help_heading = "Faults")]
    fault: Vec<Order>,

    /// List the faults and what each does.
    #[arg(long, help_heading = "Faults")]
    list_faults: bool,

    /// Name of the channel or interface.
    #[arg(long, value_name = "NAME", default_value = "BUS", value_parser = channel, help_heading = "Capture")]
    channel: String,

    /// When the capture starts, in seconds since 1970 (pcapng, chars). Default: 2026-01-01 for
    /// pcapng, none for chars.
    #[arg(long, value_name = "SECONDS", value_parser = clap::value_parser!(u32), help_heading = "Capture")]
    start_time: Option<u32>,
}

/// The forms of a capture.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum Form {
    /// Characters with their times.
    Pcapng,
    /// Characters as text: time,byte,parity.
    Chars,
    /// The line's level, as a sigrok session.
    Sr,
    /// The line's level, as text.
    Vcd,
}

impl destination::Form for Form {
    const ENDINGS: &'static str = ".pcapng, .chars, .sr or .vcd";

    fn levels(&self) -> Option<Levels> {
        match self {
            Form::Sr => Some(Levels::Sr),
            Form::Vcd => Some(Levels::Vcd),
            _ => None,
        }
    }
}

impl Slin {
    /// Writes the capture.
    pub fn run(&self) -> ExitCode {
        if self.list_faults {
            return list_faults(|fault: &Fault| fault.code());
        }
        let plan = match self.plan() {
            Ok(plan) => plan,
            Err(error) => return refuse(&error),
        };
        end(self.write(plan), |summary| {
            if !self.destination.quiet {
                tell(
                    &format!("{} exchanges", summary.exchanges),
                    summary.duration,
                    &summary.faults,
                );
            }
        })
    }

    fn plan(&self) -> Result<Plan> {
        self.check_form()?;
        let plan = Plan {
            seed: self.seed,
            length: self.duration.map_or(Length::Exchanges(self.exchanges), Length::Duration),
            stations: self.stations()?,
            scan: self.scan.clone(),
            bits: self.bits,
            baud: self.baud,
            motion: self.motion,
            speed: self.speed,
            position: self.position,
            is_length_fixed: self.fixed_length,
            is_zero_a_footer: self.zero_as_footer,
            clock_error: self.clock,
            pause: if self.full { 0 } else { self.pause.unwrap_or(Plan::usual_pause(self.baud)) },
            faults: self.fault.clone(),
        };
        ensure!(
            self.position.is_none_or(|position| position >> self.bits == 0),
            "--position is beyond the {} bits of --bits",
            self.bits
        );
        plan.settle()
    }

    /// Refuses what the form cannot hold.
    fn check_form(&self) -> Result<()> {
        let form = self.destination.form()?;
        let is_levels = form.levels().is_some();
        for Order { fault, .. } in &self.fault {
            ensure!(
                !fault.is_in_the_tap() || form == Form::Pcapng,
                "{}: only pcapng can say that characters are missing",
                fault.name()
            );
            ensure!(
                *fault != Fault::WrongRate || !is_levels,
                "wrong-rate: line levels have no rate, write pcapng or chars"
            );
        }
        self.destination.check(self.baud, "Bd", 8)
    }

    fn stations(&self) -> Result<Vec<Station>> {
        for ProfileOf { address, .. } in &self.profile {
            if let Some(address) = address.filter(|address| !self.encoders.contains(address)) {
                bail!("--profile names address {address}, which is not in --encoders");
            }
        }
        let profile_of = |address: u8| {
            let fitting = |of: &&ProfileOf| of.address == Some(address);
            let everybody = |of: &&ProfileOf| of.address.is_none();
            let own = self.profile.iter().rev().find(fitting);
            own.or(self.profile.iter().rev().find(everybody))
                .map_or(Profile::Baumer, |of| of.profile)
        };
        let stations = self.encoders.iter().map(|address| {
            let profile = profile_of(*address);
            let checksum = self.checksum.unwrap_or(profile.checksum());
            Station { address: *address, profile, checksum }
        });
        Ok(stations.collect())
    }

    fn write(&self, plan: Plan) -> Result<Summary> {
        let start = match self.destination.form()? {
            Form::Pcapng => self.start_time.unwrap_or(NEW_YEAR),
            Form::Chars => self.start_time.unwrap_or(0),
            Form::Sr | Form::Vcd => 0,
        };
        let files = self.destination.open()?;
        let tap = self.tap(&plan, &files, start)?;
        let start_ns = i64::from(start) * 1_000_000_000;
        let summary = slin::run(plan, tap, files.truth()?, start_ns)
            .with_context(|| format!("cannot write {}", self.destination.path().display()))?;
        files.keep()?;
        Ok(summary)
    }

    fn tap(&self, plan: &Plan, files: &Files, start: u32) -> Result<Box<dyn Tap>> {
        let setup = plan.tap();
        Ok(match self.destination.form()? {
            Form::Pcapng => {
                let capture =
                    Pcapng::new(files.capture()?, &self.channel, setup, u64::from(start))?;
                Box::new(Uart::new(setup, capture))
            }
            Form::Chars => {
                Box::new(Uart::new(setup, Chars::new(files.capture()?, i64::from(start))?))
            }
            Form::Sr => Box::new(self.destination.sampler(
                files,
                Levels::Sr,
                &[&self.channel],
                setup.is_swapped,
            )?),
            Form::Vcd => Box::new(self.destination.sampler(
                files,
                Levels::Vcd,
                &[&self.channel],
                setup.is_swapped,
            )?),
        })
    }
}

/// A profile, of one encoder or of all.
#[derive(Clone, Copy, Debug)]
struct ProfileOf {
    address: Option<u8>,
    profile: Profile,
}

fn profile(text: &str) -> Result<ProfileOf, String> {
    let (address, name) = match text.split_once('=') {
        Some((number, name)) => (Some(address(number)?), name),
        None => (None, text),
    };
    let profile = Profile::from_str(name, false)
        .map_err(|_| "not a profile: baumer, tr or tr-reserve-high".to_owned())?;
    Ok(ProfileOf { address, profile })
}

fn bits(text: &str) -> Result<u32, String> {
    let (single, multi) = text.split_once('+').unwrap_or((text, "0"));
    let sum = single.parse::<u32>().ok().zip(multi.parse::<u32>().ok());
    sum.and_then(|(single, multi)| single.checked_add(multi))
        .filter(|bits| (1..=MAX_BITS).contains(bits))
        .ok_or(format!("bits such as 13 or 13+12, {MAX_BITS} together at most: four data words"))
}
