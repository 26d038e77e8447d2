//! Logs of Vector's programs (ASC), and those of others that write them: BUSMASTER, python-can,
//! can-utils.
//!
//! A header tells the date, the base of numbers and whether stamps count from the start or from
//! the line before; trigger blocks have dates of their own. Then a line an event:
//! `0.001000 1 42C Rx d 5 01 0E 01 01 01 Length = 184000 BitCount = 95 ID = 1068`.

use super::super::numbers::seconds;
use super::date::written_out;
use super::hex::{Bytes, decimal, digit, identifier, number, words};
use super::log::{Grammar, Name, Said};
use super::report::{Kind, Report, State};
use dissectors::can::{Direction, FdFlags, Frame, FrameKind, Identifier, MAX_CLASSIC_DATA};
use dissectors::event::Moment;
use std::iter::Peekable;

// Flags of a CANFD line.
const REMOTE: u32 = 0x10;
const FD: u32 = 0x1000;

/// Lines of a log.
pub struct Asc {
    base: Base,
    is_relative: bool,
    /// When stamps begin, in ns: of the trigger block, else of the file.
    start_ns: i64,
    /// The time of the line before, in ns since then.
    now: i64,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Base {
    Hex,
    Dec,
}

impl Base {
    fn number(self, word: &[u8]) -> Option<u32> {
        match self {
            Base::Hex => number(word),
            Base::Dec => decimal(word),
        }
    }

    fn byte(self, word: &[u8]) -> Option<u8> {
        self.number(word).and_then(|value| u8::try_from(value).ok())
    }
}

/// Whether a source begins with the header of this format.
pub fn is_header(head: &[u8]) -> bool {
    let mut lines = head.split(|byte| *byte == b'\n').map(<[u8]>::trim_ascii);
    let is_header = |line: &[u8]| line.starts_with(b"date ") || line.starts_with(b"base ");
    let first = lines.find(|line| !line.is_empty() && !line.starts_with(b"//"));
    first.is_some_and(is_header) && head.windows(5).any(|part| part == b"base ")
}

/// One moment of a log.
#[derive(Clone, Copy)]
struct At {
    time: Moment,
    uncertainty: u32,
}

impl Asc {
    /// Nothing was read yet.
    pub fn new() -> Self {
        Asc { base: Base::Hex, is_relative: false, start_ns: 0, now: 0 }
    }

    /// Reads a line that is no event; false if it is one.
    fn header(&mut self, line: &[u8]) -> bool {
        let lower = line.to_ascii_lowercase();
        if let Some(date) = lower.strip_prefix(b"date ") {
            self.begin(date);
        } else if let Some(date) = lower.strip_prefix(b"begin triggerblock") {
            self.begin(date);
        } else if let Some(base) = lower.strip_prefix(b"base ") {
            let mut words = words(base);
            self.base = if words.next() == Some(b"dec") { Base::Dec } else { Base::Hex };
            self.is_relative = words.any(|word| word == b"relative");
        } else {
            let is_known = lower.is_empty()
                || lower.starts_with(b"//")
                || lower.starts_with(b"end triggerblock")
                || lower.ends_with(b"internal events logged");
            return is_known;
        }
        true
    }

    fn begin(&mut self, date: &[u8]) {
        if let Some(start) = written_out(date).and_then(Moment::ns) {
            self.start_ns = start;
        }
        self.now = 0;
    }

    /// The time of a line, which every event moves on.
    fn at(&mut self, word: &[u8]) -> Option<At> {
        let ([], stamp) = seconds(word).ok()? else { return None };
        let ns = stamp.time.ns()?;
        self.now = if self.is_relative { self.now.saturating_add(ns) } else { ns };
        let time = Moment::from_ns(self.start_ns.saturating_add(self.now));
        Some(At { time, uncertainty: stamp.resolution })
    }

