//! Shafts that turn: where an encoder's position comes from.

use super::chance::Chance;
use super::time::{Ps, S};
use clap::ValueEnum;

/// How a shaft turns.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub enum Motion {
    /// At one speed.
    Steady,
    /// It moves for a while and rests for a while, with ramps between.
    StopAndGo,
    /// It turns back every now and then, with ramps between.
    Reversing,
    /// Not at all.
    Still,
}

/// What a shaft does, and how fast at most.
#[derive(Clone, Copy, Debug)]
pub struct Drive {
    /// How it turns.
    pub motion: Motion,
    /// Steps a second.
    pub speed: f64,
    /// Time between two looks at the shaft: moves and rests last for some of these.
    pub cycle: Ps,
}

/// A shaft with an encoder.
pub struct Shaft {
    drive: Drive,
    /// Number of positions.
    circle: f64,
    position: f64,
    /// Steps a second.
    speed: f64,
    /// The speed that it goes towards.
    wanted: f64,
    /// When it is there, and when it wants another one.
    change_at: Ps,
    now: Ps,
    chance: Chance,
}

impl Shaft {
    /// A shaft at this position of so many, one at least.
    pub fn new(positions: u32, position: u32, drive: Drive, mut chance: Chance) -> Self {
        let speed = match drive.motion {
            Motion::Still => 0.0,
            Motion::Steady if chance.happens(0.5) => -drive.speed * chance.within(0.3, 1.0),
            _ => drive.speed * chance.within(0.3, 1.0),
        };
        let circle = f64::from(positions);
        let position = f64::from(position);
        Shaft { drive, circle, position, speed, wanted: speed, change_at: 0, now: 0, chance }
    }

    /// Where it is at this time, which is not before the one asked for last.
    pub fn position_at(&mut self, time: Ps) -> u32 {
        while self.now < time {
            if self.now >= self.change_at {
                self.change();
            }
            // Short enough for a ramp to look like one.
            let step = self.change_at.min(time).min(self.now + self.drive.cycle / 4 + 1) - self.now;
            self.turn(step);
        }
        // A position that is rounded up to the full circle would be 0 again.
        (self.position as u32).min(self.circle as u32 - 1)
    }

    /// Whether it rests, and until when it goes on as it does; nothing while its speed changes.
    pub fn pace(&self) -> Option<(bool, Ps)> {
        let is_for_ever = matches!(self.drive.motion, Motion::Still | Motion::Steady);
        let until = if is_for_ever { Ps::MAX } else { self.change_at };
        // As fast as it wants to be, to a step a second.
        let is_there = (self.speed - self.wanted).abs() < 1.0;
        is_there.then_some((self.speed == 0.0, until))
    }

    fn turn(&mut self, step: Ps) {
        let seconds = step as f64 / S as f64;
        let ramp = self.drive.speed / RAMP / (self.drive.cycle as f64 / S as f64) * seconds;
        let missing = self.wanted - self.speed;
        self.speed += missing.clamp(-ramp, ramp);
        self.position += self.speed * seconds;
        self.position -= (self.position / self.circle).floor() * self.circle;
        self.now += step;
    }

    /// Another speed is wanted.
    fn change(&mut self) {
        let go = self.drive.speed * self.chance.within(0.3, 1.0);
        self.wanted = match self.drive.motion {
            Motion::Still => 0.0,
            Motion::Steady => self.speed,
            Motion::StopAndGo if self.wanted == 0.0 => go,
            Motion::StopAndGo => 0.0,
            Motion::Reversing if self.wanted < 0.0 => go,
            Motion::Reversing => -go,
        };
        let looks = self.chance.between(20, 80);
        self.change_at = self.now + looks * self.drive.cycle;
    }
}

/// Looks at the shaft that it takes to reach full speed.
const RAMP: f64 = 6.0;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::time::MS;

    fn positions(motion: Motion, bits: u32, start: u32) -> Vec<u32> {
        let drive = Drive { motion, speed: 2_000.0, cycle: 10 * MS };
        let mut shaft = Shaft::new(1 << bits, start, drive, Chance::new(1, 1));
        (0..1_000).map(|look| shaft.position_at(look * 10 * MS)).collect()
    }

    fn steps(positions: &[u32]) -> Vec<i64> {
        positions.windows(2).map(|two| i64::from(two[1]) - i64::from(two[0])).collect()
    }

    #[test]
    fn a_steady_shaft_makes_equal_steps() {
        let steps = steps(&positions(Motion::Steady, 25, 1 << 24));
        // 2000 steps/s · 10 ms = 20 steps at most, up to rounding the same each time.
        let (least, most) = (steps.iter().min().unwrap(), steps.iter().max().unwrap());
        assert!(most - least <= 1 && most.abs() <= 21 && least.abs() >= 5);
    }

    #[test]
    fn a_shaft_that_stops_and_goes_rests_and_moves() {
        let steps = steps(&positions(Motion::StopAndGo, 25, 1 << 24));
        assert!(steps.iter().filter(|step| **step == 0).count() > 100);
        assert!(steps.iter().filter(|step| **step >= 5).count() > 100);
        // A ramp takes six looks from 0 to 20 steps.
        assert!(steps.windows(2).all(|two| (two[1] - two[0]).abs() <= 5), "{steps:?}");
    }

    #[test]
    fn a_reversing_shaft_goes_both_ways_and_a_still_one_nowhere() {
        let reversing = steps(&positions(Motion::Reversing, 25, 1 << 24));
        assert!(reversing.iter().any(|step| *step > 5) && reversing.iter().any(|step| *step < -5));
        assert!(positions(Motion::Still, 13, 4_711).iter().all(|position| *position == 4_711));
    }

    #[test]
    fn a_shaft_keeps_its_pace_as_long_as_it_says() {
        let drive = Drive { motion: Motion::StopAndGo, speed: 2_000.0, cycle: 10 * MS };
        let mut shaft = Shaft::new(1 << 25, 1 << 24, drive, Chance::new(1, 1));
        let (mut rests, mut moves) = (0, 0);
        for look in 0..1_000 {
            let before = shaft.position_at(look * 10 * MS);
            let Some((is_at_rest, until)) = shaft.pace() else { continue };
            if until < (look + 1) * 10 * MS {
                continue;
            }
            let has_moved = shaft.position_at((look + 1) * 10 * MS) != before;
            assert_eq!(has_moved, !is_at_rest, "{look}");
            (rests, moves) = (rests + u32::from(is_at_rest), moves + u32::from(!is_at_rest));
        }
        assert!(rests > 100 && moves > 100, "{rests} {moves}");
    }

    #[test]
    fn positions_go_round_in_the_encoders_circle() {
        let round = positions(Motion::Steady, 10, 0);
        assert!(round.iter().all(|position| *position < 1_024));
        assert!(steps(&round).iter().any(|step| step.abs() > 900));
    }
}
