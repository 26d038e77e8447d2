//! `interbus-log`: process words as CSV, a row each.

use super::super::lines::Lines;
use super::super::numbers::{hex32, seconds, whole};
use super::super::outbox::{Outbox, Reader};
use super::super::{Input, SourceError, SourceOptions};
use dissectors::bus::WireFacts;
use dissectors::event::Clock;
use dissectors::interbus::{Content, Device, Row};
use dissectors::protocol::Medium;
use dissectors::record::BusInfo;
use nom::character::complete::char;
use nom::{IResult, Parser};

/// The name of the bus: such a log has none.
const BUS: &str = "ring";

const HEADER: &[u8] = b"time,out,in";

/// Whether a source begins with a header of this format.
pub fn is_header(head: &[u8]) -> bool {
    head.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(head).starts_with(HEADER)
}

/// A log of process words.
pub struct Log {
    lines: Lines<Input>,
    is_announced: bool,
}

impl Log {
    /// Reads rows from this input.
    ///
    /// # Errors
    /// None so far.
    pub fn new(input: Input, options: &SourceOptions) -> Result<Self, SourceError> {
        options.choose_only(BUS, &input.name)?;
        let name = input.name.clone();
        Ok(Log { lines: Lines::new(&name, input), is_announced: false })
    }
}

impl Reader for Log {
    fn read_on(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
        if !self.is_announced {
            self.is_announced = true;
            let facts = WireFacts { medium: Some(Medium::Words), ..WireFacts::default() };
            out.bus(BusInfo::new(BUS, Some(Clock::Log)), facts);
        }
        while !out.is_full() {
            let Some(line) = self.lines.next_line()? else { return Ok(false) };
            let line = line.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(line);
            if line.is_empty() || line == HEADER {
                continue;
            }
            let Some(row) = whole(row, line) else {
                let what = "not a row: expected seconds and two words of 8 hex digits";
                return Err(self.lines.error(what));
            };
            out.row(0, row);
        }
        Ok(true)
    }
}

fn row(input: &[u8]) -> IResult<&[u8], Row> {
    let (input, stamp) = seconds(input)?;
    let (input, _) = char(',').parse(input)?;
    let (input, sent) = hex32(8)(input)?;
    let (input, _) = char(',').parse(input)?;
    let (input, received) = hex32(8)(input)?;
    let content = Content::Process { out: Some(sent), input: Some(received) };
    Ok((input, Row::new(Some(Device::FIRST), content).at(stamp.time, stamp.resolution)))
}
