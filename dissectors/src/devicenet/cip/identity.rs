//! All attributes of a device's identity in one answer: Get_Attributes_All of class 01h (CIP Vol. 1
//! §5-2).
//!
//! ```text
//! vendor (2)  device type (2)  product code (2)  revision (1, 1)  status (2)  serial number (4)
//! length of the name (1)  name
//! ```

use super::{Revision, Text, device_type_name, vendor_name};
use crate::field;
use core::fmt;
use nom::multi::length_data;
use nom::number::complete::{le_u16, le_u32, u8};
use nom::{IResult, Parser};

/// Who a device is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct DeviceIdentity<'a> {
    /// Attribute 1.
    pub vendor: u16,
    /// Attribute 2.
    pub device_type: u16,
    /// Attribute 3.
    pub product_code: u16,
    /// Attribute 4.
    pub revision: Revision,
    /// Attribute 5.
    pub status: u16,
    /// Attribute 6.
    pub serial: u32,
    /// Attribute 7; nothing where the answer ends before it.
    pub name: Text<'a>,
}

impl<'a> DeviceIdentity<'a> {
    /// Reads the answer. What follows the name are attributes that not every device has.
    ///
    /// # Errors
    /// The input ends before the serial number, or within the name.
    pub fn parse(input: &'a [u8]) -> IResult<&'a [u8], Self> {
        let (rest, (vendor, device_type, product_code, major, minor, status, serial)) =
            (le_u16, le_u16, le_u16, u8, u8, le_u16, le_u32).parse(input)?;
        let (rest, name) =
            if rest.is_empty() { (rest, rest) } else { length_data(u8).parse(rest)? };
        let revision = Revision { major: major & 0x7F, minor };
        let name = Text(name);
        let all =
            DeviceIdentity { vendor, device_type, product_code, revision, status, serial, name };
        Ok((rest, all))
    }
}

/// The attributes in order, the revision as two numbers.
impl field::List for DeviceIdentity<'_> {
    fn len(&self) -> usize {
        8
    }

    fn get(&self, index: usize) -> field::Value<'_> {
        let number: i64 = match index {
            0 => self.vendor.into(),
            1 => self.device_type.into(),
            2 => self.product_code.into(),
            3 => self.revision.major.into(),
            4 => self.revision.minor.into(),
            5 => self.status.into(),
            6 => self.serial.into(),
            7 => {
                return self
                    .name
                    .as_str()
                    .map_or(field::Value::Hex(self.name.0), field::Value::Text);
            }
            _ => return field::Value::Absent,
        };
        field::Value::Int(number)
    }
}

impl fmt::Display for DeviceIdentity<'_> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.name.0.is_empty() {
            write!(out, "{}, ", self.name)?;
        }
        write!(out, "vendor {}", self.vendor)?;
        if let Some(name) = vendor_name(self.vendor) {
            write!(out, " ({name})")?;
        }
        write!(out, ", type {}", self.device_type)?;
        if let Some(name) = device_type_name(self.device_type) {
            write!(out, " ({name})")?;
        }
        let DeviceIdentity { product_code, revision, status, serial, .. } = self;
        write!(out, ", product {product_code}, revision {revision}")?;
        write!(out, ", status {status:04X}h, serial {serial:08X}h")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;
    use alloc::vec::Vec;

    /// Vendor 468 is 01D4h, the encoder type 22h; product 10, revision 1.1, status 0, serial
    /// 017FE315h.
    const NUMBERS: [u8; 14] = [0xD4, 1, 0x22, 0, 10, 0, 1, 1, 0, 0, 0x15, 0xE3, 0x7F, 1];

    #[test]
    fn the_attributes_stand_one_after_the_other() {
        let data = [&NUMBERS[..], b"\x06AMG 11"].concat();
        let (rest, device) = DeviceIdentity::parse(&data).unwrap();
        assert_eq!((rest, device.name), (&[][..], Text(b"AMG 11")));
        assert_eq!(
            device.to_string(),
            "AMG 11, vendor 468 (Baumer IVO), type 34 (encoder), product 10, revision 1.1, \
             status 0000h, serial 017FE315h"
        );
    }

    #[test]
    fn an_answer_may_end_before_the_name_but_not_before() {
        assert!(DeviceIdentity::parse(&NUMBERS).is_ok());
        assert!(DeviceIdentity::parse(&NUMBERS[..13]).is_err());
        let torn: Vec<u8> = [&NUMBERS[..], &[3, b'A']].concat();
        assert!(DeviceIdentity::parse(&torn).is_err());
    }
}
