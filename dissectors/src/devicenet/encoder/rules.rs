//! What the manual of Baumer's encoders promises and demands, as checks without memory.

use super::Kind;
use super::baumer::{ATTRIBUTES, attribute};
use crate::devicenet::cip::{DataType, WrongLength, find};
use core::fmt;
use core::ops::RangeInclusive;

/// A shaft that moves by so many steps may still be at rest: the last bits flicker.
pub const AT_REST: u32 = 2;

/// Highest number of steps per turn, 13 bits (manual §4).
const MAX_STEPS: i64 = 8192;

/// Highest total resolution, 29 bits (manual §4).
const MAX_TOTAL: i64 = 536_870_912;

/// What is known of an encoder, as far as values depend on it.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct Known {
    /// Its total resolution, attribute 8, as it is in effect.
    pub total_resolution: Option<u32>,
    /// Singleturn or multiturn.
    pub kind: Option<Kind>,
}

/// Why a value cannot be written.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Violation {
    /// The encoder has no such attribute.
    NoSuchAttribute,
    /// It can only be read.
    ReadOnly,
    /// The value is too short or too long for its type.
    WrongLength(WrongLength),
    /// The value is outside its range.
    OutOfRange {
        /// The value.
        value: i64,
        /// Lowest that is allowed.
        lowest: i64,
        /// Highest that is allowed.
        highest: i64,
    },
}

/// The values that an attribute of class 2Fh can be set to; `None` for those that cannot be set.
/// Where the total resolution is not known, its highest value is taken.
#[must_use]
pub fn range(attribute: u8, known: Known) -> Option<RangeInclusive<i64>> {
    let total = known.total_resolution.filter(|total| *total > 0).map_or(MAX_TOTAL, i64::from);
    Some(match attribute {
        attribute::SENSE_OF_ROTATION => 0..=1,
        attribute::STEPS_PER_TURN => 1..=MAX_STEPS,
        // "In the case of singleturn encoders, the measurement range = the resolution".
        attribute::TOTAL_RESOLUTION if known.kind == Some(Kind::Singleturn) => 1..=MAX_STEPS,
        attribute::TOTAL_RESOLUTION => 1..=MAX_TOTAL,
        attribute::PRESET => 0..=total - 1,
        attribute::COS_DELTA => 1..=total,
        _ => return None,
    })
}

/// Whether an attribute of class 2Fh can be set to the value in these bytes; the value.
///
/// # Errors
/// It cannot, for this reason.
pub fn check_set(attribute: u8, data: &[u8], known: Known) -> Result<i64, Violation> {
    let entry = find(ATTRIBUTES, attribute).ok_or(Violation::NoSuchAttribute)?;
    let range = range(attribute, known).ok_or(Violation::ReadOnly)?;
    let value = entry.decode(data).map_err(Violation::WrongLength)?;
    let value = match (entry.kind, data) {
        // More than one bit may be set in the byte of a BOOL.
        (DataType::Bool, [byte]) => i64::from(*byte),
        _ => value.number().unwrap_or_default(),
    };
    within(value, range)
}

/// Whether a position can be one of an encoder with this total resolution. Positions go from 0 to
/// one less; but the manual gives "1 to overall resolution" for attribute 12, so that the total
/// itself is let pass.
///
/// # Errors
/// It is beyond.
pub fn check_position(position: u32, total_resolution: u32) -> Result<(), Violation> {
    within(position.into(), 0..=total_resolution.into()).map(|_| ())
}

fn within(value: i64, range: RangeInclusive<i64>) -> Result<i64, Violation> {
    if range.contains(&value) {
        return Ok(value);
    }
    Err(Violation::OutOfRange { value, lowest: *range.start(), highest: *range.end() })
}

/// How many turns an encoder counts: total resolution by steps per turn.
///
/// "If the number of turns is programmed as a value not equal to 2ⁿ (1, 2, 4, … 65536),
/// parameterizing will have to be done anew as soon as the encoder's zero point has been exceeded in
/// powerless state" (manual §8).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Turns {
    total: u32,
    steps: u32,
}

impl Turns {
    /// The turns of this total resolution; `None` where either number is 0.
    #[must_use]
    pub const fn of(total_resolution: u32, steps_per_turn: u32) -> Option<Self> {
        if total_resolution == 0 || steps_per_turn == 0 {
            return None;
        }
        Some(Turns { total: total_resolution, steps: steps_per_turn })
    }

    /// Their number, where it is a whole one.
    #[must_use]
    pub const fn whole(self) -> Option<u32> {
        if self.total.is_multiple_of(self.steps) { Some(self.total / self.steps) } else { None }
    }

    /// Whether the encoder keeps its place when it is turned without power.
    #[must_use]
    pub fn is_power_of_two(self) -> bool {
        self.whole().is_some_and(u32::is_power_of_two)
    }
}

/// A broken number has two decimals.
impl fmt::Display for Turns {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.whole() {
            Some(turns) => write!(out, "{turns}"),
            None => {
                let hundredths = u64::from(self.total) * 100 / u64::from(self.steps);
                write!(out, "{}.{:02}", hundredths / 100, hundredths % 100)
            }
        }
    }
}

