//! The times of frames: the adapter's own, or when their line was read.

use super::line::STAMPS;
use dissectors::event::Moment;
use std::time::{Duration, SystemTime};

const MS: i64 = 1_000_000;

/// How long the adapter's clock is compared with the host's before it is corrected, in ns. A line is
/// never read before its stamp, and may be read later; that all of them are for so long is no host's
/// doing.
const WINDOW_NS: i64 = 10_000 * MS;

/// What is corrected at once, in ns: no more than what a stamp is worth. In each window that makes up
/// for 100 ppm, and crystals are good to 50.
const STEP_NS: i64 = MS;

/// Beyond that, in ns, it is no clock that drifts but one that stood still, began anew or is no good.
const FAR_NS: i64 = 100 * MS;

/// The time of this host, which does not jump while a tap listens.
pub struct HostClock {
    began: Duration,
    wall: Moment,
}

impl HostClock {
    /// Begins to run.
    pub fn new() -> Self {
        let wall = SystemTime::UNIX_EPOCH.elapsed().unwrap_or_default();
        let wall = Moment::from_ns(i64::try_from(wall.as_nanos()).unwrap_or(i64::MAX));
        HostClock { began: running(), wall }
    }

    /// The time.
    pub fn now(&self) -> Moment {
        let elapsed = running().saturating_sub(self.began).as_nanos();
        self.wall.plus(i64::try_from(elapsed).unwrap_or(i64::MAX))
    }
}

/// The time since the host was started. It goes on while the host is suspended, as that of
/// `Instant` does not.
#[cfg(target_os = "linux")]
fn running() -> Duration {
    use rustix::time::{ClockId, clock_gettime};
    Duration::try_from(clock_gettime(ClockId::Boottime)).unwrap_or_default()
}

/// The time since this program first asked.
#[cfg(not(target_os = "linux"))]
fn running() -> Duration {
    use std::sync::OnceLock;
    use std::time::Instant;
    static FIRST: OnceLock<Instant> = OnceLock::new();
    FIRST.get_or_init(Instant::now).elapsed()
}

/// The milliseconds of an adapter, which begin again every minute, as times that go on. The first
/// one is taken for the time when it was read, and the later ones are kept to the host's clock.
#[derive(Clone, Copy, Default, Debug)]
pub struct AdapterClock {
    last: Option<Stamp>,
    window: Option<Window>,
    /// What is still to be corrected, in ns.
    owed: i64,
    jump: Option<i64>,
}

#[derive(Clone, Copy, Debug)]
struct Stamp {
    ms: u16,
    at: Moment,
    read: Moment,
}

/// How late lines were read at least, in ns.
#[derive(Clone, Copy, Debug)]
struct Window {
    until: Moment,
    least: i64,
}

impl AdapterClock {
    /// The time of a stamp that was read at this time: minutes that passed in silence are counted
    /// by the host's clock.
    pub fn at(&mut self, ms: u16, read: Moment) -> Moment {
        let at = match self.last {
            None => self.compare(read, read),
            Some(last) => {
                let minute = i64::from(STAMPS);
                let step = i64::from(ms) - i64::from(last.ms);
                let passed = read.since(last.read).unwrap_or(0) / MS;
                // The nearest whole number of minutes.
                let minutes = (passed - step + minute / 2).div_euclid(minute);
                let at = self.correct(last.at, last.at.plus((step + minutes * minute) * MS));
                // Lines come in order: no clock that goes on shows less than before.
                match last.at.since(at).is_some_and(|back| back > FAR_NS) {
                    true => self.begin_anew(at, read),
                    false => self.compare(at, read),
                }
            }
        };
        self.last = Some(Stamp { ms, at, read });
        at
    }

    /// Corrects a time by what is owed, but never back before the last one.
    fn correct(&mut self, last: Moment, at: Moment) -> Moment {
        let passed = at.since(last).unwrap_or(0).max(0);
        let correction = self.owed.max(-passed);
        self.owed -= correction;
        at.plus(correction)
    }

    /// Compares a time with that of reading, which is the time itself where it is far from it.
    fn compare(&mut self, at: Moment, read: Moment) -> Moment {
        let late = read.since(at).unwrap_or(0) - self.owed;
        let window = self.window.get_or_insert(Window { until: read.plus(WINDOW_NS), least: late });
        window.least = window.least.min(late);
        let Window { until, least } = *window;
        let is_over = read.is_after(until);
        if least < -FAR_NS || (is_over && least > FAR_NS) {
            return self.begin_anew(at, read);
        }
        if is_over {
            self.window = None;
            self.owed += least.clamp(-STEP_NS, STEP_NS);
        }
        at
    }

