//! The times of frames: the adapter's own, or when their line was read.

use super::line::STAMPS;
use dissectors::event::Moment;
use std::time::{Instant, SystemTime};

const MS: i64 = 1_000_000;

/// The time of this host, which does not jump while a tap listens.
pub struct HostClock {
    began: Instant,
    wall: Moment,
}

impl HostClock {
    /// Begins to run.
    pub fn new() -> Self {
        let wall = SystemTime::UNIX_EPOCH.elapsed().unwrap_or_default();
        let wall = Moment::from_ns(i64::try_from(wall.as_nanos()).unwrap_or(i64::MAX));
        HostClock { began: Instant::now(), wall }
    }

    /// The time.
    pub fn now(&self) -> Moment {
        let elapsed = self.began.elapsed().as_nanos();
        self.wall.plus(i64::try_from(elapsed).unwrap_or(i64::MAX))
    }
}

/// The milliseconds of an adapter, which begin again every minute, as times that go on. The first
/// one is taken for the time when it was read.
#[derive(Clone, Copy, Default, Debug)]
pub struct AdapterClock {
    last: Option<Stamp>,
}

#[derive(Clone, Copy, Debug)]
struct Stamp {
    ms: u16,
    at: Moment,
    read: Moment,
}

impl AdapterClock {
    /// The time of a stamp that was read at this time: minutes that passed in silence are counted
    /// by the host's clock.
    pub fn at(&mut self, ms: u16, read: Moment) -> Moment {
        let at = match self.last {
            None => read,
            Some(last) => {
                let minute = i64::from(STAMPS);
                let step = i64::from(ms) - i64::from(last.ms);
                let passed = read.since(last.read).unwrap_or(0) / MS;
                // The nearest whole number of minutes.
                let minutes = (passed - step + minute / 2).div_euclid(minute);
                last.at.plus((step + minutes * minute) * MS)
            }
        };
        self.last = Some(Stamp { ms, at, read });
        at
    }

    /// What the adapter's clock shows at a time of the host's.
    pub fn shown(&self, host: Moment) -> Moment {
        let since = self.last.and_then(|last| Some((last.at, host.since(last.read)?)));
        since.map_or(host, |(at, since)| at.plus(since))
    }

    /// The adapter begins anew.
    pub fn forget(&mut self) {
        self.last = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The times of stamps that were read at these times of the host, all in ms.
    fn times(stamps: &[(u16, i64)]) -> Vec<i64> {
        let mut clock = AdapterClock::default();
        let time = |&(ms, read)| clock.at(ms, Moment::from_ns(read * MS)).ns().expect("known") / MS;
        stamps.iter().map(time).collect()
    }

    #[test]
    fn stamps_go_on_where_the_minute_begins_again() {
        // Read late by 0 to 8 ms; the stamps are right.
        let read = [(59_990, 1_000), (59_999, 1_017), (1, 1_011), (10, 1_028)];
        assert_eq!(times(&read), [1_000, 1_009, 1_011, 1_020]);
    }

    #[test]
    fn minutes_of_silence_are_counted_by_the_host() {
        // Two minutes and 5 s; an hour, in which the host's clock gained 20 s on the adapter's.
        assert_eq!(times(&[(100, 0), (5_100, 125_003)]), [0, 125_000]);
        assert_eq!(times(&[(100, 0), (100, 3_620_000)]), [0, 3_600_000]);
    }

    #[test]
    fn a_stamp_that_is_out_of_order_by_a_little_goes_back_by_a_little() {
        assert_eq!(times(&[(0, 500), (59_999, 500), (1, 502)]), [500, 499, 501]);
    }

    #[test]
    fn the_hosts_time_is_shown_as_the_adapters() {
        let mut clock = AdapterClock::default();
        let host = |ms: i64| Moment::from_ns(ms * MS);
        assert_eq!(clock.shown(host(7)), host(7));
        clock.at(10, host(1_000));
        // Read 40 ms late.
        clock.at(20, host(1_050));
        assert_eq!(clock.shown(host(2_050)), host(2_010));
    }
}
