//! Times of logs: seconds, counters, dates, times of day.

use super::super::numbers::{seconds, whole};
use super::layout::TimeUnit;
use dissectors::event::Moment;
use jiff::civil;
use jiff::tz::TimeZone;

const MINUTE: i64 = 60_000_000_000;
const DAY: i64 = 24 * 60 * MINUTE;

/// Where times are counted from. Those of different bases cannot be compared.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Base {
    /// From wherever the log began to count.
    Counter,
    /// From the epoch.
    Date,
    /// From midnight of a day that is not told.
    Midnight,
}

impl Base {
    /// What such times are called.
    pub const fn name(self) -> &'static str {
        match self {
            Base::Counter => "numbers",
            Base::Date => "dates",
            Base::Midnight => "times of day without a date",
        }
    }
}

/// Reads the times of one log. Dates without a zone are taken as UTC.
pub struct Stamps {
    unit: TimeUnit,
    /// A comma may divide decimals: it divides no columns.
    has_comma: bool,
    /// The finest resolution seen, in ns: zeros at the end may have been left out.
    resolution: u32,
    /// The date that was read last, and its midnight.
    date: (Vec<u8>, i64),
    /// Midnights since the first row of a log that has times of day alone, and its last time.
    midnights: i64,
    last: i64,
    /// That of the time that was read last.
    base: Option<Base>,
}

impl Stamps {
    /// Times in this unit, of columns divided by `delimiter`.
    pub fn new(unit: TimeUnit, delimiter: u8) -> Self {
        Stamps {
            unit,
            has_comma: delimiter != b',',
            resolution: u32::MAX,
            date: (Vec::new(), 0),
            midnights: 0,
            last: i64::MIN,
            base: None,
        }
    }

    /// Reads a time, and its date where that has a column of its own. Returns what its last digit
    /// is worth in ns, too. An empty cell is a time that nobody knows.
    pub fn read(&mut self, date: &[u8], time: &[u8]) -> Option<(Moment, u32)> {
        let read = self.read_time(date, time)?;
        let is_date = || !date.is_empty() || time.iter().any(|byte| matches!(byte, b'T' | b' '));
        self.base = match time {
            [] => self.base,
            _ if is_date() => Some(Base::Date),
            _ if time.contains(&b':') => Some(Base::Midnight),
            _ => Some(Base::Counter),
        };
        Some(read)
    }

    /// Where the time that was read last is counted from.
    pub fn base(&self) -> Option<Base> {
        self.base
    }

    fn read_time(&mut self, date: &[u8], time: &[u8]) -> Option<(Moment, u32)> {
        if let Some((ns, resolution)) = self.counted(time).filter(|_| date.is_empty()) {
            return Some(self.moment(ns, resolution));
        }
        if time.is_empty() {
            return Some((Moment::UNKNOWN, 0));
        }
        if !date.is_empty() {
            let midnight = self.midnight(date)?;
            let (ns, resolution) = self.time_of_day(time)?;
            return Some(self.moment(midnight.saturating_add(ns), resolution));
        }
        if let Some(at) = time.iter().position(|byte| matches!(byte, b'T' | b' ')) {
            let midnight = self.midnight(&time[..at])?;
            let (time, offset) = offset(time[at + 1..].trim_ascii())?;
            let (ns, resolution) = self.time_of_day(time)?;
            return Some(self.moment(midnight.saturating_add(ns - offset), resolution));
        }
        if time.contains(&b':') {
            return self.after_midnight(time);
        }
        // A sign, an exponent, more digits than nanoseconds.
        let stamp = whole(seconds, time).filter(|_| self.unit == TimeUnit::S)?;
        Some(self.moment(stamp.time.ns()?, stamp.resolution))
    }

    /// Begins again, but remembers how fine times are.
    pub fn rewind(&mut self) {
        (self.midnights, self.last) = (0, i64::MIN);
    }

    fn moment(&mut self, ns: i64, resolution: u32) -> (Moment, u32) {
        self.resolution = self.resolution.min(resolution);
        (Moment::from_ns(ns), self.resolution)
    }

    /// A number without a sign: its value in ns, and what its last digit is worth.
    fn counted(&self, text: &[u8]) -> Option<(i64, u32)> {
        let power = self.unit.power();
        let (mut value, mut decimals) = (0_i64, None);
        if text.is_empty() || text.len() > 18 {
            return None;
        }
        for byte in text {
            match byte {
                b'0'..=b'9' => {
                    value = value * 10 + i64::from(byte - b'0');
                    decimals = decimals.map(|count| count + 1);
                }
                b'.' if decimals.is_none() => decimals = Some(0),
                b',' if decimals.is_none() && self.has_comma => decimals = Some(0),
                _ => return None,
            }
        }
        let worth = 10_u32.pow(power.checked_sub(decimals.unwrap_or(0))?);
        Some((value.checked_mul(i64::from(worth))?, worth))
    }

