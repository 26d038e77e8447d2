//! `simulate devicenet`: a scanner and absolute encoders on CAN.

use super::destination::{self, Destination, Files, Form as _, Levels};
use super::{
    NEW_YEAR, channel, duration, end, list_faults, milliseconds, number, refuse, speed, tell,
};
use crate::say;
use crate::simulate::devicenet::{
    self, Candump, Fault, Mode, Order, Pcapng, Plan, STEPS_PER_TURN, Station, Summary,
    TOTAL_RESOLUTION, Tap, mac,
};
use crate::simulate::{MS, Motion, Orderable, Ps};
use anyhow::{Context, Result, bail, ensure};
use clap::{Args, ValueEnum};
use std::process::ExitCode;

/// A DeviceNet bus, and where to write it.
#[derive(Args, Debug)]
pub struct Devicenet {
    /// Where to write it.
    #[command(flatten)]
    destination: Destination<Form>,

    /// What every chance follows from: the same seed makes the same bus, for ever.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,

    /// How long the bus is watched.
    #[arg(long, value_name = "SECONDS", value_parser = duration, default_value = "10")]
    duration: Ps,

    /// Begin when everybody is at work, in the middle of the traffic.
    #[arg(long)]
    late_start: bool,

    /// MAC IDs of the encoders.
    #[arg(long, visible_alias = "nodes", value_name = "LIST", value_delimiter = ',', default_value = "5,7,23", value_parser = mac, help_heading = "Bus")]
    encoders: Vec<u8>,

    /// MAC ID of the scanner.
    #[arg(long, value_name = "MAC", default_value = "0", value_parser = mac, help_heading = "Bus")]
    master: u8,

    /// How the scanner gets the positions: poll, cos (change of state), cyclic or strobe. MAC=MODE
    /// says it of one encoder (repeatable).
    #[arg(long, value_name = "MODE", value_parser = mode, help_heading = "Bus")]
    mode: Vec<Of<Mode>>,

    /// Bits a second: 125k, 250k or 500k.
    #[arg(long, visible_alias = "baud", value_name = "RATE", default_value = "125k", value_parser = bitrate, help_heading = "Bus")]
    bitrate: u32,

    /// By how many percent the clocks of the nodes may be off, each its own.
    #[arg(long, value_name = "PERCENT", default_value = "0.02", value_parser = percent, help_heading = "Bus")]
    clock: f64,

    /// One encoder and nobody else: it repeats its first frame for want of an acknowledge. The same
    /// as --fault not-acknowledged.
    #[arg(long, help_heading = "Bus")]
    lone: bool,

    /// From one poll of all encoders to the next.
    #[arg(long, value_name = "MS", default_value = "25", value_parser = milliseconds, help_heading = "Scanner")]
    scan: Ps,

    /// The expected packet rate that it sets; encoders round it up to 10 ms.
    #[arg(long, value_name = "MS", default_value_t = 75, value_parser = clap::value_parser!(u16).range(10..=10_000), help_heading = "Scanner")]
    packet_rate: u16,

    /// The production inhibit time that it sets for change of state; 0 for none.
    #[arg(long, value_name = "MS", default_value_t = 20, value_parser = clap::value_parser!(u16).range(0..=10_000), help_heading = "Scanner")]
    inhibit: u16,

    /// The change that makes an encoder produce, in steps.
    #[arg(long, value_name = "STEPS", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=536_870_912), help_heading = "Scanner")]
    delta: u32,

    /// Allocate change of state and cyclic without acknowledges.
    #[arg(long, help_heading = "Scanner")]
    no_acknowledge: bool,

    /// Typical time from one explicit request in between to the next.
    #[arg(long, value_name = "MS", default_value = "400", value_parser = milliseconds, help_heading = "Scanner")]
    errands: Ps,

    /// What an encoder sends: assembly 1, the position, or 2, the position, alarm and warning.
    /// MAC=ASSEMBLY says it of one (repeatable).
    #[arg(long, visible_alias = "profile", value_name = "ASSEMBLY", value_parser = assembly, help_heading = "Encoders")]
    assembly: Vec<Of<u8>>,

