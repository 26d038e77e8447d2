//! What INTERBUS traffic is read and judged by.

use super::line::Profile;
use crate::limit::Limit;

/// What the user decided; the defaults are those of the manuals, or usual ones where they have none.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Settings {
    /// A service is to be acknowledged within this, in ns. The LA-66 manual has no limit.
    pub no_acknowledge_ns: i64,
    /// An acknowledgement is to be withdrawn within this, in ns, once the request was.
    pub no_release_ns: i64,
    /// The log has a row for every bus cycle: a state that it does not show was skipped.
    pub every_cycle: bool,
    /// What is known of the format of the line.
    pub line: Profile,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            no_acknowledge_ns: 1_000_000_000,
            no_release_ns: 1_000_000_000,
            every_cycle: false,
            line: Profile::default(),
        }
    }
}

/// Those that the user can set.
pub static LIMITS: [Limit; 2] = [
    Limit::milliseconds("no-acknowledge", "a service is to be acknowledged", |it| {
        &mut it.interbus.no_acknowledge_ns
    }),
    Limit::milliseconds("no-release", "an acknowledgement is to be withdrawn", |it| {
        &mut it.interbus.no_release_ns
    }),
];
