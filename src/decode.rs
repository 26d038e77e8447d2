//! What every decoding command does: read the sources, pass records on, and end well.

use crate::cli::{Decoding, FailOn, Invert};
use crate::clock::{At, Clock};
use crate::export::Export;
use crate::interrupt;
use crate::pipeline::{Consumer, Pipeline};
use crate::say;
use crate::source::{self, SourceError, SourceOptions};
use crate::tally::Tally;
use crate::verdict::{Cut, Learned, Verdict};
use anyhow::Context;
use dissectors::bus::{Bus, LineCounts};
use dissectors::can;
use dissectors::device::Profile;
use dissectors::devicenet::eds::{self, Eds};
use dissectors::event::Moment;
use dissectors::finding::Severity;
use dissectors::protocol::{Medium, Settings};
use dissectors::record::{BusInfo, Record, Sink};
use dissectors::slin;
use dissectors::station::Stations;
use dissectors::uart::{Baud, LineSettings};
use std::fs::File;
use std::io::{self, Read};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

/// Exit statuses, as scripts rely on them.
pub const DONE: u8 = 0;
/// There are findings at or above `--fail-on`.
pub const FOUND: u8 = 1;
/// The command line is wrong.
pub const USAGE: u8 = 2;
/// A source failed, or the output cannot be written.
pub const FAILED: u8 = 3;
/// Interrupted by the user.
pub const INTERRUPTED: u8 = 130;

/// What a run came to.
pub struct Outcome {
    /// What was counted.
    pub tally: Tally,
    /// The buses, at the end.
    pub pipeline: Pipeline,
    /// How times are shown.
    pub clock: Clock,
    error: Option<SourceError>,
    /// No source could be opened: there is nothing to sum up.
    is_unopened: bool,
    output: io::Result<()>,
    is_interrupted: bool,
    /// A source would have had more to tell when the user interrupted.
    is_cut: bool,
    /// A source goes on until somebody ends it.
    is_live: bool,
    fail_on: Option<FailOn>,
    /// What the user said that fits nothing in the sources.
    unused: Vec<String>,
    /// Nothing but errors is said on standard error.
    pub is_quiet: bool,
}

impl Outcome {
    /// Whether nobody reads what is written: then nothing is said any more.
    pub fn is_pipe_closed(&self) -> bool {
        self.output.as_ref().is_err_and(|error| error.kind() == io::ErrorKind::BrokenPipe)
    }

    /// Whether no source could be opened, so that there is nothing to sum up.
    pub fn is_unopened(&self) -> bool {
        self.is_unopened
    }

    /// Whether the output could be written, as far as the source went.
    pub fn has_written(&self) -> bool {
        self.output.is_ok()
    }

    /// Whether the source was read to its end, and all of it was written.
    pub fn is_whole(&self) -> bool {
        self.has_written() && self.error.is_none() && !self.is_interrupted
    }

    /// Whether a source failed, or the output could not be written though somebody read it.
    pub fn has_failed(&self) -> bool {
        self.error.is_some() || (self.output.is_err() && !self.is_pipe_closed())
    }

    /// The four lines that sum it up.
    pub fn verdict(&self) -> Verdict {
        let cut = match (&self.error, self.is_cut) {
            (Some(_), _) => Some(Cut::Failure),
            (None, true) => Some(Cut::Interruption),
            (None, false) => None,
        };
        Verdict::of(&self.tally, &self.pipeline, &self.clock, cut)
    }

    /// Says on standard error what was found out, what went wrong, and the last four lines.
    pub fn report(&self) {
        if self.is_pipe_closed() {
            return;
        }
        if !self.is_quiet {
            self.conclusions().for_each(|line| say!("{line}"));
        }
        for unused in self.unused.iter().filter(|_| !self.is_quiet) {
            say!("fieldtap: warning: {unused}");
        }
        if let Err(error) = &self.output {
            say!("fieldtap: the output cannot be written: {error}");
        }
        if let Some(error) = &self.error {
            say!("fieldtap: {error}");
        }
        // Lines that say of everything that it is not known would push the reason off the screen.
        if !self.is_quiet && !self.is_unopened {
            for (heading, text) in self.verdict().lines() {
                say!("{heading:<6} {text}");
            }
        }
    }