    fn event<'a, I: Iterator<Item = &'a [u8]> + Clone>(
        &self,
        at: At,
        mut words: Peekable<I>,
        line: &'a [u8],
    ) -> Said<'a> {
        let Some(first) = words.next() else { return Said::Nothing };
        if first == b"CANFD" {
            return self.fd(at, words);
        }
        if first == b"CAN" {
            let Some(channel) = words.next().and_then(decimal) else { return Said::Foreign };
            return status(Name::Number(channel), at, line);
        }
        let Some(channel) = decimal(first) else { return Said::Foreign };
        let name = Name::Number(channel);
        match words.next() {
            Some(b"ErrorFrame") => Said::Frame(name, error(words).frame(at.time, at.uncertainty)),
            Some(b"OverloadFrame") => {
                Said::Frame(name, Report::of_overload().frame(at.time, at.uncertainty))
            }
            Some(b"Statistic:") => Said::Remark(name, at.time, line),
            Some(id) => match self.id(id) {
                Some(id) => self.classic(name, id, at, words),
                None => Said::Foreign,
            },
            None => Said::Foreign,
        }
    }

    /// An `x` behind it tells 29 bits from 11.
    fn id(&self, word: &[u8]) -> Option<Identifier> {
        match word.strip_suffix(b"x") {
            Some(word) => identifier(self.base.number(word)?, true),
            None => identifier(self.base.number(word)?, false),
        }
    }

    fn classic<'a, I: Iterator<Item = &'a [u8]> + Clone>(
        &self,
        name: Name<'a>,
        id: Identifier,
        at: At,
        mut words: Peekable<I>,
    ) -> Said<'a> {
        let direction = match words.next() {
            Some(b"Rx") => Direction::Received,
            Some(b"Tx") => Direction::Sent,
            // Only asked for; it is told again once it is sent.
            Some(b"TxRq") => return Said::Nothing,
            _ => return Said::Foreign,
        };
        let kind = match words.next() {
            Some(b"d") => FrameKind::Data,
            Some(b"r") => FrameKind::Remote,
            _ => return Said::Bad("neither d for data nor r for a remote frame"),
        };
        // Hex in either base. Remote frames of old versions have none.
        let dlc = match words.peek().copied() {
            Some([one]) => digit(*one),
            _ => None,
        };
        let Some(dlc) = dlc.or((kind == FrameKind::Remote).then_some(0)) else {
            return Said::Bad("no data length code");
        };
        let frame = Frame::new(at.time, at.uncertainty, kind, id, dlc);
        let mut frame = match kind {
            FrameKind::Remote => frame,
            _ => {
                words.next();
                let count = usize::from(dlc).min(MAX_CLASSIC_DATA);
                frame.with(self.data(&mut words, count).as_slice())
            }
        };
        frame.direction = Some(direction);
        frame.measured_bits = value_of(words, b"BitCount").and_then(|bits| bits.try_into().ok());
        Said::Frame(name, frame)
    }

    /// `CANFD channel direction identifier [name] brs esi dlc length data… duration bits flags …`,
    /// which also has classic frames.
    fn fd<'a, I: Iterator<Item = &'a [u8]> + Clone>(
        &self,
        at: At,
        mut words: Peekable<I>,
    ) -> Said<'a> {
        let Some(channel) = words.next().and_then(decimal) else { return Said::Foreign };
        let name = Name::Number(channel);
        let direction = match words.next() {
            Some(b"Rx") => Direction::Received,
            Some(b"Tx") => Direction::Sent,
            _ => return Said::Nothing,
        };
        let Some(id) = words.next() else { return Said::Foreign };
        if id == b"ErrorFrame" {
            return Said::Frame(name, error(words).frame(at.time, at.uncertainty));
        }
        let Some(id) = self.id(id) else { return Said::Foreign };
        if !matches!(words.peek(), Some([b'0' | b'1'])) {
            words.next();
        }
        let (brs, esi) = (words.next() == Some(b"1"), words.next() == Some(b"1"));
        let dlc = words.next().and_then(number);
        let Some((dlc, length)) = dlc.zip(words.next().and_then(decimal)) else {
            return Said::Bad("no data length");
        };
        let (Ok(dlc), Ok(length @ ..=64)) = (u8::try_from(dlc), u8::try_from(length)) else {
            return Said::Bad("more data than a frame has");
        };
        let data = self.data(&mut words, usize::from(length));
        let flags = words.nth(2).and_then(number);
        let is_fd = flags.is_none_or(|flags| flags & FD != 0);
        let kind = match flags {
            _ if is_fd => FrameKind::Fd,
            Some(flags) if flags & REMOTE != 0 => FrameKind::Remote,
            _ => FrameKind::Data,
        };
        let dlc = if is_fd { length } else { dlc.min(15) };
        let frame = Frame::new(at.time, at.uncertainty, kind, id, dlc);
        let there = data.as_slice();
        let mut frame = match kind {
            FrameKind::Fd => frame.with(there),
            FrameKind::Remote => frame,
            _ => frame.with(&there[..there.len().min(MAX_CLASSIC_DATA)]),
        };
        if is_fd {
            frame.fd_flags = FdFlags { has_rate_switch: brs, is_error_passive: esi };
            let is_cut = there.len() < usize::from(length);
            frame.original_length = is_cut.then_some(length.into());
        }
        frame.direction = Some(direction);
        Said::Frame(name, frame)
    }

    /// As many bytes as there should be, or those that there are.
    fn data<'a, I: Iterator<Item = &'a [u8]> + Clone>(
        &self,
        words: &mut Peekable<I>,
        count: usize,
    ) -> Bytes {
        let mut bytes = Bytes::new();
        while bytes.as_slice().len() < count {
            let Some(byte) = words.peek().and_then(|word| self.base.byte(word)) else { break };
            if !bytes.push(byte) {
                break;
            }
            words.next();
        }
        bytes
    }
}

