//! Traces of PEAK's programs, versions 1.0 to 2.1 (PEAK-System: PCAN trace file formats).
//!
//! Rows have the columns that `;$COLUMNS` names or the version has. Offsets are milliseconds since
//! `;$STARTTIME`, which is a number of days.

use super::super::numbers::seconds;
use super::hex::{Bytes, decimal, identifier, number, pair, words};
use super::log::{Grammar, Name, Said};
use super::report::{Kind, Report, State};
use dissectors::can::{Direction, FdFlags, Frame, FrameKind, MAX_CLASSIC_DATA};
use dissectors::event::Moment;

/// The day on which days are counted from, 30 December 1899, to 1 January 1970.
const EPOCH_DAYS: i128 = 25_569;
const DAY_NS: i128 = 86_400 * 1_000_000_000;

/// The identifier of status rows in versions 1.
const STATUS: &[u8] = b"FFFFFFFF";

// Bits of a status row (PCAN-Basic).
const OVERRUN: u32 = 0x42;
const BUS_LIGHT: u32 = 0x04;
const BUS_HEAVY: u32 = 0x08;
const BUS_OFF: u32 = 0x10;

/// Bytes of a CAN FD frame by its DLC.
const FD_LENGTHS: [u8; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];

/// Rows of a trace.
pub struct Trc {
    /// The letters of `;$COLUMNS`: N number, O offset, T type, B bus, I identifier, d direction, R
    /// reserved, l length in bytes, L data length code, D data. Here t stands for the type that
    /// versions 1 have, which is the direction.
    columns: Vec<u8>,
    start_ns: i64,
}

impl Trc {
    /// Nothing was read yet: without a header it is version 1.0.
    pub fn new() -> Self {
        Trc { columns: columns_of(b"1.0").to_vec(), start_ns: 0 }
    }

    fn header(&mut self, line: &[u8]) -> Option<&'static str> {
        let value = |key: &[u8]| line.strip_prefix(key).map(<[u8]>::trim_ascii);
        if let Some(version) = value(b";$FILEVERSION=") {
            self.columns = columns_of(version).to_vec();
            if self.columns.is_empty() {
                return Some("a trace of a version that is not known: 1.0 to 2.1 are");
            }
        } else if let Some(days) = value(b";$STARTTIME=") {
            self.start_ns = since_epoch(days).unwrap_or(0);
        } else if let Some(columns) = value(b";$COLUMNS=") {
            self.columns = columns.iter().copied().filter(u8::is_ascii_alphabetic).collect();
        }
        None
    }
}

/// Whether a line is the header of a trace, or a row of version 1.0, which has none.
pub fn is_line(line: &[u8]) -> bool {
    let is_old_row = || matches!(Trc::new().read(line), Said::Frame(..)) && line.contains(&b')');
    line.starts_with(b";$FILEVERSION=") || is_old_row()
}

fn columns_of(version: &[u8]) -> &'static [u8] {
    match version {
        b"1.0" => b"NOILD",
        b"1.1" => b"NOtILD",
        b"1.2" => b"NOBtILD",
        b"1.3" => b"NOBtIRLD",
        b"2.0" => b"NOTIdlD",
        b"2.1" => b"NOTBIdRLD",
        _ => b"",
    }
}

/// Days since 1899, exact: in ns since 1970. There is no zone; it is taken as UTC.
fn since_epoch(days: &[u8]) -> Option<i64> {
    let (whole, fraction) = match days.iter().position(|byte| *byte == b'.') {
        Some(at) => (&days[..at], &days[at + 1..]),
        None => (days, &[][..]),
    };
    let fraction = &fraction[..fraction.len().min(15)];
    let digits = |text: &[u8]| {
        text.iter().try_fold(0_i128, |value, byte| {
            byte.is_ascii_digit().then(|| value * 10 + i128::from(byte - b'0'))
        })
    };
    let part = 10_i128.pow(u32::try_from(fraction.len()).ok()?);
    let whole = i128::from(decimal(whole)?) - EPOCH_DAYS;
    let ns = whole * DAY_NS + (digits(fraction)? * DAY_NS + part / 2) / part;
    i64::try_from(ns).ok()
}

