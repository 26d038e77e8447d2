//! Raw digital data in binary form: a file a channel, little-endian.
//!
//! After `<SALEAE>`, i32 version and i32 type (0: digital), version 0 has one run of data: u32 first
//! level, f64 begin, f64 end, u64 count, and so many f64 times at which the level changed. Version 1
//! has a u64 count of such runs, each with an f64 sample rate behind its first level, and gaps may
//! be between them. Times are in seconds.

use super::super::lanes::Lanes;
use super::super::outbox::{Outbox, Reader};
use super::super::stream::Stream;
use super::super::{Input, SourceError, SourceOptions};
use dissectors::event::Moment;
use nom::combinator::cond;
use nom::number::complete::{le_f64, le_i32, le_u32, le_u64};
use nom::{IResult, Parser};
use std::path::Path;

/// What the file begins with.
pub const MAGIC: &[u8] = b"<SALEAE>";

const FILE_HEADER: usize = 16;
const RUN_HEADER_V0: usize = 28;
const RUN_HEADER_V1: usize = 36;

/// Times that are read at once at most.
const BATCH: usize = 4096;

/// A binary digital source.
pub struct Binary {
    stream: Stream,
    /// That of the file, as nothing in it tells.
    channel: String,
    version: Option<Version>,
    /// Runs that are still to come.
    runs: u64,
    /// Changes of this run that are still to come.
    changes: u64,
    line: Option<Line>,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Version {
    Zero,
    One,
}

/// What a run of data begins with.
#[derive(Clone, Copy, Debug)]
struct Run {
    is_high: bool,
    /// In Hz.
    sample_rate: Option<f64>,
    /// In s.
    begin: f64,
    end: f64,
    changes: u64,
}

/// What is known since the first run.
struct Line {
    lanes: Lanes,
    /// The time of tick 0 in the file, in ns.
    base: i64,
    /// ± of a run's begin and end, in ns.
    slack: u64,
    is_high: bool,
    last: u64,
    /// Where the run ends.
    end: u64,
}

impl Binary {
    /// Reads changes from this input.
    ///
    /// # Errors
    /// The user asked for another channel than the one there is.
    pub fn new(input: Input, options: &SourceOptions) -> Result<Self, SourceError> {
        let stem = Path::new(&input.name).file_stem().unwrap_or_default();
        let channel = stem.to_string_lossy().into_owned();
        options.choose_only(&channel, &input.name)?;
        let stream = Stream::new(input);
        Ok(Binary { stream, channel, version: None, runs: 0, changes: 0, line: None })
    }

    fn step(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
        let Some(version) = self.version else {
            self.open()?;
            return Ok(true);
        };
        if self.changes > 0 {
            self.changes(out)?;
        } else if self.runs > 0 {
            self.run(version, out)?;
        } else {
            return self.close(out);
        }
        Ok(true)
    }

    fn open(&mut self) -> Result<(), SourceError> {
        let Ok((_, (version, kind))) = file_header(self.stream.ahead(FILE_HEADER)?) else {
            return Err(self.stream.error("the file ends inside its header: it was cut"));
        };
        if kind != 0 {
            let what = match kind {
                1 => "this is an analog channel: export the digital ones".to_owned(),
                _ => format!("data of type {kind} is not known: export the channel as binary"),
            };
            return Err(self.stream.error(what));
        }
        let version = match version {
            0 => Version::Zero,
            1 => Version::One,
            _ => {
                let what = format!("version {version} is not known: export the channel as CSV");
                return Err(self.stream.error(what));
            }
        };
        self.stream.take(FILE_HEADER);
        self.version = Some(version);
        self.runs = 1;
        if version == Version::One {
            let Ok((_, runs)) = run_count(self.stream.ahead(8)?) else {
                return Err(self.stream.error("the file ends inside its header: it was cut"));
            };
            self.stream.take(8);
            self.runs = runs;
        }
        Ok(())
    }

    /// Begins the next run.
    fn run(&mut self, version: Version, out: &mut Outbox) -> Result<(), SourceError> {
        let length = match version {
            Version::Zero => RUN_HEADER_V0,
            Version::One => RUN_HEADER_V1,
        };
        let Ok((_, run)) = run(self.stream.ahead(length)?, version) else {
            return Err(self.stream.error("the file ends where data should begin: it was cut"));
        };
        let channel = &self.channel;
        let line = match &mut self.line {
            Some(line) => line.go_on(&run, out),
            none => Line::new(&run, channel, out).map(|line| *none = Some(line)),
        };
        if line.is_none() {
            let what = "the times of this run of data are not possible: the file is damaged";
            return Err(self.stream.error(what));
        }
        self.stream.take(length);
        self.runs -= 1;
        self.changes = run.changes;
        Ok(())
    }