impl Grammar for Asc {
    const NAME: &'static str = "ASC";

    fn read<'a>(&mut self, line: &'a [u8]) -> Said<'a> {
        let line = line.trim_ascii();
        if self.header(line) {
            return Said::Nothing;
        }
        let mut words = words(line).peekable();
        let at = words.next().and_then(|word| self.at(word));
        match at {
            Some(at) => self.event(at, words, line),
            None => Said::Foreign,
        }
    }
}

/// `KEY = 123` among the words.
fn value_of<'a>(mut words: impl Iterator<Item = &'a [u8]>, key: &[u8]) -> Option<u32> {
    words.find(|word| *word == key)?;
    words.nth(1).and_then(decimal)
}

/// `ErrorFrame` alone, with the capture code of an SJA1000 (`ECC: 10100010`), or with more.
fn error<'a>(words: impl Iterator<Item = &'a [u8]> + Clone) -> Report {
    let value = |key: &[u8], skip: usize| {
        let mut words = words.clone();
        words.find(|word| *word == key)?;
        words.nth(skip)
    };
    let extended = value(b"CodeExt", 1).and_then(|word| word.strip_prefix(b"0x")).and_then(number);
    if let Some(code) = extended {
        // Five bits of place, one of direction, six of kind.
        let kind = match code >> 6 & 0x3F {
            0 => Kind::Bit,
            1 => Kind::Form,
            2 => Kind::Stuff,
            4 => Kind::Crc,
            5 => Kind::Acknowledge,
            _ => Kind::Other,
        };
        return Report::of_kind(kind, (code & 0x1F) as u8, code & 0x20 == 0);
    }
    let bits = value(b"ECC:", 0).filter(|bits| bits.len() == 8);
    let code = bits.and_then(|bits| {
        bits.iter().try_fold(0, |code, bit| match bit {
            b'0' | b'1' => Some(code << 1 | (bit - b'0')),
            _ => None,
        })
    });
    code.map_or(Report::of_error(), Report::of_capture_code)
}

/// `CAN 1 Status:chip status error passive - TxErr: 132 RxErr: 0`.
fn status<'a>(name: Name<'a>, at: At, line: &'a [u8]) -> Said<'a> {
    let has = |text: &[u8]| line.windows(text.len()).any(|part| part == text);
    let state = match () {
        () if has(b"error active") => State::Active,
        () if has(b"warning") => State::Warning,
        () if has(b"error passive") => State::Passive,
        () if has(b"busoff") || has(b"bus off") => State::Off,
        () => return Said::Remark(name, at.time, line),
    };
    let counter = |key: &[u8]| {
        let mut words = words(line);
        words.find(|word| *word == key)?;
        words.next().and_then(decimal)
    };
    let mut report = Report::of_state(state);
    if let (Some(sent), Some(received)) = (counter(b"TxErr:"), counter(b"RxErr:")) {
        report = report.counting(sent.min(255) as u8, received.min(255) as u8);
    }
    Said::Frame(name, report.frame(at.time, at.uncertainty))
}