impl Grammar for Trc {
    const NAME: &'static str = "PEAK";

    fn read<'a>(&mut self, line: &'a [u8]) -> Said<'a> {
        let line = line.trim_ascii();
        match line {
            [] => Said::Nothing,
            [b';', ..] => self.header(line).map_or(Said::Nothing, Said::End),
            [b'0'..=b'9', ..] => match Row::read(line, &self.columns) {
                Ok(row) => row.say(self.start_ns, line),
                Err(what) => Said::Bad(what),
            },
            _ => Said::Foreign,
        }
    }
}

/// A row, by its columns.
struct Row<'a> {
    offset_ns: i64,
    uncertainty: u32,
    kind: &'a [u8],
    bus: Option<u32>,
    id: &'a [u8],
    direction: Option<Direction>,
    length: Option<u32>,
    /// The length is a DLC, also for CAN FD.
    is_dlc: bool,
    /// `RTR`, `ERROR`: what stands in place of data.
    word: Option<&'a [u8]>,
    data: Bytes,
}

impl<'a> Row<'a> {
    fn read(line: &'a [u8], columns: &[u8]) -> Result<Row<'a>, &'static str> {
        let mut words = words(line).peekable();
        let mut row = Row {
            offset_ns: 0,
            uncertainty: 0,
            kind: b"DT",
            bus: None,
            id: b"-",
            direction: None,
            length: None,
            is_dlc: false,
            word: None,
            data: Bytes::new(),
        };
        for column in columns {
            // Rows of reports leave out what they have not.
            let next = words.peek().copied().unwrap_or_default();
            match column {
                b'N' => drop(words.next()),
                b'O' => {
                    let offset = words.next().and_then(milliseconds);
                    (row.offset_ns, row.uncertainty) = offset.ok_or("not a time in ms")?;
                }
                b'T' => row.kind = words.next().ok_or("no type")?,
                b't' => {
                    row.kind = words.next().ok_or("no type")?;
                    row.direction = side(row.kind);
                }
                b'B' => row.bus = words.next().and_then(decimal),
                b'I' if side(next).is_none() => row.id = words.next().ok_or("no identifier")?,
                b'd' if side(next).is_some() => row.direction = words.next().and_then(side),
                b'R' if next == b"-" => drop(words.next()),
                b'l' | b'L' if next.len() == 1 || row.has_length() => {
                    row.is_dlc = *column == b'L';
                    row.length = Some(words.next().and_then(decimal).ok_or("no length")?);
                }
                b'D' => row.read_data(&mut words),
                _ => {}
            }
        }
        Ok(row)
    }

    /// Status and error rows need no length: what stands there may be their first byte.
    fn has_length(&self) -> bool {
        !matches!(self.kind, b"ST" | b"ER" | b"EC" | b"EV")
    }

    fn read_data(&mut self, words: &mut impl Iterator<Item = &'a [u8]>) {
        for word in words {
            match pair(word) {
                Some(byte) => drop(self.data.push(byte)),
                None if word == b"--" => {}
                None => self.word = self.word.or(Some(word)),
            }
        }
    }

