//! Whether a position fits its neighbours: what parity and checksum let pass, and what nobody
//! commanded.

use alloc::collections::VecDeque;

/// Step changes that a new one is compared with.
const HISTORY: usize = 100;

/// Step changes it takes before anything can be called unusual.
const MIN_HISTORY: usize = 4;

/// Differences up to this are never told, unless the caller asks for more.
pub const NOTICEABLE: i64 = 127;

/// How many times larger than any other a step change must be.
const UNUSUAL: i64 = 8;

/// A position, and the number of the record that told it.
#[derive(Clone, Copy, Debug)]
struct Sample {
    position: u32,
    record: u64,
}

/// A position that does not fit.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Jump {
    /// The record that told it.
    pub record: u64,
    /// The position.
    pub position: u32,
    /// Where it would have been, had the step before it been repeated.
    pub expected: u32,
    /// The position after it goes on where the ones before it led: nothing was moved for good.
    pub is_spike: bool,
    /// The step before it.
    pub step_before: i64,
}

/// The recent positions of one station.
#[derive(Clone, Debug)]
pub struct Motion {
    /// Number of positions that a word holds: 0 less 1 is the highest.
    word: i64,
    /// Number of different positions, if it is known.
    resolution: Option<u32>,
    /// Differences up to this are never told.
    noticeable: i64,
    /// The smallest power of two above every position shown.
    shown: i64,
    /// The last three, oldest first.
    recent: [Option<Sample>; 3],
    changes: VecDeque<i64>,
    /// Changes of step that a jump has spoilt and that are still to come.
    spoilt: u8,
    /// Whether the next position is the return from one that was told.
    returns: bool,
}

impl Motion {
    /// Nothing seen yet of positions of so many bits, 62 at most.
    #[must_use]
    pub fn new(bits: u32, resolution: Option<u32>) -> Self {
        Motion {
            word: 1 << bits,
            resolution,
            noticeable: NOTICEABLE,
            shown: 1,
            recent: [None; 3],
            changes: VecDeque::with_capacity(HISTORY),
            spoilt: 0,
            returns: false,
        }
    }

    /// Differences up to this many steps are not told, from now on.
    pub const fn tell_above(&mut self, steps: i64) {
        self.noticeable = steps;
    }

    /// The number of different positions is known from now on.
    pub fn learn_resolution(&mut self, resolution: u32) {
        self.resolution = Some(resolution).filter(|positions| *positions > 0);
    }

    /// A telegram is missing or damaged: steps across it say nothing.
    pub fn interrupt(&mut self) {
        self.recent = [None; 3];
        self.spoilt = 0;
        self.returns = false;
    }

    /// The next position. Tells whether the one before it was a jump.
    pub fn add(&mut self, position: u32, record: u64) -> Option<Jump> {
        while i64::from(position) >= self.shown {
            self.shown *= 2;
        }
        let [first, second, candidate] = self.recent;
        self.recent = [second, candidate, Some(Sample { position, record })];
        let (first, second, candidate) = (first?, second?, candidate?);
        let before = self.step(first.position, second.position);
        let step = self.step(second.position, candidate.position);
        let after = self.step(candidate.position, position);
        let is_return = core::mem::take(&mut self.returns);
        if !is_return && self.stands_out(step - before, step - after) {
            self.spoilt = 2;
            self.returns = true;
            let expected = self.on_circle(i64::from(second.position) + before);
            // Two steps later it is where two of the old steps lead, give or take a quarter.
            let off_path = (step + after - 2 * before).abs();
            let is_spike = off_path <= (step - before).abs().min((step - after).abs()) / 4;
            let (record, position) = (candidate.record, candidate.position);
            return Some(Jump { record, position, expected, is_spike, step_before: before });
        }
        self.remember(step - before);
        None
    }

    /// The way from one position to the next, over the shorter side of the circle.
    fn step(&self, from: u32, to: u32) -> i64 {
        let way = i64::from(to) - i64::from(from);
        let (circle, half) = (self.circle(), self.circle() / 2);
        // Nearly always it is short, and a division would be the dearest part of a row.
        if -half <= way && way < circle - half {
            return way;
        }
        let way = (way + self.word / 2).rem_euclid(self.word) - self.word / 2;
        (way + half).rem_euclid(circle) - half
    }

    /// Number of positions of a whole circle.
    fn circle(&self) -> i64 {
        self.resolution.map_or(self.shown, i64::from)
    }

