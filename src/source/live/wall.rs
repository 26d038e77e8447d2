//! Whether the computer's clock was set while a tap listens.
//!
//! Most taps stamp with the time of day. A computer without a clock of its own has the right one only
//! once it found a time server, a minute after it began: for whoever is told of times alone, the bus
//! was silent for hours.

use dissectors::event::Moment;
use std::time::SystemTime;

/// ± of the sharpest stamps that a program takes, in ns: what a clock that is steered makes in a turn
/// is a thousand times less.
const STEP: i64 = 2_000_000;

/// What two clocks showed at once, in ns.
#[derive(Clone, Copy, Debug)]
pub struct Reading {
    /// The time of day, which can be set.
    pub day: i64,
    /// The time since the computer was switched on, which cannot, before and after that was asked.
    pub running: [i64; 2],
}

impl Reading {
    /// What they show now.
    pub fn take() -> Self {
        let before = running();
        let since = SystemTime::UNIX_EPOCH.elapsed().unwrap_or_default();
        let day = i64::try_from(since.as_nanos()).unwrap_or(i64::MAX);
        Reading { day, running: [before, running()] }
    }
}

/// Suspended computers go on counting.
#[cfg(target_os = "linux")]
fn running() -> i64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::Boottime);
    time.tv_sec.saturating_mul(1_000_000_000).saturating_add(time.tv_nsec)
}

#[cfg(not(target_os = "linux"))]
fn running() -> i64 {
    static BEGAN: std::sync::OnceLock<std::time::Instant> = std::sync::OnceLock::new();
    let began = BEGAN.get_or_init(std::time::Instant::now);
    i64::try_from(began.elapsed().as_nanos()).unwrap_or(i64::MAX)
}

/// The clock was set.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Step {
    /// By so many ns.
    pub by: i64,
    /// What it last showed before.
    pub before: Moment,
}

/// Watches the clock.
#[derive(Clone, Copy, Default, Debug)]
pub struct Watch {
    last: Option<Reading>,
}

impl Watch {
    /// Whether it was set since the last reading.
    pub fn look(&mut self, reading: Reading) -> Option<Step> {
        let Reading { day, running: [began, ended] } = reading;
        // Kept between two questions, this thread knows nothing.
        if ended.saturating_sub(began) > STEP / 2 {
            return None;
        }
        let last = self.last.replace(reading)?;
        let passed = began.saturating_sub(last.running[0]);
        let by = day.saturating_sub(last.day).saturating_sub(passed);
        (by.saturating_abs() > STEP).then_some(Step { by, before: Moment::from_ns(last.day) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: i64 = 1_000_000_000;

    fn at(day: i64, running: i64) -> Reading {
        Reading { day, running: [running, running + 100] }
    }

    #[test]
    fn a_clock_that_is_set_is_noticed_once() {
        let mut watch = Watch::default();
        let turns = [(1_000, 10), (1_001, 11), (4_602, 12), (4_603, 13), (1_004, 14)];
        let steps = turns.map(|(day, running)| watch.look(at(day * S, running * S)));
        let step = |by, before| Some(Step { by: by * S, before: Moment::from_ns(before * S) });
        assert_eq!(steps, [None, None, step(3_600, 1_001), None, step(-3_600, 4_603)]);
    }

    #[test]
    fn a_clock_that_is_steered_is_not_set() {
        // 500 ppm, the most that a kernel steers by, for an hour of turns of 10 ms.
        let mut watch = Watch::default();
        for turn in 0..360_000 {
            assert_eq!(watch.look(at(turn * 10_005_000, turn * 10_000_000)), None);
        }
    }

    #[test]
    fn a_program_that_stops_or_a_computer_that_sleeps_sets_no_clock() {
        let mut watch = Watch::default();
        watch.look(at(0, 0));
        assert_eq!(watch.look(at(3_600 * S, 3_600 * S)), None);
        // Stopped for a second between the two clocks.
        let stopped = Reading { day: 3_602 * S, running: [3_601 * S, 3_602 * S] };
        assert_eq!(watch.look(stopped), None);
        assert_eq!(watch.look(at(3_603 * S, 3_603 * S)), None);
    }
}
