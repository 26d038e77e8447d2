//! Buses that exist only here: encoders that turn, masters that ask, and faults on order.
//!
//! ```text
//! plan -> bus (master, encoders, faults) -> line (levels over time) -> tap -> capture
//!                    \-> account -> truth
//! ```
//!
//! It is the other side of the analyzer and shares nothing with it: what is sent is encoded here
//! from the makers' manuals and the specifications, and what must be found is told by an account of
//! its own. Where the two sides disagree, one of them has misread the manuals.
//!
//! Each bus has a room of its own. Above them stands what every bus needs: chance, time, shafts
//! that turn, and captures of line levels.

mod chance;
pub mod devicenet;
pub mod interbus;
mod level;
mod motion;
mod order;
mod pcapng;
mod samples;
pub mod slin;
mod sr;
mod time;
mod vcd;

pub use motion::Motion;
pub use order::Orderable;
pub use samples::{Sampler, Samples};
pub use sr::Sr;
pub use time::{MS, Ps, seconds};
pub use vcd::Vcd;

/// Bytes as upper-case hex digits.
fn hex(bytes: impl Iterator<Item = u8>) -> String {
    bytes.map(|byte| format!("{byte:02X}")).collect()
}