    /// Steps per turn.
    #[arg(long, value_name = "N", default_value_t = STEPS_PER_TURN, value_parser = clap::value_parser!(u32).range(1..=i64::from(STEPS_PER_TURN)), help_heading = "Encoders")]
    steps_per_turn: u32,

    /// Steps over all turns.
    #[arg(long, value_name = "N", default_value_t = TOTAL_RESOLUTION, value_parser = clap::value_parser!(u32).range(1..=i64::from(TOTAL_RESOLUTION)), help_heading = "Encoders")]
    total_resolution: u32,

    /// Seconds between two heartbeats; 0 for none.
    #[arg(long, value_name = "SECONDS", default_value_t = 0, help_heading = "Encoders")]
    heartbeat: u8,

    /// How the shafts turn.
    #[arg(long, value_name = "HOW", default_value = "stop-and-go", help_heading = "Encoders")]
    motion: Motion,

    /// How fast they turn at most, in steps of the disc a second.
    #[arg(long, value_name = "STEPS", default_value = "4000", value_parser = speed, help_heading = "Encoders")]
    speed: f64,

    /// What goes wrong (repeatable): NAME strikes 1 time in 100 that it could, NAME=PROBABILITY
    /// that part of them, NAME@MAC=PROBABILITY one encoder.
    #[arg(long, value_name = "FAULT", help_heading = "Faults")]
    fault: Vec<Order>,

    /// List the faults and what each does.
    #[arg(long, help_heading = "Faults")]
    list_faults: bool,

    /// Name of the interface or channel. Default: can0, or CAN_RX for line levels.
    #[arg(long, value_name = "NAME", value_parser = channel, help_heading = "Capture")]
    channel: Option<String>,

    /// When the capture starts, in seconds since 1970 (log, pcapng). Default: 2026-01-01.
    #[arg(long, value_name = "SECONDS", value_parser = clap::value_parser!(u32), help_heading = "Capture")]
    start_time: Option<u32>,
}

/// The forms of a capture.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum Form {
    /// Frames as candump logs them.
    #[value(alias = "candump")]
    Log,
    /// Frames with their times.
    Pcapng,
    /// The line's level, as a sigrok session.
    Sr,
    /// The line's level, as text.
    Vcd,
}

impl destination::Form for Form {
    const ENDINGS: &'static str = ".log, .pcapng, .sr or .vcd";

    fn levels(&self) -> Option<Levels> {
        match self {
            Form::Sr => Some(Levels::Sr),
            Form::Vcd => Some(Levels::Vcd),
            _ => None,
        }
    }
}

/// Something of one encoder or of all.
#[derive(Clone, Copy, Debug)]
struct Of<T> {
    mac: Option<u8>,
    what: T,
}

/// What is said of this encoder, or else of all; the last word counts.
fn of<T: Copy>(said: &[Of<T>], mac: u8) -> Option<T> {
    let own = said.iter().rev().find(|of| of.mac == Some(mac));
    own.or(said.iter().rev().find(|of| of.mac.is_none())).map(|of| of.what)
}

