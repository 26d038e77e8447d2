//! The log of candump (`candump -l`, `-L`), which every tool of Linux reads and writes:
//! `(1700000010.000000) can0 42C#010E010101`, and at the end perhaps ` R` or ` T` for received and
//! sent (can-utils, `lib.c` and `candump.c`).

use super::super::numbers::{Stamp, seconds};
use super::hex::{Bytes, decimal, digit, identifier, number, pair, words};
use super::log::{Grammar, Name, Said};
use dissectors::can::{Direction, FdFlags, Frame, FrameKind, Identifier, MAX_CLASSIC_DATA};
use nom::bytes::complete::{tag, take_till1, take_while1};
use nom::character::complete::char;
use nom::sequence::delimited;
use nom::{IResult, Parser};

/// The flag of error frames in an identifier of eight digits.
const ERROR: u32 = 0x2000_0000;

/// Digits of identifiers: 11 bits, 29 bits, and those of CAN XL.
const STANDARD_DIGITS: usize = 3;
const EXTENDED_DIGITS: usize = 8;
const XL_DIGITS: usize = 5;

/// Lines of candump's log.
pub struct Candump;

/// Whether a line is a frame of this format.
pub fn is_frame(line: &[u8]) -> bool {
    matches!(Candump.read(line), Said::Frame(..))
}

impl Grammar for Candump {
    const NAME: &'static str = "candump";

    fn read<'a>(&mut self, line: &'a [u8]) -> Said<'a> {
        match line {
            [] => Said::Nothing,
            [b'(', ..] => match columns(line) {
                Ok((rest, (stamp, name, text))) => frame(stamp, name, text, rest),
                Err(_) => Said::Bad("not a frame: expected (seconds) interface identifier#data"),
            },
            _ => lost(line).unwrap_or(Said::Foreign),
        }
    }
}

/// Stamp, interface, and the frame itself.
type Columns<'a> = (Stamp, &'a [u8], &'a [u8]);

/// Names are padded to the longest one's length.
fn columns(line: &[u8]) -> IResult<&[u8], Columns<'_>> {
    let (line, stamp) = delimited(char('('), seconds, char(')')).parse(line)?;
    let (line, name) = word(line)?;
    let (line, frame) = word(line)?;
    Ok((line, (stamp, name, frame)))
}

fn word(line: &[u8]) -> IResult<&[u8], &[u8]> {
    let is_blank = |byte: u8| byte == b' ' || byte == b'\t';
    let (line, _) = take_while1(is_blank).parse(line)?;
    take_till1(is_blank).parse(line)
}

fn frame<'a>(stamp: Stamp, name: &'a [u8], text: &[u8], rest: &[u8]) -> Said<'a> {
    let Some((id, text)) = text.iter().position(|byte| *byte == b'#').map(|at| text.split_at(at))
    else {
        return Said::Bad("no # behind the identifier");
    };
    if id.len() == XL_DIGITS {
        return Said::Foreign;
    }
    let Some((kind, id)) = kind_of(id) else {
        return Said::Bad("an identifier has 3 or 8 hex digits, 7FF or 1FFFFFFF at most");
    };
    let frame = Frame::new(stamp.time, stamp.resolution, kind, id, 0);
    match body(frame, &text[1..]) {
        Some(mut frame) => {
            frame.direction = words(rest).find_map(|word| match word {
                b"R" => Some(Direction::Received),
                b"T" => Some(Direction::Sent),
                _ => None,
            });
            Said::Frame(Name::Text(name), frame)
        }
        None => Said::Bad("the data is no hex digits in pairs, or more than a frame has"),
    }
}

/// Width, not value, tells 29 bits from 11: `00000123` is an extended identifier.
fn kind_of(id: &[u8]) -> Option<(FrameKind, Identifier)> {
    let value = number(id)?;
    match id.len() {
        EXTENDED_DIGITS if value & ERROR != 0 => {
            Some((FrameKind::Error, Identifier::Extended(value & (ERROR - 1))))
        }
        EXTENDED_DIGITS => Some((FrameKind::Data, identifier(value, true)?)),
        STANDARD_DIGITS => Some((FrameKind::Data, identifier(value, false)?)),
        _ => None,
    }
}