    fn say(&self, start_ns: i64, line: &'a [u8]) -> Said<'a> {
        let name = self.bus.map_or(Name::Only, Name::Number);
        let at = Moment::from_ns(start_ns.saturating_add(self.offset_ns));
        let report = |report: Option<Report>| match report {
            Some(report) => Said::Frame(name, report.frame(at, self.uncertainty)),
            None => Said::Remark(name, at, line),
        };
        match (self.kind, self.word) {
            (b"Error" | b"ER", _) | (_, Some(b"ERROR")) => report(self.error()),
            (b"Warng" | b"ST", _) => report(self.status()),
            (b"EC", _) => report(self.counters()),
            (b"EV", _) => Said::Remark(name, at, line),
            _ if self.id == STATUS => report(self.status()),
            _ => match self.frame(at) {
                Some(frame) => Said::Frame(name, frame),
                None => Said::Bad("not a row of a trace: expected identifier, length and data"),
            },
        }
    }

    fn frame(&self, at: Moment) -> Option<Frame> {
        let kind = match self.kind {
            b"RR" => FrameKind::Remote,
            b"FD" | b"FB" | b"FE" | b"BI" => FrameKind::Fd,
            b"DT" | b"Rx" | b"Tx" if self.word == Some(b"RTR") => FrameKind::Remote,
            b"DT" | b"Rx" | b"Tx" => FrameKind::Data,
            _ => return None,
        };
        // Width, not value, tells 29 bits from 11.
        let id = match self.id.len() {
            4 => identifier(number(self.id)?, false)?,
            8 => identifier(number(self.id)?, true)?,
            _ => return None,
        };
        let length = u8::try_from(self.length?).ok()?;
        let (dlc, bytes) = match (kind, self.is_dlc) {
            (FrameKind::Fd, true) => {
                let bytes = *FD_LENGTHS.get(usize::from(length))?;
                (bytes, bytes)
            }
            (FrameKind::Fd, false) => (length, length),
            _ => (length, length.min(MAX_CLASSIC_DATA as u8)),
        };
        if dlc > if kind == FrameKind::Fd { 64 } else { 15 } {
            return None;
        }
        let mut frame = Frame::new(at, self.uncertainty, kind, id, dlc);
        frame.direction = self.direction;
        if kind == FrameKind::Remote {
            return Some(frame);
        }
        let data = self.data.as_slice();
        let there = data.len().min(usize::from(bytes));
        let mut frame = frame.with(&data[..there]);
        if kind == FrameKind::Fd {
            frame.fd_flags = FdFlags {
                has_rate_switch: matches!(self.kind, b"FB" | b"BI"),
                is_error_passive: matches!(self.kind, b"FE" | b"BI"),
            };
            frame.original_length = (there < usize::from(bytes)).then_some(bytes.into());
        }
        Some(frame)
    }

    /// Type, direction, place, receive and transmit counter. Versions 1 have the type in place of
    /// the identifier.
    fn error(&self) -> Option<Report> {
        let (kind, direction, place, counters) = match *self.data.as_slice() {
            [kind, direction, place, received, sent] => (kind, direction, place, (sent, received)),
            [direction, place, received, sent] => {
                (number(self.id)? as u8, direction, place, (sent, received))
            }
            _ => return Some(Report::of_error()),
        };
        let kind = match kind {
            1 => Kind::Bit,
            2 => Kind::Form,
            4 => Kind::Stuff,
            _ => Kind::Other,
        };
        Some(Report::of_kind(kind, place, direction == 0).counting(counters.0, counters.1))
    }

    /// Nothing where the status is that all is well.
    fn status(&self) -> Option<Report> {
        let bytes = self.data.as_slice().first_chunk()?;
        let status = u32::from_be_bytes(*bytes);
        let has = |bit: u32| status & bit != 0;
        Some(match () {
            () if has(BUS_OFF) => Report::of_state(State::Off),
            () if has(BUS_HEAVY) => Report::of_state(State::Passive),
            () if has(BUS_LIGHT) => Report::of_state(State::Warning),
            () if has(OVERRUN) => Report::of_overrun(),
            () => return None,
        })
    }

    fn counters(&self) -> Option<Report> {
        match *self.data.as_slice() {
            [received, sent, ..] => Some(Report::of_counters(sent, received)),
            _ => None,
        }
    }
}

fn side(word: &[u8]) -> Option<Direction> {
    match word {
        b"Rx" => Some(Direction::Received),
        b"Tx" => Some(Direction::Sent),
        _ => None,
    }
}

/// Milliseconds with up to three decimals: ns, and what the last digit is worth in ns.
fn milliseconds(word: &[u8]) -> Option<(i64, u32)> {
    // A number of seconds a thousand times too large; its resolution too.
    let ([], stamp) = seconds(word).ok()? else { return None };
    Some((stamp.time.ns()? / 1_000, stamp.resolution / 1_000)).filter(|(_, unit)| *unit > 0)
}

#[cfg(test)]
mod tests {
    use super::super::super::damage::survive;
    use super::super::super::transcript::transcript;
    use super::super::super::{InputFormat, SourceOptions};

