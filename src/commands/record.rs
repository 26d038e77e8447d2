//! `record`: write what a tap hears to disk, for days.

use crate::cli::Decoding;
use crate::clock::Clock;
use crate::decode::{FAILED, INTERRUPTED, USAGE, settings, source_options};
use crate::interrupt;
use crate::record::{
    Files, RecordError, Recorder, Ring, Summary, Surroundings, Trigger, Watch, span, undecoded,
};
use crate::say;
use crate::source::{self, Piece, Source, SourceError, SourceOptions};
use clap::Args;
use dissectors::protocol::{Medium, Settings};
use dissectors::record::BusInfo;
use dissectors::uart::ParityMarks;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// How often it is looked after what waits.
const TURN: Duration = Duration::from_millis(100);

/// How often the user is told how it goes.
const TOLD_EACH: Duration = Duration::from_secs(60);

/// What `--help` ends with.
const EXAMPLES: &str = "\
Examples:
  The last day of a serial bus, in files of half an hour:
    fieldtap record serial:/dev/ttyUSB0 -w tape --ring files=48,duration=30min
  What surrounds each alarm of an encoder on CAN:
    fieldtap record can:can0 -w tape --trigger encoder.alarm --before 30s --after 10s";

/// What to record, and where.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct Arguments {
    /// A live tap, such as serial:/dev/ttyUSB0 or can:can0; or captures: files, or - for standard
    /// input.
    #[arg(value_name = "SOURCE", required = true)]
    sources: Vec<String>,

    /// The directory for the recorded files, which is made if it is not there.
    #[arg(short = 'w', long = "write", value_name = "DIR", help_heading = "Recording")]
    directory: PathBuf,

    /// When one file ends and the next begins, and how many are kept: files=10,size=100MB or
    /// files=24,duration=1h. The oldest is deleted. Default: one file. With --trigger each event
    /// begins a file of its own, files=20 keeps those of the last twenty, and size or duration
    /// divide what surrounds one event.
    #[arg(long, value_name = "RING", help_heading = "Recording")]
    ring: Option<Ring>,

    /// Keep only what surrounds such an event: a finding's code, such as slin.parity, or what is
    /// behind its point where only one code has it; or at least so bad: error, warning or info
    /// (repeatable).
    #[arg(long = "trigger", value_name = "CODE", help_heading = "Recording")]
    triggers: Vec<Trigger>,

    /// With --trigger: how much before an event is kept, such as 30s, 500ms or 2min: a bare number
    /// is seconds.
    #[arg(long, value_name = "TIME", default_value = "30s", value_parser = span, allow_hyphen_values = true, requires = "triggers", help_heading = "Recording")]
    before: i64,

    /// With --trigger: how much after an event is kept, given alike.
    #[arg(long, value_name = "TIME", default_value = "10s", value_parser = span, allow_hyphen_values = true, requires = "triggers", help_heading = "Recording")]
    after: i64,

    #[command(flatten)]
    decoding: Decoding,
}

/// Records.
pub fn run(arguments: &Arguments) -> ExitCode {
    if let Some(wrong) = misuse(arguments) {
        say!("fieldtap: {wrong}");
        return ExitCode::from(USAGE);
    }
    let settings = match settings(&arguments.decoding) {
        Ok(settings) => settings,
        Err(error) => {
            say!("fieldtap: {error:#}");
            return ExitCode::from(USAGE);
        }
    };
    // A second Ctrl-C does not wait for a good end.
    interrupt::catch(INTERRUPTED);
    match begin(arguments, settings) {
        Ok(recorder) => Recording::new(recorder, arguments).run(arguments),
        Err(error) => {
            say_error(&error, false);
            ExitCode::from(FAILED)
        }
    }
}

