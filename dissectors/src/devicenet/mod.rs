//! DeviceNet: CIP over CAN.

pub mod cip;
pub mod encoder;