    /// Midnight of `2024-05-03`, `2024/05/03` or `03.05.2024`.
    fn midnight(&mut self, text: &[u8]) -> Option<i64> {
        if self.date.0 != text {
            let ns = midnight(text)?;
            self.date.0.clear();
            self.date.0.extend_from_slice(text);
            self.date.1 = ns;
        }
        Some(self.date.1)
    }

    /// `10:41:07.123`: ns since midnight. A comma divides decimals, too: it is in quotes, then.
    fn time_of_day(&self, text: &[u8]) -> Option<(i64, u32)> {
        let mut parts = text.splitn(3, |byte| *byte == b':');
        let (hours, minutes) = (below(parts.next()?, 24)?, below(parts.next()?, 60)?);
        let seconds = parts.next()?;
        let in_seconds = Stamps { has_comma: true, ..Stamps::new(TimeUnit::S, b';') };
        let (ns, resolution) = in_seconds.counted(seconds.get(..12).unwrap_or(seconds))?;
        (ns <= MINUTE).then_some(((hours * 60 + minutes) * MINUTE + ns, resolution))
    }

    /// A time of day without a date: a new day begins where it falls back by more than half a day.
    fn after_midnight(&mut self, text: &[u8]) -> Option<(Moment, u32)> {
        let (ns, resolution) = self.time_of_day(text)?;
        if ns < self.last.saturating_sub(DAY / 2) {
            self.midnights += 1;
        }
        self.last = ns;
        Some(self.moment(ns.saturating_add(self.midnights.saturating_mul(DAY)), resolution))
    }
}

/// What is wrong with a time that is none.
pub fn wrong(date: &[u8], time: &[u8]) -> &'static str {
    let text = if date.is_empty() { time } else { date };
    let day = text.split(|byte| matches!(byte, b'T' | b' ')).next().unwrap_or_default();
    let parts: Vec<&[u8]> = day.split(|byte| b"-/.".contains(byte)).collect();
    let is_number = |part: &&[u8]| !part.is_empty() && part.iter().all(u8::is_ascii_digit);
    match parts.as_slice() {
        parts if parts.len() != 3 || !parts.iter().all(is_number) => {
            "the time is neither a number nor a date"
        }
        parts if parts.iter().all(|part| part.len() <= 2) => {
            "the year of the date has two digits, and which number is the year is open: write \
             2024-05-03, or 03.05.2024"
        }
        [first, ..] if first.len() <= 2 && day.contains(&b'/') => {
            "which number of the date is the month is open: write 2024-05-03, or 03.05.2024"
        }
        _ => "the date is none, or its time of day is missing or none",
    }
}

fn below(text: &[u8], limit: i64) -> Option<i64> {
    let number: i64 = std::str::from_utf8(text).ok()?.parse().ok()?;
    (0..limit).contains(&number).then_some(number)
}

fn midnight(text: &[u8]) -> Option<i64> {
    let parts: Vec<&[u8]> = text.split(|byte| b"-/.".contains(byte)).collect();
    let &[first, month, third] = parts.as_slice() else { return None };
    let (year, day) = if first.len() == 4 { (first, third) } else { (third, first) };
    // 05/03/2024 is May or March, as the reader wishes.
    if year.len() != 4 || first.len() != 4 && text.contains(&b'/') {
        return None;
    }
    let number = |text| below(text, 10_000);
    let (year, month, day) = (number(year)?, number(month)?, number(day)?);
    let date =
        civil::Date::new(year.try_into().ok()?, month.try_into().ok()?, day.try_into().ok()?);
    let midnight = date.ok()?.to_zoned(TimeZone::UTC).ok()?.timestamp().as_nanosecond();
    i64::try_from(midnight).ok()
}

