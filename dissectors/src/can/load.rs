//! How busy a bus is.

use crate::event::Moment;
use crate::uart::Baud;

/// Over which time load is watched, in ns.
const WINDOW_NS: i64 = 1_000_000_000;

/// The time that frames took of a bus: data and remote frames with stuff bits and intermission.
/// Error frames and what is sent again because of them are not in it, as no log has them.
#[derive(Clone, Copy, Debug)]
pub struct Load {
    busy_ns: u64,
    /// Time that was heard before the last pause.
    heard_ns: i64,
    /// The time since.
    first: Moment,
    last: Moment,
    window: Moment,
    window_ns: u64,
    peak: u16,
}

impl Load {
    /// Nothing was heard yet.
    #[must_use]
    pub const fn new() -> Self {
        let none = Moment::UNKNOWN;
        Load {
            busy_ns: 0,
            heard_ns: 0,
            first: none,
            last: none,
            window: none,
            window_ns: 0,
            peak: 0,
        }
    }

    /// Adds a frame. Returns the load of the second that ended with it, in permille, if one did.
    pub fn add(&mut self, start: Moment, bits: u16, rate: Baud) -> Option<u16> {
        let ns = rate.bits_ns(u32::from(bits));
        self.busy_ns += ns;
        if !self.first.is_known() {
            (self.first, self.window) = (start, start);
        }
        self.last = start;
        let passed = start.since(self.window)?;
        if (0..WINDOW_NS).contains(&passed) {
            self.window_ns += ns;
            return None;
        }
        // After a pause, or where time ran backwards, a new second begins.
        let load = permille(self.window_ns, WINDOW_NS);
        (self.window, self.window_ns) = (start, ns);
        self.peak = self.peak.max(load);
        Some(load)
    }

    /// Nobody listened from the last frame to the next: how busy the bus was meanwhile is not known.
    pub fn pause(&mut self) {
        self.heard_ns = self.heard();
        (self.first, self.last, self.window_ns) = (Moment::UNKNOWN, Moment::UNKNOWN, 0);
    }

    /// The load of all the time that was heard, in permille; `None` where there was none.
    #[must_use]
    pub fn mean(&self) -> Option<u16> {
        let heard = self.heard();
        (heard > 0).then(|| permille(self.busy_ns, heard))
    }

    fn heard(&self) -> i64 {
        let since = self.last.since(self.first).unwrap_or(0);
        self.heard_ns.saturating_add(since.max(0))
    }

    /// The busiest second, in permille; `None` where there was no whole second.
    #[must_use]
    pub fn peak(&self) -> Option<u16> {
        (self.peak > 0).then_some(self.peak)
    }
}

impl Default for Load {
    fn default() -> Self {
        Load::new()
    }
}

fn permille(busy: u64, all: i64) -> u16 {
    let all = all.unsigned_abs().max(1);
    (busy.saturating_mul(1_000) / all).min(1_000) as u16
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    #[test]
    fn a_frame_every_millisecond() {
        // 105 bits at 125 kbit/s are 840 µs: 84 % of a millisecond.
        let rate = Baud::new(125_000).unwrap();
        let mut load = Load::new();
        let told: Vec<u16> = (0..2_001)
            .filter_map(|ms| load.add(Moment::from_ns(ms * 1_000_000), 105, rate))
            .collect();
        assert_eq!(told, [840, 840]);
        assert_eq!(load.peak(), Some(840));
        assert_eq!(load.mean(), Some(840));
    }

    /// The same for a second before and a second after an hour in which nobody listened.
    #[test]
    fn a_pause_of_the_tap_is_none_of_the_bus() {
        let rate = Baud::new(125_000).unwrap();
        let mut load = Load::new();
        let second = |from: i64, load: &mut Load| {
            (0..1_001).for_each(|ms| {
                load.add(Moment::from_ns((from + ms) * 1_000_000), 105, rate);
            });
        };
        second(0, &mut load);
        load.pause();
        second(3_600_000, &mut load);
        // 2002 frames of 840 µs in 2000 ms.
        assert_eq!(load.mean(), Some(840));
        assert_eq!(load.peak(), Some(840));
    }
}
