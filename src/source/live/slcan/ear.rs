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
mod tests {
    use super::super::super::super::Piece;
    use super::super::adapter::Rate;
    use super::*;
    use dissectors::event::Event;
    use std::io;
    use std::time::Duration;

    /// What is said of these bytes of an adapter, a word a piece.
    fn hear(bytes: &[u8], has_stamps: bool) -> Vec<String> {
        struct Port<'a>(&'a [u8]);
        impl Read for Port<'_> {
            fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
                match self.0.read(buffer) {
                    Ok(0) => Err(io::ErrorKind::TimedOut.into()),
                    other => other,
                }
            }
        }
        impl Write for Port<'_> {
            fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
                Ok(bytes.len())
            }
            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        let rate = Rate::new(500_000).expect("adapters have it");
        let setting = Setting { name: String::new(), rate, has_stamps, is_confirmed: true };
        let (mut ear, mut out) = (Ear::new("tty", "slcan:tty"), Outbox::default());
        let mut port = Adapter::new(Port(bytes));
        ear.announce(&setting, &mut out);
        ear.listen(&mut port, &setting, &mut out).expect("the port is there");
        ear.listen(&mut port, &setting, &mut out).expect("the port is there");
        ear.end(&mut out);
        let mut said = Vec::new();
        let mut first = None;
        while let Some(piece) = out.next() {
            match piece.expect("it goes on") {
                Piece::Bus(info, facts) => {
                    let clock = info.clock.map(Clock::name);
                    said.push(format!("{} {clock:?} {:?}", info.name, facts.baud.map(Baud::get)));
                }
                Piece::Heard(_, Event::Frames(frames)) => {
                    for frame in frames {
                        let begin = *first.get_or_insert(frame.start);
                        let ms = frame.start.since(begin).expect("times are known") / 1_000_000;
                        said.push(format!("{:X} +{ms}", frame.id.value()));
                    }
                }
                Piece::Heard(_, Event::Lost(loss)) => said.push(format!("lost {:?}", loss.count)),
                Piece::Heard(_, Event::Advance(_)) => said.push("silence".to_owned()),
                Piece::Warning(warning) => said.push(warning.to_string()),
                Piece::Note(note) => said.push(note.to_owned()),
                Piece::End(..) => {}
                _ => panic!("nothing else is said"),
            }
        }
        said
    }

    #[test]
    fn frames_have_the_adapters_times() {
        let said = hear(b"t1230EA5A\rt45600003\rT000001230000D\r", true);
        let note = "slcan:tty: adapter of no name, listen-only, 500000 bit/s, its own time stamps \
                    ±1 ms";
        let frames = ["123 +0", "456 +9", "123 +19", "silence"];
        assert_eq!(said[..2], ["tty Some(\"hardware\") Some(500000)", note]);
        assert_eq!(said[2..], frames);
    }

    /// A thread that waits for the processor after a read that found nothing.
    #[test]
    fn silence_is_said_of_what_was_waited_for_and_not_of_what_came_since() {
        /// A frame, then nothing for long, then one that came 60 ms after the first.
        struct Held(u32);
        impl Read for Held {
            fn read(&mut self, mut buffer: &mut [u8]) -> io::Result<usize> {
                self.0 += 1;
                match self.0 {
                    1 => buffer.write(b"t12300000\r"),
                    2 => {
                        std::thread::sleep(Duration::from_millis(150));
                        Err(io::ErrorKind::TimedOut.into())
                    }
                    _ => buffer.write(b"t4560003C\r"),
                }
            }
        }
        impl Write for Held {
            fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
                Ok(bytes.len())
            }
            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        let rate = Rate::new(500_000).expect("adapters have it");
        let setting = Setting { name: String::new(), rate, has_stamps: true, is_confirmed: true };
        let (mut ear, mut out) = (Ear::new("tty", "slcan:tty"), Outbox::default());
        let mut port = Adapter::new(Held(0));
        for _ in 0..3 {
            ear.listen(&mut port, &setting, &mut out).expect("the port is there");
        }
        let (mut silent_until, mut starts) = (Moment::UNKNOWN, Vec::new());
        while let Some(piece) = out.next() {
            match piece.expect("it goes on") {
                Piece::Heard(_, Event::Frames(frames)) => {
                    starts.extend(frames.iter().map(|f| f.start))
                }
                Piece::Heard(_, Event::Advance(until)) => silent_until = until,
                _ => panic!("nothing else is said"),
            }
        }
        assert_eq!(starts[1].since(starts[0]), Some(60_000_000));
        assert!(starts[1].is_after(silent_until), "{starts:?} {silent_until:?}");
    }

    /// Which ± holds instead of the one that was told is told.
    #[test]
    fn an_adapter_that_does_not_stamp_after_all_is_told_once_with_what_holds() {
        let said = hear(b"t1230\rt4560\r", true);
        assert!(said[1].ends_with("its own time stamps ±1 ms"), "{said:?}");
        let told = |line: &&String| line.ends_with("the time when they were read, ±10 ms");
        assert_eq!(said.iter().filter(told).count(), 1, "{said:?}");
    }

    /// Nothing can be read a second before it was heard.
    #[test]
    fn a_clock_that_cannot_be_right_begins_anew_with_a_note() {
        let said = hear(b"t12300000\rt456003E8\r", true);
        let begins = "slcan:tty: the adapter's clock was 99";
        let ends = " ms ahead of this host's: times begin anew with the host's";
        assert!(said[4].starts_with(begins) && said[4].ends_with(ends), "{said:?}");
        assert_eq!((said[2].as_str(), said.len()), ("123 +0", 6));
    }

    /// 20 s ahead and 20 s back, again and again.
    #[test]
    fn stamps_that_jump_are_given_up_with_a_warning() {
        let said = hear(&b"t12300000\rt45604E20\r".repeat(50), true);
        let count = |what: &str| said.iter().filter(|said| said.contains(what)).count();
        assert_eq!(count("times begin anew"), MOST_JUMPS as usize - 1, "{said:?}");
        assert_eq!(count("jump again and again"), 1, "{said:?}");
        let frames = said.iter().filter(|said| said.contains(" +"));
        let is_near = |said: &String| said.ends_with(" +0") || said.ends_with(" +1");
        assert_eq!((frames.clone().count(), frames.clone().all(is_near)), (100, true), "{said:?}");
    }

    #[test]
    fn without_stamps_the_time_of_reading_is_taken() {
        let said = hear(b"t1230\rt4560\r", false);
        assert_eq!(said[0], "tty Some(\"read\") Some(500000)");
        assert_eq!(said[2..], ["123 +0", "456 +0", "silence"]);
        // One that promised stamps is told once.
        let said = hear(b"t1230\rt4560\r", true);
        assert!(said[2].contains("does not"), "{said:?}");
        assert_eq!(said[3..], ["123 +0", "456 +0", "silence"]);
    }

    #[test]
    fn garbage_is_a_warning_and_one_loss_until_a_good_line_comes() {
        let said = hear(b"t1230\rt12\x80\rgarbage\rt4560\rt4561\r\r\x07", false);
        let told =
            |line: &str| format!("slcan:tty: not a frame: {line}. Bytes are lost on the port");
        assert_eq!(said[2..4], ["123 +0", "lost None"]);
        assert!(said[4].starts_with("slcan:tty: not a frame: "), "{said:?}");
        assert_eq!(said[5], told(&shown(b"garbage")));
        assert_eq!(said[6..8], ["456 +0", "lost None"]);
        assert_eq!(said[8], told(&shown(b"t4561")));
        assert_eq!(said[9..], ["silence"]);
    }

    #[test]
    fn one_that_never_ends_a_line_is_told_once_and_something_is_lost() {
        let said = hear(&[b'x'; 4000], false);
        assert_eq!((said[2].as_str(), said.len()), ("lost None", 5));
        assert!(said[3].contains("it sends, but not slcan"), "{said:?}");
    }

    /// FFFh is an overrun, error passive and a bus error: three error frames.
    #[test]
    fn a_flood_of_states_is_told_once_and_counted() {
        let said = hear(&b"F00\rFFF\r".repeat(400), false);
        let [errors @ .., silence, note] = &said[2..] else { panic!("{said:?}") };
        assert_eq!((errors.len(), silence.as_str()), (3, "silence"), "{said:?}");
        assert!(note.contains(": 798 lines about the adapter's own state"), "{said:?}");
        let said = hear(&b"e1s\r".repeat(400), false);
        assert_eq!(said.len(), 2 + 400 + 1, "each is an error on the bus");
    }

    #[test]
    fn a_line_that_is_cut_is_a_loss() {
        let said = hear(b"t1230\rt45\x07t4560\r", false);
        assert_eq!(said[2..4], ["123 +0", "lost None"]);
        assert!(said[4].contains("a line that BEL cuts"), "{said:?}");
        assert_eq!(said[5..], ["456 +0", "silence"]);
    }

    #[test]
    fn what_was_begun_when_the_adapter_is_unplugged_is_a_loss() {
        struct Unplugged(&'static [u8]);
        impl Read for Unplugged {
            fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
                self.0.read(buffer)
            }
        }
        impl Write for Unplugged {
            fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
                Ok(bytes.len())
            }
            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        let rate = Rate::new(500_000).expect("adapters have it");
        let setting = Setting { name: String::new(), rate, has_stamps: true, is_confirmed: true };
        for (told, losses) in [(&b"t12381122"[..], 1), (b"t1230\r", 0)] {
            let (mut ear, mut out) = (Ear::new("tty", "slcan:tty"), Outbox::default());
            let mut port = Adapter::new(Unplugged(told));
            ear.listen(&mut port, &setting, &mut out).expect("there is something");
            ear.listen(&mut port, &setting, &mut out).expect_err("it is gone");
            let mut lost = 0;
            while let Some(piece) = out.next() {
                lost += i32::from(matches!(piece, Ok(Piece::Heard(_, Event::Lost(_)))));
            }
            assert_eq!(lost, losses, "{told:?}");
        }
    }

    #[test]
    fn garbage_without_end_is_not_told_without_end() {
        // Noise has refusals among it, and empty lines.
        let said = hear(&b"x\r\x07\r".repeat(1000), false);
        // The bus, how it is set, the loss, the lines, the silence, what the end says.
        assert_eq!(said.len(), 3 + MOST_TOLD as usize + 2);
        assert!(said[2 + MOST_TOLD as usize].ends_with("More such lines are not told"));
        assert!(
            said[4 + MOST_TOLD as usize].contains("980 more lines are no frames: it sends, but")
        );
    }
}