/// What stands behind the `#`: data, `R` for a remote frame, or another `#` for CAN FD.
fn body(mut frame: Frame, text: &[u8]) -> Option<Frame> {
    match text {
        [b'#', flags, text @ ..] => {
            frame.kind = FrameKind::Fd;
            frame.fd_flags = FdFlags::from_bits(digit(*flags)?);
            let bytes = data(text)?;
            frame.dlc = bytes.as_slice().len() as u8;
            Some(frame.with(bytes.as_slice()))
        }
        [b'R' | b'r', text @ ..] => {
            frame.kind = FrameKind::Remote;
            let (length, raw) = raw_dlc(text)?;
            let length = match length {
                [] => 0,
                [one] => digit(*one).filter(|length| usize::from(*length) <= MAX_CLASSIC_DATA)?,
                _ => return None,
            };
            frame.dlc = raw.unwrap_or(length);
            Some(frame)
        }
        text => {
            let (text, raw) = raw_dlc(text)?;
            let bytes = data(text)?;
            let bytes = bytes.as_slice();
            frame.dlc = raw.unwrap_or(bytes.len() as u8);
            (bytes.len() <= MAX_CLASSIC_DATA).then(|| frame.with(bytes))
        }
    }
}

/// Divides off `_C`: eight bytes whose DLC was 9 to F.
fn raw_dlc(text: &[u8]) -> Option<(&[u8], Option<u8>)> {
    match text {
        [text @ .., b'_', raw] => Some((text, Some(digit(*raw).filter(|raw| *raw > 8)?))),
        _ => Some((text, None)),
    }
}

/// Pairs of hex digits; dots may stand between them.
fn data(mut text: &[u8]) -> Option<Bytes> {
    let mut bytes = Bytes::new();
    while let Some((two, rest)) = text.split_first_chunk::<2>() {
        if !bytes.push(pair(two)?) {
            return None;
        }
        text = rest.strip_prefix(b".").unwrap_or(rest);
    }
    text.is_empty().then_some(bytes)
}

/// `DROPCOUNT: dropped 4 CAN frames on 'can0' socket (total drops 12)`; ours have no number where
/// nobody counted.
pub fn lost(line: &[u8]) -> Option<Said<'_>> {
    let (rest, _) = tag::<_, _, nom::error::Error<_>>("DROPCOUNT: dropped ").parse(line).ok()?;
    let count = words(rest).next().and_then(decimal).map(u64::from);
    let name = rest.split(|byte| *byte == b'\'').nth(1).filter(|name| !name.is_empty())?;
    Some(Said::Lost(Name::Text(name), count))
}

#[cfg(test)]
mod tests {
    use super::super::super::damage::survive;
    use super::super::super::transcript::transcript;
    use super::super::super::{InputFormat, SourceOptions};

    fn read(text: &str) -> Vec<String> {
        transcript(InputFormat::Candump, text.as_bytes(), &SourceOptions::default())
    }

    /// What is said of one frame at 1.000001 s on can0.
    fn frame(text: &str) -> String {
        let said = read(&format!("(1.000001) can0 {text}\n"));
        match said.as_slice() {
            [bus, one] if bus == "bus can0 log" => {
                one.trim_start_matches("0: ").replace(" @1000001000±1000", "")
            }
            _ => said.join(", "),
        }
    }

    #[test]
    fn stamps_are_exact_in_micro_and_nanoseconds() {
        let said = read(
            "(1345212884.756589) can0 123#00\n(1345212884.318850123) can0 123#\n\
             (000.123456) can0 123#\n",
        );
        assert_eq!(
            said,
            [
                "bus can0 log",
                "0: 123#00 @1345212884756589000±1000, 123# @1345212884318850123±1, \
                 123# @123456000±1000"
            ]
        );
    }

    #[test]
    fn every_form_of_a_frame() {
        for (text, expected) in [
            ("42C#010E010101", "42C#010E010101"),
            ("123#", "123#"),
            ("123#11.22.aA", "123#1122AA"),
            // The width tells 29 bits from 11.
            ("00000123#", "00000123#"),
            ("18EBFF00#01", "18EBFF00#01"),
            ("123#R", "123#R0"),
            ("123#R4", "123#R4"),
            ("123#R8_F", "123#R15"),
            ("123#1122334455667788_C", "123#1122334455667788 dlc 12"),
            ("123##5112233", "123##112233"),
            ("123##1112233", "123##112233"),
            ("20000088#0000040800006000", "error 88#0000040800006000"),
            ("42C#01 R", "42C#01 R"),
            ("42C#01 T", "42C#01 T"),
        ] {
            assert_eq!(frame(text), expected);
        }
    }

