//! What INTERBUS traffic is read and judged by.

use super::line::Profile;
use super::report::Master;
use crate::limit::Limit;

/// What IN holds when a read service is acknowledged. The LA-66 manual says both.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub enum ReadEcho {
    /// The value that was asked for (§2.3, and the same text in the manual of the 582 encoders).
    #[default]
    Value,
    /// The OUT data once more (§4, step 3).
    Echo,
}

impl ReadEcho {
    /// Both, with their names on the command line.
    pub const NAMES: [(&'static str, ReadEcho); 2] =
        [("value", ReadEcho::Value), ("echo", ReadEcho::Echo)];
}

/// What the user decided; the defaults are those of the manuals, or usual ones where they have none.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Settings {
    /// A service is to be acknowledged within this, in ns. The LA-66 manual has no limit.
    pub no_acknowledge_ns: i64,
    /// An acknowledgement is to be withdrawn within this, in ns, once the request was.
    pub no_release_ns: i64,
    /// The log has a row for every bus cycle: a state that it does not show was skipped.
    pub every_cycle: bool,
    /// What IN holds when a read service is acknowledged.
    pub read_echo: ReadEcho,
    /// How the registers and messages of a master are read.
    pub master: Master,
    /// What is known of the format of the line.
    pub line: Profile,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            no_acknowledge_ns: 1_000_000_000,
            no_release_ns: 1_000_000_000,
            every_cycle: false,
            read_echo: ReadEcho::Value,
            master: Master::default(),
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
