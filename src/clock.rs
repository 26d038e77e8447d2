//! How times are shown.

use crate::cli::TimeStyle;
use crate::source::seconds_in_ns;
use crate::tally::Period;
use dissectors::event::Moment;
use jiff::Timestamp;
use jiff::tz::TimeZone;
use std::fmt;
use std::str::FromStr;

/// Times from here on are taken for dates, not for seconds since the capture's start: 1973.
const FIRST_DATE_NS: i64 = 100_000_000_000_000_000;

/// Whether a time is a date, rather than a time since the capture's start.
pub fn is_date(ns: i64) -> bool {
    ns >= FIRST_DATE_NS
}

const DAY_NS: i64 = 86_400_000_000_000;

/// A time as the user names it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum At {
    /// Seconds since the capture's start, in ns.
    Since(i64),
    /// Time of day (UTC), in ns since midnight.
    TimeOfDay(i64),
}

impl FromStr for At {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        const NO_TIME: &str = "not a time: seconds such as 1.25, or a time of day such as 10:41:07";
        let Some((hours, rest)) = text.split_once(':') else {
            return seconds_in_ns(text).map(At::Since).ok_or(NO_TIME);
        };
        let (minutes, seconds) = rest.split_once(':').ok_or(NO_TIME)?;
        let below = |text: &str, limit: i64| {
            text.parse().ok().filter(|number| (0..limit).contains(number)).ok_or(NO_TIME)
        };
        let minutes = below(hours, 24)? * 60 + below(minutes, 60)?;
        let seconds = seconds_in_ns(seconds).filter(|ns| (0..60_000_000_000).contains(ns));
        Ok(At::TimeOfDay(minutes * 60_000_000_000 + seconds.ok_or(NO_TIME)?))
    }
}

/// Turns moments into text.
#[derive(Clone, Debug)]
pub struct Clock {
    style: TimeStyle,
    /// The first time seen, if it is a date: where relative times begin.
    zero: Option<i64>,
    last: Option<i64>,
}

impl Clock {
    /// A clock of that style.
    pub fn new(style: TimeStyle) -> Clock {
        Clock { style, zero: None, last: None }
    }

    /// Takes note of the first time of the run: dates are counted from here.
    pub fn begin(&mut self, time: Moment) {
        if let (Some(ns), None) = (time.ns(), self.zero) {
            self.zero = Some(if ns >= FIRST_DATE_NS { ns } else { 0 });
        }
    }

    /// Takes note of the next record's time, and returns how much later it is than the one before.
    pub fn tick(&mut self, time: Moment) -> Option<i64> {
        self.begin(time);
        let ns = time.ns()?;
        let delta = self.last.map(|last| ns.saturating_sub(last));
        self.last = Some(ns);
        delta
    }

    /// Nanoseconds since the capture's start.
    pub fn relative(&self, time: Moment) -> Option<i64> {
        Some(time.ns()?.saturating_sub(self.zero.unwrap_or(0)))
    }

    /// A time that the user named, in nanoseconds since the capture's start. A time of day is the
    /// first one after that start.
    pub fn resolve(&self, at: At) -> i64 {
        let zero = self.zero.unwrap_or(0);
        match at {
            At::Since(ns) => ns,
            At::TimeOfDay(ns) => (ns - zero % DAY_NS).rem_euclid(DAY_NS),
        }
    }

    /// The time in this style, given how much later it is than the record before.
    pub fn show(&self, time: Moment, delta: Option<i64>) -> Shown {
        match (self.style, time.ns()) {
            (_, None) => Shown::Nothing,
            (TimeStyle::Delta, Some(_)) => Shown::Seconds(delta.unwrap_or(0)),
            (TimeStyle::Absolute, Some(ns)) if ns >= FIRST_DATE_NS => Shown::Date(ns),
            (_, Some(_)) => Shown::Seconds(self.relative(time).unwrap_or(0)),
        }
    }

