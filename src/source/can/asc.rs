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
use std::ops::RangeInclusive;

// Flags of a CANFD line.
const REMOTE: u32 = 0x10;
const FD: u32 = 0x1000;

/// Bits of a frame with the intermission, from 47 without stuffing to 160, and some for how writers
/// count: what is beyond was not measured. Some write 0.
const POSSIBLE_BITS: RangeInclusive<u16> = 44..=164;

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
        match first {
            // Start of measurement.
            b"Start" => return Said::Nothing,
            b"CANFD" => return self.fd(at, words),
            b"CAN" => {
                let Some(channel) = words.next().and_then(decimal) else { return Said::Foreign };
                return status(Name::Number(channel), at, line);
            }
            _ => {}
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
        frame.measured_bits = value_of(words, b"BitCount")
            .and_then(|bits| bits.try_into().ok())
            .filter(|bits| POSSIBLE_BITS.contains(bits));
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

#[cfg(test)]
mod tests {
    use super::super::super::damage::survive;
    use super::super::super::transcript::transcript;
    use super::super::super::{InputFormat, SourceOptions};

    const HEADER: &str = "date Sam Sep 30 15:06:13.191 2017\nbase hex  timestamps absolute\n\
                          internal events logged\n// version 9.0.0\n";

    fn read(text: &str) -> Vec<String> {
        transcript(InputFormat::Asc, text.as_bytes(), &SourceOptions::default())
    }

    /// What is said of lines on channel 1, without their times.
    fn lines(header: &str, lines: &[&str]) -> Vec<String> {
        let said = read(&format!("{header}{}\n", lines.join("\n")));
        assert_eq!(said[0], "bus can1 log", "{said:?}");
        let said = said[1..].join(", ");
        said.split(", ")
            .map(|frame| frame.trim_start_matches("0: ").split(" @").next().unwrap().to_owned())
            .collect()
    }

    #[test]
    fn frames_of_either_kind() {
        let said = lines(
            HEADER,
            &[
                "   0.000000 Start of measurement",
                "   1.000100 1  42C             Rx   d 5 01 0E 01 01 01  Length = 184000 BitCount = \
                 95 ID = 1068",
                "   1.000200 1  18EBFF00x       Tx   d 2 AA bb",
                "   1.000300 1  123             Rx   r",
                "   1.000300 1  123             Rx   r 4",
                "   1.000300 1  123             Rx   r Length = 0 BitCount = 0",
                "   1.000300 1  123             Rx   d C 01 02 03 04 05 06 07 08",
                "   1.000300 1  123             TxRq d 1 01",
                "   1.000300 1  123             Rx   d 4 01 02",
            ],
        );
        assert_eq!(
            said,
            [
                "42C#010E010101 R",
                "18EBFF00#AABB T",
                "123#R0 R",
                "123#R4 R",
                "123#R0 R",
                "123#0102030405060708 dlc 12 R",
                "123#0102 dlc 4 R",
            ]
        );
    }

    /// The header's date is 1506783973.191 s after the epoch (`date -d`).
    #[test]
    fn stamps_count_from_the_date_or_from_the_line_before() {
        let frames = "   1.000100 1  123 Rx d 0\n   1.0002 1  Statistic: D 1 R 0 XD 0 XR 0 E 0 O 0 B \
                      0.04%\n   2.5 1  123 Rx d 0\n";
        assert_eq!(
            read(&format!("{HEADER}{frames}")),
            [
                "bus can1 log",
                "0: 123# R @1506783974191100000±1000",
                "0: comment @1506783974191200000 \"1.0002 1  Statistic: D 1 R 0 XD 0 XR 0 E 0 O 0 B \
                 0.04%\"",
                "0: 123# R @1506783975691000000±100000000",
            ]
        );
        let relative = HEADER.replace("absolute", "relative");
        assert_eq!(
            read(&format!("{relative}{frames}"))[3],
            "0: 123# R @1506783977691300000±100000000"
        );
        // A trigger block has a date of its own, an hour later.
        let block = "Begin Triggerblock Sam Sep 30 04:06:13.191 pm 2017\n   1.0 1 123 Rx d 0\nEnd \
                     TriggerBlock\n";
        assert_eq!(
            read(&format!("{HEADER}{block}{block}"))[1],
            "0: 123# R @1506787574191000000±100000000, 123# R @1506787574191000000±100000000"
        );
    }

    #[test]
    fn numbers_may_be_decimal_but_not_the_dlc() {
        let header = HEADER.replace("hex", "dec");
        let lines =
            lines(&header, &["1.0 1 1068 Rx d A 1 14 255 0 0 0 0 8", "1.0 1 418119424x Rx d 1 16"]);
        assert_eq!(lines, ["42C#010EFF0000000008 dlc 10 R", "18EBFF00#10 R"]);
    }

    /// BUSMASTER says nothing of stamps, and its first frame follows the header at once.
    #[test]
    fn busmaster_writes_a_shorter_header() {
        let header = "date 30 Sep 2017\nbase hex  no internal events logged\n";
        assert_eq!(lines(header, &["0.0047 1 124             Rx d 1 FF "]), ["124#FF R"]);
    }

    #[test]
    fn canfd_lines_carry_classic_frames_too() {
        let said = lines(
            HEADER,
            &[
                "1.0 CANFD   1 Rx        123  1 0 9 12 00 01 02 03 04 05 06 07 08 09 0a 0b   130000  \
                 130 303000 0 0 0 0 0",
                "1.0 CANFD   1 Tx        123  EngineName 0 0 2  2 00 01   130000  130 0 0 0",
                "1.0 CANFD   1 Rx   18EBFF00x  0 0 4  0    130000  130 10 0 0",
                "1.0 CANFD   1 Rx   ErrorFrame   Not Acknowledge error, dominant error flag",
            ],
        );
        assert_eq!(
            said,
            [
                "123##000102030405060708090A0B R",
                "123#0001 T",
                "18EBFF00#R4 R",
                "error 80#0000000000000000"
            ]
        );
    }

    #[test]
    fn errors_and_states_of_the_controller() {
        let said = lines(
            HEADER,
            &[
                "1.0 1  ErrorFrame",
                // 10: stuff; 1: receiving; 00010: identifier bits 28 to 21 (SJA1000).
                "1.0 1  ErrorFrame\tECC: 10100010",
                "1.0 1  ErrorFrame Flags = 0xe CodeExt = 0x2122 Code = 0x82 ID = 0 DLC = 0 Position = \
                 5 Length = 11300",
                "1.0 1  OverloadFrame",
                "1.0 CAN 1 Status:chip status error passive - TxErr: 132 RxErr: 0",
                "1.0 CAN 1 Status:chip status warning level - TxErr: 96 RxErr: 97",
                "1.0 CAN 1 Status:chip status busoff",
                "1.0 CAN 1 Status:chip status error active",
            ],
        );
        assert_eq!(
            said,
            [
                "error 80#0000000000000000",
                "error 88#0000040200000000",
                // Kind 4: the checksum, which is at place 8.
                "error 88#0000000800000000",
                "error 8#0000200000000000",
                "error 204#0030000000008400",
                "error 204#000C000000006061",
                "error 40#0000000000000000",
                "error 4#0040000000000000",
            ]
        );
    }

    #[test]
    fn other_events_are_left_out_and_counted() {
        let said = read(&format!(
            "{HEADER}1.0 1 J1939TP FEE3p 6 0 0 - Rx d 23 A0\n1.0 Li 3C Rx 8 01\n1.0 1 123 Rx x 1\n\
             1.0 1 123 Rx d\n1.0 1 123 Rx d 0\n"
        ));
        assert_eq!(
            said,
            [
                "warning: test: line 7: neither d for data nor r for a remote frame: left out",
                "warning: test: line 8: no data length code: left out",
                "bus can1 log",
                "0: 123# R @1506783974191000000±100000000",
                "warning: test: left out 2 lines that hold no CAN or CAN FD frame, the first is \
                 \"1.0 1 J1939TP FEE3p 6 0 0 - Rx d 23 A0\"",
            ]
        );
    }

    #[test]
    fn no_damage_stops_the_reader_for_good() {
        let text = "1.0 CANFD   1 Rx        123  1 0 9 2 00 01 130000  130 303000 0\n1.0 1  ErrorFrame \
                    CodeExt = 0x2122\n1.0 CAN 1 Status:chip status error passive - TxErr: 132 RxErr: \
                    0\nBegin Triggerblock Sam Sep 30 04:06:13.191 pm 2017\n1.1 1 18EBFF00x Rx d 1 01 \
                    BitCount = 99\n";
        survive(InputFormat::Asc, format!("{HEADER}{text}").as_bytes());
    }
}
