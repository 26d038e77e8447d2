//! Two logs of one ring, joined by time: usually what the master sends in one, and what it receives
//! in the other.
//!
//! Each line becomes a row, as if one log held both: it carries the last word of the other side.
//! Lines with the same stamp are one row. A log that is over says nothing of what came later than
//! its longest pause behind its end: a device whose answers were not logged any more is not silent.

use super::super::SourceError;
use super::super::outbox::Outbox;
use super::log::File;
use dissectors::event::Moment;
use dissectors::interbus::{Content, Row};

/// Devices in a ring, and one more for number 0, which is none.
const PLACES: usize = 513;

/// The second log, and where both are.
pub struct Join {
    second: File,
    /// The next rows of each: those of a line.
    next: [Vec<Row>; 2],
    is_over: [bool; 2],
    pace: [Pace; 2],
    /// Rows of it were taken.
    has_begun: [bool; 2],
    is_compared: bool,
    /// The last words of each device.
    last: Vec<Sides>,
}

/// What the master sent and received last.
type Sides = (Option<u32>, Option<u32>);

/// How the rows of a log come.
#[derive(Clone, Copy)]
struct Pace {
    /// When the last one came.
    last: Moment,
    /// The longest time from one to the next, in ns.
    longest: i64,
}

impl Pace {
    fn add(&mut self, row: Moment) {
        self.longest = self.longest.max(row.since(self.last).unwrap_or(0));
        self.last = row;
    }

    /// Whether a log that is over still says what was there at that time.
    fn reaches(self, time: Moment) -> bool {
        time.since(self.last).is_none_or(|ns| ns <= self.longest)
    }
}

impl Join {
    /// To be joined to a first one.
    pub fn new(second: File) -> Self {
        Join {
            second,
            next: [Vec::new(), Vec::new()],
            is_over: [false; 2],
            pace: [Pace { last: Moment::UNKNOWN, longest: 0 }; 2],
            has_begun: [false; 2],
            is_compared: false,
            last: vec![(None, None); PLACES],
        }
    }

    /// The second log.
    pub fn second(&self) -> &File {
        &self.second
    }

    /// Reads the next row, or those of the next line. False at the end of both.
    ///
    /// # Errors
    /// One of them cannot be read any further, or their times cannot be compared.
    pub fn read(
        &mut self,
        first: &mut File,
        rows: &mut Vec<Row>,
        out: &mut Outbox,
    ) -> Result<bool, SourceError> {
        for (file, index) in [(&mut *first, 0), (&mut self.second, 1)] {
            while self.next[index].is_empty() && !self.is_over[index] {
                self.is_over[index] = !file.read(&mut self.next[index], out)?;
            }
        }
        let start = |index: usize| self.next[index].first().map(|row| row.start);
        let takes = match (start(0), start(1)) {
            (None, None) => return Ok(false),
            (Some(next), None) => self.goes_on(0, next)?,
            (None, Some(next)) => self.goes_on(1, next)?,
            (Some(one), Some(other)) => {
                self.compare(first)?;
                takes(one, other)
            }
        };
        (0..2).for_each(|index| self.has_begun[index] |= takes[index]);
        let taken = (0..2).filter(|index| takes[*index]);
        taken.clone().for_each(|index| self.learn(index));
        taken.for_each(|index| self.tell(index, rows));
        Ok(true)
    }

    /// Whether the times of both are counted from the same moment, as far as their first ones tell.
    fn compare(&mut self, first: &File) -> Result<(), SourceError> {
        if std::mem::replace(&mut self.is_compared, true) {
            return Ok(());
        }
        match (self.second.base(), first.base()) {
            (Some(own), Some(others)) if own != others => Err(self.second.error(format!(
                "its times are {}, those of {} are {}: they cannot be joined",
                own.name(),
                first.name(),
                others.name()
            ))),
            _ => Ok(()),
        }
    }

    /// Which log goes on where the other has no more. One that has not begun by then has nothing in
    /// common with the other, unless that one is empty.
    fn goes_on(&self, index: usize, next: Moment) -> Result<[bool; 2], SourceError> {
        if next.is_known() && !self.has_begun[index] && self.has_begun[1 - index] {
            return Err(self.second.error(
                "one log begins after the other has ended, so that they cannot be joined: check \
                 their clocks and --time-unit",
            ));
        }
        Ok([index == 0, index == 1])
    }

    /// Takes note of the next words of one log.
    fn learn(&mut self, index: usize) {
        for row in &self.next[index] {
            self.pace[index].add(row.start);
            if let (Content::Process { out, input }, Some(sides)) =
                (row.content, self.last.get_mut(place(row)))
            {
                *sides = (out.or(sides.0), input.or(sides.1));
            }
        }
    }

    /// Hands the next rows of one log out, with what is known of both sides.
    fn tell(&mut self, index: usize, rows: &mut Vec<Row>) {
        for row in self.next[index].drain(..) {
            let same = |told: &Row| told.device == row.device && told.start == row.start;
            if rows.iter().any(same) {
                continue;
            }
            let is_alone = self.is_over[1 - index] && !self.pace[1 - index].reaches(row.start);
            let content = match (row.content, self.last.get(place(&row))) {
                (Content::Process { .. }, Some((out, input))) if !is_alone => {
                    Content::Process { out: *out, input: *input }
                }
                (own, _) => own,
            };
            rows.push(Row::new(row.device, content).at(row.start, row.uncertainty));
        }
    }
}

fn place(row: &Row) -> usize {
    row.device.map_or(0, |device| usize::from(device.number()))
}

/// Which of two rows comes next, or both.
fn takes(first: Moment, second: Moment) -> [bool; 2] {
    match first.ns().cmp(&second.ns()) {
        std::cmp::Ordering::Less => [true, false],
        std::cmp::Ordering::Greater => [false, true],
        std::cmp::Ordering::Equal => [true, true],
    }
}
