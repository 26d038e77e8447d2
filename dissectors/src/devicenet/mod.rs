//! DeviceNet: CIP over CAN.

pub mod cip;
