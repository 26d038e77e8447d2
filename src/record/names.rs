//! The names of recorded files: when they begin, and their number in the recording.
//!
//! `fieldtap-20261122T081500Z-0001.pcapng`, in UTC, so that names sort as time goes. While a file is
//! being written its name ends with `.part`, and no program takes it for a whole one.

use crate::clock::is_date;
use dissectors::event::Moment;
use jiff::Timestamp;
use jiff::tz::TimeZone;
use std::path::{Path, PathBuf};

/// How a file is named while it is written, and once it is whole.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Names {
    /// While it is being written.
    pub part: PathBuf,
    /// Once it is whole.
    pub whole: PathBuf,
}

impl Names {
    /// Those of the file of this number, which begins at this time: now, where the source has no
    /// dates.
    pub fn new(directory: &Path, begin: Moment, number: u32) -> Names {
        let dated = begin.ns().filter(|ns| is_date(*ns));
        let time = dated.and_then(|ns| Timestamp::from_nanosecond(i128::from(ns)).ok());
        let time = time.unwrap_or_else(Timestamp::now).to_zoned(TimeZone::UTC);
        let name = format!("fieldtap-{}-{number:04}.pcapng", time.strftime("%Y%m%dT%H%M%SZ"));
        Names { part: directory.join(format!("{name}.part")), whole: directory.join(name) }
    }

    /// Whether no file bears either.
    pub fn are_free(&self) -> bool {
        !self.part.exists() && !self.whole.exists()
    }
}

/// Whether a file of this name may be one of a recording.
pub fn is_name_of_recording(name: &str) -> bool {
    name.starts_with("fieldtap-") && name.ends_with(".pcapng")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_tell_when_a_file_begins() {
        // 1 795 335 300 s after 1970: 2026-11-22, 08:15:00 UTC (`date -u -d @1795335300`).
        let begin = Moment::from_ns(1_795_335_300_999_999_999);
        let names = Names::new(Path::new("d"), begin, 7);
        assert_eq!(names.whole, Path::new("d/fieldtap-20261122T081500Z-0007.pcapng"));
        assert!(is_name_of_recording("fieldtap-20261122T081500Z-0007.pcapng"));
        assert_eq!(names.part, Path::new("d/fieldtap-20261122T081500Z-0007.pcapng.part"));
    }

    #[test]
    fn seconds_since_a_start_are_no_date() {
        let names = Names::new(Path::new("d"), Moment::from_ns(5_000_000_000), 1);
        assert!(!names.whole.to_string_lossy().contains("1970"));
    }
}
