//! DeviceNet: CIP over CAN.
//!
//! ```text
//! 400h+8s+4   h h s b b b b b    a master asks slave s: header, service, body
//! 400h+8s+3   h h s d d d d d    slave s answers
//! 400h+8s+5   d d d d d d d d    a master polls slave s
//! 3C0h+s      d d d d d d d d    slave s answers
//! ```
//!
//! [`identifier`] and [`message`] read a frame.

pub mod allocation;
pub mod defect;
pub mod identifier;
pub mod message;