    /// It is no clock that goes on: the time is that of reading.
    fn begin_anew(&mut self, at: Moment, read: Moment) -> Moment {
        let late = read.since(at).unwrap_or(0).saturating_sub(self.owed);
        *self = AdapterClock { jump: Some(late), ..AdapterClock::default() };
        read
    }

    /// How far in ns the adapter's clock was behind the host's when its times last began anew, if
    /// they did since this was last asked.
    pub fn take_jump(&mut self) -> Option<i64> {
        self.jump.take()
    }

    /// What the adapter's clock shows at a time of the host's.
    pub fn shown(&self, host: Moment) -> Moment {
        let since = self.last.and_then(|last| Some((last.at, host.since(last.read)?)));
        since.map_or(host, |(at, since)| at.plus(since))
    }

    /// The adapter begins anew.
    pub fn forget(&mut self) {
        *self = AdapterClock::default();
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
    fn stamps_that_jump_never_give_times_far_from_those_of_reading() {
        let (mut clock, mut ms, mut last) = (AdapterClock::default(), 1_u32, 0);
        for read in (0..600_000).step_by(10) {
            // Any numbers will do (Numerical Recipes, 7.1).
            ms = ms.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let stamp = (ms >> 16) % u32::from(STAMPS);
            let at = clock.at(stamp as u16, Moment::from_ns(read * MS)).ns().expect("known") / MS;
            // A step of 100 ms is no jump, and two may follow each other.
            assert!((at - read).abs() <= 200 && last - at <= 200, "{read}: {last}, {at}");
            last = at;
        }
        // Back by 20 s: at once those of the host again.
        assert_eq!(
            times(&[(30_000, 1_000), (10_000, 1_010), (10_010, 1_020)])[1..],
            [1_010, 1_020]
        );
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

    /// An adapter that was heard every 100 ms for so many seconds of the host's, and whose clock is
    /// so many ppm fast: how far its times were off at most in ms, and how often they began anew.
    /// Lines are read 1 to 8 ms late.
    fn drift(ppm: i64, seconds: i64) -> (i64, usize) {
        let (mut clock, mut worst, mut jumps) = (AdapterClock::default(), 0, 0);
        let mut last = Moment::UNKNOWN;
        for ms in (0..seconds * 1000).step_by(100) {
            let shown = (ms + ms * ppm / 1_000_000).rem_euclid(i64::from(STAMPS));
            let late = 1 + ms / 100 * 5 % 8;
            let at = clock.at(shown as u16, Moment::from_ns((ms + late) * MS));
            let jump = clock.take_jump();
            assert!(jump.is_some() || !last.is_after(at), "{ppm} ppm, {ms} ms: {last:?} {at:?}");
            (last, jumps) = (at, jumps + usize::from(jump.is_some()));
            worst = worst.max((at.ns().expect("known") / MS - ms).abs());
        }
        (worst, jumps)
    }

    #[test]
    fn a_clock_that_drifts_as_crystals_do_is_kept_to_the_hosts_without_a_jump() {
        // In a day 50 ppm are 4.3 s.
        for ppm in [-50, 0, 50] {
            let (worst, jumps) = drift(ppm, 86_400);
            assert!(worst <= 10 && jumps == 0, "{ppm} ppm: {worst} ms off, {jumps} jumps");
        }
    }

    /// 5000 ppm are 50 ms in each window. One that is ahead is found out after 20 s. For one that is
    /// behind a whole window must be late: four of them pass, less what was corrected, and 8 ms.
    #[test]
    fn a_clock_that_is_no_good_begins_anew_and_says_so() {
        for ppm in [-5000, 5000] {
            let (worst, jumps) = drift(ppm, 600);
            assert!(worst <= 4 * 50 + 8, "{ppm} ppm: {worst} ms off");
            assert!((600 / 40..=600 / 20).contains(&jumps), "{ppm} ppm: {jumps} jumps");
        }
    }

    #[test]
    fn a_host_that_is_late_for_a_while_changes_nothing() {
        let mut clock = AdapterClock::default();
        for ms in (0..60_000).step_by(100) {
            let late = if (20_000..28_000).contains(&ms) { 2_000 } else { 0 };
            let at = clock.at(ms as u16, Moment::from_ns((ms + late) * MS));
            assert_eq!((at.ns().map(|ns| ns / MS), clock.take_jump()), (Some(ms), None));
        }
    }

    #[test]
    fn the_host_goes_on() {
        let clock = HostClock::new();
        let wall = SystemTime::UNIX_EPOCH.elapsed().expect("after 1970").as_nanos() as i64;
        std::thread::sleep(Duration::from_millis(20));
        let off = clock.now().since(Moment::from_ns(wall)).expect("known");
        assert!((20 * MS..10_000 * MS).contains(&off), "{off}");
    }
}
