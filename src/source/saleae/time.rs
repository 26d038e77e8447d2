//! Times as Logic writes them.

use super::super::numbers::{Stamp, seconds, whole};
use dissectors::event::Moment;
use jiff::Timestamp;

/// A time: seconds since the capture's start, or a date with time of day.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Time {
    /// In ns since the capture's start, or since the Unix epoch.
    pub ns: i64,
    /// What its last digit is worth, in ns.
    pub resolution: u32,
    /// Whether it is a date.
    pub is_dated: bool,
}

impl Time {
    /// Reads `0.000016460`, `2.00000068e-09` or `2022-06-24T18:51:08.852112100+00:00`.
    pub fn parse(field: &[u8]) -> Option<Time> {
        if field.get(4) == Some(&b'-') && field.contains(&b'T') {
            return date(std::str::from_utf8(field).ok()?);
        }
        let Stamp { time, resolution } = whole(seconds, field)?;
        Some(Time { ns: time.ns()?, resolution, is_dated: false })
    }

    /// As a point in time.
    pub fn moment(self) -> Moment {
        Moment::from_ns(self.ns)
    }
}

fn date(text: &str) -> Option<Time> {
    let ns = text.parse::<Timestamp>().ok()?.as_nanosecond();
    let fraction = text.split_once('.').map_or("", |(_, fraction)| fraction);
    let digits = fraction.bytes().take_while(u8::is_ascii_digit).count();
    let zeros = 9_u32.saturating_sub(u32::try_from(digits).ok()?);
    Some(Time { ns: i64::try_from(ns).ok()?, resolution: 10_u32.pow(zeros), is_dated: true })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_and_dates() {
        let parse = |text: &str| {
            Time::parse(text.as_bytes()).map(|time| (time.ns, time.resolution, time.is_dated))
        };
        assert_eq!(parse("0.000016460"), Some((16_460, 1, false)));
        assert_eq!(parse("2.00000068e-09"), Some((2, 1, false)));
        assert_eq!(parse("-1.5"), Some((-1_500_000_000, 100_000_000, false)));
        // date -u -d 2022-06-24T18:51:08 +%s: 1656096668.
        let date = Some((1_656_096_668_852_112_100, 1, true));
        assert_eq!(parse("2022-06-24T18:51:08.852112100+00:00"), date);
        assert_eq!(parse("2022-06-24T20:51:08.852112100+02:00"), date);
        assert_eq!(
            parse("2022-06-24T18:51:08Z"),
            Some((1_656_096_668_000_000_000, 1_000_000_000, true))
        );
        for wrong in ["", "x", "2022-13-24T18:51:08Z", "9999-01-01T00:00:00Z", "1,5"] {
            assert_eq!(parse(wrong), None, "{wrong}");
        }
    }
}
