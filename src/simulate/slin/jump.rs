//! Positions that no shaft can have gone to: how far off one must be to be told for certain.
//!
//! A jump is told by comparing a step with its neighbours and with the largest change of step
//! before, so the generator keeps the same measure of what is usual.

use crate::simulate::chance::Chance;

/// Telegrams in a row that must have been right before a jump.
const SOUND: u32 = 12;

/// Smallest jump, in steps, and how many times larger than the largest usual change it is. Told
/// must be what is above 127 and 8 times.
const LEAST: i64 = 1_000;
const TIMES: i64 = 12;

/// Largest jump.
const MOST: i64 = 100_000;

/// The steps of one shaft, as its telegrams show them.
#[derive(Clone, Debug)]
pub struct Steps {
    circle: i64,
    last: Option<i64>,
    step: Option<i64>,
    largest_change: i64,
    highest: i64,
    sound: u32,
}

impl Steps {
    /// A shaft with an encoder of some bits that was not seen yet.
    pub fn new(bits: u32) -> Self {
        let circle = 1 << bits;
        Steps { circle, last: None, step: None, largest_change: 0, highest: 0, sound: 0 }
    }

    /// A telegram was right.
    pub fn add(&mut self, position: u32) {
        let position = i64::from(position);
        let step = self.last.map(|last| {
            let half = self.circle / 2;
            (position - last + half).rem_euclid(self.circle) - half
        });
        if let (Some(before), Some(now)) = (self.step, step) {
            self.largest_change = self.largest_change.max((now - before).abs());
        }
        self.last = Some(position);
        self.step = step;
        self.highest = self.highest.max(position);
        self.sound += 1;
    }

    /// A telegram was missing or damaged.
    pub fn interrupt(&mut self) {
        self.last = None;
        self.step = None;
        self.sound = 0;
    }

    /// A position that is off beyond doubt, if there is one now.
    pub fn spike(&self, position: u32, chance: &mut Chance) -> Option<u32> {
        let least = LEAST.max(TIMES * self.largest_change);
        let most = MOST.min(self.circle / 4);
        if self.sound < SOUND || least >= most {
            return None;
        }
        let size = chance.between(least, most);
        let position = i64::from(position);
        let places = [position + size, position - size];
        let possible: Vec<i64> =
            places.into_iter().filter(|place| self.is_far(*place, size, least)).collect();
        u32::try_from(chance.one_of(&possible)?).ok()
    }

    /// Whether the way there is long even for who takes the circle for the smallest power of two
    /// above every position shown.
    fn is_far(&self, place: i64, size: i64, least: i64) -> bool {
        if !(0..self.circle).contains(&place) {
            return false;
        }
        let circle = (self.highest.max(place) + 1).unsigned_abs().next_power_of_two();
        circle.cast_signed() - size >= least
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spike_is_larger_than_anything_usual() {
        let mut steps = Steps::new(25);
        let mut chance = Chance::new(1, 0);
        for position in 0..11 {
            steps.add(1_000_000 + 50 * position);
        }
        assert_eq!(steps.spike(1_000_550, &mut chance), None, "too few");
        // A step of 250 after steps of 50: a change of 200.
        steps.add(1_000_750);
        for _ in 0..100 {
            let spike = i64::from(steps.spike(1_000_800, &mut chance).unwrap());
            assert!((12 * 200..100_000).contains(&(spike - 1_000_800).abs()));
        }
        steps.interrupt();
        assert_eq!(steps.spike(1_000_800, &mut chance), None);
    }

    #[test]
    fn going_round_is_no_change() {
        let mut steps = Steps::new(13);
        for position in [8_100, 8_150, 8, 58, 108] {
            steps.add(position);
        }
        assert_eq!(steps.largest_change, 0);
    }

    #[test]
    fn a_small_circle_leaves_no_room() {
        let mut steps = Steps::new(10);
        (0..50).for_each(|position| steps.add(position));
        assert_eq!(steps.spike(50, &mut Chance::new(1, 0)), None);
    }
}
