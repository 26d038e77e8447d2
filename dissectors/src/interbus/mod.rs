//! INTERBUS-S: what a controller logs of a ring, and what the ring carries.
//!
//! ```text
//! OUT 42001388   the service and its data are laid out
//! OUT C2001388   service bit: write the measuring length in steps, 5000
//! IN  C2001388   the encoder has done it
//! OUT 42001388   service bit withdrawn
//! IN  00000100   position again
//! ```
//!
//! [`row`] is what a source hands in.

mod codes;
pub mod diagnostic;
mod dissector;
pub mod identification;
mod layer;
pub mod message;
mod profile;
mod report;
pub mod row;
mod settings;

pub use dissector::Interbus;
pub use layer::FIELDS;
pub use profile::Profile;
pub use report::{Master, Report};
pub use row::{Content, Device, Row};
pub use settings::{LIMITS, Settings};

use crate::protocol::{Medium, Protocol, Speaks};
use alloc::{boxed::Box, string::String};

/// INTERBUS in the list of protocols.
pub static PROTOCOL: Protocol = Protocol {
    name: "interbus",
    title: "INTERBUS-S",
    kinds: &layer::KINDS,
    fields: FIELDS,
    codes: &codes::CODES,
    limits: &LIMITS,
    medium: Medium::Words,
    speaks: |_| Speaks::Yes(String::from("the source has words of a ring")),
    dissector: |wire, settings| Box::new(Interbus::new(wire, settings)),
};