impl Devicenet {
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
                tell(&format!("{} frames", summary.frames), summary.duration, &summary.faults);
                for name in &summary.missing {
                    say!("{name} never struck: give it more time, or a higher probability");
                }
            }
        })
    }

    fn plan(&self) -> Result<Plan> {
        let mut faults = self.fault.clone();
        if self.lone && !faults.iter().any(|order| order.fault == Fault::NotAcknowledged) {
            faults.push(Order { fault: Fault::NotAcknowledged, station: None, probability: 1.0 });
        }
        ensure!(
            !self.lone || self.encoders.len() == 1,
            "--lone: one encoder is alone on the bus: name it, such as --encoders 5"
        );
        self.check_form(&faults)?;
        ensure!(self.errands >= 20 * MS, "--errands: 20 ms at least");
        let plan = Plan {
            seed: self.seed,
            duration: self.duration,
            master: self.master,
            stations: self.stations()?,
            bitrate: self.bitrate,
            clock_error: self.clock,
            scan: self.scan,
            packet_rate: self.packet_rate,
            inhibit: self.inhibit,
            delta: self.delta,
            is_acknowledged: !self.no_acknowledge,
            errands: self.errands,
            heartbeat: self.heartbeat,
            motion: self.motion,
            speed: self.speed,
            starts_late: self.late_start,
            faults,
        };
        plan.settle()
    }

    /// Refuses what the form cannot hold.
    fn check_form(&self, faults: &[Order]) -> Result<()> {
        let form = self.destination.form()?;
        let is_levels = form.levels().is_some();
        for Order { fault, .. } in faults {
            let name = fault.name();
            ensure!(
                !fault.is_in_the_tap() || !is_levels,
                "{name}: it is in the controller of the tap, and line levels have none"
            );
            ensure!(
                *fault != Fault::Truncated || form == Form::Pcapng,
                "{name}: only pcapng can say that bytes are missing"
            );
        }
        self.destination.check(self.bitrate, "bit/s", 2)
    }

    fn stations(&self) -> Result<Vec<Station>> {
        let named = self.mode.iter().map(|of| of.mac).chain(self.assembly.iter().map(|of| of.mac));
        for mac in named.flatten() {
            if !self.encoders.contains(&mac) {
                bail!("MAC ID {mac} is not in --encoders");
            }
        }
        let stations = self.encoders.iter().map(|mac| Station {
            mac: *mac,
            mode: of(&self.mode, *mac).unwrap_or(Mode::Poll),
            assembly: of(&self.assembly, *mac).unwrap_or(1),
            steps: self.steps_per_turn,
            total: self.total_resolution,
        });
        Ok(stations.collect())
    }

    fn write(&self, plan: Plan) -> Result<Summary> {
        let start = match self.destination.form()? {
            Form::Log | Form::Pcapng => self.start_time.unwrap_or(NEW_YEAR),
            Form::Sr | Form::Vcd => 0,
        };
        let files = self.destination.open()?;
        let tap = self.tap(&files, start)?;
        let start_ns = i64::from(start) * 1_000_000_000;
        let summary = devicenet::run(plan, tap, files.truth()?, start_ns)
            .with_context(|| format!("cannot write {}", self.destination.path().display()))?;
        files.keep()?;
        Ok(summary)
    }

    fn tap(&self, files: &Files, start: u32) -> Result<Box<dyn Tap>> {
        let interface = self.channel.as_deref().unwrap_or("can0");
        let channel = self.channel.as_deref().unwrap_or("CAN_RX");
        Ok(match self.destination.form()? {
            Form::Log => Box::new(Candump::new(files.capture()?, interface, start)),
            Form::Pcapng => {
                Box::new(Pcapng::new(files.capture()?, interface, self.bitrate, start)?)
            }
            Form::Sr => Box::new(self.destination.sampler(files, Levels::Sr, &[channel], false)?),
            Form::Vcd => {
                Box::new(self.destination.sampler(files, Levels::Vcd, &[channel], false)?)
            }
        })
    }
}

fn of_one<T>(text: &str, what: impl Fn(&str) -> Result<T, String>) -> Result<Of<T>, String> {
    let (station, name) = match text.split_once('=') {
        Some((number, name)) => (Some(mac(number)?), name),
        None => (None, text),
    };
    Ok(Of { mac: station, what: what(name)? })
}

fn mode(text: &str) -> Result<Of<Mode>, String> {
    of_one(text, |name| {
        Mode::from_str(name, false)
            .map_err(|_| "not a mode: poll, cos, cyclic or strobe".to_owned())
    })
}

fn assembly(text: &str) -> Result<Of<u8>, String> {
    of_one(text, |name| match name {
        "1" => Ok(1),
        "2" => Ok(2),
        _ => Err("an assembly is 1 or 2".to_owned()),
    })
}

fn bitrate(text: &str) -> Result<u32, String> {
    let rates = [125_000, 250_000, 500_000];
    let rate = crate::source::frequency(text).and_then(|rate| u32::try_from(rate).ok());
    rate.filter(|rate| rates.contains(rate))
        .ok_or("DeviceNet runs at 125k, 250k or 500k".to_owned())
}

fn percent(text: &str) -> Result<f64, String> {
    number(text.strip_suffix('%').unwrap_or(text), 0.5)
        .ok_or("0 to 0.5 percent: CAN cannot follow a clock that is further off".to_owned())
}