    /// What was found out of each bus, with its evidence.
    pub fn conclusions(&self) -> impl Iterator<Item = String> {
        self.pipeline.buses().iter().flat_map(|bus| {
            let say = |learned| format!("auto: {}: {learned}", bus.info().name);
            Learned::of(bus).into_iter().map(say)
        })
    }

    /// The same where an interruption is how a live source is meant to end.
    pub fn ended_as_meant(mut self) -> Self {
        self.is_interrupted &= !self.is_live;
        self.is_cut &= !self.is_live;
        self
    }

    /// 3 outranks 130 outranks 1; a closed pipe is none of these.
    pub fn exit_code(&self) -> ExitCode {
        let limit = self.fail_on.map(|limit| match limit {
            FailOn::Error => Severity::Error,
            FailOn::Warning => Severity::Warning,
        });
        let has_found = limit.is_some_and(|limit| self.tally.worst() >= Some(limit));
        ExitCode::from(if self.is_pipe_closed() {
            DONE
        } else if self.has_failed() {
            FAILED
        } else if self.is_interrupted {
            INTERRUPTED
        } else if has_found {
            FOUND
        } else {
            DONE
        })
    }
}

/// Decodes the sources into `export`.
pub fn decode(
    decoding: &Decoding,
    sources: &[String],
    settings: Settings,
    export: &mut dyn Export,
) -> Outcome {
    interrupt::catch(INTERRUPTED);
    let mut pipeline = Pipeline::new(settings);
    let mut desk = Desk {
        export,
        tally: Tally::default(),
        clock: Clock::new(decoding.time),
        from: decoding.from,
        to: decoding.to,
        left: decoding.count.unwrap_or(u64::MAX),
        output: Ok(()),
        is_live: sources.iter().any(|name| name == "-" || source::live::is_tap(name)),
        is_quiet: decoding.quiet,
    };
    let options = source_options(decoding);
    let (sources, empty) = source::without_empty(sources);
    empty.iter().for_each(|warning| desk.warn(warning));
    let (mut error, mut is_opened) = (None, false);
    for name in &sources {
        let passed = source::open(name, &options).and_then(|mut source| {
            is_opened = true;
            pipeline.pass(&mut *source, &mut desk)
        });
        if let Err(stopped) = passed {
            // What an interruption cuts is not the source's fault.
            error = Some(stopped).filter(|_| !interrupt::came());
            break;
        }
    }
    let is_unopened = error.is_some() && !is_opened;
    let is_interrupted = interrupt::came();
    // A tap has no more to tell than what was heard until then.
    let is_cut = is_interrupted && !sources.iter().all(|name| source::live::is_tap(name));
    pipeline.finish(&mut desk);
    if desk.output.is_ok() && !is_unopened {
        desk.output = desk.export.status().and_then(|()| desk.export.flush());
    }
    let Desk { tally, clock, output, is_live, .. } = desk;
    let is_all = decoding.from.is_none() && decoding.to.is_none() && decoding.count.is_none();
    let has_all = is_all && error.is_none() && !is_cut && tally.records > 0;
    let mut unused = if has_all { unused(&tally, &pipeline) } else { Vec::new() };
    unused.extend(apart(&pipeline));
    let (fail_on, is_quiet) = (decoding.fail_on, decoding.quiet);
    Outcome {
        tally,
        pipeline,
        clock,
        error,
        is_unopened,
        output,
        is_interrupted,
        is_cut,
        is_live,
        fail_on,
        unused,
        is_quiet,
    }
}

