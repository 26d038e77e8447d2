//! How long files get, and how many are kept.

use crate::source::frequency;
use std::str::FromStr;

/// Smallest size of a file: less could not hold what describes a bus.
const SMALLEST: u64 = 4_000;

/// Shortest duration of a file, in ns: a folder is not for thousands of files a minute.
const SHORTEST: i64 = 1_000_000_000;

/// When one file ends and the next begins, and how many stay.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct Ring {
    /// Files that are kept: the oldest is deleted. All where it is not given.
    pub files: Option<u32>,
    /// A file ends before it gets longer than this, in bytes.
    pub size: Option<u64>,
    /// A file ends when it covers this, in ns.
    pub duration: Option<i64>,
}

impl Ring {
    /// Whether files end by themselves.
    pub fn ends_files(&self) -> bool {
        self.size.is_some() || self.duration.is_some()
    }
}

impl FromStr for Ring {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        const FORM: &str = "a ring is given as files=10,size=100MB or files=24,duration=1h";
        const SIZE: &str = "size is bytes such as 64k, 100MB, 2GB or 1TB: 4 kB or more";
        let mut ring = Ring::default();
        for part in text.split(',') {
            let (key, value) = part.split_once('=').ok_or(FORM)?;
            let is_new = match key {
                "files" => {
                    let count = value.parse().ok().filter(|count| *count > 0);
                    ring.files
                        .replace(count.ok_or("files is how many are kept: 1 or more")?)
                        .is_none()
                }
                "size" => {
                    let size = bytes(value).filter(|size| *size >= SMALLEST);
                    let size = size.ok_or(SIZE)?;
                    ring.size.replace(size).is_none()
                }
                "duration" => {
                    let duration = Some(span(value)?).filter(|ns| *ns >= SHORTEST);
                    ring.duration.replace(duration.ok_or("duration is 1s or more")?).is_none()
                }
                _ => return Err(format!("{FORM}; {key} is none of these")),
            };
            if !is_new {
                return Err(format!("{key} is given twice"));
            }
        }
        Ok(ring)
    }
}

/// A number of bytes such as `100MB`, `64k` or `4096`: k is 1000.
fn bytes(text: &str) -> Option<u64> {
    let text = text.strip_suffix(['B', 'b']).unwrap_or(text);
    if let Some(number) = text.strip_suffix(['T', 't']) {
        return number.parse::<u64>().ok()?.checked_mul(1_000_000_000_000);
    }
    // The other letters mean the same as with frequencies.
    frequency(text)
}

/// A span of time such as `30s`, `500ms`, `10min` or `1h`, in ns. A bare number is seconds.
///
/// # Errors
/// It is none: what is one.
pub fn span(text: &str) -> Result<i64, String> {
    let wrong = || format!("{text} is no time such as 30s, 500ms, 10min, 1h or 2d");
    let digits = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
    let (number, unit) = text.split_at(digits);
    let unit: i64 = match unit {
        "ms" => 1_000_000,
        "s" | "" => 1_000_000_000,
        "min" | "m" => 60_000_000_000,
        "h" => 3_600_000_000_000,
        "d" => 86_400_000_000_000,
        _ => return Err(wrong()),
    };
    let number: i64 = number.parse().map_err(|_| wrong())?;
    number.checked_mul(unit).ok_or_else(wrong)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bare_number_is_seconds() {
        let spans = ["10", "10s", "1500ms", "2min", "1d"].map(span);
        let seconds = [10_000, 10_000, 1_500, 120_000, 86_400_000].map(|ms| Ok(ms * 1_000_000));
        assert_eq!(spans, seconds);
        assert!(span("10 s").is_err() && span("s").is_err() && span("-1s").is_err());
    }

    #[test]
    fn a_ring_has_files_of_a_size_or_a_duration() {
        let ring = |text: &str| text.parse::<Ring>();
        let of_size = Ring { files: Some(10), size: Some(100_000_000), duration: None };
        assert_eq!(ring("files=10,size=100MB"), Ok(of_size));
        let of_an_hour = Ring { files: None, size: None, duration: Some(3_600_000_000_000) };
        assert_eq!(ring("duration=1h"), Ok(of_an_hour));
        let of_a_disk = Ring { size: Some(1_000_000_000_000), ..Ring::default() };
        assert_eq!((ring("size=1TB"), ring("size=1t")), (Ok(of_a_disk), Ok(of_a_disk)));
        assert_eq!(ring("size=2GB").map(|ring| ring.size), Ok(Some(2_000_000_000)));
        for wrong in [
            "",
            "size=T",
            "size=99999999999TB",
            "duration=999ms",
            "files=x",
            "size=1",
            "size=x",
            "files=0,size=1M",
            "size=1M,size=1M",
            "a=1",
            "duration=0s",
            "duration=1ms",
        ] {
            assert!(ring(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn spans_have_units() {
        for (text, ns) in [("30s", 30_000_000_000), ("500ms", 500_000_000), ("2", 2_000_000_000)] {
            assert_eq!(span(text), Ok(ns));
        }
        assert_eq!((span("10min"), span("2d")), (Ok(600_000_000_000), Ok(172_800_000_000_000)));
        for wrong in ["", "s", "-1s", "1y", "9999999999999999d"] {
            assert!(span(wrong).is_err(), "{wrong}");
        }
    }
}
