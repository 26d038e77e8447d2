//! What holds for DeviceNet: the worked frames of the makers' manuals, exchanges and faults as a
//! technician meets them, and what holds whatever is on the bus.

#![allow(clippy::unwrap_used)]

mod bus;
mod eds;
mod encoders;
mod examples;
mod explicit;
mod gaps;
mod healthy;
mod io;
mod management;
mod productions;
mod properties;
