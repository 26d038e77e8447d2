//! The rate that a port really makes: chips divide a clock, and not every rate can be had.
//!
//! Computed from how the kernel's drivers choose divisors, not measured; the crystal's own error,
//! some 0.01 %, comes on top.

use serde::Serialize;

/// How a chip makes its rate.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Divider {
    /// A clock in Hz, already divided by the samples a bit, by a number of these parts of one: 1
    /// where only whole numbers can be had.
    Parts(u64, u64),
    /// A clock in Hz by a number of eighths, as FTDI's chips have it.
    Ftdi(u64),
    /// The CH340 and CH341.
    Ch341,
}

/// A rate asked for, and what comes of it.
#[derive(Serialize, Clone, Copy, PartialEq, Debug)]
pub struct Rate {
    /// What is asked for, in Bd.
    pub asked: u32,
    /// What the port makes of it, in Bd; `None` where it cannot come near.
    pub real: Option<u32>,
    /// How far that is off, in %.
    pub error_percent: Option<f64>,
}

/// A rate further off than this cannot be had: two and a half bits in a hundred are lost at the
/// end of a character.
const FURTHEST_PERCENT: f64 = 2.5;

impl Divider {
    /// What comes of a rate.
    pub fn rate(self, asked: u32) -> Rate {
        let real = self.real(u64::from(asked)).filter(|_| asked > 0);
        let error = |real: f64| {
            // Two decimals: the crystal is no better.
            let percent = (real / f64::from(asked) - 1.0) * 100.0;
            (percent * 100.0).round() / 100.0
        };
        let near = real.filter(|real| error(*real).abs() <= FURTHEST_PERCENT);
        Rate { asked, real: near.map(|real| real.round() as u32), error_percent: near.map(error) }
    }

    fn real(self, asked: u64) -> Option<f64> {
        let nearest = |clock: u64| clock.checked_add(asked / 2)?.checked_div(asked);
        match self {
            // The drivers of 8250 (serial8250_get_divisor()) and PL011 round to the nearest. A
            // divisor below one cannot be had.
            Divider::Parts(clock, parts) => {
                let divisor = nearest(clock * parts)?.min(0xFFFF * parts);
                (divisor >= parts).then(|| (clock * parts) as f64 / divisor as f64)
            }
            // ftdi_232bm_baud_base_to_divisor() in ftdi_sio: below two, only 1 and 1.5.
            Divider::Ftdi(clock) => {
                let eighths = match nearest(clock * 8)? {
                    0..=7 => return None,
                    8..=9 => 8,
                    10..=15 => 12,
                    more => more,
                };
                Some(clock as f64 * 8.0 / eighths as f64)
            }
            Divider::Ch341 => ch341(asked),
        }
    }
}

/// The clock of a CH341, in Hz.
const CH341_CLOCK: u64 = 48_000_000;

/// What ch341_get_divisor() comes to: one of four prescalers, halved or not, and a divisor.
fn ch341(asked: u64) -> Option<f64> {
    let divided_by = |prescaler: u64, fact: u64| 1 << (12 - 3 * prescaler - fact);
    let lowest = |prescaler: &u64| CH341_CLOCK / (divided_by(*prescaler, 1) * 512);
    let prescaler = (0..=3).rev().find(|prescaler| asked > lowest(prescaler))?;
    let mut clock = CH341_CLOCK / divided_by(prescaler, 1);
    let mut divisor = clock.checked_div(asked)?;
    if !(9..=255).contains(&divisor) {
        divisor /= 2;
        clock /= 2;
    }
    if divisor < 2 {
        return None;
    }
    let (above, below) = (clock as f64 / divisor as f64, clock as f64 / (divisor + 1) as f64);
    let asked = asked as f64;
    Some(if above - asked >= asked - below { below } else { above })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rates of SLIN encoders: the usual 115200 Bd, and TR's 345594 Bd.
    #[test]
    fn the_rates_of_slin_are_those_of_the_divisors() {
        let rates = |divider: Divider| {
            [115_200, 345_594].map(|asked| {
                let rate = divider.rate(asked);
                (rate.real, rate.error_percent)
            })
        };
        // FT232R: 3 MHz by 26 and by 8 5/8.
        let made = [(Some(115_385), Some(0.16)), (Some(347_826), Some(0.65))];
        assert_eq!(rates(Divider::Ftdi(3_000_000)), made);
        // FT2232H: 12 MHz by 104 1/8 (833/8) and by 34 6/8.
        let made = [(Some(115_246), Some(0.04)), (Some(345_324), Some(-0.08))];
        assert_eq!(rates(Divider::Ftdi(12_000_000)), made);
        // CH340: 12 MHz by 104 and by 35.
        let made = [(Some(115_385), Some(0.16)), (Some(342_857), Some(-0.79))];
        assert_eq!(rates(Divider::Ch341), made);
        // A PL011 at 48 MHz: 3 MHz by 26 3/64 (1667/64) and by 8 44/64.
        let made = [(Some(115_177), Some(-0.02)), (Some(345_324), Some(-0.08))];
        assert_eq!(rates(Divider::Parts(3_000_000, 64)), made);
        // A PC's port: 115200 Bd is all it has.
        assert_eq!(rates(Divider::Parts(115_200, 1)), [(Some(115_200), Some(0.0)), (None, None)]);
    }

    #[test]
    fn no_rate_is_believed_that_no_chip_makes() {
        for divider in [Divider::Parts(115_200, 1), Divider::Ftdi(3_000_000), Divider::Ch341] {
            assert_eq!(divider.rate(0).real, None);
            assert_eq!(divider.rate(u32::MAX).real, None);
            // The CH340 makes 1.5 MHz by 156 of it: 9615.
            let real = divider.rate(9600).real;
            assert!(matches!(real, Some(9600 | 9615)), "{divider:?}: {real:?}");
        }
        // Between 3 and 2 MBd an FTDI has nothing.
        assert_eq!(Divider::Ftdi(3_000_000).rate(2_500_000).real, None);
        assert_eq!(Divider::Ftdi(3_000_000).rate(3_000_000).real, Some(3_000_000));
        assert_eq!(Divider::Ftdi(3_000_000).rate(2_000_000).real, Some(2_000_000));
    }
}
