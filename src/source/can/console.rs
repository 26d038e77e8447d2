//! What candump prints on a terminal, and people paste into tickets:
//! ` (001.234567)  can0  42C   [5]  01 0E 01 01 01` (can-utils, `lib.c` and `candump.c`).
//!
//! Stamps may be absolute, since the start, a difference to the line before, a date, or missing.

use super::super::numbers::seconds;
use super::candump::lost;
use super::date::date_and_time;
use super::hex::{Bytes, decimal, digit, identifier, number, pair, words};
use super::log::{Grammar, Name, Said};
use dissectors::can::{Direction, FdFlags, Frame, FrameKind, Identifier, MAX_CLASSIC_DATA};
use dissectors::event::Moment;
use std::borrow::Cow;

/// The flag of error frames in an identifier of eight digits.
const ERROR: u32 = 0x2000_0000;

/// Stamps from here on are dates, in ns: no difference is a year long.
const FIRST_DATE_NS: i64 = 365 * 86_400 * 1_000_000_000;

/// Lines of candump's console text.
pub struct Console {
    /// Stamps are differences to the line before (`-t d`).
    is_delta: bool,
    now: i64,
}

impl Console {
    /// Lines that begin like these: what grows and shrinks again is a difference, which looks the
    /// same as the time since the start.
    pub fn new(head: &[u8]) -> Self {
        let stamps = head.split(|byte| *byte == b'\n').filter_map(|line| match stamp(line) {
            Some((Some((time, _)), _)) => time.ns().filter(|ns| *ns < FIRST_DATE_NS),
            _ => None,
        });
        let is_delta = stamps.is_sorted();
        Console { is_delta: !is_delta, now: 0 }
    }
}

/// Whether a line is a frame of this format.
pub fn is_frame(line: &[u8]) -> bool {
    matches!(frame(&uncoloured(line)), Some(Ok(_)))
}

impl Grammar for Console {
    const NAME: &'static str = "candump";

    fn read<'a>(&mut self, line: &'a [u8]) -> Said<'a> {
        if line.iter().all(u8::is_ascii_whitespace) || line.starts_with(b"\t") {
            // Below an error frame stands in words what it says.
            return Said::Nothing;
        }
        if let Some(loss) = lost(line) {
            return loss;
        }
        let plain = uncoloured(line);
        match frame(&plain) {
            None => Said::Foreign,
            Some(Err(what)) => Said::Bad(what),
            Some(Ok((name, mut frame))) => {
                if let (true, Some(ns)) = (self.is_delta, frame.start.ns()) {
                    self.now = self.now.saturating_add(ns);
                    frame.start = Moment::from_ns(self.now);
                }
                // Colour stands around the name, not in it: the name is in the line as it was.
                let at = line.windows(name.len()).position(|part| part == name).unwrap_or(0);
                Said::Frame(Name::Text(&line[at..at + name.len()]), frame)
            }
        }
    }
}

/// The line without what colours it (`-c`).
fn uncoloured(line: &[u8]) -> Cow<'_, [u8]> {
    if !line.contains(&0x1B) {
        return Cow::Borrowed(line);
    }
    let mut plain = Vec::with_capacity(line.len());
    for (index, part) in line.split(|byte| *byte == 0x1B).enumerate() {
        let end = part.iter().position(|byte| *byte == b'm').map_or(part.len(), |at| at + 1);
        plain.extend_from_slice(if index == 0 { part } else { &part[end..] });
    }
    Cow::Owned(plain)
}

/// Time and ± of a line, if it has them, and what follows.
type Stamped<'a> = (Option<(Moment, u32)>, &'a [u8]);

/// Divides the stamp off; `None` if it only begins like one.
fn stamp(line: &[u8]) -> Option<Stamped<'_>> {
    let line = line.trim_ascii_start();
    let Some(inside) = line.strip_prefix(b"(") else { return Some((None, line)) };
    let end = inside.iter().position(|byte| *byte == b')')?;
    let (inside, rest) = (&inside[..end], &inside[end + 1..]);
    let time = match seconds(inside) {
        Ok(([], stamp)) => Some((stamp.time, stamp.resolution)),
        _ => date_and_time(inside),
    };
    Some((Some(time?), rest))
}

