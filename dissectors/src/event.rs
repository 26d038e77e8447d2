//! What a tap can hear.
//!
//! Everything a dissector takes in is an [`Event`]: characters, CAN frames, rows of words, cycles,
//! line levels, a break, a loss, or the fact that nothing was heard. Events carry their times; nothing in this crate asks a clock.

use crate::can::Frame;
use crate::finding::Span;
use crate::interbus::{Cycle, Row};
use crate::uart::Character;
use core::fmt;

/// A point in time on the wire: nanoseconds since the Unix epoch or, where the source has no
/// date, since its start. [`Moment::UNKNOWN`] for sources without any time.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Moment(i64);

impl Default for Moment {
    fn default() -> Self {
        Moment::UNKNOWN
    }
}

impl Moment {
    /// No time is known.
    pub const UNKNOWN: Moment = Moment(i64::MIN);

    /// The point `ns` nanoseconds after the epoch or the capture's start.
    #[must_use]
    pub const fn from_ns(ns: i64) -> Self {
        // The one value that stands for "unknown" is 292 years before the epoch.
        Moment(if ns == i64::MIN { i64::MIN + 1 } else { ns })
    }

    /// Nanoseconds, if the time is known.
    #[must_use]
    pub const fn ns(self) -> Option<i64> {
        if self.is_known() { Some(self.0) } else { None }
    }

    /// Whether there is a time at all.
    #[must_use]
    pub const fn is_known(self) -> bool {
        self.0 != i64::MIN
    }

    /// The point `ns` later (earlier, if negative).
    #[must_use]
    pub const fn plus(self, ns: i64) -> Self {
        if self.is_known() { Moment::from_ns(self.0.saturating_add(ns)) } else { self }
    }

    /// Nanoseconds from `earlier` to this point: negative where time ran backwards, `None` where
    /// either is unknown.
    #[must_use]
    pub const fn since(self, earlier: Moment) -> Option<i64> {
        if self.is_known() && earlier.is_known() {
            Some(self.0.saturating_sub(earlier.0))
        } else {
            None
        }
    }

    /// Whether this point lies after `other`; false where either is unknown.
    #[must_use]
    pub const fn is_after(self, other: Moment) -> bool {
        self.is_known() && other.is_known() && self.0 > other.0
    }
}

/// Who stamped the times of a source, best first.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Clock {
    /// The interface hardware.
    Hardware,
    /// The sample counter of a logic analyzer.
    Sample,
    /// The kernel, on arrival.
    Kernel,
    /// A program, after `read` returned.
    Read,
    /// A log whose maker did not say.
    Log,
}

impl Clock {
    /// The name that records carry.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Clock::Hardware => "hardware",
            Clock::Sample => "sample",
            Clock::Kernel => "kernel",
            Clock::Read => "read",
            Clock::Log => "log",
        }
    }

    /// The clock of that name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        [Clock::Hardware, Clock::Sample, Clock::Kernel, Clock::Read, Clock::Log]
            .into_iter()
            .find(|clock| clock.name() == name)
    }
}

/// A piece of one line's level history: where it toggled, in ticks of the source's sample clock.
#[derive(Clone, Copy, Debug)]
pub struct Levels<'a> {
    /// Ticks at which the level changed, ascending: the first sample of the new level.
    pub edges: &'a [u64],
    /// The level before the first edge of this piece.
    pub level: bool,
    /// The line is known from this tick on: where the piece before ended, unless something was
    /// lost in between.
    pub from: u64,
    /// The line is known before this tick.
    pub until: u64,
}

/// The line was held at the start-bit level for longer than a character.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Break {
    /// When the line went to the start-bit level.
    pub start: Moment,
    /// ± of `start` in ns.
    pub uncertainty: u32,
    /// How long it stayed there, in ns, if the source tells.
    pub duration: Option<u64>,
}

/// Nothing was on a line for longer than its protocol allows.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Silence {
    /// When it began.
    pub start: Moment,
    /// From when on it means something.
    pub deadline: Moment,
    /// ± of `start` in ns.
    pub uncertainty: u32,
}

/// Something was on the wire and is not in the capture.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Loss {
    /// When what was lost began.
    pub start: Moment,
    /// Characters or frames lost, if the source counts them.
    pub count: Option<u64>,
    /// Who lost it.
    pub cause: LossCause,
}

/// Where something was lost.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum LossCause {
    /// The capture has a gap.
    Capture,
    /// The receiver was overrun.
    Overrun,
    /// Nobody listened: the interface was down, or the port or adapter gone.
    Deaf,
    /// It was heard, and a recording of what surrounds events kept nothing of it.
    NotKept,
    /// The tap listened at other rates for so many ns, to find out the bus's.
    Sought(i64),
}

impl LossCause {
    /// Whether something failed. Else it is as the user wanted it.
    #[must_use]
    pub const fn is_failure(self) -> bool {
        match self {
            LossCause::Capture | LossCause::Overrun | LossCause::Deaf => true,
            LossCause::NotKept | LossCause::Sought(_) => false,
        }
    }

    /// Whether it is a time of which there is nothing, and not single characters or frames.
    #[must_use]
    pub const fn is_gap(self) -> bool {
        match self {
            LossCause::Capture | LossCause::Overrun => false,
            LossCause::Deaf | LossCause::NotKept | LossCause::Sought(_) => true,
        }
    }

    /// Writes what is said of it where it is no finding; nothing of a failure.
    ///
    /// # Errors
    /// Only where `out` fails.
    pub fn say(self, out: &mut dyn fmt::Write) -> fmt::Result {
        match self {
            LossCause::Capture | LossCause::Overrun | LossCause::Deaf => Ok(()),
            LossCause::NotKept => write!(
                out,
                "nothing was kept before this: the recording holds only what surrounds events"
            ),
            LossCause::Sought(ns) => write!(
                out,
                "the rate was being looked for during the {} before this, at others than this one",
                Span(ns)
            ),
        }
    }
}

/// What a tap hears on one bus.
#[derive(Clone, Copy, Debug)]
pub enum Event<'a> {
    /// Characters, in the order they were on the wire.
    Characters(&'a [Character]),
    /// CAN frames, in the order they were on the wire.
    Frames(&'a [Frame]),
    /// Rows of words, in the order they were logged.
    Rows(&'a [Row]),
    /// A cycle of a ring, as its line carried it.
    Cycle(&'a Cycle),
    /// Nothing was on a line for so long that it means something.
    Silence(Silence),
    /// Line levels, to be decoded into characters, frames or cycles.
    Levels(Levels<'a>),
    /// A break.
    Break(Break),
    /// A loss: what comes next may begin anywhere.
    Lost(Loss),
    /// Nothing more was heard until this time. Records never depend on how often this is said.
    Advance(Moment),
}
