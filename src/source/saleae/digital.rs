//! Raw digital data as CSV: a row whenever an exported channel changes.
//!
//! `Time [s],Channel 0,Channel 1`, then `0.000016460,0,1`. The first row has the levels the capture
//! began with, the last one those it ended with. `X` is no data.

use super::super::lanes::Lanes;
use super::super::outbox::{Outbox, Reader};
use super::super::rows::{Quotes, Rows, shown, without_mark};
use super::super::{Input, MOST_CHANNELS, SourceError, SourceOptions};
use super::time::Time;
use dissectors::event::Moment;
use nom::branch::alt;
use nom::bytes::complete::tag;
use nom::{IResult, Parser};

/// Whether a line is the header of such a file.
pub fn is_header(line: &[u8]) -> bool {
    // Tables of packets begin like it.
    time_column(line).is_ok_and(|(rest, _)| rest.starts_with(b",") && !rest.starts_with(b",Packet"))
}

fn time_column(line: &[u8]) -> IResult<&[u8], &[u8]> {
    alt((tag("Time [s]"), tag("\"Time [s]\""), tag("Time[s]"))).parse(line)
}

/// A raw digital source.
pub struct Digital {
    rows: Rows,
    options: SourceOptions,
    columns: Option<Columns>,
    line: Option<Line>,
}

/// What the header tells.
struct Columns {
    count: usize,
    /// Number and name of those that are decoded.
    taken: Vec<(usize, String)>,
}

/// What is known since the first row.
struct Line {
    lanes: Lanes,
    is_dated: bool,
    /// The time of tick 0 in the file, in ns.
    base: i64,
    last: u64,
}

impl Digital {
    /// Reads rows from this input.
    pub fn new(input: Input, options: &SourceOptions) -> Self {
        let rows = Rows::new(input, Quotes::Used);
        Digital { rows, options: options.clone(), columns: None, line: None }
    }

    fn header(&mut self) -> Result<Columns, SourceError> {
        let header = self.rows.row();
        let is_time = |field: &[u8]| time_column(field).is_ok_and(|(rest, _)| rest.is_empty());
        if !header.get(0).is_some_and(|field| is_time(without_mark(field))) || header.len() < 2 {
            let what = "not raw digital data of Logic 2: expected a header Time [s],Channel 0,…";
            return Err(self.rows.error(what));
        }
        if header.len() > MOST_CHANNELS {
            return Err(self.rows.error("more channels than any analyzer has"));
        }
        let mut names: Vec<String> = Vec::new();
        for (column, field) in header.iter().enumerate().skip(1) {
            let mut name = String::from_utf8_lossy(field).into_owned();
            // Two channels may have the same name, two buses not.
            while names.contains(&name) {
                name = format!("{name} (column {column})");
            }
            names.push(name);
        }
        let count = header.len();
        let columns = (1..).zip(names).collect();
        let taken = self.options.chosen(columns, |(_, name)| name);
        let taken = taken.map_err(|what| self.rows.error(what))?;
        Ok(Columns { count, taken })
    }

    fn next_row(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
        if !self.rows.find()? {
            return Ok(false);
        }
        let Some(Columns { count, taken }) = &self.columns else {
            self.columns = Some(self.header()?);
            return Ok(true);
        };
        let row = self.rows.row();
        if row.len() != *count {
            return Err(self.rows.wrong_length(*count));
        }
        let Some(time) = Time::parse(&row[0]) else {
            return Err(self.rows.error(format!("{} is not a time", shown(&row[0]))));
        };
        let line = self.line.get_or_insert_with(|| Line::new(time, taken));
        let Some(tick) = line.tick(time) else {
            return Err(self.rows.error("the time goes back: the file is damaged"));
        };
        line.lanes.reach(tick, out);
        for (lane, (column, _)) in taken.iter().enumerate() {
            let level = match row[*column].trim_ascii() {
                b"0" => Some(false),
                b"1" => Some(true),
                b"X" | b"x" => None,
                other => {
                    let what = format!("{} is not a level: expected 0, 1 or X", shown(other));
                    return Err(self.rows.error(what));
                }
            };
            line.lanes.set(lane, tick, level, out);
        }
        line.last = tick;
        Ok(true)
    }
}

impl Reader for Digital {
    fn read_on(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
        let read = self.next_row(out);
        if let (false, Some(line)) = (matches!(read, Ok(true)), &mut self.line) {
            // However the file ends, what was gathered is good.
            line.lanes.finish(line.last, out);
        }
        read
    }
}

impl Line {
    fn new(first: Time, taken: &[(usize, String)]) -> Self {
        // Seconds count from the start or from a trigger, and may be negative then.
        let base = if first.is_dated { first.ns } else { first.ns.min(0) };
        let origin = Moment::from_ns(if first.is_dated { first.ns } else { 0 });
        let mut lanes = Lanes::new(origin, None);
        for (_, name) in taken {
            lanes.add(name.clone());
        }
        Line { lanes, is_dated: first.is_dated, base, last: 0 }
    }

