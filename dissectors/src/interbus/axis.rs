//! The positions of one device over time: what no axis can do.

use crate::event::Moment;
use crate::motion::{Jump, Motion, NOTICEABLE};

/// No axis gains speed faster than this, in nm/s²: 100 m/s². Between two rows it may move off and
/// stop again, and the rows show a jump; beyond what this allows, it is one.
const FASTEST: i64 = 100_000_000_000;

/// A step in nm where it is not known: 0.01 mm, the finer one of the manual's two examples.
const USUAL_STEP: i64 = 10_000;

/// Bits of a position. Its sign is not stated: below 0 comes FFFFFFh.
const BITS: u32 = 24;

/// Rows so many times further apart than the rows before have a gap between them.
const GAP: i64 = 4;

/// Spacing in ns above which nothing can be said anyway.
const COARSEST: i64 = 1_000_000_000;

/// The axis of one device.
#[derive(Debug)]
pub struct Axis {
    motion: Motion,
    last: Moment,
    /// Time between the last two rows in ns.
    spacing: i64,
    /// The longest spacing that the limit was worked out for.
    limit_for: i64,
    /// One step in nm.
    step: i64,
}

impl Axis {
    /// Nothing seen yet.
    pub fn new() -> Self {
        Axis {
            motion: Motion::new(BITS, None),
            last: Moment::UNKNOWN,
            spacing: 0,
            limit_for: -1,
            step: USUAL_STEP,
        }
    }

    /// The next position, at this time, in this record. Tells whether the one before it was a
    /// jump.
    pub fn add(&mut self, position: u32, n: u64, now: Moment) -> Option<Jump> {
        let spacing = now.since(self.last);
        self.last = now;
        let spacing = spacing.filter(|ns| (0..=COARSEST).contains(ns));
        let Some(spacing) = spacing.filter(|ns| self.spacing == 0 || *ns <= GAP * self.spacing)
        else {
            self.motion.interrupt();
            self.spacing = spacing.unwrap_or(0);
            return self.motion.add(position, n);
        };
        let longest = spacing.max(self.spacing);
        self.spacing = spacing;
        if longest != self.limit_for {
            self.limit_for = longest;
            self.motion.tell_above(self.limit(longest));
        }
        self.motion.add(position, n)
    }

    /// Positions before and after do not compare.
    pub fn interrupt(&mut self) {
        self.motion.interrupt();
        (self.last, self.spacing) = (Moment::UNKNOWN, 0);
    }

    /// The measuring length in steps is known, and perhaps that of the rod in µm.
    pub fn learn(&mut self, steps: u32, length_um: Option<u32>) {
        self.motion.learn_resolution(steps);
        let step = length_um.map(|um| i64::from(um) * 1_000 / i64::from(steps.max(1)));
        self.step = step.unwrap_or(USUAL_STEP).max(1);
        self.limit_for = -1;
    }

    /// How far rows of this spacing can show the fastest axis off its path, in steps.
    const fn limit(&self, spacing: i64) -> i64 {
        // nm/s² · ns² = 1e-18 nm.
        let nm = (FASTEST as i128 * spacing as i128 * spacing as i128) / 1_000_000_000_000_000_000;
        let steps = nm as i64 / self.step;
        if steps > NOTICEABLE { steps } else { NOTICEABLE }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    /// Records of jumps among positions that come every so many ms.
    fn jumps(positions: &[u32], ms: i64) -> Vec<u64> {
        let mut axis = Axis::new();
        let rows = (0..).zip(positions);
        rows.filter_map(|(n, position)| {
            let at = Moment::from_ns(n as i64 * ms * 1_000_000);
            axis.add(*position, n, at).map(|jump| jump.record)
        })
        .collect()
    }

    #[test]
    fn what_no_axis_can_do_is_a_jump() {
        let mut positions: Vec<u32> = (0..60).map(|n| 5_000 + 3 * n).collect();
        positions[30] += 5_000;
        assert_eq!(jumps(&positions, 1), [30]);
        // 100 m/s² for 10 ms and back: 10 mm, which is 1000 steps of 0.01 mm; for 50 ms 25000.
        assert_eq!(jumps(&positions, 10), [30]);
        assert_eq!(jumps(&positions, 50), []);
    }

    #[test]
    fn a_move_that_fits_between_two_coarse_rows_is_none() {
        let mut positions = [1_000_u32; 60];
        positions[30..].fill(9_000);
        assert_eq!(jumps(&positions, 50), []);
        assert_eq!(jumps(&positions, 1), [30]);
    }

    #[test]
    fn a_gap_in_the_log_is_none() {
        let mut axis = Axis::new();
        let at = |ms: i64| Moment::from_ns(ms * 1_000_000);
        for n in 0..30 {
            assert!(axis.add(1_000, n, at(n as i64)).is_none());
        }
        for n in 30..60 {
            assert!(axis.add(90_000, n, at(n as i64 + 500)).is_none());
        }
    }
}
