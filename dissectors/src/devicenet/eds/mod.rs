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

pub use layout::{Assembly, Cell, Content, Format, Io, Member, Mode, format_of_size};
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
    /// Attribute 2, if it is known.
    pub device_type: Option<u16>,
    /// Attribute 3.
    pub product_code: u16,
    /// Of attribute 4, if it is known.
    pub major_revision: Option<u8>,
}

/// Reads a file. It never fails: of what is no EDS file nothing is known.
#[must_use]
pub fn parse(file: &[u8]) -> (Eds, Vec<Warning>) {
    let text = text::decode(&file[..file.len().min(MAX_FILE)]);
    parser::parse(&text, file.len() > MAX_FILE)
}

/// Where the file that describes a device is in a list. `None` where several may, because they
/// differ in what is not known of it; of files that are alike in that the first is taken.
#[must_use]
pub fn find(files: &[Eds], identity: &Identity) -> Option<usize> {
    let key = |file: &Eds| (file.device.device_type, file.device.major_revision);
    let mut fitting = files.iter().enumerate().filter(|(_, file)| file.describes(identity));
    let (place, first) = fitting.next()?;
    fitting.all(|(_, other)| key(other) == key(first)).then_some(place)
}

/// Whether two numbers are the same, as far as they are known.
fn same<T: PartialEq>(one: Option<T>, other: Option<T>) -> bool {
    one.zip(other).is_none_or(|(one, other)| one == other)
}

impl Eds {
    /// Whether this is the file of a device. Vendor and product code must be in the file and the
    /// same; device type and major revision must be the same where both are known.
    #[must_use]
    pub fn describes(&self, identity: &Identity) -> bool {
        let device = &self.device;
        device.vendor == Some(identity.vendor)
            && device.product_code == Some(identity.product_code)
            && same(device.device_type, identity.device_type)
            && same(device.major_revision, identity.major_revision)
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

    /// All assemblies.
    pub fn assemblies(&self) -> impl Iterator<Item = &Assembly> {
        self.assemblies.values()
    }

    /// The members of an assembly at their places, as far as these are known: up to one whose size
    /// the file does not tell.
    pub fn cells<'a>(&'a self, assembly: &'a Assembly) -> impl Iterator<Item = Cell<'a>> {
        let mut end = 0_u32;
        assembly.members.iter().map_while(move |member| {
            let parameter = match member.content {
                Content::Parameter(number) => self.parameters.get(&number),
                Content::Attribute(target) => {
                    self.by_target.get(&target).and_then(|number| self.parameters.get(number))
                }
                Content::Constant(_) | Content::Padding => None,
            };
            let own = parameter.and_then(|known| known.size).map(|size| size.saturating_mul(8));
            let (offset, bits) = (end, member.bits.or(own).filter(|bits| *bits > 0)?);
            end = end.saturating_add(bits.into());
            Some(Cell { offset, bits, content: member.content, parameter })
        })
    }
}

#[cfg(test)]
mod tests;
