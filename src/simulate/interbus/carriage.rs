//! What moves along the rod: a magnet that goes from place to place, and rests there.

use crate::simulate::chance::Chance;
use crate::simulate::motion::Motion;
use crate::simulate::time::{MS, Ps, S};

/// Shortest time for a move.
const SHORTEST: Ps = 600 * MS;

/// A carriage with a magnet.
pub struct Carriage {
    motion: Motion,
    /// Rods that it goes in a second, on average.
    speed: f64,
    /// Places on the rod, from 0 to 1.
    from: f64,
    to: f64,
    start: Ps,
    end: Ps,
    chance: Chance,
}

impl Carriage {
    /// A carriage that rests somewhere. The speed is in rods a second.
    pub fn new(motion: Motion, speed: f64, mut chance: Chance) -> Self {
        let place = chance.within(0.1, 0.9);
        Carriage { motion, speed, from: place, to: place, start: 0, end: 0, chance }
    }

    /// Where it is at this time, from 0 to 1. Times ascend.
    pub fn place_at(&mut self, time: Ps) -> f64 {
        while time >= self.end && self.motion != Motion::Still {
            self.set_out();
        }
        let gone = ((time - self.start) as f64 / (self.end - self.start).max(1) as f64).min(1.0);
        // Gently off and gently on: no step of the position is much longer than its neighbours.
        self.from + (self.to - self.from) * gone * gone * (3.0 - 2.0 * gone)
    }

    /// Whether it rests.
    pub fn is_at_rest(&self) -> bool {
        self.from == self.to
    }

    /// It sets out for another place, or rests where it is.
    fn set_out(&mut self) {
        let rests = self.motion == Motion::StopAndGo && !self.is_at_rest();
        self.from = self.to;
        self.start = self.end;
        let lasts = if rests {
            (self.chance.within(0.3, 1.5) * S as f64) as Ps
        } else {
            self.to = self.chance.within(0.02, 0.98);
            let seconds = (self.to - self.from).abs() / self.speed;
            SHORTEST.max((seconds * S as f64) as Ps)
        };
        self.end = self.start + lasts;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_goes_gently_rests_and_stays_on_the_rod() {
        let mut carriage = Carriage::new(Motion::StopAndGo, 0.5, Chance::new(1, 1));
        let places: Vec<f64> = (0..20_000).map(|ms| carriage.place_at(ms * MS)).collect();
        assert!(places.iter().all(|place| (0.0..=1.0).contains(place)));
        let steps: Vec<f64> = places.windows(2).map(|two| two[1] - two[0]).collect();
        assert!(steps.iter().filter(|step| **step == 0.0).count() > 2_000);
        // A second derivative of 6 D / T² at most, D ≤ 1 and T ≥ 0.6 s: 17e-6 a ms².
        assert!(steps.windows(2).all(|two| (two[1] - two[0]).abs() < 17e-6));
        let mut still = Carriage::new(Motion::Still, 0.5, Chance::new(1, 2));
        assert!((0..100).all(|s| still.place_at(s * S) == still.place_at(s * S)));
    }
}
