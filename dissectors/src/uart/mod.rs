//! Serial characters: what they are, how line levels become characters, and what a wrong set-up
//! looks like.

mod character;
mod codes;
mod dissector;
mod doubt;
mod find;
mod format;
mod line;
mod rate;
mod receiver;
mod sampler;
mod settle;
mod setup;

pub use character::{Character, Parity, ParityMarks};
pub use codes::{
    BREAK, CODES, FRAMING, LISTEN_AGAIN, LOST, OVERRUN, SETUP_CODES, SWAPPED_LINES, WRONG_PARITY,
    WRONG_RATE,
};
pub use dissector::PROTOCOL;
pub use format::{Baud, Format, FormatError, ParityRule, Wire};
pub use line::Line;
pub use setup::Setup;

pub(crate) use codes::name_characters;
pub(crate) use rate::baud_from_spacing;

/// What the user decided about a serial line; the rest is found out.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct LineSettings {
    /// The rate.
    pub baud: Option<Baud>,
    /// The character format.
    pub format: Option<Format>,
    /// Whether the line is upside down.
    pub inverted: Option<bool>,
}
