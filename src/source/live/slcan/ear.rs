//! What an adapter says, as frames with times.

use super::super::super::outbox::Outbox;
use super::super::super::rows::shown;
use super::super::super::{Place, SourceError};
use super::adapter::{Adapter, Problem, Setting};
use super::clock::{AdapterClock, HostClock};
use super::line::{self, Line};
use super::repeats::Repeats;
use super::search::Search;
use super::split::Saying;
use dissectors::bus::WireFacts;
use dissectors::can::{Direction, Frame};
use dissectors::event::{Clock, Loss, LossCause, Moment};
use dissectors::protocol::Medium;
use dissectors::record::BusInfo;
use dissectors::uart::Baud;
use std::io::{Read, Write};

/// There is but one bus.
const BUS: usize = 0;

/// ± of an adapter's stamp in ns: it counts milliseconds.
const STAMP_NS: u32 = 1_000_000;

/// ± of the time when a line was read, in ns: it takes 2 ms on the port, and the system hands it
/// over some milliseconds later.
const READ_NS: u32 = 10_000_000;

/// How much later than its stamp a line may be read, beyond what the one before was, in ns.
const LATENCY_NS: i64 = 50_000_000;

/// Jumps of an adapter's clock after which its stamps are given up, and how long after the one before
/// one counts, in ns: what jumps each minute is worth less than the time of reading.
const MOST_JUMPS: u32 = 5;
const JUMPS_NS: i64 = 60_000_000_000;

/// Lines that are told of one by one because they are no frames.
const MOST_TOLD: u32 = 20;

/// Listens to an adapter.
pub struct Ear {
    name: String,
    source: String,
    host: HostClock,
    stamps: AdapterClock,
    is_announced: bool,
    /// Lines that are no frames.
    garbled: u32,
    /// The last line was none: what was lost with it was told.
    is_garbled: bool,
    is_stamp_missed: bool,
    has_frames: bool,
    repeats: Repeats,
    /// Jumps of the adapter's clock one soon after the other, and when the last was.
    jumps: u32,
    last_jump: Moment,
}

impl Ear {
    /// Of the bus of this name, and the source as the user named it.
    pub fn new(name: &str, source: &str) -> Self {
        Ear {
            name: name.to_owned(),
            source: source.to_owned(),
            host: HostClock::new(),
            stamps: AdapterClock::default(),
            is_announced: false,
            garbled: 0,
            is_garbled: false,
            is_stamp_missed: false,
            has_frames: false,
            repeats: Repeats::default(),
            jumps: 0,
            last_jump: Moment::UNKNOWN,
        }
    }

    /// The adapter begins anew, and so may its clock.
    pub fn begin(&mut self) {
        self.stamps.forget();
    }

    /// Lets the bus appear, and says how the adapter is set; once.
    pub fn announce(&mut self, setting: &Setting, out: &mut Outbox) {
        if self.is_announced {
            return;
        }
        self.is_announced = true;
        let baud = Baud::new(setting.rate.get());
        let facts = WireFacts { medium: Some(Medium::Can), baud, ..WireFacts::default() };
        let clock = if setting.has_stamps { Clock::Hardware } else { Clock::Read };
        out.bus(BusInfo::new(self.name.clone(), Some(clock)), facts);
        out.note(&format!("{}: {}", self.source, describe(setting)));
    }

    /// Reads once, and says what was heard, or that nothing was.
    ///
    /// # Errors
    /// The port is gone, or the adapter refuses after all to listen only.
    pub fn listen<P: Read + Write>(
        &mut self,
        port: &mut Adapter<P>,
        setting: &Setting,
        out: &mut Outbox,
    ) -> Result<(), Problem> {
        // Taken first: this thread may be kept from going on for any time once it has read.
        let before = self.host.now();
        let heard = port.read(|saying| self.hear(saying, setting, out));
        if heard.is_err() && port.has_begun() {
            // With the rest of this line a frame is gone.
            let start = self.now();
            out.lost(BUS, Loss { start, count: None, cause: LossCause::Capture });
        }
        if heard? {
            return Ok(());
        }
        let until = match self.has_stamps(setting) {
            true => self.stamps.shown(before).plus(-LATENCY_NS),
            // What is read from now on has later times.
            false => before,
        };
        out.silence(BUS, until);
        Ok(())
    }

    /// Whether the adapter's stamps are the times of frames.
    fn has_stamps(&self, setting: &Setting) -> bool {
        setting.has_stamps && self.jumps < MOST_JUMPS
    }

    /// Says where times begin anew, and where that came too often.
    fn tell_jump(&mut self, out: &mut Outbox) {
        let Some(behind) = self.stamps.take_jump() else { return };
        let now = self.host.now();
        let is_soon = now.since(self.last_jump).is_some_and(|ns| ns < JUMPS_NS);
        self.jumps = if is_soon { self.jumps + 1 } else { 1 };
        self.last_jump = now;
        if self.jumps >= MOST_JUMPS {
            self.stamps.forget();
            let what = "the adapter's stamps jump again and again: from here on frames have the \
                        time when they were read, ±10 ms";
            out.warning(SourceError::new(&self.source, Place::Whole, what));
            return;
        }
        let side = if behind > 0 { "behind" } else { "ahead of" };
        out.note(&format!(
            "{}: the adapter's clock was {} ms {side} this host's: times begin anew with the host's",
            self.source,
            behind.unsigned_abs() / 1_000_000
        ));
    }

