//! Time on the wire, and the clocks that stations send by.

/// Picoseconds since the beginning of the capture. A bit at 115200 Bd has 8 680 556 of them, so
/// that rounding them never shows.
pub type Ps = i64;

/// A nanosecond.
pub const NS: Ps = 1_000;
/// A microsecond.
pub const US: Ps = 1_000 * NS;
/// A millisecond.
pub const MS: Ps = 1_000 * US;
/// A second.
pub const S: Ps = 1_000 * MS;

/// Seconds as picoseconds.
pub fn seconds(seconds: f64) -> Ps {
    (seconds * S as f64).round() as Ps
}

/// The clock that a station sends or listens by.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Clock {
    /// How long it takes a bit to be.
    bit: Ps,
}

impl Clock {
    /// A clock that is exact.
    pub fn exact(baud: u32) -> Self {
        Clock::off_by(baud, 0.0)
    }

    /// A clock that is fast by this many percent, or slow if that is negative.
    pub fn off_by(baud: u32, percent: f64) -> Self {
        let rate = f64::from(baud) * (1.0 + percent / 100.0);
        Clock { bit: seconds(1.0 / rate) }
    }

    /// By how many millionths it is fast at this rate.
    pub fn ppm(self, baud: u32) -> i64 {
        let exact = S as f64 / f64::from(baud);
        ((exact / self.bit as f64 - 1.0) * 1e6) as i64
    }

    /// Duration of this many bits.
    pub fn bits(self, bits: f64) -> Ps {
        (self.bit as f64 * bits).round() as Ps
    }

    /// Duration of a character: start bit, eight data bits, parity bit, stop bit.
    pub fn characters(self, characters: f64) -> Ps {
        self.bits(11.0 * characters)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_character_lasts_eleven_bits() {
        // 11 / 115200 s = 95.486 µs; 11 / 9600 s = 1145.833 µs.
        assert_eq!(Clock::exact(115_200).characters(1.0) / NS, 95_486);
        assert_eq!(Clock::exact(9_600).characters(1.0) / NS, 1_145_833);
        // 1 % fast: 95.486 / 1.01 = 94.541 µs.
        assert_eq!(Clock::off_by(115_200, 1.0).characters(1.0) / NS, 94_540);
    }
}