    /// A period as `, 10:41:07 to 10:41:09`, finer within one second, or nothing where there are
    /// no times.
    pub fn period(&self, period: Period) -> String {
        let (Some(first), Some(last)) = (period.first.ns(), period.last.ns()) else {
            return String::new();
        };
        let form = if last / 1_000_000_000 > first / 1_000_000_000 { "%T" } else { "%T%.3f" };
        let text = |ns: i64| match Timestamp::from_nanosecond(i128::from(ns)) {
            Ok(time) if ns >= FIRST_DATE_NS => {
                time.to_zoned(TimeZone::UTC).strftime(form).to_string()
            }
            _ => format!("{}.{:03} s", ns / 1_000_000_000, ns / 1_000_000 % 1_000),
        };
        let (first, last) = (text(first), text(last));
        if first == last { format!(", {first}") } else { format!(", {first} to {last}") }
    }
}

/// A time as it is shown.
#[derive(Clone, Copy, Debug)]
pub enum Shown {
    /// There is none.
    Nothing,
    /// Seconds, in ns.
    Seconds(i64),
    /// Date and time of day, in ns since the Unix epoch.
    Date(i64),
}

impl fmt::Display for Shown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Shown::Nothing => Ok(()),
            Shown::Seconds(ns) => {
                let sign = if ns < 0 { "-" } else { "" };
                let us = (ns.unsigned_abs() + 500) / 1_000;
                write!(f, "{sign}{}.{:06}", us / 1_000_000, us % 1_000_000)
            }
            Shown::Date(ns) => match Timestamp::from_nanosecond(i128::from(ns)) {
                Ok(time) => write!(f, "{}", time.to_zoned(TimeZone::UTC).strftime("%F %T%.6f")),
                Err(_) => Shown::Seconds(ns).fmt(f),
            },
        }
    }
}

/// Seconds with nine decimals, exact.
pub struct Exact(pub i64);

impl fmt::Display for Exact {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sign = if self.0 < 0 { "-" } else { "" };
        let ns = self.0.unsigned_abs();
        write!(f, "{sign}{}.{:09}", ns / 1_000_000_000, ns % 1_000_000_000)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_dates_and_seconds_seconds() {
        // 1700000000 s after the epoch is 2023-11-14 22:13:20 UTC.
        let date = Moment::from_ns(1_700_000_000_123_456_789);
        let mut clock = Clock::new(TimeStyle::Absolute);
        assert_eq!(clock.tick(date), None);
        assert_eq!(clock.show(date, None).to_string(), "2023-11-14 22:13:20.123456");
        let later = date.plus(1_500_000);
        let mut clock = Clock::new(TimeStyle::Relative);
        clock.tick(date);
        assert_eq!(clock.tick(later), Some(1_500_000));
        assert_eq!(clock.show(later, None).to_string(), "0.001500");
    }

    #[test]
    fn periods_are_as_fine_as_they_are_short() {
        let at = |ns: i64| Moment::from_ns(1_700_000_000_000_000_000 + ns);
        let clock = Clock::new(TimeStyle::Relative);
        let period =
            |first: i64, last: i64| clock.period(Period { first: at(first), last: at(last) });
        assert_eq!(period(0, 2_100_000_000), ", 22:13:20 to 22:13:22");
        assert_eq!(period(5_000_000, 650_000_000), ", 22:13:20.005 to 22:13:20.650");
        assert_eq!(period(5_000_000, 5_000_000), ", 22:13:20.005");
        assert_eq!(clock.period(Period::NEVER), "");
    }

    #[test]
    fn users_name_times_as_they_are_shown() {
        let second = 1_000_000_000;
        let mut clock = Clock::new(TimeStyle::Relative);
        // 22:13:20 UTC.
        clock.begin(Moment::from_ns(1_700_000_000 * second));
        let at = |text: &str| text.parse().map(|at| clock.resolve(at));
        assert_eq!(at("1.25"), Ok(1_250_000_000));
        assert_eq!(at("22:13:20.5"), Ok(500_000_000));
        // The next day.
        assert_eq!(at("00:00:00"), Ok((6_400) * second));
        assert!(at("24:00:00").is_err() && at("10:41").is_err() && at("soon").is_err());
    }

    #[test]
    fn times_since_the_start_stay_as_they_are() {
        let mut clock = Clock::new(TimeStyle::Absolute);
        let time = Moment::from_ns(2_500_000_499);
        clock.tick(time);
        assert_eq!(clock.show(time, None).to_string(), "2.500000");
        assert_eq!(clock.show(Moment::UNKNOWN, None).to_string(), "");
        assert_eq!(Exact(-1_000_000_001).to_string(), "-1.000000001");
    }
}