    /// Takes as many changes as are there.
    fn changes(&mut self, out: &mut Outbox) -> Result<(), SourceError> {
        let Some(line) = &mut self.line else { return Ok(()) };
        let there = self.stream.ahead(size_of::<f64>())?;
        let (times, _) = there.as_chunks();
        let most = usize::try_from(self.changes).unwrap_or(BATCH).min(BATCH);
        let times = &times[..times.len().min(most)];
        let good = times.iter().take_while(|time| line.change(f64::from_le_bytes(**time), out));
        let (good, there) = (good.count(), times.len());
        self.stream.take(good * size_of::<f64>());
        self.changes -= good as u64;
        if there == 0 {
            let what =
                format!("the file ends {} level changes too early: it was cut", self.changes);
            return Err(self.stream.error(what));
        }
        if good < there {
            return Err(self.stream.error("the time goes back: the file is damaged"));
        }
        Ok(())
    }

    fn close(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
        if !self.stream.ahead(1)?.is_empty() {
            out.warning(self.stream.error("more data than the header tells: it is left out"));
        }
        Ok(false)
    }
}

impl Reader for Binary {
    fn read_on(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
        let read = self.step(out);
        if let (false, Some(line)) = (matches!(read, Ok(true)), &mut self.line) {
            // However the file ends, what was gathered is good.
            let end = if read.is_ok() { line.end.max(line.last) } else { line.last };
            line.lanes.finish(end, out);
        }
        read
    }
}

impl Line {
    /// The line at the start of the first run; `None` if its times are not possible.
    fn new(run: &Run, channel: &str, out: &mut Outbox) -> Option<Self> {
        // Times count from the start or from a trigger, and may be negative then.
        let base = ns(run.begin)?.min(0);
        let period = run.sample_rate.filter(|rate| *rate > 0.0).map(|rate| {
            // Saturates at what fits.
            (1e9 / rate).ceil() as u32
        });
        let mut lanes = Lanes::new(Moment::from_ns(0), period);
        lanes.add(channel.to_owned());
        let slack = u64::from(period.unwrap_or(1)) * 3 / 2;
        let mut line = Line { lanes, base, slack, is_high: false, last: 0, end: 0 };
        line.begin(run, out)?;
        Some(line)
    }

    /// Goes on with the next run, which begins where the last one ended or behind a gap.
    fn go_on(&mut self, run: &Run, out: &mut Outbox) -> Option<()> {
        let begin = self.tick(run.begin)?;
        let end = self.end.max(self.last);
        if begin.saturating_add(self.slack) < end {
            return None;
        }
        if begin > end.saturating_add(self.slack) {
            self.lanes.set(0, end, None, out);
        }
        self.last = end;
        self.begin(run, out)
    }

    fn begin(&mut self, run: &Run, out: &mut Outbox) -> Option<()> {
        let begin = self.tick(run.begin)?.max(self.last);
        self.end = self.tick(run.end).filter(|end| end.saturating_add(self.slack) >= begin)?;
        self.is_high = run.is_high;
        self.last = begin;
        self.lanes.set(0, begin, Some(run.is_high), out);
        Some(())
    }

    /// The level changes. False if the time is not possible.
    fn change(&mut self, time: f64, out: &mut Outbox) -> bool {
        let Some(tick) = self.tick(time).filter(|tick| *tick >= self.last) else { return false };
        self.last = tick;
        self.is_high = !self.is_high;
        self.lanes.reach(tick, out);
        self.lanes.set(0, tick, Some(self.is_high), out);
        true
    }

    fn tick(&self, time: f64) -> Option<u64> {
        u64::try_from(ns(time)?.checked_sub(self.base)?).ok()
    }
}

/// Seconds in whole ns; `None` for what no capture reaches.
fn ns(seconds: f64) -> Option<i64> {
    const MOST: f64 = 9.0e18;
    let ns = (seconds * 1e9).round();
    // Not a number is not in it.
    (-MOST..MOST).contains(&ns).then_some(ns as i64)
}

fn file_header(input: &[u8]) -> IResult<&[u8], (i32, i32)> {
    let (input, _) = nom::bytes::complete::tag(MAGIC)(input)?;
    (le_i32, le_i32).parse(input)
}

fn run_count(input: &[u8]) -> IResult<&[u8], u64> {
    le_u64(input)
}

fn run(input: &[u8], version: Version) -> IResult<&[u8], Run> {
    let (input, level) = le_u32(input)?;
    let (input, sample_rate) = cond(version == Version::One, le_f64).parse(input)?;
    let (input, (begin, end, changes)) = (le_f64, le_f64, le_u64).parse(input)?;
    Ok((input, Run { is_high: level != 0, sample_rate, begin, end, changes }))
}

#[cfg(test)]
mod tests {
    use super::super::super::InputFormat;
    use super::super::super::damage::survive;
    use super::super::super::transcript::transcript;
    use super::*;

    fn file(version: i32, kind: i32, rest: &[Vec<u8>]) -> Vec<u8> {
        [MAGIC, &version.to_le_bytes(), &kind.to_le_bytes(), &rest.concat()].concat()
    }

