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
//! [`row`] is what a source hands in. Process data are [`word`]s; `device` follows the `handshake`
//! of each device through its rows and lets `judge`, `writes` and `axis` look at what it sees; what
//! the words mean is in [`service`]. `layer` and `summary` tell it as records. [`line`] is what is made
//! of the levels of a ring's wires.

mod axis;
mod codes;
mod cycle_fields;
mod device;
pub mod diagnostic;
mod dissector;
mod handshake;
pub mod identification;
mod judge;
mod layer;
pub mod line;
pub mod message;
mod pace;
mod profile;
mod report;
pub mod row;
pub mod service;
mod settings;
mod summary;
pub mod word;
mod writes;

pub use dissector::Interbus;
pub use layer::FIELDS;
pub use line::Cycle;
pub use profile::Profile;
pub use report::{Master, Report};
pub use row::{Content, Device, Row};
pub use service::can_be;
pub use settings::{LIMITS, ReadEcho, Settings};

use crate::field::Roles;
use crate::protocol::{Medium, Protocol, Speaks};
use alloc::{boxed::Box, string::String};

/// INTERBUS in the list of protocols.
pub static PROTOCOL: Protocol = Protocol {
    name: "interbus",
    title: "INTERBUS-S",
    kinds: &layer::KINDS,
    fields: FIELDS,
    roles: Roles::of(FIELDS),
    codes: &codes::CODES,
    limits: &LIMITS,
    medium: Medium::Words,
    wires: &["DO", "DI"],
    speaks: |_| Speaks::Yes(String::from("the source has words of a ring")),
    dissector: |wire, settings| Box::new(Interbus::new(wire, settings)),
};
