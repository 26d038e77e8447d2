//! DeviceNet: CIP over CAN.
//!
//! ```text
//! 400h+8s+4   h h s b b b b b    a master asks slave s: header, service, body
//! 400h+8s+3   h h s d d d d d    slave s answers
//! 400h+8s+5   d d d d d d d d    a master polls slave s
//! 3C0h+s      d d d d d d d d    slave s answers
//! ```
//!
//! [`identifier`] and [`message`] read a frame, `fragment` puts messages together, `transactions`
//! finds the request of an answer, `connection` and `node` are what is known of a slave. The
//! `ledger` holds it all; `explicit`, `request`, `response`, `learn`, `io`, `flow` and `management`
//! say what each frame does to it, and `alarms` what did not come. Records are told by `layer` and
//! `summary`.
//!
//! [`cip`] knows what services, classes and attributes are called and how their values are typed,
//! [`encoder`] the encoder profiles, [`eds`] reads the makers' files.

mod alarms;
pub mod allocation;
pub mod cip;
pub mod codes;
mod connection;
pub mod defect;
mod dissector;
mod dynamic;
pub mod eds;
pub mod encoder;
mod encoders;
mod explicit;
mod flood;
mod flow;
mod fragment;
pub mod identifier;
mod inventory;
mod io;
mod layer;
mod learn;
mod ledger;
mod management;
mod members;
pub mod message;
mod names;
mod node;
mod pace;
mod request;
mod response;
mod settings;
mod signature;
mod summary;
mod timing;
mod transactions;

pub use dissector::DeviceNet;
pub use layer::FIELDS;
pub use settings::{LIMITS, Settings};

use crate::field::Roles;
use crate::protocol::{Medium, Protocol};
use alloc::boxed::Box;

/// DeviceNet in the list of protocols.
pub static PROTOCOL: Protocol = Protocol {
    name: "devicenet",
    title: "DeviceNet on CAN",
    kinds: &layer::KINDS,
    fields: &FIELDS,
    roles: Roles::of(&FIELDS),
    codes: &codes::CODES,
    limits: &LIMITS,
    medium: Medium::Can,
    wires: &[],
    speaks: signature::speaks,
    dissector: |wire, settings| Box::new(DeviceNet::new(wire, settings)),
};
