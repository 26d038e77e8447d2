//! Encoder field buses as pure code.
//!
//! What a tap heard goes in as [`event::Event`]s, one [`bus::Bus`] a bus; what it means comes out
//! as [`record::Record`]s with [`finding::Finding`]s. There is no I/O here, no clock, no thread
//! and no printing: the same code serves a saved capture, a live tap and a firmware.
//!
//! Malformed traffic is a record with findings, never a panic and never an `Err`.

#![no_std]
#![forbid(unsafe_code)]

extern crate alloc;

pub mod bus;
pub mod can;
mod decoder;
pub mod device;
pub mod devicenet;
mod edges;
pub mod event;
pub mod field;
pub mod finding;
pub mod interbus;
pub mod limit;
mod line;
pub mod measure;
mod motion;
pub mod protocol;
pub mod record;
pub mod setting;
pub mod slin;
pub mod station;
pub mod uart;
