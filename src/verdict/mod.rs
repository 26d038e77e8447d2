//! The last four lines: what a technician asks first.
//!
//! Is the line all right, who is there, what was wrong, and what could not be judged.

mod learned;
mod line;
mod names;
mod open;
mod who;
mod wrong;

pub use learned::Learned;
pub use line::line_of_counts;

use crate::clock::Clock;
use crate::pipeline::Pipeline;
use crate::tally::Tally;
use crate::terminal::clean;
use line::line;
use open::{is_radix_open, open};
use who::who;
use wrong::{nothing, wrong};

/// The four lines, each with its heading.
pub struct Verdict {
    /// Rate, format, and what came over the wire.
    pub line: String,
    /// Who was asked, who answered, who never did.
    pub who: String,
    /// The worst that was found, and what to do.
    pub wrong: String,
    /// What was not judged, and why.
    pub open: String,
}

/// What ended a run before its source did.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Cut {
    /// The source could not go on.
    Failure,
    /// The user interrupted.
    Interruption,
}

impl Cut {
    /// What was not judged for it.
    const fn open(self) -> &'static str {
        match self {
            Cut::Failure => "what comes after the source's failure",
            Cut::Interruption => "what comes after the interruption",
        }
    }
}

impl Verdict {
    /// Sums a run up.
    pub fn of(tally: &Tally, pipeline: &Pipeline, clock: &Clock, cut: Option<Cut>) -> Verdict {
        let buses = pipeline.buses();
        let several = buses.len() > 1;
        let wrong = match wrong(tally, several, clock) {
            None => nothing(tally, pipeline, cut),
            // Decimal positions that are read as hex jump from 999 to 1000.
            Some(wrong) if is_radix_open(buses) => format!("only if words are hex: {wrong}"),
            Some(wrong) => wrong,
        };
        Verdict {
            line: clean(&line(buses, several, cut)),
            who: clean(&who(tally, several)),
            wrong: clean(&wrong),
            open: clean(&open(tally, pipeline, cut)),
        }
    }

    /// The lines with their headings, in order.
    pub fn lines(&self) -> [(&'static str, &str); 4] {
        [("LINE", &self.line), ("WHO", &self.who), ("WRONG", &self.wrong), ("OPEN", &self.open)]
    }
}

fn counted(count: u64, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}