    fn read(text: &str) -> Vec<String> {
        transcript(InputFormat::Trc, text.as_bytes(), &SourceOptions::default())
    }

    /// What is said of rows of a version; an hour after its start.
    fn rows(header: &str, rows: &[&str]) -> Vec<String> {
        let said = read(&format!("{header}\n;  Rx/Tx  a comment\n{}\n", rows.join("\n")));
        said[1..]
            .join(", ")
            .split(", ")
            .map(|row| row.trim_start_matches("0: ").to_owned())
            .collect()
    }

    /// Day 43008.5 is noon of 30 September 2017: 1506772800 s after the epoch (`date -d`).
    #[test]
    fn version_1_0_has_no_header_and_whole_milliseconds() {
        let said = read(
            ";   Start time: 26.04.2002\n     1)      1841 0001  8 00 11 22 33 44 55 66 77 \n     2)      \
             1842 00000001  2 AA BB -- -- \n     3)      1843 0100  4 RTR\n     4)      1844 FFFFFFFF  4 00 \
             00 00 08 -- -- -- -- BUSHEAVY \n     5)      1845 00000004  4 ERROR 01 0A 05 06\n",
        );
        assert_eq!(
            said,
            [
                "bus can log",
                "0: 001#0011223344556677 @1841000000±1000000, 00000001#AABB @1842000000±1000000, \
                 100#R4 @1843000000±1000000, error 4#0030000000000000 @1844000000±1000000, \
                 error 288#0000040A00000605 @1845000000±1000000"
            ]
        );
    }

    #[test]
    fn version_1_1_counts_tenths_from_the_start() {
        let header = ";$FILEVERSION=1.1\n;$STARTTIME=43008.5";
        let said = rows(
            header,
            &[
                "     1)      1059.9  Rx         0300  2  00 04",
                "     2)      1060.0  Tx     18EBFF00  1  AA",
                "     3)      1060.1  Rx         0300  4  RTR",
                "     4)      1060.2  Warng  FFFFFFFF  4  00 00 00 10  BUSOFF",
                "     5)      1060.3  Error  00000001  4  00 19 08 09",
                "     6)      1060.4  Warng  FFFFFFFF  4  00 00 00 00  ",
            ],
        );
        assert_eq!(
            said,
            [
                "300#0004 R @1506772801059900000±100000",
                "18EBFF00#AA T @1506772801060000000±100000",
                "300#R4 R @1506772801060100000±100000",
                "error 40#0000000000000000 @1506772801060200000±100000",
                // Sent by the tap itself: 80h. Counters: received 8, sent 9.
                "error 288#0000811900000908 @1506772801060300000±100000",
                "comment @1506772801060400000 \"6)      1060.4  Warng  FFFFFFFF  4  00 00 00 00\"",
            ]
        );
    }

    #[test]
    fn versions_1_2_and_1_3_name_the_bus() {
        for (version, reserved) in [("1.2", ""), ("1.3", " -")] {
            let row =
                |bus| format!("     1)   1059.900 {bus}  Rx        0300{reserved}  1    0{bus}");
            let said = read(&format!(";$FILEVERSION={version}\n{}\n{}\n", row(1), row(2)));
            assert_eq!(
                said,
                [
                    "bus can1 log",
                    "0: 300#01 R @1059900000±1000",
                    "bus can2 log",
                    "1: 300#02 R @1059900000±1000",
                ],
                "{version}"
            );
        }
    }

