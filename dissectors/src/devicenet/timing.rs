//! Whether a limit is kept, as far as the clock can tell.

use crate::uart::Wire;

/// A bit of the slowest rate, where the rate is not known: 125 kbit/s.
const SLOWEST_BIT_NS: i64 = 8_000;

/// What becomes of a limit.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Verdict {
    Kept,
    /// The clock is too coarse to tell.
    Withheld,
    Broken,
}

/// How finely times can be told apart on this bus.
#[derive(Clone, Copy, Debug)]
pub(super) struct Timing {
    bit_ns: i64,
}

impl Timing {
    pub fn new(wire: Wire) -> Self {
        Timing { bit_ns: wire.baud().map_or(SLOWEST_BIT_NS, |rate| rate.bits_ns(1).cast_signed()) }
    }

    /// Whether a time is above an upper limit by more than the ± of both stamps and one bit.
    pub const fn above(self, value: i64, limit: i64, uncertainty: i64) -> Verdict {
        self.judge(value.saturating_sub(limit), uncertainty)
    }

    /// Whether a time is below a lower limit by more than the ± of both stamps and one bit.
    pub const fn below(self, value: i64, limit: i64, uncertainty: i64) -> Verdict {
        if limit < self.bit_ns {
            return Verdict::Withheld;
        }
        self.judge(limit.saturating_sub(value), uncertainty)
    }

    const fn judge(self, beyond: i64, uncertainty: i64) -> Verdict {
        if beyond > uncertainty.saturating_add(self.bit_ns) {
            Verdict::Broken
        } else if uncertainty > 0 && beyond >= -uncertainty && beyond <= uncertainty {
            Verdict::Withheld
        } else {
            Verdict::Kept
        }
    }

    /// How long so many bits take, in ns: at the slowest rate, where it is not known.
    pub const fn bits_ns(self, bits: u32) -> i64 {
        self.bit_ns.saturating_mul(bits as i64)
    }

    /// How long after a deadline silence is certain, with stamps of that ±.
    pub fn patience(self, uncertainty: u32) -> i64 {
        2 * i64::from(uncertainty) + self.bit_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::uart::{Baud, Format};

    #[test]
    fn a_limit_is_broken_by_more_than_the_stamps_and_a_bit() {
        // 500 kbit/s: a bit is 2 µs. ± 10 µs in all.
        let timing = Timing::new(Wire::new(Baud::new(500_000), Format::FT12));
        for (value, verdict) in [
            (100_000, Verdict::Kept),
            (489_999, Verdict::Kept),
            (490_000, Verdict::Withheld),
            (510_000, Verdict::Withheld),
            (512_000, Verdict::Kept),
            (512_001, Verdict::Broken),
        ] {
            assert_eq!(timing.above(value, 500_000, 10_000), verdict, "{value}");
            assert_eq!(timing.below(1_000_000 - value, 500_000, 10_000), verdict, "{value}");
        }
        assert_eq!(timing.below(500, 1_000, 0), Verdict::Withheld);
        assert_eq!(timing.above(500_000, 500_000, 0), Verdict::Kept);
    }
}