    /// The tick of a time; `None` before the last one.
    fn tick(&self, time: Time) -> Option<u64> {
        let tick = u64::try_from(time.ns.checked_sub(self.base)?).ok()?;
        (tick >= self.last && time.is_dated == self.is_dated).then_some(tick)
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::InputFormat;
    use super::super::super::damage::survive;
    use super::super::super::transcript::transcript;
    use super::*;

    fn read(text: &str) -> Vec<String> {
        transcript(InputFormat::SaleaeCsv, text.as_bytes(), &SourceOptions::default())
    }

    const BUS_A: &str = "bus A sample 1000000000/s ±1 @0";

    #[test]
    fn the_first_row_is_the_start_and_the_last_one_the_end() {
        let said = read(
            "Time [s],Channel 0,Channel 1\n0.000016460,0,1\n0.000020000,0,0\n\
                         0.000025,0,1\n1.000000000,0,1\n",
        );
        assert_eq!(
            said,
            [
                // Channel 0 never moves.
                "bus Channel 1 sample 1000000000/s ±1 @0",
                "0: high from 16460 [20000, 25000] until 1000000000",
                "0: end @1000000000"
            ]
        );
    }

    #[test]
    fn dates_and_times_before_a_trigger() {
        let said = read(
            "Time [s],A\r\n2022-06-24T18:51:08.852112100+00:00,1\r\n\
                         2022-06-24T18:51:08.852112600+00:00,0\r\n",
        );
        assert_eq!(
            said,
            [
                "bus A sample 1000000000/s ±1 @1656096668852112100",
                "0: high from 0 [500] until 501",
                "0: end @1656096668852112600"
            ]
        );
        assert_eq!(
            read("Time [s],A\n-0.000001,1\n0.000001,0\n")[1],
            "0: high from 0 [2000] until 2001"
        );
    }

    #[test]
    fn x_is_a_gap_of_one_channel() {
        let said = read(
            "Time [s],A,B\n0,1,1\n0.000000010,0,0\n0.000000020,X,1\n\
                         0.000000030,0,1\n0.000000040,1,1\n0.000000050,1,1\n",
        );
        assert_eq!(
            said,
            [
                BUS_A,
                "0: high from 0 [10] until 20",
                "0: lost Capture @20",
                "0: low from 30 [40] until 50",
                "bus B sample 1000000000/s ±1 @0",
                "1: high from 0 [10, 20] until 50",
                "0: end @50",
                "1: end @50"
            ]
        );
    }

    #[test]
    fn names_are_free_text_and_chosen_by() {
        let text = "Time [s],\"TX, RX\",TX,TX\n0,0,0,0\n1,1,1,1\n2,1,1,1\n";
        let buses: Vec<_> = read(text).into_iter().filter(|line| line.starts_with("bus")).collect();
        assert_eq!(
            buses,
            [
                "bus TX, RX sample 1000000000/s ±1 @0",
                "bus TX sample 1000000000/s ±1 @0",
                "bus TX (column 3) sample 1000000000/s ±1 @0"
            ]
        );
        let channels = |name: &str| {
            let channels = vec![name.to_owned()];
            let options = SourceOptions { channels, ..SourceOptions::default() };
            transcript(InputFormat::SaleaeCsv, text.as_bytes(), &options)
        };
        assert_eq!(channels("TX").len(), 3);
        assert_eq!(
            channels("Channel 0"),
            ["test: line 1: there is no channel Channel 0: there is TX, RX, TX, TX (column 3)"]
        );
    }

    #[test]
    fn damage_is_told_with_its_line_behind_what_is_good() {
        let good = "Time [s],A\n0,1\n0.000000010,0\n0.000000020,1\n";
        let wrong = |row: &str| {
            let said = read(&format!("{good}{row}"));
            assert_eq!(said[..2], [BUS_A, "0: high from 0 [10, 20] until 21"]);
            said.last().unwrap().clone()
        };
        for cut in ["0.00000002", "0.000000025"] {
            assert_eq!(wrong(cut), "test: line 5: the file ends inside this row: it was cut");
        }
        assert_eq!(wrong("0.000000025,"), "test: line 5: \"\" is not a level: expected 0, 1 or X");
        assert_eq!(
            wrong("0.000000025,3.3\n"),
            "test: line 5: \"3.3\" is not a level: expected 0, 1 or X"
        );
        assert_eq!(wrong("x,1\n"), "test: line 5: \"x\" is not a time");
        assert_eq!(
            wrong("0.000000005,1\n"),
            "test: line 5: the time goes back: the file is damaged"
        );
        assert_eq!(wrong("0.000000025,1,1\n"), "test: line 5: 3 fields, where the first row has 2");
    }

    #[test]
    fn a_row_without_an_end_is_no_row() {
        let text = format!("Time [s],A\n0,1\n\"{}", "1,".repeat(600_000));
        assert_eq!(
            read(&text).last().unwrap(),
            "test: line 3: the row has no end: this is not a table"
        );
    }

    #[test]
    fn no_damage_stops_the_reader_for_good() {
        let seconds = "Time [s],A,\"B, C\"\n0,1,1\n0.000000010,0,X\n0.00002,0,1\n1e-3,1,1\n2,1,0\n";
        survive(InputFormat::SaleaeCsv, seconds.as_bytes());
        let dates = "Time [s],A\n2022-06-24T18:51:08.852112100+00:00,1\n\
                     2022-06-24T18:51:08.852112600+00:00,0\n";
        survive(InputFormat::SaleaeCsv, dates.as_bytes());
    }
}