/// Selects the records the user asked for, counts them and has them written.
struct Desk<'a> {
    export: &'a mut dyn Export,
    tally: Tally,
    clock: Clock,
    from: Option<At>,
    to: Option<At>,
    left: u64,
    output: io::Result<()>,
    /// What is heard comes as it happens, and so it is shown.
    is_live: bool,
    is_quiet: bool,
}

impl Sink for Desk<'_> {
    fn record(&mut self, record: &Record<'_>) {
        self.clock.begin(record.start);
        self.export.begin(record.start);
        let is_before = |limit: Option<At>| {
            let time = self.clock.relative(record.start).zip(limit);
            time.is_some_and(|(time, limit)| time < self.clock.resolve(limit))
        };
        let is_late = self.to.is_some() && record.start.is_known() && !is_before(self.to);
        if is_before(self.from) || is_late || self.left == 0 {
            return;
        }
        self.tally.record(record);
        if self.export.wants(record) {
            self.left -= 1;
            self.export.record(record);
        }
    }
}

impl Consumer for Desk<'_> {
    fn goes_on(&mut self) -> bool {
        if self.output.is_ok() {
            self.output = self.export.status();
        }
        if self.is_live && self.output.is_ok() {
            self.output = self.export.flush();
        }
        self.output.is_ok() && self.left > 0 && !interrupt::came()
    }

    fn comment(&mut self, bus: &BusInfo, time: Moment, text: &str) {
        self.export.comment(bus, time, text);
    }

    fn warn(&mut self, warning: &SourceError) {
        self.tally.unread += warning.left_out;
        let line = format!("fieldtap: warning: {warning}");
        self.export.note(&line);
        if !self.is_quiet {
            say!("{line}");
        }
    }

    fn note(&mut self, text: &str) {
        let line = format!("fieldtap: {text}");
        self.export.note(&line);
        if !self.is_quiet {
            say!("{line}");
        }
    }

    fn end(&mut self, bus: &BusInfo, end: Moment) {
        self.export.end(bus, end);
    }
}

/// What the user said of stations and protocol that fits nothing that was heard.
fn unused(tally: &Tally, pipeline: &Pipeline) -> Vec<String> {
    let Settings { protocol, devices, stations, .. } = pipeline.settings();
    let buses = pipeline.buses();
    let speaks = |name| buses.iter().filter_map(Bus::protocol).any(|it| it.name == name);
    let device = |(number, device): (&u16, &Profile)| {
        let is_there = tally.has_heard(*number) && speaks(device.protocol());
        (!is_there).then(|| number.to_string())
    };
    let station = |number: &u16| (!tally.has_heard(*number)).then(|| number.to_string());
    let missing = [
        ("--device", devices.iter().filter_map(device).collect::<Vec<_>>(), " of that kind"),
        ("--stations", stations.keys().filter_map(station).collect(), ""),
    ];
    let missing = missing.into_iter().filter(|(_, numbers, _)| !numbers.is_empty());
    let missing = missing.map(|(option, numbers, kind)| {
        let numbers = numbers.join(" ");
        format!("{option} names {numbers}: no such station{kind} was heard")
    });
    let other = protocol.and_then(|given| {
        let carried = |bus: &Bus| carried(bus).filter(|medium| *medium != given.medium);
        let (bus, medium) = buses.iter().find_map(|bus| Some((bus, carried(bus)?)))?;
        let (name, carries) = (&bus.info().name, medium.carries());
        Some(format!("--protocol {}: {name} carries {carries}, which are none of it", given.name))
    });
    missing.chain(other).collect()
}