/// Divides the zone off a time of day: `Z`, `+02:00`. Returns how far ahead of UTC it is, in ns.
fn offset(text: &[u8]) -> Option<(&[u8], i64)> {
    if let Some(time) = text.strip_suffix(b"Z") {
        return Some((time, 0));
    }
    let Some(at) = text.iter().position(|byte| matches!(byte, b'+' | b'-')) else {
        return Some((text, 0));
    };
    let (hours, minutes) = match &text[at + 1..] {
        [h, i, b':', m, n] | [h, i, m, n] => ([*h, *i], [*m, *n]),
        _ => return None,
    };
    let ahead = (below(&hours, 24)? * 60 + below(&minutes, 60)?) * MINUTE;
    Some((&text[..at], if text[at] == b'-' { -ahead } else { ahead }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(unit: TimeUnit, delimiter: u8, text: &str) -> Option<(i64, u32)> {
        let (time, resolution) = Stamps::new(unit, delimiter).read(b"", text.as_bytes())?;
        Some((time.ns()?, resolution))
    }

    #[test]
    fn seconds_and_counters() {
        assert_eq!(read(TimeUnit::S, b',', "12.345"), Some((12_345_000_000, 1_000_000)));
        assert_eq!(read(TimeUnit::S, b';', "12,345"), Some((12_345_000_000, 1_000_000)));
        assert_eq!(read(TimeUnit::S, b',', "12,345"), None);
        assert_eq!(read(TimeUnit::S, b',', "-0.5"), Some((-500_000_000, 100_000_000)));
        assert_eq!(read(TimeUnit::S, b',', "0.1234567890123"), Some((123_456_789, 1)));
        assert_eq!(read(TimeUnit::Ms, b',', "1500"), Some((1_500_000_000, 1_000_000)));
        assert_eq!(read(TimeUnit::Us, b',', "1500.25"), Some((1_500_250, 10)));
        assert_eq!(read(TimeUnit::Ns, b',', "7"), Some((7, 1)));
        assert_eq!(read(TimeUnit::S, b',', "99999999999999999"), None);
    }

    /// 2024-05-03 10:41:07 UTC is 1714732867 s after the epoch (`date -u -d … +%s`).
    #[test]
    fn dates_with_their_time_of_day() {
        let there = Some((1_714_732_867_250_000_000, 10_000_000));
        for text in [
            "2024-05-03T10:41:07.25",
            "2024-05-03 10:41:07.25Z",
            "2024/05/03 10:41:07,25",
            "2024-05-03T12:41:07.25+02:00",
            "2024-05-03T09:41:07.25-0100",
            "03.05.2024 10:41:07,25",
        ] {
            assert_eq!(read(TimeUnit::S, b';', text), there, "{text}");
        }
        let mut stamps = Stamps::new(TimeUnit::S, b';');
        let read_two = stamps.read(b"03.05.2024", b"10:41:07,25").unwrap();
        assert_eq!(read_two.0.ns(), Some(1_714_732_867_250_000_000));
        for wrong in ["2024-13-03 10:41:07", "05/03/2024 10:41:07", "2024-05-03", "25:00:00", "x"] {
            assert_eq!(read(TimeUnit::S, b';', wrong), None, "{wrong}");
        }
    }

    #[test]
    fn dates_that_are_open_are_named() {
        for (text, what) in [
            ("24-05-03 10:41:07", "two digits"),
            ("03.05.24 10:41:07", "two digits"),
            ("05/03/2024 10:41:07", "which number of the date is the month"),
            ("2024-13-03 10:41:07", "the date is none"),
            ("2024-05-03", "time of day is missing"),
            ("now", "neither a number nor a date"),
        ] {
            assert!(read(TimeUnit::S, b';', text).is_none(), "{text}");
            assert!(wrong(b"", text.as_bytes()).contains(what), "{text}");
        }
        assert!(wrong(b"24-05-03", b"10:41:07").contains("two digits"));
    }

    #[test]
    fn a_day_ends_at_midnight() {
        let mut stamps = Stamps::new(TimeUnit::S, b',');
        let mut at = |text: &str| stamps.read(b"", text.as_bytes()).unwrap().0.ns().unwrap();
        assert_eq!(at("23:59:59.5"), DAY - 500_000_000);
        assert_eq!(at("00:00:00.5"), DAY + 500_000_000);
        // Times that run backwards a little are the same day.
        assert_eq!(at("00:00:00.4"), DAY + 400_000_000);
    }

    /// Spreadsheets leave zeros at the end out.
    #[test]
    fn the_resolution_is_the_finest_seen() {
        let mut stamps = Stamps::new(TimeUnit::S, b',');
        let mut resolution = |text: &str| stamps.read(b"", text.as_bytes()).unwrap().1;
        assert_eq!(resolution("0.010"), 1_000_000);
        assert_eq!(resolution("1"), 1_000_000);
    }
}