/// What cannot be meant.
fn misuse(arguments: &Arguments) -> Option<String> {
    let Arguments { decoding, sources, triggers, ring, .. } = arguments;
    let chooses = decoding.from.is_some() || decoding.to.is_some() || decoding.count.is_some();
    let is_tap = |name: &String| source::live::is_tap(name);
    let (protocol, medium) = (decoding.protocol.given(), medium_of(&sources[0]));
    if let Some(never) = triggers.iter().find_map(|trigger| trigger.obstacle(protocol, medium)) {
        return Some(format!("--trigger: {never}"));
    }
    let directory = &arguments.directory;
    if directory.exists() && !directory.is_dir() {
        return Some(format!("{}: is a file: -w wants a folder", directory.display()));
    }
    let wrong = if chooses || decoding.fail_on.is_some() {
        "a recording keeps everything: --from, --to, --count and --fail-on are for `read`"
    } else if sources.len() > 1 && sources.iter().any(is_tap) {
        "a recording listens to one live tap: start another one for the other"
    } else if ring.is_some_and(|ring| !ring.ends_files()) && triggers.is_empty() {
        "without size or duration no file of the ring ever ends: --ring files=10,size=100MB"
    } else {
        return None;
    };
    Some(wrong.to_owned())
}

/// What a live tap hears, by its name.
fn medium_of(source: &str) -> Option<Medium> {
    match source.split_once(':')?.0 {
        "serial" => Some(Medium::Serial),
        "can" | "slcan" => Some(Medium::Can),
        _ => None,
    }
}

fn begin(arguments: &Arguments, settings: Settings) -> Result<Recorder, RecordError> {
    let Arguments { decoding, directory, ring, triggers, before, after, sources } = arguments;
    let files = Files::new(directory, ring.unwrap_or_default())?;
    let is_live = sources.iter().any(|name| source::live::is_tap(name));
    let events = (!triggers.is_empty()).then(|| {
        let watch = Watch::begin(triggers.clone(), settings, Clock::new(decoding.time), is_live);
        (watch, Surroundings { before: *before, after: *after })
    });
    Recorder::new(&source_options(decoding), files, events)
}

/// Says why a recording ends, and that what came before is whole, where files are there.
fn say_error(error: &RecordError, is_kept: bool) {
    let kept = if is_kept { ", what came before is whole" } else { "" };
    match error {
        RecordError::Write(error) => say!("fieldtap: {error}; the recording ends here{kept}"),
        RecordError::Unfit(cause) => say!("fieldtap: this cannot be recorded: {cause}"),
    }
}

/// What ended a recording before its time.
enum Ended {
    Source(SourceError),
    Recorder(RecordError),
}

/// A recording that is going on.
struct Recording {
    recorder: Mutex<Recorder>,
    /// What ended it from behind.
    failure: Mutex<Option<RecordError>>,
    is_over: AtomicBool,
    begin: Instant,
    is_quiet: bool,
    /// A trigger waits for parity errors.
    needs_parity: bool,
}

impl Recording {
    fn new(recorder: Recorder, arguments: &Arguments) -> Self {
        Recording {
            recorder: Mutex::new(recorder),
            failure: Mutex::new(None),
            is_over: AtomicBool::new(false),
            begin: Instant::now(),
            is_quiet: arguments.decoding.quiet,
            needs_parity: arguments.triggers.iter().any(|trigger| trigger.needs_parity()),
        }
    }

    /// Whether what is waited for cannot come on this bus.
    fn is_parity_missed(&self, bus: &BusInfo) -> bool {
        self.needs_parity && !self.is_quiet && bus.parity == ParityMarks::None
    }

    fn recorder(&self) -> MutexGuard<'_, Recorder> {
        // Whoever panicked has said so; what was recorded is to be finished.
        self.recorder.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn failure(&self) -> MutexGuard<'_, Option<RecordError>> {
        self.failure.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn run(self, arguments: &Arguments) -> ExitCode {
        let options = source_options(&arguments.decoding);
        let (source_error, failed) = thread::scope(|scope| {
            scope.spawn(|| self.look_after());
            let ended = self.record(&arguments.sources, &options);
            self.is_over.store(true, Ordering::Relaxed);
            ended
        });
        let failed = failed.or_else(|| self.failure().take());
        self.report(source_error, failed)
    }

