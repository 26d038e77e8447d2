//! Lines of an adapter (Lawicel CANUSB manual; `slcan-core.c` of Linux for states and errors).
//!
//! `t` and `T` are data frames with 11 and 29 bits of identifier, `r` and `R` remote frames; newer
//! adapters have `d` and `D` for CAN FD, and `b` and `B` for CAN FD with a second bit rate. All of
//! them have the identifier, one digit of length, the data, and where time stamps are on four
//! digits: milliseconds that begin again after 59999. All digits are hexadecimal.

use super::super::super::can::hex;
use super::super::super::can::report::{Kind, Report, State};
use dissectors::can::{FdFlags, Frame, FrameKind, Identifier, MAX_CLASSIC_DATA};
use dissectors::event::Moment;
use nom::branch::alt;
use nom::bytes::complete::{tag, take};
use nom::character::complete::{char, one_of};
use nom::combinator::{all_consuming, map_opt, opt, rest, value};
use nom::{IResult, Parser};

/// Time stamps are below this.
pub const STAMPS: u16 = 60_000;

/// Lengths of CAN FD frames by their code (ISO 11898-1).
const FD_LENGTHS: [u8; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];

/// The CRC sequence, as SocketCAN numbers the places of a frame; the acknowledge slot.
const IN_CRC: u8 = 0x08;
const IN_ACK: u8 = 0x19;

/// What a line says.
#[derive(Clone, Copy, Debug)]
pub enum Line {
    /// A frame without a time, and the adapter's stamp in ms, if it has one.
    Frame(Frame, Option<u16>),
    /// What the adapter's controller reports of itself and of errors.
    Reports(Reports),
    /// An answer to a command, or the acknowledge of one.
    Answer,
}

/// Most reports of one line.
const MOST: usize = 8;

/// Reports, in the order they are to be told.
#[derive(Clone, Copy, Default, Debug)]
pub struct Reports {
    reports: [Option<Report>; MOST],
}

impl Reports {
    fn add(&mut self, report: Report) {
        if let Some(free) = self.reports.iter_mut().find(|free| free.is_none()) {
            *free = Some(report);
        }
    }

    /// As error frames.
    pub fn frames(self, at: Moment, uncertainty: u32) -> impl Iterator<Item = Frame> {
        self.reports.into_iter().flatten().map(move |report| report.frame(at, uncertainty))
    }
}

/// Reads a line; `None` for what is none.
pub fn parse(line: &[u8]) -> Option<Line> {
    let lines = alt((frame, status, state, errors, answer));
    all_consuming(lines).parse(line).ok().map(|(_, line)| line)
}

/// For fuzzing: reads these bytes as an adapter's.
pub fn fuzz(bytes: &[u8]) {
    let mut splitter = super::split::Splitter::default();
    for byte in bytes {
        if let Some(super::split::Saying::Line(line)) = splitter.take(*byte) {
            let _ = parse(line);
        }
    }
}

/// A number of so many hex digits.
fn number<'a>(digits: usize) -> impl Parser<&'a [u8], Output = u32, Error = Error<'a>> {
    map_opt(take(digits), hex::number)
}

type Error<'a> = nom::error::Error<&'a [u8]>;

fn frame(line: &[u8]) -> IResult<&[u8], Line> {
    let (line, letter) = one_of("tTrRdDbB").parse(line)?;
    let digits = if letter.is_ascii_uppercase() { 8 } else { 3 };
    let of_width = |value| match digits {
        8 => Identifier::extended(value),
        _ => Identifier::standard(value),
    };
    let (line, id) = map_opt(number(digits), of_width).parse(line)?;
    let kind = match letter {
        'r' | 'R' => FrameKind::Remote,
        't' | 'T' => FrameKind::Data,
        _ => FrameKind::Fd,
    };
    let (line, length) = map_opt(number(1), |code| length(kind, code)).parse(line)?;
    let there = if kind == FrameKind::Remote { 0 } else { length };
    let (line, data) = map_opt(take(usize::from(there) * 2), bytes).parse(line)?;
    let (line, stamp) = opt(map_opt(number(4), stamp)).parse(line)?;
    let mut frame = Frame::new(Moment::UNKNOWN, 0, kind, id, length).with(data.as_slice());
    if kind == FrameKind::Fd {
        frame.fd_flags = FdFlags::from_bits(u8::from(letter.eq_ignore_ascii_case(&'b')));
    }
    Ok((line, Line::Frame(frame, stamp)))
}

fn length(kind: FrameKind, code: u32) -> Option<u8> {
    let code = usize::try_from(code).ok()?;
    let is_fd = kind == FrameKind::Fd;
    FD_LENGTHS.get(code).copied().filter(|_| is_fd || code <= MAX_CLASSIC_DATA)
}