    #[test]
    fn names_may_be_padded_and_are_buses() {
        let said = read("(1.0)  can0 001#\n(2.0) vcan10 002#\n(3.0)   can0 003#\n");
        assert_eq!(
            said,
            [
                "bus can0 log",
                "0: 001# @1000000000±100000000",
                "bus vcan10 log",
                "1: 002# @2000000000±100000000",
                "0: 003# @3000000000±100000000",
            ]
        );
        let channels = vec!["vcan10".to_owned()];
        let options = SourceOptions { channels, ..SourceOptions::default() };
        let text = b"(1.0)  can0 001#\n(2.0) vcan10 002#\n";
        let said = transcript(InputFormat::Candump, text, &options);
        assert_eq!(said, ["bus vcan10 log", "0: 002# @2000000000±100000000"]);
    }

    #[test]
    fn a_drop_count_is_a_loss_where_the_frame_before_was() {
        let said = read(
            "DROPCOUNT: dropped 1 CAN frame on 'can0' socket (total drops 1)\n(1.000001) can0 1FF#\n\
             DROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 4)\n\
             DROPCOUNT: dropped CAN frames on 'can0' socket\n",
        );
        assert_eq!(
            said,
            [
                "bus can0 log",
                // Before the first frame there is no time yet.
                "0: lost 1 Capture @1000001000",
                "0: 1FF# @1000001000±1000",
                "0: lost 3 Capture @1000001000",
                "0: lost Capture @1000001000",
            ]
        );
    }

    #[test]
    fn other_text_and_can_xl_are_counted_and_left_out() {
        let said = read(
            "# my notes\n(1.000001) can0 00242#81:00:12345678#00112233\n(1.000001) can0 1FF#\n\
             plug 3 moved\n",
        );
        assert_eq!(
            said[1..],
            [
                "0: 1FF# @1000001000±1000",
                "warning: test: left out 3 lines that hold no CAN or CAN FD frame, the first \
                 is \"# my notes\"",
            ]
        );
    }

    #[test]
    fn a_bad_line_is_told_and_the_rest_is_read() {
        let data = "the data is no hex digits in pairs, or more than a frame has: left out";
        let id = "an identifier has 3 or 8 hex digits, 7FF or 1FFFFFFF at most: left out";
        for (text, what) in [
            ("123#0", data),
            ("123#0G", data),
            ("123#112233445566778899", data),
            ("123#R9", data),
            ("123##", data),
            ("8FF#", id),
            ("1234#", id),
            ("9FFFFFFF#", id),
            ("123", "no # behind the identifier: left out"),
        ] {
            let said = read(&format!("(1.000001) can0 {text}\n(1.000001) can0 1FF#\n"));
            assert_eq!(said[0], format!("warning: test: line 1: {what}"), "{text}");
            assert_eq!(said[2], "0: 1FF# @1000001000±1000");
        }
        let many = "(1.0 can0 1FF#\n".repeat(50) + "(1.000001) can0 1FF#\n";
        let said = read(&many);
        assert_eq!(said.len(), 20 + 3);
        assert_eq!(said[22], "warning: test: 30 more lines are no frames: left out");
    }

    #[test]
    fn a_cut_line_and_a_wrong_file_end_in_an_error() {
        let said = read("(1.000001) can0 1FF#\n(1.000002) can0 1FF#0");
        assert_eq!(said[2], "test: line 2: the file ends inside this line: it was cut");
        // What is whole needs no end of line.
        assert_eq!(read("(1.000001) can0 1FF#").len(), 2);
        assert_eq!(
            read("hello\nworld\n"),
            ["test: no line of it is of a candump log: it begins with \"hello\""]
        );
    }

    #[test]
    fn no_damage_stops_the_reader_for_good() {
        let text = "(1.000001) can0 123#11.22 R\n(1.000002)  can1 20000088#0000040800006000\n\
                    (1.000002) can0 123##5112233\n(1.5) can0 123#R8_F T\n\
                    DROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 4)\n";
        survive(InputFormat::Candump, text.as_bytes());
    }
}
