//! EDS files: what the maker of a device tells of its parameters and its I/O data.
//!
//! Files in the field are full of slips. Everything that can be read is; what cannot be is a
//! [`Warning`] with its line.

mod layout;
mod lexer;
mod parameter;
mod parser;
mod text;
mod warning;

pub use layout::{Assembly, Cell, Content, Format, Io, Member, Mode, Sizes};
pub use parameter::{Described, Parameter, Scaling};
pub use warning::{Problem, Warning};

use crate::devicenet::cip::{Target, class};
use alloc::collections::BTreeMap;
use alloc::string::String;
use alloc::vec::Vec;

/// Most bytes of a file that are read.
pub const MAX_FILE: usize = 4 << 20;

/// What a file tells of a device.
#[derive(Clone, PartialEq, Default, Debug)]
pub struct Eds {
    /// Whose file it is.
    pub device: Device,
    /// Its I/O data.
    pub io: Io,
    parameters: BTreeMap<u16, Parameter>,
    by_target: BTreeMap<Target, u16>,
    assemblies: BTreeMap<u16, Assembly>,
}

/// The section `[Device]`.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct Device {
    /// `VendCode`
    pub vendor: Option<u16>,
    /// `VendName`, or nothing.
    pub vendor_name: String,
    /// `ProdType`
    pub device_type: Option<u16>,
    /// `ProdCode`
    pub product_code: Option<u16>,
    /// `MajRev`
    pub major_revision: Option<u8>,
    /// `MinRev`
    pub minor_revision: Option<u8>,
    /// `ProdName`, or nothing.
    pub product_name: String,
}

/// Who a device is, as its Identity object says: the key to its file.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Identity {
    /// Attribute 1.
    pub vendor: u16,
    /// Attribute 2.
    pub device_type: u16,
    /// Attribute 3.
    pub product_code: u16,
    /// Of attribute 4.
    pub major_revision: u8,
}

/// Reads a file. It never fails: of what is no EDS file nothing is known.
#[must_use]
pub fn parse(file: &[u8]) -> (Eds, Vec<Warning>) {
    let text = text::decode(&file[..file.len().min(MAX_FILE)]);
    parser::parse(&text, file.len() > MAX_FILE)
}

/// The file that describes a device.
#[must_use]
pub fn find<'a>(files: &'a [Eds], identity: &Identity) -> Option<&'a Eds> {
    files.iter().find(|file| file.describes(identity))
}

impl Eds {
    /// Whether this is the file of a device. Vendor and product code must be in the file and the
    /// same; device type and major revision must be the same where they are in it.
    #[must_use]
    pub fn describes(&self, identity: &Identity) -> bool {
        let device = &self.device;
        device.vendor == Some(identity.vendor)
            && device.product_code == Some(identity.product_code)
            && device.device_type.is_none_or(|it| it == identity.device_type)
            && device.major_revision.is_none_or(|it| it == identity.major_revision)
    }

    /// The parameter that an access means: the one that points there, or the instance of the class
    /// Parameter whose value is accessed.
    #[must_use]
    pub fn parameter(&self, class: u16, instance: u16, attribute: u8) -> Option<&Parameter> {
        let target = Target { class, instance, attribute: Some(attribute) };
        let number = match self.by_target.get(&target) {
            Some(number) => *number,
            None if class == class::PARAMETER && attribute == 1 => instance,
            None => return None,
        };
        self.parameters.get(&number)
    }

    /// All parameters, by their numbers.
    pub fn parameters(&self) -> impl Iterator<Item = (u16, &Parameter)> {
        self.parameters.iter().map(|(number, parameter)| (*number, parameter))
    }

    /// Whether a parameter points into this class: the device has it, then.
    #[must_use]
    pub fn has_class(&self, class: u16) -> bool {
        self.by_target.keys().any(|target| target.class == class)
    }

    /// An assembly by its instance.
    #[must_use]
    pub fn assembly(&self, instance: u16) -> Option<&Assembly> {
        self.assemblies.get(&instance)
    }

    /// The members of an assembly at their places.
    pub fn cells<'a>(&'a self, assembly: &'a Assembly) -> impl Iterator<Item = Cell<'a>> {
        let mut end = 0_u32;
        assembly.members.iter().map(move |member| {
            let parameter = match member.content {
                Content::Parameter(number) => self.parameters.get(&number),
                Content::Attribute(target) => {
                    self.by_target.get(&target).and_then(|number| self.parameters.get(number))
                }
                Content::Constant(_) | Content::Padding => None,
            };
            let own = parameter.and_then(|known| known.size).map(|size| size.saturating_mul(8));
            let (offset, bits) = (end, member.bits.or(own).unwrap_or(0));
            end = end.saturating_add(bits.into());
            Cell { offset, bits, content: member.content, parameter }
        })
    }
}

#[cfg(test)]
mod tests;