/// How far two positions lie apart, the short way round where the total resolution is known. More
/// than [`AT_REST`] is motion.
#[must_use]
pub fn distance(from: u32, to: u32, total_resolution: Option<u32>) -> u32 {
    let direct = from.abs_diff(to);
    match total_resolution {
        Some(total) if direct <= total => direct.min(total - direct),
        _ => direct,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;
    use proptest::prelude::*;

    const UNKNOWN: Known = Known { total_resolution: None, kind: None };
    const EXAMPLE: Known = Known { total_resolution: Some(921_600), kind: Some(Kind::Multiturn) };

    fn set(attribute: u8, value: u32, known: Known) -> Result<i64, Violation> {
        check_set(attribute, &value.to_le_bytes(), known)
    }

    fn beyond(value: i64, lowest: i64, highest: i64) -> Result<i64, Violation> {
        Err(Violation::OutOfRange { value, lowest, highest })
    }

    #[test]
    fn ranges_of_the_manual() {
        assert_eq!(set(7, 8192, UNKNOWN), Ok(8192));
        assert_eq!(set(7, 8193, UNKNOWN), beyond(8193, 1, 8192));
        assert_eq!(set(7, 0, UNKNOWN), beyond(0, 1, 8192));
        assert_eq!(set(8, 0x2000_0000, UNKNOWN), Ok(1 << 29));
        assert_eq!(set(8, 0x2000_0001, UNKNOWN), beyond((1 << 29) + 1, 1, 1 << 29));
        let singleturn = Known { kind: Some(Kind::Singleturn), ..UNKNOWN };
        assert_eq!(set(8, 16384, singleturn), beyond(16384, 1, 8192));
        assert_eq!(check_set(3, &[1], UNKNOWN), Ok(1));
        assert_eq!(check_set(3, &[2], UNKNOWN), beyond(2, 0, 1));
    }

    #[test]
    fn a_preset_is_below_the_total_resolution() {
        assert_eq!(set(10, 74565, EXAMPLE), Ok(74565));
        assert_eq!(set(10, 921_599, EXAMPLE), Ok(921_599));
        assert_eq!(set(10, 921_600, EXAMPLE), beyond(921_600, 0, 921_599));
        assert_eq!(set(10, 921_600, UNKNOWN), Ok(921_600));
    }

    #[test]
    fn the_cos_delta_is_neither_zero_nor_negative() {
        assert_eq!(set(11, 0, EXAMPLE), beyond(0, 1, 921_600));
        assert_eq!(set(11, u32::MAX, EXAMPLE), beyond(-1, 1, 921_600));
        assert_eq!(set(11, 921_600, EXAMPLE), Ok(921_600));
    }

    #[test]
    fn only_five_attributes_can_be_set() {
        for id in ATTRIBUTES.iter().map(|entry| entry.id) {
            let is_read_only = set(id, 1, UNKNOWN) == Err(Violation::ReadOnly);
            assert_eq!(is_read_only, ![3, 7, 8, 10, 11].contains(&id), "{id}");
        }
        assert_eq!(set(13, 1, UNKNOWN), Err(Violation::NoSuchAttribute));
        let wrong = WrongLength { expected: 4, actual: 2 };
        assert_eq!(check_set(7, &[0, 1], UNKNOWN), Err(Violation::WrongLength(wrong)));
    }

    #[test]
    fn the_manuals_3600_steps_of_256_turns_are_healthy() {
        let turns = Turns::of(921_600, 3600).unwrap();
        assert_eq!((turns.whole(), turns.is_power_of_two()), (Some(256), true));
        assert!(Turns::of(8192, 8192).unwrap().is_power_of_two());
        assert!(Turns::of(536_870_912, 8192).unwrap().is_power_of_two());
    }

    #[test]
    fn other_numbers_of_turns_are_not() {
        // 1000 turns of 3600 steps; 1000 steps of turns of 3600.
        assert!(!Turns::of(3_600_000, 3600).unwrap().is_power_of_two());
        let broken = Turns::of(1_000_000, 3600).unwrap();
        assert_eq!((broken.whole(), broken.is_power_of_two()), (None, false));
        assert_eq!(broken.to_string(), "277.77");
        assert_eq!(Turns::of(0, 3600), None);
        assert_eq!(Turns::of(3600, 0), None);
    }

    #[test]
    fn positions_reach_to_the_total_resolution() {
        assert_eq!(check_position(0, 4096), Ok(()));
        assert_eq!(check_position(4096, 4096), Ok(()));
        assert!(check_position(4097, 4096).is_err());
    }

    #[test]
    fn motion_is_measured_the_short_way_round() {
        assert_eq!(distance(4095, 1, Some(4096)), 2);
        assert_eq!(distance(1, 4095, None), 4094);
        assert_eq!(distance(0, 4096, Some(4096)), 0);
        assert!(distance(100, 103, Some(4096)) > AT_REST);
    }

    proptest! {
        #[test]
        fn any_write_may_come(
            attribute: u8,
            data in proptest::collection::vec(any::<u8>(), 0..10),
            total_resolution: Option<u32>,
        ) {
            let _ = check_set(attribute, &data, Known { total_resolution, kind: None });
        }

        #[test]
        fn any_numbers_may_come(a: u32, b: u32, total: u32) {
            let _ = (distance(a, b, Some(total)), check_position(a, b));
            let _ = Turns::of(a, b).map(|turns| (turns.is_power_of_two(), turns.to_string()));
        }
    }
}