    #[test]
    fn version_2_0_leaves_columns_of_reports_empty() {
        let said = rows(
            ";$FILEVERSION=2.0\n;$STARTTIME=43008.5\n;$COLUMNS=N,O,T,I,d,l,D",
            &[
                "      1     17535.400 DT     0100 Rx 2  00 01 ",
                "      2     17540.300 ST          Rx    00 00 00 04 ",
                "      3     17540.400 FB     0100 Tx 12 00 01 02 03 04 05 06 07 08 09 0A 0B",
                "      4     17540.500 RR     0100 Rx 4  ",
                "      5     17540.600 EC          Rx    07 09 ",
                "      6     17540.700 ER          Rx    02 01 18 05 06 ",
                "      7     17540.800 DT     0100 Rx 8  00 01 ",
            ],
        );
        let said: Vec<&str> = said.iter().map(|row| row.split(" @").next().unwrap()).collect();
        assert_eq!(
            said,
            [
                "100#0001 R",
                "error 4#000C000000000000",
                "100##000102030405060708090A0B T",
                "100#R4 R",
                "error 200#0000000000000907",
                "error 288#0000021800000605",
                "100#0001 dlc 8 R",
            ]
        );
    }

    #[test]
    fn version_2_1_has_a_bus_and_a_dlc() {
        let columns = ";$FILEVERSION=2.1\n;$COLUMNS=N,O,T,B,I,d,R,L,D";
        let said = rows(
            columns,
            &[
                "      1     17535.400 DT 1      0100 Rx -  2    00 01 ",
                "      2     17540.300 ST 1         - Rx -  4    00 00 00 08 ",
                "      3     17540.400 BI 1      0100 Rx -  9    00 01 02 03 04 05 06 07 08 09 0A 0B",
                // Eight bytes with DLC 12, and a row without the reserved column.
                "      4     17540.500 DT 1  00000100 Rx -  12   00 01 02 03 04 05 06 07",
                "      5     17540.600 DT 1      0100 Rx 1    AA",
                "      6     17540.700 EV 1  user text",
            ],
        );
        let said: Vec<&str> = said.iter().map(|row| row.split(" @").next().unwrap()).collect();
        assert_eq!(
            said,
            [
                "100#0001 R",
                "error 4#0030000000000000",
                "100##000102030405060708090A0B R",
                "00000100#0001020304050607 dlc 12 R",
                "100#AA R",
                "comment",
            ]
        );
    }

    #[test]
    fn what_is_wrong_is_told() {
        assert_eq!(
            read(";$FILEVERSION=3.0\n"),
            ["test: line 1: a trace of a version that is not known: 1.0 to 2.1 are"]
        );
        let said = read(";$FILEVERSION=1.1\n1) x Rx 0300 0\n2) 1.0 Rx 03 0\n3) 2.0 Rx 0300 1 A");
        assert_eq!(
            said,
            [
                "warning: test: line 2: not a time in ms: left out",
                "warning: test: line 3: not a row of a trace: expected identifier, length and \
                 data: left out",
                "bus can log",
                "0: 300# dlc 1 R @2000000±100000",
                "test: line 4: the file ends inside this line: it was cut",
            ]
        );
    }

    #[test]
    fn no_damage_stops_the_reader_for_good() {
        let text = ";$FILEVERSION=2.1\n;$STARTTIME=43008.920986006946\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n      \
                    1     17535.400 DT 1      0100 Rx -  2    00 01 \n      2     17540.300 ST 1         - \
                    Rx -  4    00 00 00 08 \n";
        survive(InputFormat::Trc, text.as_bytes());
        let old = "     1)      1841 0001  2 00 11 \n     2)      1842 0100  4 RTR\n";
        survive(InputFormat::Trc, old.as_bytes());
    }
}
