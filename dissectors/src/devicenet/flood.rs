//! How much of the bus change-of-state and cyclic messages take.

use super::identifier::{MAC_IDS, MacId};
use crate::event::Moment;
use crate::uart::Baud;

/// Over which time it is watched, in ns.
const WINDOW_NS: i64 = 1_000_000_000;

/// A bit of the fastest rate that DeviceNet has, 500 kbit/s, in ns. Where the rate is not known,
/// messages take at least that long.
const SHORTEST_BIT_NS: u64 = 2_000;

/// Counts the bits of productions.
pub(super) struct Flood {
    bit_ns: u64,
    window: Moment,
    bits: [u32; MAC_IDS],
    total: u64,
    is_flooded: bool,
    /// The node that produces most, and the share of all, until it is told.
    to_tell: Option<(MacId, i64)>,
}

impl Flood {
    /// Of a bus at that rate. Without one shares are at least what is told.
    pub fn new(rate: Option<Baud>) -> Self {
        Flood {
            bit_ns: bit_ns(rate),
            window: Moment::UNKNOWN,
            bits: [0; MAC_IDS],
            total: 0,
            is_flooded: false,
            to_tell: None,
        }
    }

    /// The rate is known from now on: what was added before counts no more.
    pub fn learn_rate(&mut self, rate: Option<Baud>) {
        self.bit_ns = bit_ns(rate);
        self.lose();
    }

    /// Adds a production. Returns the share of all productions, in permille, if it is above the
    /// limit since the last full second and this node produces most.
    pub fn add(&mut self, slave: MacId, bits: u16, start: Moment, limit: u64) -> Option<i64> {
        if !self.window.is_known() {
            self.window = start;
        }
        let passed = start.since(self.window)?;
        if !(0..WINDOW_NS).contains(&passed) {
            let busy = self.bit_ns.saturating_mul(self.total);
            let share = busy.saturating_mul(1_000) / passed.unsigned_abs().max(1);
            let most = (0..MAC_IDS as u8).max_by_key(|mac| self.bits[usize::from(*mac)]);
            let is_flooded = share > limit;
            if is_flooded && !self.is_flooded {
                self.to_tell = most.map(|mac| (MacId::of(mac), share.min(1_000).cast_signed()));
            }
            self.is_flooded = is_flooded;
            (self.window, self.bits, self.total) = (start, [0; MAC_IDS], 0);
        }
        self.bits[slave.index()] += u32::from(bits);
        self.total += u64::from(bits);
        self.to_tell.take_if(|(most, _)| *most == slave).map(|(_, share)| share)
    }

    /// What was lost may have been anything.
    pub const fn lose(&mut self) {
        (self.window, self.bits, self.total) = (Moment::UNKNOWN, [0; MAC_IDS], 0);
    }
}

fn bit_ns(rate: Option<Baud>) -> u64 {
    rate.map_or(SHORTEST_BIT_NS, |rate| rate.bits_ns(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_node_that_takes_a_third_of_the_bus_is_told_once() {
        // 89 bits at 125 kbit/s are 712 µs: every 2 ms they take 356 of 1000.
        let mut flood = Flood::new(Baud::new(125_000));
        let told: alloc::vec::Vec<i64> = (0..2_000)
            .filter_map(|n| flood.add(MacId::of(23), 89, Moment::from_ns(n * 2_000_000), 300))
            .collect();
        assert_eq!(told, [356]);
        // The rate is not known. At 500 kbit/s they are 178 µs: every 0.5 ms they take 356 of 1000,
        // at any other rate more. Every 2 ms they take 89, which proves nothing.
        let mut unknown = Flood::new(None);
        let told: alloc::vec::Vec<i64> = (0..4_000)
            .filter_map(|n| unknown.add(MacId::of(23), 89, Moment::from_ns(n * 500_000), 300))
            .collect();
        assert_eq!(told, [356]);
        let mut unknown = Flood::new(None);
        assert!((0..2_000).all(|n| {
            unknown.add(MacId::of(23), 89, Moment::from_ns(n * 2_000_000), 300).is_none()
        }));
        // Every 4 ms: 178.
        let mut calm = Flood::new(Baud::new(125_000));
        assert!((0..2_000).all(|n| {
            calm.add(MacId::of(23), 89, Moment::from_ns(n * 4_000_000), 300).is_none()
        }));
    }
}