fn bytes(digits: &[u8]) -> Option<hex::Bytes> {
    let mut bytes = hex::Bytes::new();
    let is_whole = digits.chunks(2).all(|two| hex::pair(two).is_some_and(|byte| bytes.push(byte)));
    is_whole.then_some(bytes)
}

fn stamp(value: u32) -> Option<u16> {
    u16::try_from(value).ok().filter(|stamp| *stamp < STAMPS)
}

/// The flags of the controller, an SJA1000: `F` and two digits (Lawicel manual, command F).
fn status(line: &[u8]) -> IResult<&[u8], Line> {
    const RECEIVE_QUEUE_FULL: u32 = 0x01;
    const WARNING: u32 = 0x04;
    const OVERRUN: u32 = 0x08;
    const PASSIVE: u32 = 0x20;
    const BUS_ERROR: u32 = 0x80;
    let (line, _) = char('F').parse(line)?;
    let (line, flags) = number(2).parse(line)?;
    let mut reports = Reports::default();
    if flags & (RECEIVE_QUEUE_FULL | OVERRUN) != 0 {
        reports.add(Report::of_overrun());
    }
    if flags & PASSIVE != 0 {
        reports.add(Report::of_state(State::Passive));
    } else if flags & WARNING != 0 {
        reports.add(Report::of_state(State::Warning));
    }
    if flags & BUS_ERROR != 0 {
        reports.add(Report::of_error());
    }
    Ok((line, Line::Reports(reports)))
}

/// The state of the controller: `sw012000`, its letter and two error counters of three decimal
/// digits, received and sent.
fn state(line: &[u8]) -> IResult<&[u8], Line> {
    let (line, _) = char('s').parse(line)?;
    let (line, state) = alt((
        value(State::Active, char('a')),
        value(State::Warning, char('w')),
        value(State::Passive, char('p')),
        value(State::Off, char('b')),
    ))
    .parse(line)?;
    let counter = || map_opt(take(3_usize), hex::decimal);
    let (line, (received, sent)) = (counter(), counter()).parse(line)?;
    let most = |count: u32| u8::try_from(count).unwrap_or(u8::MAX);
    let mut reports = Reports::default();
    reports.add(Report::of_state(state).counting(most(sent), most(received)));
    Ok((line, Line::Reports(reports)))
}

/// Errors on the bus: `e`, how many, and a letter of each.
fn errors(line: &[u8]) -> IResult<&[u8], Line> {
    let (line, _) = char('e').parse(line)?;
    let (line, count) = map_opt(number(1), |count| usize::try_from(count).ok()).parse(line)?;
    let (line, letters) = take(count).parse(line)?;
    let mut reports = Reports::default();
    for letter in letters {
        match letter {
            b'a' => reports.add(Report::of_kind(Kind::Acknowledge, IN_ACK, false)),
            b'b' | b'B' => reports.add(Report::of_kind(Kind::Bit, 0, false)),
            b'c' => reports.add(Report::of_kind(Kind::Crc, IN_CRC, false)),
            b'f' => reports.add(Report::of_kind(Kind::Form, 0, false)),
            b's' => reports.add(Report::of_kind(Kind::Stuff, 0, false)),
            b'o' => reports.add(Report::of_overrun()),
            // What was to be sent does not concern a tap.
            b'O' => {}
            _ => return Err(wrong(line)),
        }
    }
    Ok((line, Line::Reports(reports)))
}

fn wrong(line: &[u8]) -> nom::Err<Error<'_>> {
    nom::Err::Error(nom::error::make_error(line, nom::error::ErrorKind::OneOf))
}

