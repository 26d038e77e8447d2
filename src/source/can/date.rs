//! Dates of logs, which have no zone: they are taken as UTC.

use super::super::numbers::seconds;
use super::hex::{decimal, words};
use dissectors::event::Moment;
use jiff::civil;
use jiff::tz::TimeZone;

/// Beginnings of months' names, in English, German and French.
const MONTHS: [&[&[u8]]; 12] = [
    &[b"jan"],
    &[b"feb", b"f\xE9v", b"f\xC3\xA9v"],
    &[b"mar", b"m\xE4r", b"m\xC3\xA4r", b"mrz"],
    &[b"apr", b"avr"],
    &[b"may", b"mai"],
    &[b"jun", b"juin"],
    &[b"jul", b"juil"],
    &[b"aug", b"ao\xFB", b"ao\xC3\xBB"],
    &[b"sep"],
    &[b"oct", b"okt"],
    &[b"nov"],
    &[b"dec", b"dez", b"d\xE9c", b"d\xC3\xA9c"],
];

/// `2025-06-15 17:06:40.000124`: the time, and what its last digit is worth in ns.
pub fn date_and_time(text: &[u8]) -> Option<(Moment, u32)> {
    let mut words = words(text);
    let mut date = words.next()?.split(|byte| *byte == b'-').map(decimal);
    let (year, month, day) = (date.next()??, date.next()??, date.next()??);
    moment(year, month, day, time_of_day(words.next()?)?)
}

/// `Sam Sep 30 03:06:13.191 pm 2017`, with the weekday and the month in the writer's language.
pub fn written_out(text: &[u8]) -> Option<Moment> {
    let (mut month, mut day, mut year, mut time, mut is_afternoon) = (None, None, None, None, None);
    for word in words(text) {
        match decimal(word) {
            Some(number @ 1..=31) if day.is_none() => day = Some(number),
            Some(number @ 1970..) => year = Some(number),
            Some(_) => return None,
            None if word.contains(&b':') => time = time_of_day(word),
            None if word.eq_ignore_ascii_case(b"am") => is_afternoon = Some(false),
            None if word.eq_ignore_ascii_case(b"pm") => is_afternoon = Some(true),
            // The first one that can be a month's; `Mar` for Tuesday comes before the month.
            None => month = month_named(word).or(month),
        }
    }
    let (mut ns, resolution) = time?;
    const HALF_DAY: i64 = 12 * 3_600 * 1_000_000_000;
    match is_afternoon {
        Some(true) if ns < HALF_DAY => ns += HALF_DAY,
        Some(false) if ns >= HALF_DAY => ns -= HALF_DAY,
        _ => {}
    }
    moment(year?, month?, day?, (ns, resolution)).map(|(time, _)| time)
}

fn month_named(word: &[u8]) -> Option<u32> {
    let lower = word.to_ascii_lowercase();
    let is_it = |names: &&[&[u8]]| names.iter().any(|name| lower.starts_with(name));
    (1..).zip(&MONTHS).find(|(_, names)| is_it(names)).map(|(number, _)| number)
}

/// Hours, minutes and seconds with a fraction: ns since midnight, and what the last digit is worth.
fn time_of_day(text: &[u8]) -> Option<(i64, u32)> {
    let mut parts = text.splitn(3, |byte| *byte == b':');
    let (hours, minutes) = (decimal(parts.next()?)?, decimal(parts.next()?)?);
    let ([], stamp) = seconds(parts.next()?).ok()? else { return None };
    let minutes = i64::from(hours.min(23)) * 60 + i64::from(minutes.min(59));
    Some((minutes * 60_000_000_000 + stamp.time.ns()?, stamp.resolution))
}

fn moment(year: u32, month: u32, day: u32, (ns, unit): (i64, u32)) -> Option<(Moment, u32)> {
    let date =
        civil::Date::new(year.try_into().ok()?, month.try_into().ok()?, day.try_into().ok()?);
    let midnight = date.ok()?.to_zoned(TimeZone::UTC).ok()?.timestamp().as_nanosecond();
    let midnight = i64::try_from(midnight).ok()?;
    Some((Moment::from_ns(midnight.saturating_add(ns)), unit))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2017-09-30 15:06:13 UTC is 1506783973 s after the epoch (`date -d`).
    #[test]
    fn dates_are_read_in_the_writers_language() {
        for text in [
            &b"Sam Sep 30 15:06:13.191 2017"[..],
            b"Sat Sep 30 03:06:13.191 pm 2017",
            b"Sa Sept 30 15:06:13.191 2017",
        ] {
            let ns = written_out(text).unwrap().ns();
            assert_eq!(ns, Some(1_506_783_973_191_000_000));
        }
        // French Tuesdays begin like March: mar. = mardi.
        assert_eq!(
            written_out(b"Mar Okt 3 12:00:00 am 2017"),
            written_out(b"X Oct 3 00:00:00 2017")
        );
        for month in [&b"M\xE4r"[..], "Mär".as_bytes(), b"Mrz", b"March"] {
            let text = [b"Don ", month, b" 1 00:00:00 2018"].concat();
            assert_eq!(written_out(&text).unwrap().ns(), Some(1_519_862_400_000_000_000));
        }
        for text in [&b"now"[..], b"Sat Sep 30 2017", b"Sat Foo 30 15:06:13 2017", b""] {
            assert_eq!(written_out(text), None);
        }
    }

    #[test]
    fn dates_in_numbers() {
        let read = date_and_time(b"2017-09-30 15:06:13.000124").unwrap();
        assert_eq!(read, (Moment::from_ns(1_506_783_973_000_124_000), 1_000));
        assert_eq!(date_and_time(b"2017-13-30 15:06:13"), None);
    }
}