    /// The position that a way from position 0 leads to. A preset may have moved positions beyond
    /// their number.
    fn on_circle(&self, way: i64) -> u32 {
        if 0 <= way && way < self.shown {
            return u32::try_from(way).unwrap_or_default();
        }
        u32::try_from(way.rem_euclid(self.circle())).unwrap_or_default()
    }

    fn stands_out(&self, from_before: i64, from_after: i64) -> bool {
        let smaller = from_before.abs().min(from_after.abs());
        if smaller <= self.noticeable || from_before.signum() != from_after.signum() {
            return false;
        }
        let largest = self.changes.iter().copied().max().unwrap_or_default();
        self.changes.len() >= MIN_HISTORY && smaller > UNUSUAL * largest
    }

    fn remember(&mut self, change: i64) {
        if self.spoilt > 0 {
            self.spoilt -= 1;
            return;
        }
        if self.changes.len() == HISTORY {
            self.changes.pop_front();
        }
        self.changes.push_back(change.abs());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    fn jumps(positions: &[u32], resolution: Option<u32>) -> Vec<Jump> {
        let mut motion = Motion::new(28, resolution);
        (0..)
            .zip(positions)
            .filter_map(|(record, position)| motion.add(*position, record))
            .collect()
    }

    fn steady(count: u32) -> Vec<u32> {
        (0..count).map(|n| 5_000 + 20 * n).collect()
    }

    #[test]
    fn a_spike_is_told_once_and_not_its_return() {
        let mut positions = steady(40);
        positions[20] += 4096;
        let (position, expected) = (5_400 + 4_096, 5_400);
        let jump = Jump { record: 20, position, expected, is_spike: true, step_before: 20 };
        assert_eq!(jumps(&positions, None), [jump]);
    }

    #[test]
    fn what_was_expected_is_a_position() {
        // Down 30 a telegram, 400 to 10 and on at 8172 on a circle of 8192; in between, where 8172
        // is due, 5000. The largest position before it makes the circle of what was shown.
        let mut positions: Vec<u32> = (0..14).map(|n| 400 - 30 * n).collect();
        positions.extend([5_000, 8_142, 8_112]);
        let jump = |expected| Jump {
            record: 14,
            position: 5_000,
            expected,
            is_spike: true,
            step_before: -30,
        };
        assert_eq!(jumps(&positions, Some(8_192)), [jump(8_172)]);
        assert_eq!(jumps(&positions, None), [jump(8_172)]);
    }

    #[test]
    fn an_offset_that_stays_is_told_once() {
        let mut positions = steady(40);
        for position in &mut positions[20..] {
            *position += 1_000;
        }
        assert_eq!(
            jumps(&positions, None)
                .iter()
                .map(|jump| (jump.record, jump.is_spike))
                .collect::<Vec<_>>(),
            [(20, false)]
        );
    }

    #[test]
    fn going_round_the_circle_is_no_jump() {
        // 13 bits: from 8191 to 0.
        let positions: Vec<u32> = (0..600).map(|n| (7_000 + 37 * n) % 8_192).collect();
        assert_eq!(jumps(&positions, Some(8_192)), []);
        assert_eq!(jumps(&positions, None), []);
    }

    #[test]
    fn starting_and_stopping_is_no_jump() {
        // 200 telegrams at rest, then full speed from one telegram to the next, and back.
        let mut positions = alloc::vec![1_000_u32; 200];
        positions.extend((0..50).map(|n| 1_400 + 1_000 * n));
        positions.extend([50_400; 50]);
        assert_eq!(jumps(&positions, None), []);
    }

    #[test]
    fn a_small_or_usual_change_is_no_jump() {
        let mut positions = steady(40);
        positions[20] += 127;
        assert_eq!(jumps(&positions, None), []);
        // Steps that always differ by 100: 700 is not more than 8 times as much, 2000 is.
        for (off, told) in [(700, 0), (2_000, 1)] {
            let mut positions: Vec<u32> = (0..60).map(|n| 5_000 + 500 * n + n % 2 * 50).collect();
            positions[30] += off;
            assert_eq!(jumps(&positions, None).len(), told, "{off}");
        }
    }

    #[test]
    fn steps_across_a_missed_telegram_are_left_out() {
        let mut motion = Motion::new(28, None);
        for (record, position) in (0..).zip(steady(20)) {
            assert_eq!(motion.add(position, record), None);
        }
        motion.interrupt();
        for (record, position) in (20..).zip([9_000, 9_020, 9_040, 9_060, 9_080]) {
            assert_eq!(motion.add(position, record), None);
        }
    }
}
