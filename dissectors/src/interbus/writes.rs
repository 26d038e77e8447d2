//! Writes that a program repeats: parameters live in an EEPROM, which wears out.

use crate::event::Moment;
use alloc::vec::Vec;

/// So many writes of the same value ...
const TIMES: usize = 10;

/// ... within this, in ns, are told.
const WITHIN_NS: i64 = 60_000_000_000;

/// What was written to one device, by service.
#[derive(Default, Debug)]
pub struct Writes {
    runs: Vec<Run>,
}

/// The last writes of one value.
#[derive(Debug)]
struct Run {
    service: u8,
    value: u32,
    /// When, the newest first.
    times: [Moment; TIMES],
    is_told: bool,
}

impl Writes {
    /// A value was written. Tells from when on it was written ten times within a minute: once,
    /// until it pauses.
    pub fn add(&mut self, service: u8, value: u32, now: Moment) -> bool {
        let place = self.runs.iter().position(|run| run.service == service);
        let fresh = Run { service, value, times: [Moment::UNKNOWN; TIMES], is_told: false };
        let run = match place {
            // There are sixteen services at most.
            None => {
                self.runs.push(fresh);
                self.runs.last_mut()
            }
            Some(place) => self.runs.get_mut(place),
        };
        let Some(run) = run else { return false };
        if run.value != value {
            *run = Run { service, value, times: [Moment::UNKNOWN; TIMES], is_told: false };
        }
        run.times.rotate_right(1);
        run.times[0] = now;
        let span = now.since(run.times[TIMES - 1]);
        let is_repeated = span.is_some_and(|ns| (0..=WITHIN_NS).contains(&ns));
        let was_told = core::mem::replace(&mut run.is_told, is_repeated);
        is_repeated && !was_told
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At which of so many writes, one every `spacing` s, it is told.
    fn told(count: i64, spacing: i64, value: impl Fn(i64) -> u32) -> Vec<i64> {
        let mut writes = Writes::default();
        let at = |n: i64| Moment::from_ns(n * spacing * 1_000_000_000);
        (1..=count).filter(|n| writes.add(2, value(*n), at(*n))).collect()
    }

    #[test]
    fn the_tenth_write_of_a_value_within_a_minute_is_told_once() {
        assert_eq!(told(40, 1, |_| 5_000), [10]);
        // Ten writes span nine pauses: 9 · 6 s = 54 s, 9 · 7 s = 63 s.
        assert_eq!(told(40, 6, |_| 5_000), [10]);
        assert_eq!(told(40, 7, |_| 5_000), []);
    }

    #[test]
    fn values_that_differ_are_no_repetition() {
        assert_eq!(told(100, 1, |n| n as u32 % 2), []);
        // Another value after nine: counted anew.
        assert_eq!(told(25, 1, |n| u32::from(n > 9)), [19]);
    }

    #[test]
    fn without_times_nothing_is_told() {
        let mut writes = Writes::default();
        assert!((0..50).all(|_| !writes.add(2, 5_000, Moment::UNKNOWN)));
    }
}
