//! The comment in which an interface of a packet capture tells what its stamps and marks are
//! worth: `fieldtap-tap: clock=read pm_ns=16000000 parity=packet format=8E1`.

use dissectors::event::{Clock, LossCause};
use dissectors::uart::{Format, ParityMarks};

const BEGINNING: &str = "fieldtap-tap:";

/// How comments on a loss begin that tell more of it than the format has room for.
pub const LOSS: &str = "fieldtap-loss: ";

/// The comment on a loss because nobody listened.
const DEAF: &str = "fieldtap-loss: nobody listened";

/// The comment on a time of which a recording kept nothing.
const NOT_KEPT: &str = "fieldtap-loss: not kept";

/// How the comment on a time begins in which the rate was looked for: how long follows, in ns.
const SOUGHT: &str = "fieldtap-loss: rate looked for, ns ";

/// The comment on a loss, where the format has no room for its cause.
pub fn of_loss(cause: LossCause) -> Option<String> {
    match cause {
        LossCause::Capture | LossCause::Overrun => None,
        LossCause::Deaf => Some(DEAF.to_owned()),
        LossCause::NotKept => Some(NOT_KEPT.to_owned()),
        LossCause::Sought(ns) => Some(format!("{SOUGHT}{ns}")),
    }
}

/// The cause that a comment tells; `None` for any other comment.
pub fn cause_of(comment: &[u8]) -> Option<LossCause> {
    match std::str::from_utf8(comment).ok()? {
        DEAF => Some(LossCause::Deaf),
        NOT_KEPT => Some(LossCause::NotKept),
        text => text.strip_prefix(SOUGHT)?.parse().ok().map(LossCause::Sought),
    }
}

/// What an interface tells about itself. By default, what holds for captures by other programs.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct TapNote {
    /// Who stamped.
    pub clock: Clock,
    /// ± of a stamp in ns; 0 where it is the stamp's resolution.
    pub uncertainty: u32,
    /// What a parity mark covers.
    pub parity: ParityMarks,
    /// The character format, if it is told.
    pub format: Option<Format>,
    /// Every character has a stamp of its own, whether the rate is told or not.
    pub has_all_stamps: bool,
}

impl Default for TapNote {
    fn default() -> Self {
        TapNote {
            clock: Clock::Log,
            uncertainty: 0,
            parity: ParityMarks::Character,
            format: None,
            has_all_stamps: false,
        }
    }
}

impl TapNote {
    /// Reads such a comment; `None` for any other. What is not understood counts as not told.
    pub fn parse(comment: &str) -> Option<TapNote> {
        let words = comment.strip_prefix(BEGINNING)?.split_ascii_whitespace();
        let mut note = TapNote::default();
        for (key, value) in words.filter_map(|word| word.split_once('=')) {
            match key {
                "clock" => note.clock = Clock::from_name(value).unwrap_or(Clock::Log),
                "pm_ns" => {
                    let ns = value.parse().unwrap_or(0_u64);
                    note.uncertainty = u32::try_from(ns).unwrap_or(u32::MAX);
                }
                "parity" => {
                    note.parity = match value {
                        "packet" => ParityMarks::Packet,
                        "none" => ParityMarks::None,
                        _ => ParityMarks::Character,
                    }
                }
                "stamps" => note.has_all_stamps = value == "all",
                "format" => note.format = value.parse().ok(),
                _ => {}
            }
        }
        Some(note)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_comment_of_the_contract_is_read() {
        let comment = "fieldtap-tap: clock=read pm_ns=16000000 parity=packet format=8E1";
        assert_eq!(
            TapNote::parse(comment),
            Some(TapNote {
                clock: Clock::Read,
                uncertainty: 16_000_000,
                parity: ParityMarks::Packet,
                format: Some(Format::FT12),
                has_all_stamps: false,
            })
        );
    }

    #[test]
    fn why_something_is_missing_is_read_as_it_was_written() {
        for cause in [LossCause::Deaf, LossCause::NotKept, LossCause::Sought(3_200_000_000)] {
            let comment = of_loss(cause).unwrap();
            assert!(comment.starts_with(LOSS));
            assert_eq!(cause_of(comment.as_bytes()), Some(cause));
        }
        assert_eq!(cause_of(b"fieldtap-loss: rate looked for, ns long"), None);
        assert_eq!(cause_of(b"nobody listened"), None);
    }

    #[test]
    fn what_is_missing_or_strange_counts_as_not_told() {
        let parse = |text| TapNote::parse(text);
        assert_eq!(parse("fieldtap-tap:"), Some(TapNote::default()));
        assert_eq!(
            parse("fieldtap-tap: clock=sun pm_ns=-1 format=8X1 x=y z"),
            parse("fieldtap-tap:")
        );
        assert_eq!(parse("fieldtap-tap: pm_ns=99999999999").unwrap().uncertainty, u32::MAX);
        assert_eq!(parse("fieldtap-tap: parity=none").unwrap().parity, ParityMarks::None);
        assert!(parse("fieldtap-tap: clock=log stamps=all").unwrap().has_all_stamps);
        assert_eq!(parse("a comment of somebody else"), None);
        assert_eq!(parse("fieldtap: 3 answers 154"), None);
    }
}
