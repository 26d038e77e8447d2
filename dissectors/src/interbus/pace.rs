//! How far apart the rows of one device stand, and whether a ring and its handshakes can be like
//! that: times that are bare numbers have a unit that nobody wrote down.

use crate::finding::Span;
use alloc::{format, string::String};

/// Rows cannot all be closer than this, in ns: with the master's 0.2 ms no bus cycle is shorter.
const CROWDED_NS: i64 = 200_000;

/// Rows that are all further apart than this, in ns, tell no time limit of a handshake: it takes
/// four of them at least, and no program waits a second for each service.
const FAR_NS: i64 = 250_000_000;

/// No row stands for less than this, in ns: a bus cycle of the shortest ring.
const LEAST_NS: i64 = 250_000;

/// Steps between rows that are needed before it is told.
const ENOUGH: u32 = 4;

/// What is wrong with the times.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Doubt {
    /// Rows are closer than bus cycles.
    Crowded,
    /// Rows are further apart than a handshake takes.
    Far,
}

/// The times between the rows of one device.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    shortest: i64,
    steps: u32,
    crowded: u32,
    /// Whether the unit is anybody's guess.
    is_guessed: bool,
}

impl Default for Pace {
    fn default() -> Self {
        Pace { shortest: i64::MAX, steps: 0, crowded: 0, is_guessed: false }
    }
}

impl Pace {
    /// Takes the time from one row to the next in ns, and what it is worth.
    pub fn add(&mut self, apart: i64, uncertainty: i64, is_guessed: bool) {
        self.is_guessed |= is_guessed;
        if apart <= 0 {
            return;
        }
        self.shortest = self.shortest.min(apart);
        if self.steps == u32::MAX {
            (self.steps, self.crowded) = (self.steps / 2, self.crowded / 2);
        }
        self.steps += 1;
        self.crowded += u32::from(apart.saturating_add(uncertainty) < CROWDED_NS);
    }

    /// The shortest of them in ns.
    pub const fn shortest(&self) -> i64 {
        self.shortest
    }

    /// Whether rows are as close as they seem.
    pub fn is_trusted_close(&self) -> bool {
        self.doubt() != Some(Doubt::Crowded)
    }

    /// Whether so many rows lasted longer than a limit in ns: by their times, or because even bus
    /// cycles would have.
    pub fn has_passed(&self, rows: u32, limit: i64) -> bool {
        self.doubt() != Some(Doubt::Far) || i64::from(rows) * LEAST_NS > limit
    }

    fn doubt(&self) -> Option<Doubt> {
        let is_crowded = self.crowded > self.steps / 2;
        let is_far = self.steps > 0 && self.shortest > FAR_NS;
        match (self.is_guessed, is_crowded, is_far) {
            (true, true, _) => Some(Doubt::Crowded),
            (true, _, true) => Some(Doubt::Far),
            _ => None,
        }
    }

    /// What makes no sense, in words, where there were handshakes to tell.
    pub fn complaint(&self, has_handshakes: bool) -> Option<String> {
        let doubt = self.doubt().filter(|_| self.steps >= ENOUGH)?;
        let apart = Span(self.shortest);
        match doubt {
            Doubt::Crowded => Some(format!(
                "rows are {apart} apart, and no bus cycle is shorter than {}: --time-unit",
                Span(CROWDED_NS)
            )),
            Doubt::Far if has_handshakes => Some(format!(
                "rows are {apart} apart and show handshakes, which take some ms: --time-unit"
            )),
            Doubt::Far => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn every(apart: i64, is_guessed: bool) -> Pace {
        let mut pace = Pace::default();
        (0..10).for_each(|_| pace.add(apart, 0, is_guessed));
        pace
    }

    #[test]
    fn numbers_are_trusted_while_a_ring_can_be_like_that() {
        for apart in [260_000, 4_000_000, 50_000_000, 250_000_000] {
            let pace = every(apart, true);
            assert!(pace.is_trusted_close() && pace.has_passed(1, 1_000_000_000), "{apart}");
            assert_eq!(pace.complaint(true), None);
        }
        // Four seconds: 4 ms, taken for seconds. 10 µs: 10 ms, taken for microseconds.
        assert!(!every(4_000_000_000, true).has_passed(4000, 1_000_000_000));
        assert!(every(4_000_000_000, true).has_passed(4001, 1_000_000_000));
        assert!(every(4_000_000_000, true).complaint(true).unwrap().ends_with(": --time-unit"));
        assert!(!every(10_000, true).is_trusted_close());
        assert!(every(10_000, true).complaint(false).is_some());
    }

    #[test]
    fn dates_are_what_they_are() {
        let pace = every(4_000_000_000, false);
        assert!(pace.has_passed(1, 1_000_000_000) && pace.complaint(true).is_none());
        assert!(every(10_000, false).is_trusted_close());
    }
}