/// The interface and the frame of a line; `None` if it is of another kind.
fn frame(line: &[u8]) -> Option<Result<(&[u8], Frame), &'static str>> {
    let (time, rest) = stamp(line)?;
    let mut columns = words(rest).peekable();
    let name = columns.next()?;
    let direction = match *columns.peek()? {
        b"RX" => Some(Direction::Received),
        b"TX" => Some(Direction::Sent),
        _ => None,
    };
    let mut flags = FdFlags::default();
    if direction.is_some() {
        columns.next();
        // Dashes for flags that are not set.
        flags.has_rate_switch = columns.next()? == b"B";
        flags.is_error_passive = columns.next()? == b"E";
    }
    let id = columns.next()?;
    let length = length(columns.next()?)?;
    let Some((kind, id)) = kind_of(id, length) else { return Some(Err("not an identifier")) };
    let (time, resolution) = time.unwrap_or((Moment::UNKNOWN, 0));
    let mut frame = Frame::new(time, resolution, kind, id, length.value());
    frame.direction = direction;
    if kind == FrameKind::Fd {
        frame.fd_flags = flags;
    }
    if columns.peek() == Some(&&b"remote"[..]) {
        frame.kind = FrameKind::Remote;
        return Some(Ok((name, frame)));
    }
    let count = match length {
        Length::Fd(count) => count,
        Length::Classic(count) | Length::Raw(count) => count.min(MAX_CLASSIC_DATA as u8),
    };
    Some(match data(columns, usize::from(count)) {
        Some(data) => Ok((name, frame.with(data.as_slice()))),
        None => Err("the data is no hex or binary bytes"),
    })
}

/// `[5]` is classic, `[05]` CAN FD, `{C}` a DLC above eight (`-8`).
#[derive(Clone, Copy)]
enum Length {
    Classic(u8),
    Fd(u8),
    Raw(u8),
}

impl Length {
    fn value(self) -> u8 {
        match self {
            Length::Classic(value) | Length::Fd(value) | Length::Raw(value) => value,
        }
    }
}

fn length(word: &[u8]) -> Option<Length> {
    match word {
        [b'[', one, b']'] => Some(Length::Classic(digit(*one).filter(|n| *n <= 8)?)),
        [b'[', two @ .., b']'] if two.len() == 2 => {
            let count = decimal(two).filter(|count| *count <= 64)?;
            Some(Length::Fd(count as u8))
        }
        [b'{', one, b'}'] => Some(Length::Raw(digit(*one)?)),
        _ => None,
    }
}

fn kind_of(id: &[u8], length: Length) -> Option<(FrameKind, Identifier)> {
    let value = number(id)?;
    let kind = match length {
        Length::Fd(_) => FrameKind::Fd,
        Length::Classic(_) | Length::Raw(_) => FrameKind::Data,
    };
    match id.len() {
        8 if value & ERROR != 0 => {
            Some((FrameKind::Error, Identifier::Extended(value & (ERROR - 1))))
        }
        8 => Some((kind, identifier(value, true)?)),
        3 => Some((kind, identifier(value, false)?)),
        _ => None,
    }
}

/// As many bytes as there should be, or those that there are: hex, binary (`-i`), or the last one
/// first with marks between (`-S`).
fn data<'a>(mut columns: impl Iterator<Item = &'a [u8]>, count: usize) -> Option<Bytes> {
    let mut bytes = Bytes::new();
    while bytes.as_slice().len() < count {
        let Some(column) = columns.next() else { break };
        if matches!(column, [b'\'' | b'`', ..] | b"ERRORFRAME") {
            break;
        }
        if column.contains(&b'`') {
            for part in column.split(|byte| *byte == b'`') {
                bytes.push(byte(part)?);
            }
            bytes.reverse();
            break;
        }
        bytes.push(byte(column)?);
    }
    Some(bytes)
}