    /// Reads once, and tells what was heard to who looks for the bit rate.
    ///
    /// # Errors
    /// The port is gone, or the adapter refuses after all to listen only.
    pub fn listen_for_rate<P: Read + Write>(
        &mut self,
        port: &mut Adapter<P>,
        setting: &Setting,
        search: &mut Search,
    ) -> Result<(), Problem> {
        port.read(|saying| match understand(saying) {
            Some(Line::Frame(frame, ms)) => search.hear(self.stamp(frame, ms, setting)),
            Some(Line::Reports(reports)) => {
                reports.frames(self.host.now(), READ_NS).for_each(|frame| search.hear(frame));
            }
            Some(Line::Answer) => {}
            None => search.misread(),
        })?;
        Ok(())
    }

    /// The capture ends.
    pub fn end(&mut self, out: &mut Outbox) {
        self.tell_rest(out);
        if self.is_announced {
            out.end(BUS, self.now());
        }
    }

    /// When something was lost that begins now.
    pub fn now(&self) -> Moment {
        self.stamps.shown(self.host.now())
    }

    fn hear(&mut self, saying: Saying<'_>, setting: &Setting, out: &mut Outbox) {
        let Some(line) = understand(saying) else {
            self.tell_garbled(saying, out);
            return;
        };
        // Of noise, too, some bytes say no more than that something was done, or was not.
        self.is_garbled &= matches!(line, Line::Answer);
        match line {
            Line::Frame(frame, ms) => {
                if setting.has_stamps && ms.is_none() && !self.is_stamp_missed {
                    self.is_stamp_missed = true;
                    let what = "the adapter said it would stamp frames, and does not: those \
                                without a stamp have the time when they were read, ±10 ms";
                    out.warning(SourceError::new(&self.source, Place::Whole, what));
                }
                self.has_frames = true;
                out.frame(BUS, self.stamp(frame, ms, setting));
                self.tell_jump(out);
            }
            Line::Reports(reports) => {
                let at = self.now();
                if self.is_news(saying) {
                    reports.frames(at, READ_NS).for_each(|frame| out.frame(BUS, frame));
                }
            }
            Line::Answer => {}
        }
    }

    /// Whether what the adapter reports is to be told. Each error on the bus (`e`) is; a state only
    /// where it was not told just now.
    fn is_news(&mut self, saying: Saying<'_>) -> bool {
        match saying {
            Saying::Line(line @ [b'F' | b's', ..]) => self.repeats.is_news(line, self.host.now()),
            _ => true,
        }
    }

    /// A frame with its time.
    fn stamp(&mut self, mut frame: Frame, ms: Option<u16>, setting: &Setting) -> Frame {
        let read = self.host.now();
        (frame.start, frame.uncertainty) = match ms.filter(|_| self.has_stamps(setting)) {
            Some(ms) => (self.stamps.at(ms, read), STAMP_NS),
            None => (self.stamps.shown(read), READ_NS),
        };
        // Nothing is sent through an adapter that listens only.
        frame.direction = Some(Direction::Received);
        frame
    }

    /// A line is no frame: one was lost, or some.
    fn tell_garbled(&mut self, saying: Saying<'_>, out: &mut Outbox) {
        if !self.is_garbled {
            self.is_garbled = true;
            let start = self.now();
            out.lost(BUS, Loss { start, count: None, cause: LossCause::Capture });
        }
        self.garbled = self.garbled.saturating_add(1);
        if self.garbled > MOST_TOLD {
            return;
        }
        let line = match saying {
            Saying::Line(line) => shown(line),
            Saying::TooLong => {
                let what = "a line without an end: it sends, but not slcan. Is it the right port, \
                            at the right rate, with firmware that speaks slcan?";
                out.warning(self.left_out(what, 1));
                return;
            }
            Saying::CutRefusal => "a line that BEL cuts".to_owned(),
            Saying::Refusal => return,
        };
        let more = match self.garbled {
            MOST_TOLD => ". More such lines are not told",
            _ => "",
        };
        let what = format!("not a frame: {line}. Bytes are lost on the port{more}");
        out.warning(self.left_out(what, 1));
    }

    fn left_out(&self, what: impl Into<String>, lines: u64) -> SourceError {
        SourceError::new(&self.source, Place::Whole, what).leaving_out(lines)
    }

    /// Says of how much nothing was said one by one.
    pub fn tell_rest(&mut self, out: &mut Outbox) {
        if let more @ 1.. = self.repeats.take_left_out() {
            let what =
                "lines about the adapter's own state are not told: they came again and again";
            out.note(&format!("{}: {more} {what}", self.source));
        }
        let garbled = u64::from(std::mem::take(&mut self.garbled));
        if let more @ 1.. = garbled.saturating_sub(MOST_TOLD.into()) {
            let advice = match self.has_frames {
                true => "bytes are lost on the port",
                false => {
                    "it sends, but not slcan: is it the right port, at the right rate, with \
                     firmware that speaks slcan?"
                }
            };
            out.warning(self.left_out(format!("{more} more lines are no frames: {advice}"), more));
        }
    }
}

/// What the adapter means; `None` for what is no line.
fn understand(saying: Saying<'_>) -> Option<Line> {
    match saying {
        Saying::Line(line) => line::parse(line),
        // Nothing was asked.
        Saying::Refusal => Some(Line::Answer),
        Saying::TooLong | Saying::CutRefusal => None,
    }
}

/// How an adapter is set, for people.
fn describe(setting: &Setting) -> String {
    let name = if setting.name.is_empty() { "of no name" } else { &setting.name };
    let mode = match setting.is_confirmed {
        true => "listen-only",
        false => "told to listen only, which it does not confirm",
    };
    let times = match setting.has_stamps {
        true => "its own time stamps ±1 ms",
        false => "times of reading ±10 ms",
    };
    format!("adapter {name}, {mode}, {} bit/s, {times}", setting.rate.get())
}

#[cfg(test)]
mod tests;
