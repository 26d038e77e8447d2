//! CAN frames: what was on the wire, how long it took, and what was wrong with it.

mod codes;
mod dissector;
mod errors;
mod frame;
mod length;
pub(crate) mod line;
mod load;
mod rate;
mod watch;

pub use codes::{
    BUS_OFF, CODES, CRC, DROPPED, ERROR_FRAME, FORM, HIGH_LOAD, NOT_ACKNOWLEDGED, OVERLOAD, STUFF,
    TRUNCATED, WRONG_BITRATE,
};
pub use dissector::{FIELDS, FrameFields, PROTOCOL};
pub(crate) use dissector::{duration, lose, summarize};
pub use errors::{ErrorClasses, ErrorDetail, Violation};
pub use frame::{Direction, FdFlags, Frame, FrameKind, Identifier, MAX_CLASSIC_DATA};
pub use length::checksum;
pub(crate) use line::Line;
pub use load::Load;
pub(crate) use rate::{RateSearch, bitrate_from_spacing};
pub use watch::Watch;

use crate::uart::Baud;

/// What the user decided about CAN lines; the rest is found out.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct Settings {
    /// The bit rate.
    pub bitrate: Option<Baud>,
}
