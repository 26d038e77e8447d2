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

use super::outbox::Outbox;
use dissectors::bus::WireFacts;
use dissectors::event::Clock;
use dissectors::protocol::Medium;
use dissectors::record::BusInfo;

pub use layout::{Layout, LengthCodes, Mapping, Order, Radix, RingMap, TimeUnit};

/// The name of the bus: logs have none.
const BUS: &str = "ring";

/// The ring appears.
fn announce(has_times: bool, out: &mut Outbox) {
    let facts = WireFacts { medium: Some(Medium::Words), ..WireFacts::default() };
    out.bus(BusInfo::new(BUS, has_times.then_some(Clock::Log)), facts);
}
