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

/// What to do about a table that nothing tells to be one of these.
pub const TABLE: &str = ": if it holds words of an INTERBUS ring, say in which columns, such as \
                         --columns time=1,out=2,in=3";

/// The ring appears.
fn announce(has_times: bool, base: Option<stamps::Base>, is_radix_guessed: bool, out: &mut Outbox) {
    let facts = WireFacts { medium: Some(Medium::Words), ..WireFacts::default() };
    let mut bus = BusInfo::new(BUS, has_times.then_some(Clock::Log));
    bus.is_radix_guessed = is_radix_guessed;
    let is_guessed = base.is_none_or(|base| base == stamps::Base::Counter);
    out.bus(bus.with_guessed_unit(is_guessed), facts);
}
