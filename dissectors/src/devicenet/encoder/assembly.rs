//! I/O data of encoders: the position, and with it what else an assembly holds.

use crate::devicenet::cip::WrongLength;

/// What stands in an encoder's I/O data (manual §6; CIP encoder profile).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Assembly {
    /// Instance 1, the default: the position in four bytes.
    Position,
    /// Instance 2: the position, then a byte of flags.
    PositionAndFlags,
    /// Instance 3 of the CIP profile: position and velocity.
    PositionAndVelocity,
}

/// What one message of I/O data said.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Reading {
    /// The position in steps.
    pub position: u32,
    /// The flags.
    pub flags: Flags,
    /// The velocity, in the unit that attributes 19h and 1Ah of class 23h tell.
    pub velocity: Option<i32>,
}

/// What a connection tells of an encoder's health.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Flags {
    /// Nothing: the assembly has no flags, which is no sign of health.
    NotOnThisConnection,
    /// These flags.
    Told {
        /// The position may be wrong. It clears itself after 2.5 s.
        alarm: bool,
        /// Something is out of tolerance; the position is right.
        warning: bool,
        /// Bits 2 to 7, which are reserved.
        reserved: u8,
    },
}

impl Flags {
    /// What they say, in words.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Flags::NotOnThisConnection => "alarm and warning: not on this connection",
            Flags::Told { alarm: true, warning: true, .. } => "alarm and warning",
            Flags::Told { alarm: true, .. } => "alarm",
            Flags::Told { warning: true, .. } => "warning",
            Flags::Told { .. } => "no alarm, no warning",
        }
    }

    /// The alarm flag, where there is one.
    #[must_use]
    pub const fn alarm(self) -> Option<bool> {
        match self {
            Flags::NotOnThisConnection => None,
            Flags::Told { alarm, .. } => Some(alarm),
        }
    }

    /// The warning flag, where there is one.
    #[must_use]
    pub const fn warning(self) -> Option<bool> {
        match self {
            Flags::NotOnThisConnection => None,
            Flags::Told { warning, .. } => Some(warning),
        }
    }
}

impl Assembly {
    /// Its instance.
    #[must_use]
    pub const fn instance(self) -> u16 {
        match self {
            Assembly::Position => 1,
            Assembly::PositionAndFlags => 2,
            Assembly::PositionAndVelocity => 3,
        }
    }

    /// Its size in bytes.
    #[must_use]
    pub const fn size(self) -> usize {
        match self {
            Assembly::Position => 4,
            Assembly::PositionAndFlags => 5,
            Assembly::PositionAndVelocity => 8,
        }
    }

    /// Reads a message.
    ///
    /// # Errors
    /// Data is missing or left over.
    pub fn read(self, data: &[u8]) -> Result<Reading, WrongLength> {
        let wrong = WrongLength { expected: self.size(), actual: data.len() };
        let (position, rest) = data.split_first_chunk().ok_or(wrong)?;
        let (flags, velocity) = match (self, rest) {
            (Assembly::Position, []) => (Flags::NotOnThisConnection, None),
            (Assembly::PositionAndFlags, [flags]) => (Flags::of(*flags), None),
            (Assembly::PositionAndVelocity, [a, b, c, d]) => {
                (Flags::NotOnThisConnection, Some(i32::from_le_bytes([*a, *b, *c, *d])))
            }
            _ => return Err(wrong),
        };
        Ok(Reading { position: u32::from_le_bytes(*position), flags, velocity })
    }
}

impl Flags {
    const fn of(byte: u8) -> Self {
        Flags::Told { alarm: byte & 1 != 0, warning: byte & 2 != 0, reserved: byte & !3 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn assembly_1_has_no_flags_and_says_so() {
        let reading = Assembly::Position.read(&[0x45, 0x23, 0x01, 0x00]).unwrap();
        assert_eq!((reading.position, reading.flags.alarm()), (74565, None));
        assert_eq!(reading.flags.words(), "alarm and warning: not on this connection");
    }

    #[test]
    fn assembly_2_has_the_alarm_in_bit_0_and_the_warning_in_bit_1() {
        let flags = |byte| {
            let reading = Assembly::PositionAndFlags.read(&[1, 0, 0, 0, byte]).unwrap();
            assert_eq!(reading.position, 1);
            reading.flags
        };
        let [none, alarm, warning, both] = [0, 1, 2, 3].map(flags);
        assert_eq!((none.alarm(), none.warning()), (Some(false), Some(false)));
        assert_eq!((alarm.alarm(), alarm.warning()), (Some(true), Some(false)));
        assert_eq!((warning.alarm(), warning.warning()), (Some(false), Some(true)));
        assert_eq!(both.words(), "alarm and warning");
        assert_eq!(flags(0x84), Flags::Told { alarm: false, warning: false, reserved: 0x84 });
    }

    #[test]
    fn the_cip_profile_has_the_velocity_too() {
        let data = [1, 0, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF];
        let reading = Assembly::PositionAndVelocity.read(&data).unwrap();
        assert_eq!((reading.position, reading.velocity), (1, Some(-1)));
    }

    proptest! {
        #[test]
        fn only_the_right_size_is_read(data in proptest::collection::vec(any::<u8>(), 0..12)) {
            for assembly in
                [Assembly::Position, Assembly::PositionAndFlags, Assembly::PositionAndVelocity]
            {
                prop_assert_eq!(assembly.read(&data).is_ok(), data.len() == assembly.size());
            }
        }
    }
}
