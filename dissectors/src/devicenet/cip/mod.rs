//! The objects of CIP: what classes, services, attributes and status codes are called, and how the
//! bytes of a value read.
//!
//! The tables hold what DeviceNet devices use. An unknown number is no error: it has no name.

mod attribute;
mod data;
mod identity;
mod names;
mod objects;
mod path;
mod position_sensor;
mod services;
mod status;
mod value;

pub(crate) use attribute::attributes;
pub use attribute::{Access, Attribute, Bit, InWords, Words, find};
pub use data::{DataType, WrongLength};
pub use identity::DeviceIdentity;
pub use names::{Range, class_name, class_range, device_type_name, vendor_name};
pub use objects::{
    ACKNOWLEDGE_HANDLER, ASSEMBLY, CLASS, CONNECTION, DEVICENET, IDENTITY, MESSAGE_ROUTER,
    PARAMETER, attribute,
};
pub use path::{Path, Segment, Target};
pub use position_sensor::POSITION_SENSOR;
pub use services::{service_name, service_range, unconnected_service_name};
pub use status::{Refusal, status_name};
pub use value::{Allocation, List, Revision, Text, Value};

/// Numbers of classes.
pub mod class {
    /// Who a device is.
    pub const IDENTITY: u16 = 0x01;
    /// Which objects it has.
    pub const MESSAGE_ROUTER: u16 = 0x02;
    /// Its place on the network.
    pub const DEVICENET: u16 = 0x03;
    /// Data of several objects in one block.
    pub const ASSEMBLY: u16 = 0x04;
    /// Its connections.
    pub const CONNECTION: u16 = 0x05;
    /// Its parameters, one an instance.
    pub const PARAMETER: u16 = 0x0F;
    /// The position sensor of the CIP encoder profile.
    pub const POSITION_SENSOR: u16 = 0x23;
    /// Acknowledged production.
    pub const ACKNOWLEDGE_HANDLER: u16 = 0x2B;
}

/// Codes of services, without the bit that marks a response.
pub mod service {
    /// All attributes at once.
    pub const GET_ATTRIBUTES_ALL: u8 = 0x01;
    /// What it resets depends on the class.
    pub const RESET: u8 = 0x05;
    /// One attribute is read.
    pub const GET_ATTRIBUTE_SINGLE: u8 = 0x0E;
    /// One attribute is written.
    pub const SET_ATTRIBUTE_SINGLE: u8 = 0x10;
    /// An error answer to any service.
    pub const ERROR_RESPONSE: u8 = 0x14;
    /// What is saved becomes effective again.
    pub const RESTORE: u8 = 0x15;
    /// What is effective is saved.
    pub const SAVE: u8 = 0x16;
    /// Class 3: a master takes connections of a slave.
    pub const ALLOCATE: u8 = 0x4B;
    /// Class 3: it gives them back.
    pub const RELEASE: u8 = 0x4C;
}

/// The number in these bytes, eight at most, the lowest first.
fn little_endian(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |value, byte| value << 8 | u64::from(*byte))
}
