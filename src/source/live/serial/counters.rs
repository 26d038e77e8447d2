//! What a driver counts: the only trace of what a receiver lost.

use std::fmt;

/// Counts of a driver since it was loaded, or between two moments. They run over.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct Counters {
    /// Characters, or packets of them, with a parity error.
    pub parity: u32,
    /// Characters, or packets of them, without a stop bit.
    pub framing: u32,
    /// Times that the receiver was not emptied in time.
    pub overrun: u32,
    /// Characters that found the kernel's buffer full.
    pub buffer_overrun: u32,
    /// Breaks.
    pub breaks: u32,
}

impl Counters {
    /// What was counted since then.
    pub fn since(&self, earlier: &Counters) -> Counters {
        let less = u32::wrapping_sub;
        Counters {
            parity: less(self.parity, earlier.parity),
            framing: less(self.framing, earlier.framing),
            overrun: less(self.overrun, earlier.overrun),
            buffer_overrun: less(self.buffer_overrun, earlier.buffer_overrun),
            breaks: less(self.breaks, earlier.breaks),
        }
    }

    /// Of each no more than there.
    pub fn at_most(&self, other: &Counters) -> Counters {
        Counters {
            parity: self.parity.min(other.parity),
            framing: self.framing.min(other.framing),
            overrun: self.overrun.min(other.overrun),
            buffer_overrun: self.buffer_overrun.min(other.buffer_overrun),
            breaks: self.breaks.min(other.breaks),
        }
    }

    /// Both together.
    pub fn plus(&self, other: &Counters) -> Counters {
        let more = u32::saturating_add;
        Counters {
            parity: more(self.parity, other.parity),
            framing: more(self.framing, other.framing),
            overrun: more(self.overrun, other.overrun),
            buffer_overrun: more(self.buffer_overrun, other.buffer_overrun),
            breaks: more(self.breaks, other.breaks),
        }
    }
}

impl fmt::Display for Counters {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Counters { parity, framing, overrun, buffer_overrun, breaks } = self;
        write!(
            f,
            "parity {parity}, framing {framing}, overrun {overrun}, buffer overrun \
             {buffer_overrun}, break {breaks}"
        )
    }
}

/// The counters of a run.
#[derive(Clone, Copy, Default, Debug)]
pub struct Tally {
    last: Option<Counters>,
    total: Counters,
    /// The driver counted at all times.
    is_whole: bool,
}

impl Tally {
    /// Begins with what was counted before; `None` where the driver does not count.
    pub fn begin(now: Option<Counters>) -> Self {
        Tally { last: now, total: Counters::default(), is_whole: now.is_some() }
    }

    /// The port was opened again: its counters may have begun anew.
    pub fn go_on(&mut self, now: Option<Counters>) {
        self.last = now;
        self.is_whole &= now.is_some();
    }

    /// What was counted since this was asked last.
    pub fn advance(&mut self, now: Option<Counters>) -> Counters {
        let (Some(now), Some(last)) = (now, self.last) else { return Counters::default() };
        let news = now.since(&last);
        self.last = Some(now);
        self.total = self.total.plus(&news);
        news
    }

    /// Whether the driver counts.
    pub fn counts(&self) -> bool {
        self.last.is_some()
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.is_whole {
            true => write!(f, "counted by the driver: {}", self.total),
            false => write!(f, "counters of the driver: not available"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_has_what_was_counted_in_it() {
        let before = Counters { parity: 7, overrun: u32::MAX, ..Counters::default() };
        let mut tally = Tally::begin(Some(before));
        // One more overrun makes a counter of 32 bits begin anew.
        let after = Counters { parity: 9, overrun: 0, breaks: 1, ..Counters::default() };
        let news = tally.advance(Some(after));
        assert_eq!(news, Counters { parity: 2, overrun: 1, breaks: 1, ..Counters::default() });
        assert_eq!(tally.advance(Some(after)), Counters::default());
        assert_eq!(
            tally.to_string(),
            "counted by the driver: parity 2, framing 0, overrun 1, buffer overrun 0, break 1"
        );
    }

    #[test]
    fn what_is_not_counted_is_not_zero() {
        let mut tally = Tally::begin(None);
        assert_eq!(tally.advance(None), Counters::default());
        assert_eq!(tally.to_string(), "counters of the driver: not available");
    }
}
