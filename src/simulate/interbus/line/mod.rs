//! The line: frames of a ring as telegrams on the two wires of the master's connector.

mod bus;
mod crc;
mod frame;
mod profile;
mod telegram;
mod truth;

pub use bus::run;
pub use profile::{Profile, random_ring};
