//! A capture for Wireshark: a source decoded into its pipe, our sentences and findings as comments.

use super::control::Log;
use super::fifo::Fifo;
use super::{Call, tap};
use crate::cli::Decoding;
use crate::decode::{FAILED, USAGE, decode, settings};
use crate::export::{Export, PcapNg};
use crate::interrupt;
use crate::say;
use anyhow::anyhow;
use clap::Parser;
use dissectors::event::Moment;
use dissectors::record::{BusInfo, Record, Sink};
use std::io::{self, BufWriter};
use std::process::ExitCode;

/// Options of the decoder that Wireshark can set, with a value and without.
const VALUES: [&str; 5] = ["--protocol", "--baud", "--profile", "--bitrate", "--stations"];
const SWITCHES: [&str; 2] = ["--allow-active", "--reconnect"];

/// Captures until Wireshark stops it, or the source ends. Standard error is for errors alone:
/// Wireshark shows what is there.
pub fn capture(call: &Call) -> ExitCode {
    let Some(path) = call.fifo() else {
        say!("fieldtap: --capture needs --fifo, the pipe to write to");
        return ExitCode::from(USAGE);
    };
    // Before anything can fail: who is never opened is waited for without an end.
    let fifo = match Fifo::open(path) {
        Ok(fifo) => fifo,
        Err(error) => {
            say!("fieldtap: {}: cannot be written: {error}", path.display());
            return ExitCode::from(FAILED);
        }
    };
    // The pipe is closed behind the message: who sees its end looks no further.
    match capture_into(call, &fifo) {
        Ok(code) => code,
        Err(error) => {
            say!("fieldtap: {error:#}");
            ExitCode::from(FAILED)
        }
    }
}

fn capture_into(call: &Call, fifo: &Fifo) -> anyhow::Result<ExitCode> {
    interrupt::catch_closed_pipe();
    let source = tap::source(call).map_err(|error| anyhow!(error))?;
    let decoding = decoding(call)?;
    let settings = settings(&decoding)?;
    let log = call.controls().map(|(from, to)| Log::begin(from, to));
    let mut live = Live {
        pipe: fifo.again()?,
        packets: PcapNg::new(BufWriter::new(fifo.again()?))?,
        log,
        untold: Vec::new(),
    };
    live.say(format!("listening to {source}"));
    live.flush()?;
    let outcome = decode(&decoding, &[source], settings, &mut live);
    if !outcome.is_unopened() {
        outcome.conclusions().for_each(|line| live.say(line));
        let verdict = outcome.verdict();
        verdict.lines().iter().for_each(|(heading, text)| live.say(format!("{heading:<6} {text}")));
    }
    if let Some(log) = live.log.take() {
        log.end();
    }
    outcome.report();
    Ok(if outcome.has_failed() { ExitCode::from(FAILED) } else { ExitCode::SUCCESS })
}

/// The decoder's options, as the command line would have them.
#[derive(Parser)]
#[command(name = "fieldtap", no_binary_name = true)]
struct Chosen {
    #[command(flatten)]
    decoding: Decoding,
}

fn decoding(call: &Call) -> anyhow::Result<Decoding> {
    let values = VALUES.iter().filter_map(|name| Some(format!("{name}={}", call.value(name)?)));
    let switches = SWITCHES.iter().filter(|name| call.is_on(name)).map(|name| (*name).to_owned());
    let arguments = values.chain(switches).chain(["--quiet".to_owned()]);
    // The message alone: how the command line is to be used is nothing to Wireshark's user.
    let first_line = |error: clap::Error| {
        let text = error.to_string();
        let line = text.lines().next().unwrap_or_default();
        anyhow!(line.trim_start_matches("error: ").to_owned())
    };
    Ok(Chosen::try_parse_from(arguments).map_err(first_line)?.decoding)
}

/// Packets as they come.
struct Live {
    packets: PcapNg<BufWriter<Fifo>>,
    /// The same pipe, to be watched.
    pipe: Fifo,
    log: Option<Log>,
    /// What no log took, for the next packet.
    untold: Vec<String>,
}

/// Lines that may wait for a packet.
const MOST_UNTOLD: usize = 16;

impl Live {
    fn say(&self, line: String) {
        if let Some(log) = &self.log {
            log.say(line);
        }
    }
}

impl Sink for Live {
    fn record(&mut self, record: &Record<'_>) {
        for line in self.untold.drain(..) {
            self.packets.comment(record.bus, record.start, &line);
        }
        self.packets.record(record);
    }
}

impl Export for Live {
    fn comment(&mut self, bus: &BusInfo, time: Moment, text: &str) {
        self.packets.comment(bus, time, text);
    }

    fn note(&mut self, line: &str) {
        if self.log.is_some() {
            self.say(line.to_owned());
        } else if self.untold.len() < MOST_UNTOLD {
            self.untold.push(line.to_owned());
        }
    }

    fn end(&mut self, bus: &BusInfo, end: Moment) {
        self.packets.end(bus, end);
    }

    /// Asked between pieces of the source: what came is shown at once, and whether somebody still
    /// looks is found out even where nothing comes.
    fn status(&mut self) -> io::Result<()> {
        self.packets.status()?;
        self.packets.flush()?;
        self.pipe.check()
    }

    fn flush(&mut self) -> io::Result<()> {
        self.packets.flush()
    }
}
