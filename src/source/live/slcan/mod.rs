//! `slcan:`: a CAN adapter that speaks the Lawicel ASCII protocol on a serial port.
//!
//! The adapter is sent `C` (close), `V` and `N` (who are you), `S` (bit rate), `Z` (time stamps) and
//! `L` (listen only), and nothing else: never `O`, which would have it acknowledge what it hears,
//! and never a frame. One that does not know `L` is refused.

mod adapter;
mod clock;
mod ear;
mod exchange;
mod line;
mod repeats;
mod search;
mod split;
mod tap;

use super::super::{SourceError, SourceOptions};
use super::Tap;
pub use line::fuzz;

/// Opens it.
///
/// # Errors
/// It cannot be listened to: why, and what to do.
pub fn open(name: &str, options: &SourceOptions) -> Result<Box<dyn Tap>, SourceError> {
    Ok(Box::new(tap::SlcanTap::open(name, options)?))
}
