//! `simulate interbus`: a ring of linear encoders and other devices.

use super::destination::{self, Destination, Files, Form as _, Levels};
use super::{duration, end, list_faults, milliseconds, number, refuse, tell};
use crate::simulate::interbus::{
    self, Columns, Fault, Log, Member, Order, Plan, Profile, Summary, Truth, random_ring, run_line,
};
use crate::simulate::{Motion, Ps};
use anyhow::{Context, Result, ensure};
use clap::{Args, ValueEnum};
use std::path::PathBuf;
use std::process::ExitCode;

/// An INTERBUS ring, and where to write it.
#[derive(Args, Debug)]
pub struct Interbus {
    /// Where to write it.
    #[command(flatten)]
    destination: Destination<Form>,

    /// What every chance follows from: the same seed makes the same ring, for ever.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,

    /// How long the ring is watched.
    #[arg(long, value_name = "SECONDS", value_parser = duration, default_value = "10")]
    duration: Ps,

    /// The devices from the master on: la66, or the ID word of any other, such as 0132. Default: an
    /// la66 alone; with --random-profile any ring.
    #[arg(long, value_name = "LIST", value_delimiter = ',', help_heading = "Ring")]
    ring: Vec<Member>,

    /// From one bus cycle to the next.
    #[arg(long, value_name = "MS", default_value = "2", value_parser = milliseconds, help_heading = "Ring")]
    cycle: Ps,

    /// From one look of the PLC at the encoders to the next.
    #[arg(long, value_name = "MS", default_value = "10", value_parser = milliseconds, help_heading = "PLC")]
    plc: Ps,

    /// Typical time from one service to the next.
    #[arg(long, value_name = "MS", default_value = "400", value_parser = milliseconds, help_heading = "PLC")]
    pause: Ps,

    /// Measuring length of the rods in mm.
    #[arg(long, value_name = "MM", default_value = "500", value_parser = millimetres, help_heading = "Encoders")]
    rod: f64,

    /// How the carriages go along the rods.
    #[arg(long, value_name = "HOW", default_value = "stop-and-go", help_heading = "Encoders")]
    motion: Motion,

    /// How fast they go on average, in mm a second.
    #[arg(long, value_name = "MM", default_value = "200", value_parser = millimetres, help_heading = "Encoders")]
    speed: f64,

    /// Somebody uses the external preset inputs now and then.
    #[arg(long, help_heading = "Encoders")]
    external_presets: bool,

    /// What goes wrong (repeatable): NAME strikes 1 service in 100, NAME=PROBABILITY that part of
    /// them, NAME@DEVICE=PROBABILITY those of one encoder.
    #[arg(long, value_name = "FAULT", help_heading = "Faults")]
    fault: Vec<Order>,

    /// List the faults and what each does.
    #[arg(long, help_heading = "Faults")]
    list_faults: bool,

    /// How the line is coded (TOML): bitrate, idle_level, flag_order, flag_polarity,
    /// data_bit_order, gap_bits, lbw, crc, cntr. What it leaves out is as usual.
    #[arg(long, value_name = "FILE", help_heading = "Line")]
    profile_file: Option<PathBuf>,

    /// Any coding of the line, and any ring: those of this seed.
    #[arg(long, value_name = "SEED", conflicts_with = "profile_file", help_heading = "Line")]
    random_profile: Option<u64>,

    /// Bits a second: 500k or 2M. Default: what the profile says.
    #[arg(long, value_name = "RATE", value_parser = bitrate, help_heading = "Line")]
    bitrate: Option<u32>,

    /// A row of the log for every bus cycle, or one in so many ms.
    #[arg(long, value_name = "every|50ms", default_value = "every", value_parser = rows, help_heading = "Log")]
    rows: Rows,

    /// Write words of 16 bits, two each, in place of one of 32.
    #[arg(long, help_heading = "Log")]
    split_words: bool,
}

/// The forms of a capture.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum Form {
    /// Process words as a controller logs them.
    #[value(alias = "interbus-log")]
    Csv,
    /// The levels of both wires, as a sigrok session.
    Sr,
    /// The levels of both wires, as text.
    Vcd,
}

impl destination::Form for Form {
    const ENDINGS: &'static str = ".csv, .sr or .vcd";

