//! CAN frames: logs of text, one file a format, and the packets of captures.

pub mod asc;
pub mod candump;
pub mod console;
mod date;
pub mod hex;
mod log;
pub mod packet;
pub mod report;
pub mod trc;

pub use log::{Grammar, Log};
