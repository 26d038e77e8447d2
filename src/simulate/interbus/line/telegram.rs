//! Telegrams on a wire, as lectures report them: start bit, three flags, a byte in data telegrams, stop bit.

use super::profile::{BitOrder, Profile};
use crate::simulate::level::Low;
use crate::simulate::time::{Clock, Ps};

/// Bits of a status telegram.
pub const STATUS_BITS: f64 = 5.0;
/// Bits of a data telegram.
pub const DATA_BITS: f64 = 13.0;

/// The bits of a status telegram.
pub fn status(flags: [bool; 3]) -> Vec<bool> {
    [&[false], &flags[..], &[true]].concat()
}

/// The bits of a data telegram.
pub fn data(flags: [bool; 3], byte: u8, profile: &Profile) -> Vec<bool> {
    let byte = match profile.data_bit_order {
        BitOrder::Msb => byte,
        BitOrder::Lsb => byte.reverse_bits(),
    };
    let bits = (0..8).rev().map(|bit| byte >> bit & 1 == 1);
    [false].into_iter().chain(flags).chain(bits).chain([true]).collect()
}

/// One of the two wires of a connector, at the level 1 when nothing is sent.
pub struct Wire {
    clock: Clock,
    /// When it is 0, in order.
    low: Vec<Low>,
}

impl Wire {
    /// A wire on which nothing was sent.
    pub fn new(clock: Clock) -> Self {
        Wire { clock, low: Vec::new() }
    }

    /// Sends bits from this time on.
    pub fn send(&mut self, at: Ps, bits: &[bool]) {
        let edge = |bit: usize| at + self.clock.bits(bit as f64);
        for (number, bit) in bits.iter().enumerate().filter(|(_, bit)| !**bit) {
            debug_assert!(!bit);
            let (from, to) = (edge(number), edge(number + 1));
            match self.low.last_mut() {
                Some(last) if last.to >= from => last.to = to,
                _ => self.low.push(Low { from, to }),
            }
        }
    }

    /// When it was 0 up to this time. What is later stays.
    pub fn take(&mut self, until: Ps) -> Vec<Low> {
        let end = self.low.partition_point(|low| low.from < until);
        let mut taken: Vec<Low> = self.low.drain(..end).collect();
        if let Some(last) = taken.last_mut().filter(|last| last.to > until) {
            self.low.insert(0, Low { from: until, to: last.to });
            last.to = until;
        }
        taken
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(bits: &[bool]) -> String {
        bits.iter().map(|bit| if *bit { '1' } else { '0' }).collect()
    }

    #[test]
    fn the_model_characters_of_the_specification() {
        // Data 81h with flags 001, 0 001 10000001 1; a status telegram with 000, 0 000 1.
        let profile = Profile::default();
        let flags = [false, false, true];
        assert_eq!(text(&data(flags, 0x81, &profile)), "0001100000011");
        assert_eq!(text(&status([false; 3])), "00001");
        let lsb = Profile { data_bit_order: BitOrder::Lsb, ..profile };
        assert_eq!(text(&data(flags, 0x03, &lsb)), "0001110000001");
        assert_eq!((DATA_BITS, STATUS_BITS), (13.0, 5.0));
    }

    #[test]
    fn bits_are_spans_of_time() {
        // 500 kbit/s: 2 µs a bit. 0 0 0 0 1, 0 0 1.
        let us = 1_000_000;
        let mut wire = Wire::new(Clock::exact(500_000));
        wire.send(10 * us, &status([false; 3]));
        wire.send(20 * us, &[false, false, true]);
        assert_eq!(wire.take(22 * us), [low(10, 18), low(20, 22)]);
        assert_eq!(wire.take(100 * us), [low(22, 24)]);
        fn low(from: Ps, to: Ps) -> Low {
            Low { from: from * 1_000_000, to: to * 1_000_000 }
        }
    }
}