fn byte(text: &[u8]) -> Option<u8> {
    if text.len() != 8 {
        return pair(text);
    }
    text.iter().try_fold(0, |value, digit| match digit {
        b'0' | b'1' => Some(value << 1 | (digit - b'0')),
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use super::super::super::damage::survive;
    use super::super::super::transcript::transcript;
    use super::super::super::{InputFormat, SourceOptions};

    fn read(text: &str) -> Vec<String> {
        transcript(InputFormat::CandumpText, text.as_bytes(), &SourceOptions::default())
    }

    #[test]
    fn lines_without_times() {
        let said = read(
            "  can0  123   [8]  11 22 33 44 55 66 77 88\n  can0  1F334455   [2]  11 22\n  can0       \
             123   [0] \n  can0       123   [4]  remote request\n  can0  123  [02]  AB CD\n  can0  \
             123   {C}  11 22 33 44 55 66 77 88\n  can0  20000088   [8]  00 00 04 08 00 00 60 00   \
             ERRORFRAME\n\tprotocol-violation{{stuff}{crc}}\n",
        );
        assert_eq!(
            said,
            [
                "bus can0",
                "0: 123#1122334455667788±0, 1F334455#1122±0, 123#±0, 123#R4±0, 123##ABCD±0, \
                 123#1122334455667788 dlc 12±0, error 88#0000040800006000±0"
            ]
        );
    }

    #[test]
    fn stamps_of_every_style() {
        let at = |stamps: [&str; 3]| {
            let lines = stamps.map(|stamp| format!(" ({stamp})  can0  123   [0]\n"));
            let said = read(&lines.concat());
            assert_eq!(said[0], "bus can0 log");
            said[1].trim_start_matches("0: ").replace("123# @", "")
        };
        assert_eq!(
            at(["1345212884.318850", "1345212884.318851", "1345212885.0"]),
            "1345212884318850000±1000, 1345212884318851000±1000, 1345212885000000000±100000000"
        );
        // Since the start, or a difference: that shrinks now and then.
        assert_eq!(
            at(["000.000000", "001.500000", "002.000000"]),
            "0±1000, 1500000000±1000, 2000000000±1000"
        );
        assert_eq!(
            at(["000.000000", "001.500000", "000.500000"]),
            "0±1000, 1500000000±1000, 2000000000±1000"
        );
        // 2017-09-30 15:06:13 UTC is 1506783973 s after the epoch.
        assert_eq!(
            at(["2017-09-30 15:06:13.000124", "2017-09-30 15:06:14.0", "2017-09-30 15:06:14.1"]),
            "1506783973000124000±1000, 1506783974000000000±100000000, \
             1506783974100000000±100000000"
        );
    }

    #[test]
    fn direction_colour_ascii_binary_and_the_swapped_form() {
        for (text, expected) in [
            ("  can0  RX - -  123   [3]  DE AD BE   '...'", "123#DEADBE R±0"),
            ("  can0  TX B E  123  [02]  11 22", "123##1122 T±0"),
            ("  can0  123   [3]  DE AD BE   'DE AD'", "123#DEADBE±0"),
            ("  can0  123   [3]  BE`AD`DE   `...`", "123#DEADBE±0"),
            ("  can0  123   [2]  00010001 11111111", "123#11FF±0"),
            ("\x1B[34m  can0  123\x1B[0m   [1]  \x1B[1mAB\x1B[0m", "123#AB±0"),
            // Fewer bytes than its length.
            ("  can0  123   [4]  DE AD", "123#DEAD dlc 4±0"),
        ] {
            assert_eq!(read(&format!("{text}\n"))[1..], [format!("0: {expected}")], "{text}");
        }
    }

    #[test]
    fn other_text_losses_and_bad_lines() {
        let said = read(
            "$ candump can0\n  can0  8FF   [0]\n  can0  123   [1]  GG\n  can0  123   [0]\n\
             DROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 3)\n",
        );
        assert_eq!(
            said,
            [
                "warning: test: line 2: not an identifier: left out",
                "warning: test: line 3: the data is no hex or binary bytes: left out",
                "bus can0",
                "0: 123#±0",
                "0: lost 3 Capture",
                "warning: test: left out 1 line that holds no CAN or CAN FD frame, the first is \
                 \"$ candump can0\"",
            ]
        );
    }

    #[test]
    fn no_damage_stops_the_reader_for_good() {
        let text = " (001.000000)  can0  RX - -  123   [3]  DE AD BE   '...'\n\
                    \x1B[34m  can0  123\x1B[0m  [02]  00010001 00000000\n";
        survive(InputFormat::CandumpText, text.as_bytes());
    }
}
