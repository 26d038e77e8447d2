//! A clock that is never set back, made of one that may be.
//!
//! A machine without a battery boots with any date, and its clock is set when a network is there.
//! What is kept, and when a file ends, goes by how much time has passed; what is written keeps the
//! stamps it came with.

use dissectors::event::Moment;
use std::collections::VecDeque;

/// What is earlier than what came before by no more than this, in ns, is out of order: silence is
/// told behind what was heard, as far as something may still arrive. Beyond it, the clock was set.
const DISORDER: i64 = 1_000_000_000;

/// Times that the clock was set back that are remembered: what is told of a record comes seconds
/// later.
const REMEMBERED: usize = 64;

/// A clock that is never set back. It begins as the source's.
#[derive(Default, Debug)]
pub struct Steady {
    set_back: VecDeque<SetBack>,
    /// How far it has come.
    reach: Option<i64>,
}

/// The source's clock was set back.
#[derive(Clone, Copy, Debug)]
struct SetBack {
    /// When, on the steady clock.
    at: i64,
    /// How far it is behind the steady clock from then on, in ns.
    behind: i64,
}

impl Steady {
    /// What the source calls `stamp`, where it had reached `before` (of the steady clock).
    pub fn reach(&mut self, stamp: Moment, before: Moment) -> Moment {
        let now = stamp.plus(self.behind());
        let back = before.since(now).unwrap_or(0);
        let now = if back > DISORDER { self.set_back(back, before) } else { now };
        self.reach = self.reach.max(now.ns());
        now
    }

    fn set_back(&mut self, back: i64, before: Moment) -> Moment {
        let behind = self.behind().saturating_add(back);
        if self.set_back.len() == REMEMBERED {
            self.set_back.pop_front();
        }
        self.set_back.extend(before.ns().map(|at| SetBack { at, behind }));
        before
    }

    /// When it was that the source called `stamp` a while ago: the latest time that has come.
    pub fn of(&self, stamp: Moment) -> Moment {
        let latest = self.reach.map_or(Moment::UNKNOWN, Moment::from_ns).plus(DISORDER);
        let times = self.set_back.iter().rev().map(|set| stamp.plus(set.behind));
        times.into_iter().find(|time| !time.is_after(latest)).unwrap_or(stamp)
    }

    /// What the source called this time.
    pub fn stamp(&self, time: Moment) -> Moment {
        let is_before = |set: &&SetBack| !Moment::from_ns(set.at).is_after(time);
        let behind = self.set_back.iter().rev().find(is_before).map_or(0, |set| set.behind);
        time.plus(behind.saturating_neg())
    }

    fn behind(&self) -> i64 {
        self.set_back.back().map_or(0, |set| set.behind)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: i64 = 1_000_000_000;
    const HOUR: i64 = 3_600;

    fn at(second: i64) -> Moment {
        Moment::from_ns(second * SECOND)
    }

    /// At 5000 s it is set back by an hour, and has gone on for 10 s.
    fn set_back() -> Steady {
        let mut steady = Steady::default();
        let before = steady.reach(at(5_000), Moment::UNKNOWN);
        assert_eq!(before, at(5_000));
        assert_eq!(steady.reach(at(5_000 - HOUR), before), at(5_000));
        assert_eq!(steady.reach(at(5_010 - HOUR), before), at(5_010));
        steady
    }

    #[test]
    fn time_goes_on_where_the_clock_is_set_back() {
        let mut steady = set_back();
        // Caught up, it is still behind; set back again, it is behind by more.
        assert_eq!(steady.reach(at(5_000), at(5_010)), at(5_000 + HOUR));
        assert_eq!(steady.reach(at(4_990), at(5_000 + HOUR)), at(5_000 + HOUR));
        assert_eq!(steady.reach(at(4_991), at(5_000 + HOUR)), at(5_001 + HOUR));
    }

    #[test]
    fn what_is_out_of_order_is_what_it_says() {
        let mut steady = Steady::default();
        assert_eq!(steady.reach(at(9), at(10)), at(9));
        assert_eq!(steady.reach(at(11), at(10)), at(11));
    }

    #[test]
    fn what_is_told_later_is_of_before_or_of_since() {
        let steady = set_back();
        assert_eq!(steady.of(at(4_998)), at(4_998));
        assert_eq!(steady.of(at(5_004 - HOUR)), at(5_004));
        assert_eq!(steady.stamp(at(4_998)), at(4_998));
        assert_eq!(steady.stamp(at(5_004)), at(5_004 - HOUR));
        assert_eq!(steady.of(Moment::UNKNOWN), Moment::UNKNOWN);
    }
}
