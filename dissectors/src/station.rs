//! What the user knows of the stations on a bus.

use alloc::{collections::BTreeMap, string::String};
use core::fmt;

/// Stations by SLIN address, MAC ID or device number.
pub type Stations = BTreeMap<u16, Station>;

/// One station: a name and the resolution of its encoder.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct Station {
    /// What people call it.
    pub name: Option<String>,
    /// How its positions are to be read, if known.
    pub resolution: Option<Resolution>,
}

/// Most bits a position can have: 13 and 16 of encoders on DeviceNet. The four data words of SLIN hold
/// 28.
pub const MAX_POSITION_BITS: u8 = 29;

/// How a position divides into turns and an angle.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Resolution {
    singleturn_bits: u8,
    multiturn_bits: u8,
    direction: Direction,
}

/// Which way a shaft turns as its position grows.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub enum Direction {
    /// Positions grow with clockwise rotation.
    #[default]
    Clockwise,
    /// Positions grow with counter-clockwise rotation; turns and angle are told clockwise.
    CounterClockwise,
}

impl Resolution {
    /// A resolution with at least one single-turn bit and at most [`MAX_POSITION_BITS`] in all.
    #[must_use]
    pub fn new(singleturn_bits: u8, multiturn_bits: u8, direction: Direction) -> Option<Self> {
        let total = singleturn_bits.checked_add(multiturn_bits)?;
        (singleturn_bits >= 1 && total <= MAX_POSITION_BITS).then_some(Resolution {
            singleturn_bits,
            multiturn_bits,
            direction,
        })
    }

    /// Number of different positions.
    #[must_use]
    pub const fn positions(self) -> u32 {
        1 << (self.singleturn_bits + self.multiturn_bits)
    }

    /// Steps of one turn.
    #[must_use]
    pub const fn steps_per_turn(self) -> u32 {
        1 << self.singleturn_bits
    }

    const fn clockwise(self, position: u32) -> u32 {
        let position = position & (self.positions() - 1);
        match self.direction {
            Direction::Clockwise => position,
            Direction::CounterClockwise => (self.positions() - position) & (self.positions() - 1),
        }
    }

    /// Whole turns, clockwise; `None` for a single-turn encoder.
    #[must_use]
    pub fn turns(self, position: u32) -> Option<u32> {
        (self.multiturn_bits > 0 && self.has(position))
            .then(|| self.clockwise(position) >> self.singleturn_bits)
    }

    /// Angle within the turn in degrees, clockwise, 0 up to but not including 360; `None` for a
    /// position beyond the resolution.
    #[must_use]
    pub fn angle(self, position: u32) -> Option<f64> {
        let step = self.clockwise(position) & (self.steps_per_turn() - 1);
        self.has(position).then(|| f64::from(step) * 360.0 / f64::from(self.steps_per_turn()))
    }

    /// A position as a sentence goes on behind it: `= 3 turns 90.000°`.
    #[must_use]
    pub const fn place(self, position: u32) -> Place {
        Place { resolution: self, position }
    }

    /// Whether this resolution has such a position.
    #[must_use]
    pub const fn has(self, position: u32) -> bool {
        position < self.positions()
    }
}

/// Where a shaft stands.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    resolution: Resolution,
    position: u32,
}

impl fmt::Display for Place {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Place { resolution, position } = *self;
        let Some(angle) = resolution.angle(position) else {
            return write!(out, "(more bits than --stations says)");
        };
        match resolution.turns(position) {
            Some(1) => write!(out, "= 1 turn {angle:.3}°"),
            Some(turns) => write!(out, "= {turns} turns {angle:.3}°"),
            None => write!(out, "= {angle:.3}°"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;

    #[test]
    fn a_position_divides_into_turns_and_angle() {
        // GXM7W: 13 bits single-turn, 12 bits multi-turn. 3 turns and a quarter:
        // 3 * 8192 + 2048 = 26624.
        let resolution = Resolution::new(13, 12, Direction::Clockwise).unwrap();
        assert_eq!((resolution.turns(26_624), resolution.angle(26_624)), (Some(3), Some(90.0)));
        // Seen from the other side the same shaft stands at 4096 - 3.25 = 4092.75 turns.
        let mirrored = Resolution::new(13, 12, Direction::CounterClockwise).unwrap();
        assert_eq!((mirrored.turns(26_624), mirrored.angle(26_624)), (Some(4092), Some(270.0)));
        assert_eq!((mirrored.turns(0), mirrored.angle(0)), (Some(0), Some(0.0)));
        assert_eq!(resolution.place(26_624).to_string(), "= 3 turns 90.000°");
        // 2^25 has a bit more.
        assert_eq!(resolution.place(1 << 25).to_string(), "(more bits than --stations says)");
        assert_eq!((resolution.turns(1 << 25), resolution.angle(1 << 25)), (None, None));
    }

    #[test]
    fn a_single_turn_encoder_has_no_turns() {
        let resolution = Resolution::new(13, 0, Direction::Clockwise).unwrap();
        assert_eq!((resolution.turns(8191), resolution.positions()), (None, 8192));
        assert_eq!(resolution.place(4096).to_string(), "= 180.000°");
    }

    #[test]
    fn impossible_resolutions_are_refused() {
        for (single, multi) in [(0, 12), (30, 0), (13, 17), (255, 255)] {
            assert_eq!(Resolution::new(single, multi, Direction::Clockwise), None);
        }
    }
}