/// Wires of one bus that were read each as a bus: how they are read together.
fn apart(pipeline: &Pipeline) -> Option<String> {
    let is_wire = |bus: &&Bus| bus.counts().cycles > 0 && !bus.settings().is_empty();
    let buses: Vec<&Bus> = pipeline.buses().iter().filter(is_wire).collect();
    let protocol = buses.first()?.protocol()?;
    let is_apart = pipeline.settings().protocol.is_none() && protocol.wires.len() > 1;
    if !is_apart || buses.len() < 2 {
        return None;
    }
    let names: Vec<&str> = buses.iter().map(|bus| bus.info().name.as_str()).collect();
    let command = std::env::args().skip(1).map(|part| quoted(&part)).collect::<Vec<_>>().join(" ");
    Some(format!(
        "{} carry {} each, and were read apart; as the wires of one ring: fieldtap {command} \
         --protocol {}",
        names.join(" and "),
        protocol.name.to_uppercase(),
        protocol.name
    ))
}

/// An argument as a shell takes it.
fn quoted(argument: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "-_./:=,@%+".contains(c);
    match argument.chars().all(is_plain) && !argument.is_empty() {
        true => argument.to_owned(),
        false => format!("'{}'", argument.replace('\'', "'\\''")),
    }
}

/// What was heard on a bus.
fn carried(bus: &Bus) -> Option<Medium> {
    match bus.counts() {
        LineCounts { frames: 1.., .. } => Some(Medium::Can),
        LineCounts { characters: 1.., .. } => Some(Medium::Serial),
        LineCounts { rows: 1.., .. } | LineCounts { cycles: 1.., .. } => Some(Medium::Words),
        _ => None,
    }
}

/// What the user says about the sources.
pub fn source_options(decoding: &Decoding) -> SourceOptions {
    SourceOptions {
        format: decoding.input_format,
        channels: decoding.channel.clone(),
        samplerate: decoding.samplerate,
        unitsize: usize::from(decoding.unitsize),
        baud: decoding.baud.given(),
        frame: decoding.frame.given(),
        live: decoding.live.options(decoding.bitrate.given().map(Baud::get)),
        interbus: decoding.interbus.layout(),
    }
}

/// What the user decided about the bus.
///
/// # Errors
/// A file of stations, of a device or of a line cannot be used.
pub fn settings(decoding: &Decoding) -> anyhow::Result<Settings> {
    let inverted = match decoding.invert {
        Invert::Auto => None,
        Invert::Yes => Some(true),
        Invert::No => Some(false),
    };
    let line =
        LineSettings { baud: decoding.baud.given(), format: decoding.frame.given(), inverted };
    let checksum = decoding.checksum.unwrap_or_default();
    let stations = match &decoding.stations {
        Some(path) => crate::stations::read(path)?,
        None => Stations::new(),
    };
    let (interbus, named) = decoding.interbus.settings()?;
    let mut settings = Settings {
        protocol: decoding.protocol.given(),
        line,
        can: can::Settings { bitrate: decoding.bitrate.given() },
        slin: slin::Settings { profile: decoding.profile, checksum },
        interbus,
        devices: named.into_iter().chain(decoding.devices.iter().copied()).collect(),
        eds: read_eds(&decoding.eds, decoding.quiet)?,
        stations,
        ..Settings::default()
    };
    for (limit, number) in &decoding.limits {
        limit.set(&mut settings, *number);
    }
    Ok(settings)
}

/// Reads the makers' descriptions. What is wrong in them is said, and the rest is used.
fn read_eds(paths: &[PathBuf], is_quiet: bool) -> anyhow::Result<Arc<[Eds]>> {
    let read = |path: &PathBuf| {
        let failed = || format!("{}: cannot be read", path.display());
        let mut bytes = Vec::new();
        let limit = eds::MAX_FILE as u64 + 1;
        File::open(path)
            .and_then(|file| file.take(limit).read_to_end(&mut bytes))
            .with_context(failed)?;
        let (eds, warnings) = eds::parse(&bytes);
        if eds == Eds::default() {
            let path = path.display();
            anyhow::bail!("{path}: this is no EDS file: no section of one tells anything");
        }
        for warning in warnings.iter().filter(|_| !is_quiet) {
            say!("fieldtap: warning: {}: {warning}", path.display());
        }
        Ok(eds)
    };
    paths.iter().map(read).collect()
}
