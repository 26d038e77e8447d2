//! DeviceNet: CIP over CAN.

pub mod cip;
pub mod eds;
pub mod encoder;
