//! Logs of an INTERBUS ring, as controllers, masters and commissioning tools write them.

mod columns;
pub mod diagnostic;
pub mod identification;
mod join;
mod layout;
pub mod log;
mod stamps;
mod table;
mod words;

pub use layout::{Layout, LengthCodes, Mapping, Order, Radix, RingMap, TimeUnit};

/// The name of the bus: logs have none.
const BUS: &str = "ring";