/// Done; a frame was sent; version; serial number.
fn answer(line: &[u8]) -> IResult<&[u8], Line> {
    let named = (one_of("VvN"), rest).map(|_| ());
    let sent = alt((tag(&b"z"[..]), tag(&b"Z"[..]))).map(|_| ());
    let (line, ()) = alt((named, sent, tag(&b""[..]).map(|_| ()))).parse(line)?;
    Ok((line, Line::Answer))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A line in words.
    fn read(line: &str) -> String {
        match parse(line.as_bytes()) {
            None => "nothing".to_owned(),
            Some(Line::Answer) => "answer".to_owned(),
            Some(Line::Frame(frame, stamp)) => {
                let data: String = frame.bytes().iter().map(|b| format!("{b:02X}")).collect();
                let stamp = stamp.map_or(String::new(), |stamp| format!(" at {stamp}"));
                let (kind, id, dlc) = (frame.kind, frame.id, frame.dlc);
                format!("{kind:?} {:X} {dlc} {data}{stamp}", id.value())
            }
            Some(Line::Reports(reports)) => {
                let frames = reports.frames(Moment::UNKNOWN, 0);
                let words: Vec<String> =
                    frames.map(|f| format!("{:X} {:02X?}", f.id.value(), f.bytes())).collect();
                words.join("; ")
            }
        }
    }

    #[test]
    fn frames_of_every_kind_are_read() {
        // The examples of the Lawicel manual: identifier 100h with two bytes, and so on.
        assert_eq!(read("t10021133"), "Data 100 2 1133");
        assert_eq!(read("T0000010021133"), "Data 100 2 1133");
        assert_eq!(read("t1000"), "Data 100 0 ");
        assert_eq!(read("r1002"), "Remote 100 2 ");
        assert_eq!(read("R1FFFFFFF8"), "Remote 1FFFFFFF 8 ");
        assert_eq!(read("d1239000102030405060708090a0b"), "Fd 123 12 000102030405060708090A0B");
        assert!(matches!(parse(b"T000001000"), Some(Line::Frame(f, None)) if f.id.is_extended()));
        let has_switch = |line| match parse(line) {
            Some(Line::Frame(frame, _)) => frame.fd_flags.has_rate_switch,
            _ => panic!("a frame"),
        };
        assert_eq!([has_switch(b"d1230"), has_switch(b"B000001230")], [false, true]);
        let longest = format!("D00000123F{}5A5A", "A5".repeat(64));
        assert_eq!(read(&longest), format!("Fd 123 64 {} at 23130", "A5".repeat(64)));
    }

    #[test]
    fn a_stamp_is_four_digits_behind_the_data() {
        assert_eq!(read("t100211330000"), "Data 100 2 1133 at 0");
        assert_eq!(read("t10021133EA5F"), "Data 100 2 1133 at 59999");
        assert_eq!(read("r10081234"), "Remote 100 8  at 4660");
        for wrong in ["t10021133EA60", "t100211331", "t1002113312345", "t10021133123x"] {
            assert_eq!(read(wrong), "nothing", "{wrong}");
        }
    }

    #[test]
    fn what_is_cut_or_wrong_is_nothing() {
        for wrong in [
            "t",
            "t10",
            "t8000",
            "t1009",
            "t100",
            "t100211",
            "t1002113",
            "t1001GG",
            "T1000",
            "T200000000",
            "d800",
            "x",
            "F1",
            "sx000000",
            "sw00000",
            "e2s",
            "e1x",
            "u1000",
            "t10021133t10021133",
            " t1000",
            "t+1000",
        ] {
            assert_eq!(read(wrong), "nothing", "{wrong}");
        }
    }

    #[test]
    fn answers_are_none_of_these() {
        for answer in ["", "V1013", "v0102", "NA123", "z", "Z"] {
            assert_eq!(read(answer), "answer", "{answer}");
        }
    }

    /// What Linux makes of the same lines (`slcan-core.c`, measured): sw012000, sp130005 and
    /// sb000000 become classes 204h, 204h and 40h, e1s and e1a 88h and A8h.
    #[test]
    fn states_and_errors_become_the_error_frames_of_linux() {
        let zeros = "00, 00, 00, 00";
        assert_eq!(read("sw012000"), format!("204 [00, 0C, {zeros}, 00, 0C]"));
        assert_eq!(read("sp130005"), format!("204 [00, 30, {zeros}, 05, 82]"));
        assert_eq!(read("sb000000"), format!("240 [00, 00, {zeros}, 00, 00]"));
        assert_eq!(read("e1s"), "88 [00, 00, 04, 00, 00, 00, 00, 00]");
        assert_eq!(read("e1a"), "A8 [00, 00, 00, 19, 00, 00, 00, 00]");
        assert_eq!(
            read("e3obO"),
            "4 [00, 01, 00, 00, 00, 00, 00, 00]; 88 [00, 00, 01, 00, 00, 00, 00, 00]"
        );
    }

    /// Bit 3 is the data overrun, bit 5 error passive, bit 7 a bus error.
    #[test]
    fn the_flags_of_the_controller_are_told_each() {
        assert_eq!(read("F00"), "");
        assert_eq!(read("F08"), "4 [00, 01, 00, 00, 00, 00, 00, 00]");
        assert_eq!(
            read("FA4"),
            "4 [00, 30, 00, 00, 00, 00, 00, 00]; 80 [00, 00, 00, 00, 00, 00, 00, 00]"
        );
    }

    proptest! {
        #[test]
        fn no_bytes_stop_the_parser(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            fuzz(&bytes);
        }

        #[test]
        fn every_frame_that_is_written_is_read(
            id in 0_u32..=0x1FFF_FFFF,
            data in proptest::collection::vec(any::<u8>(), 0..=8),
            ms in proptest::option::of(0..STAMPS),
        ) {
            let digits: String = data.iter().map(|byte| format!("{byte:02x}")).collect();
            let stamp = ms.map_or(String::new(), |ms| format!("{ms:04X}"));
            let line = format!("T{id:08X}{}{digits}{stamp}", data.len());
            let Some(Line::Frame(frame, told)) = parse(line.as_bytes()) else {
                panic!("{line} is a frame")
            };
            prop_assert_eq!((frame.id.value(), frame.bytes(), told), (id, &data[..], ms));
        }
    }
}