    /// Passes everything that is heard on to the recorder.
    fn record(
        &self,
        sources: &[String],
        options: &SourceOptions,
    ) -> (Option<SourceError>, Option<RecordError>) {
        for (number, name) in sources.iter().enumerate() {
            if number > 0 {
                self.recorder().begin_source();
            }
            let mut source = match source::open(name, options) {
                Ok(source) => source,
                Err(error) => return (Some(error), None),
            };
            let goes_on = || !interrupt::came() && self.failure().is_none();
            let mut passed = self.pass(&mut *source, goes_on);
            if passed.is_ok() && self.failure().is_none() && source.stop() {
                // What was heard already, and the tap's last words.
                passed = self.pass(&mut *source, || self.failure().is_none());
            }
            match passed {
                Ok(()) => {}
                // What an interruption cuts is not the source's fault.
                Err(Ended::Source(error)) => {
                    return (Some(error).filter(|_| !interrupt::came()), None);
                }
                Err(Ended::Recorder(error)) => return (None, Some(error)),
            }
        }
        (None, None)
    }

    /// Passes what a source says on to the recorder, to its end or for as long as this goes on.
    fn pass(&self, source: &mut dyn Source, goes_on: impl Fn() -> bool) -> Result<(), Ended> {
        while goes_on() {
            let Some(piece) = source.next_piece().map_err(Ended::Source)? else { break };
            match &piece {
                Piece::Warning(warning) if !self.is_quiet => say!("fieldtap: warning: {warning}"),
                Piece::Note(text) if !self.is_quiet => say!("fieldtap: {text}"),
                Piece::Bus(info, _) if self.is_parity_missed(info) => say!(
                    "fieldtap: warning: --trigger slin.parity: the parity of characters is not known \
                     on {}, and no such event will come",
                    info.name
                ),
                _ => {}
            }
            self.recorder().take(&piece).map_err(Ended::Recorder)?;
        }
        Ok(())
    }

    /// Sees to it that nothing waits, not even the user.
    fn look_after(&self) {
        let mut told = Instant::now();
        while !self.is_over.load(Ordering::Relaxed) {
            thread::sleep(TURN);
            if let Err(error) = self.recorder().attend() {
                *self.failure() = Some(error);
                return;
            }
            if told.elapsed() >= TOLD_EACH && !self.is_quiet {
                told = Instant::now();
                say!("{}", self.summary());
            }
        }
    }

    fn summary(&self) -> Summary {
        let lasted = i64::try_from(self.begin.elapsed().as_nanos()).unwrap_or(i64::MAX);
        Summary::of(&self.recorder(), lasted)
    }

    /// Ends the files well, and says what it came to.
    fn report(
        self,
        source_error: Option<SourceError>,
        mut failed: Option<RecordError>,
    ) -> ExitCode {
        let finished = self.recorder().finish();
        let watcher = finished.unwrap_or_else(|error| {
            failed.get_or_insert(error);
            None
        });
        let has_source_failed = source_error.is_some();
        let has_failed = failed.is_some() || source_error.is_some();
        let is_kept = self.recorder().files().are_there();
        failed.iter().for_each(|error| say_error(error, is_kept));
        if let Some(error) = source_error {
            say!("fieldtap: {error}");
        }
        if !self.is_quiet {
            if self.recorder().is_short() {
                say!("fieldtap: warning: --before asks for more than is held in memory (64 MiB)");
            }
            say!("{}", self.summary().behind_failure(has_source_failed));
            let decoded = watcher.and_then(|watcher| watcher.verdict(has_failed));
            let verdict = decoded.unwrap_or_else(|| undecoded(&self.recorder(), has_source_failed));
            for (heading, text) in verdict.lines() {
                say!("{heading:<6} {text}");
            }
        }
        ExitCode::from(if has_failed { FAILED } else { 0 })
    }
}