    fn levels(&self) -> Option<Levels> {
        match self {
            Form::Csv => None,
            Form::Sr => Some(Levels::Sr),
            Form::Vcd => Some(Levels::Vcd),
        }
    }
}

/// How often a log has a row.
#[derive(Clone, Copy, Debug)]
struct Rows(Option<Ps>);

impl Interbus {
    /// Writes the capture.
    pub fn run(&self) -> ExitCode {
        if self.list_faults {
            return list_faults(|fault: &Fault| fault.code());
        }
        let ordered = self.profile().and_then(|profile| Ok((self.plan(&profile)?, profile)));
        let (plan, profile) = match ordered {
            Ok(ordered) => ordered,
            Err(error) => return refuse(&error),
        };
        end(self.write(&plan, &profile), |(what, summary)| {
            if !self.destination.quiet {
                let what = format!("{} {what}", summary.count);
                tell(&what, summary.duration, &summary.faults);
            }
        })
    }

    fn profile(&self) -> Result<Profile> {
        let mut profile = match (&self.profile_file, self.random_profile) {
            (Some(path), _) => std::fs::read_to_string(path)
                .map_err(anyhow::Error::from)
                .and_then(|text| Profile::parse(&text))
                .with_context(|| path.display().to_string())?,
            (None, Some(seed)) => Profile::random(seed),
            (None, None) => Profile::default(),
        };
        profile.bitrate = self.bitrate.unwrap_or(profile.bitrate);
        Ok(profile)
    }

    fn plan(&self, profile: &Profile) -> Result<Plan> {
        let is_line = self.destination.form()?.levels().is_some();
        let has_line = self.profile_file.is_some() || self.random_profile.is_some();
        ensure!(
            is_line || !has_line && self.bitrate.is_none(),
            "a profile is for line levels: write .sr or .vcd"
        );
        self.destination.check(profile.bitrate, "bit/s", 8)?;
        let ring = match self.random_profile {
            Some(seed) if self.ring.is_empty() => random_ring(seed),
            _ if self.ring.is_empty() => vec![Member::ENCODER],
            _ => self.ring.clone(),
        };
        let plan = Plan {
            seed: self.seed,
            duration: self.duration,
            ring,
            cycle: self.cycle,
            scan: self.plc,
            pause: self.pause,
            rod: self.rod,
            motion: self.motion,
            speed: self.speed,
            has_external_presets: self.external_presets,
            faults: self.fault.clone(),
        };
        plan.settle(is_line)
    }

    fn write(&self, plan: &Plan, profile: &Profile) -> Result<(&'static str, Summary)> {
        let files = self.destination.open()?;
        let truth = Truth::new(files.truth()?, 0);
        let written = match self.destination.form()?.levels() {
            None => self.log(plan, &files, truth).map(|summary| ("rows", summary)),
            Some(form) => {
                let is_low = profile.idle_level == 0;
                let tap = self.destination.sampler(&files, form, &["DO", "DI"], is_low)?;
                run_line(plan, profile, tap, truth).map(|summary| ("cycles", summary))
            }
        };
        let written = written
            .with_context(|| format!("cannot write {}", self.destination.path().display()))?;
        files.keep()?;
        Ok(written)
    }

    fn log(&self, plan: &Plan, files: &Files, truth: Truth) -> Result<Summary> {
        let columns = Columns { has_device: plan.ring.len() > 1, is_split: self.split_words };
        interbus::run(plan, self.rows.0, Log::new(files.capture()?, columns, 0)?, truth)
    }
}

fn bitrate(text: &str) -> Result<u32, String> {
    let rate = crate::source::frequency(text).and_then(|rate| u32::try_from(rate).ok());
    let rate = rate.filter(|rate| [500_000, 2_000_000].contains(rate));
    rate.ok_or("INTERBUS runs at 500k or 2M".to_owned())
}

fn rows(text: &str) -> Result<Rows, String> {
    if text == "every" {
        return Ok(Rows(None));
    }
    let time = text.strip_suffix("ms").ok_or("every, or a time such as 50ms".to_owned())?;
    match milliseconds(time)? {
        time @ 1.. => Ok(Rows(Some(time))),
        _ => Err("longer than 0 ms: a row for each bus cycle is every".to_owned()),
    }
}

fn millimetres(text: &str) -> Result<f64, String> {
    number(text, 20_000.0).filter(|it| *it > 0.0).ok_or("more than 0, up to 20000 mm".to_owned())
}