    fn run(level: u32, rate: Option<f64>, begin: f64, end: f64, times: &[f64]) -> Vec<u8> {
        let mut bytes = level.to_le_bytes().to_vec();
        for number in rate.iter().chain([&begin, &end]) {
            bytes.extend(number.to_le_bytes());
        }
        bytes.extend((times.len() as u64).to_le_bytes());
        bytes.extend(times.iter().flat_map(|time| time.to_le_bytes()));
        bytes
    }

    fn read(bytes: &[u8]) -> Vec<String> {
        transcript(InputFormat::SaleaeBin, bytes, &SourceOptions::default())
    }

    #[test]
    fn version_0_is_one_run_rounded_to_nanoseconds() {
        let times = [0.0003731000000000001, 0.000_381_78, 0.5];
        let bytes = file(0, 0, &[run(1, None, 0.0, 1.0, &times)]);
        assert_eq!(bytes.len(), 44 + 8 * 3);
        assert_eq!(
            read(&bytes),
            [
                "bus test sample 1000000000/s ±1 @0",
                "0: high from 0 [373100, 381780, 500000000] until 1000000000",
                "0: end @1000000000"
            ]
        );
    }

    #[test]
    fn times_before_a_trigger_begin_at_0() {
        let bytes = file(0, 0, &[run(0, None, -0.25, 0.25, &[-0.125, 0.125])]);
        assert_eq!(read(&bytes)[1], "0: low from 0 [125000000, 375000000] until 500000000");
    }

    #[test]
    fn version_1_has_a_sample_rate_and_gaps() {
        let rate = Some(12e6);
        let bytes = file(
            1,
            0,
            &[
                3_u64.to_le_bytes().to_vec(),
                run(1, rate, 0.0, 0.001, &[0.0005]),
                // Goes on at once, at the other level.
                run(1, rate, 0.001, 0.002, &[0.0015]),
                run(1, rate, 0.003, 0.004, &[0.0035]),
            ],
        );
        assert_eq!(
            read(&bytes),
            [
                // 83.3 ns, rounded up.
                "bus test sample 1000000000/s ±84 @0",
                "0: high from 0 [500000, 1000000, 1500000] until 2000000",
                "0: lost Capture @2000000",
                "0: high from 3000000 [3500000] until 4000000",
                "0: end @4000000"
            ]
        );
    }

    #[test]
    fn a_channel_that_never_moves_is_no_bus() {
        assert_eq!(read(&file(0, 0, &[run(1, None, 0.0, 1.0, &[])])), [""; 0]);
        assert_eq!(read(&file(1, 0, &[vec![0; 8]])), [""; 0]);
    }

    #[test]
    fn other_data_is_refused() {
        let what = |version, kind| read(&file(version, kind, &[vec![0; 64]])).concat();
        assert!(what(0, 1).contains("analog channel: export the digital ones"));
        assert!(what(1, 100).contains("data of type 100 is not known"));
        assert!(what(7, 0).contains("version 7 is not known"));
    }

    #[test]
    fn a_cut_file_is_read_as_far_as_it_goes() {
        let whole = file(0, 0, &[run(1, None, 0.0, 1.0, &[0.25, 0.5])]);
        assert_eq!(
            read(&whole[..44 + 11])[1..],
            [
                "0: high from 0 [250000000] until 250000001",
                "0: end @250000000",
                "test: at byte 52: the file ends 1 level changes too early: it was cut"
            ]
        );
        assert_eq!(
            read(&whole[..43]),
            ["test: at byte 16: the file ends where data should begin: it was cut"]
        );
        assert_eq!(
            read(&whole[..15]),
            ["test: at byte 0: the file ends inside its header: it was cut"]
        );
        let more = [&whole[..], b"x"].concat();
        assert_eq!(
            read(&more)[0],
            "warning: test: at byte 60: more data than the header tells: it is left out"
        );
    }

    #[test]
    fn impossible_times_are_damage() {
        let last = |times: &[f64]| {
            let said = read(&file(0, 0, &[run(1, None, 0.0, 1.0, times)]));
            said.last().unwrap().clone()
        };
        let back = "the time goes back: the file is damaged";
        assert_eq!(last(&[0.5, 0.25]), format!("test: at byte 52: {back}"));
        for wrong in [f64::NAN, f64::INFINITY, -1.0, 1e300] {
            assert_eq!(last(&[wrong]), format!("test: at byte 44: {back}"), "{wrong}");
        }
        let begin = file(0, 0, &[run(1, None, f64::NAN, 1.0, &[])]);
        assert!(read(&begin)[0].contains("not possible: the file is damaged"));
    }

    #[test]
    fn no_damage_stops_the_reader_for_good() {
        let times = [0.25, 0.5, 0.625];
        survive(InputFormat::SaleaeBin, &file(0, 0, &[run(1, None, 0.0, 1.0, &times)]));
        let run = |begin, end| run(1, Some(1e6), begin, end, &times);
        let chunks = [2_u64.to_le_bytes().to_vec(), run(0.0, 1.0), run(1.0, 2.0)];
        survive(InputFormat::SaleaeBin, &file(1, 0, &chunks));
    }
}
