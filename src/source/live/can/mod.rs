//! `can:`: a SocketCAN interface.
//!
//! Nothing is ever sent on it, and nothing is set: whoever runs it decides. An interface of a real
//! bus that would acknowledge what it hears is refused.

#[cfg(target_os = "linux")]
mod control;
#[cfg(target_os = "linux")]
mod drops;
#[cfg(target_os = "linux")]
mod ear;
#[cfg(target_os = "linux")]
mod interface;
#[cfg(target_os = "linux")]
mod receiver;
#[cfg(target_os = "linux")]
mod socket;
#[cfg(target_os = "linux")]
mod tap;

use super::super::{SourceError, SourceOptions};
use super::Tap;

/// Opens it.
///
/// # Errors
/// It cannot be listened to, or ought not to be: why, and the commands that set it right.
#[cfg(target_os = "linux")]
pub fn open(name: &str, options: &SourceOptions) -> Result<Box<dyn Tap>, SourceError> {
    Ok(Box::new(tap::CanTap::open(name, options)?))
}

/// Opens it.
///
/// # Errors
/// There is none on this system.
#[cfg(not(target_os = "linux"))]
pub fn open(name: &str, _: &SourceOptions) -> Result<Box<dyn Tap>, SourceError> {
    use super::super::Place;
    let what = "SocketCAN is a part of Linux: take an adapter that speaks slcan (slcan:PORT), or \
                a log of the adapter's own program";
    Err(SourceError::new(&format!("can:{name}"), Place::Whole, what))
}
