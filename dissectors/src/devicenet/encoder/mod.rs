//! Encoders on DeviceNet: what their objects and their I/O data mean.
//!
//! A profile is bound to a station by the user, or where product code and traffic speak for it:
//! another maker's device may use the same numbers for something else.

mod assembly;
pub mod baumer;
pub mod codes;
mod led;
mod rules;
mod watch;

pub use assembly::{Assembly, Flags, Reading};
pub use led::{Led, NodeState};
pub use rules::{AT_REST, Known, Turns, Violation, check_position, check_set, distance, range};

pub use watch::Watch;

use crate::devicenet::cip::{self, Attribute, class};

/// How a station's objects and I/O data are to be read.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Profile {
    /// Baumer's absolute encoders: AMG, HMG and PMG with DeviceNet, firmware from 1.01.
    BaumerEncoder,
    /// The encoder profile of CIP: device type 22h with class 23h.
    PositionSensor,
}

/// How many turns an encoder can tell apart.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Kind {
    /// One: the measuring range is the resolution.
    Singleturn,
    /// Many.
    Multiturn,
}

impl Profile {
    /// Every profile, with its name on the command line.
    pub const NAMES: [(&'static str, Profile); 2] =
        [("baumer-encoder", Profile::BaumerEncoder), ("position-sensor", Profile::PositionSensor)];

    /// The profile of that name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let known = Profile::NAMES.into_iter().find(|(known, _)| *known == name);
        known.map(|(_, profile)| profile)
    }

    /// The name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Profile::BaumerEncoder => "baumer-encoder",
            Profile::PositionSensor => "position-sensor",
        }
    }

    /// The profile that a product code may stand for. It is no proof: every maker counts its
    /// products from the beginning, so something else must speak for the profile as well.
    #[must_use]
    pub const fn of_product_code(product_code: u16) -> Option<Self> {
        match baumer::kind_of_product(product_code) {
            Some(_) => Some(Profile::BaumerEncoder),
            None => None,
        }
    }

    /// The class that holds the position.
    #[must_use]
    pub const fn position_class(self) -> u16 {
        match self {
            Profile::BaumerEncoder => baumer::ENCODER_POSITION,
            Profile::PositionSensor => class::POSITION_SENSOR,
        }
    }

    /// The name of a class, the profile's own first.
    #[must_use]
    pub fn class_name(self, class: u16) -> Option<&'static str> {
        match (self, class) {
            (Profile::BaumerEncoder, baumer::ENCODER_POSITION) => Some("Encoder Position"),
            _ => cip::class_name(class),
        }
    }

    /// Which attribute of the position class an access means: an instance of the class Parameter
    /// stands for one. `None` where the access is to something else.
    #[must_use]
    pub fn position_attribute(self, class: u16, instance: u16, attribute: u8) -> Option<u8> {
        if class == self.position_class() {
            return (instance == 1).then_some(attribute);
        }
        let is_value = class == class::PARAMETER && attribute == 1;
        match self {
            Profile::BaumerEncoder if is_value => {
                baumer::parameter(instance).map(|parameter| parameter.attribute)
            }
            _ => None,
        }
    }

    /// The attribute of Baumer's encoder position object that means the same as this one of the
    /// profile's position class. `None` where none does: the same number is something else there.
    #[must_use]
    pub const fn as_baumer(self, attribute: u8) -> Option<u8> {
        use baumer::attribute as id;
        match (self, attribute) {
            (Profile::BaumerEncoder, _) => Some(attribute),
            (Profile::PositionSensor, 0x03 | 0x0A) => Some(id::POSITION),
            (Profile::PositionSensor, 0x13) => Some(id::PRESET),
            (Profile::PositionSensor, 0x2E) => Some(id::ALARM_FLAG),
            (Profile::PositionSensor, 0x31) => Some(id::WARNING_FLAG),
            (Profile::PositionSensor, _) => None,
        }
    }

    /// An attribute, as the profile or else as CIP defines it. An instance of the class Parameter is
    /// the attribute that it points to.
    #[must_use]
    pub fn attribute(self, class: u16, instance: u16, attribute: u8) -> Option<&'static Attribute> {
        let table = match self {
            Profile::BaumerEncoder => baumer::ATTRIBUTES,
            Profile::PositionSensor => cip::POSITION_SENSOR,
        };
        match self.position_attribute(class, instance, attribute) {
            Some(own) => cip::find(table, own),
            None => cip::attribute(class, instance, attribute),
        }
    }

    /// What an instance of the class Assembly holds.
    #[must_use]
    pub const fn assembly(self, instance: u16) -> Option<Assembly> {
        match (self, instance) {
            (_, 1) => Some(Assembly::Position),
            (_, 2) => Some(Assembly::PositionAndFlags),
            (Profile::PositionSensor, 3) => Some(Assembly::PositionAndVelocity),
            _ => None,
        }
    }

    /// The assembly that data of this size must be, where only one has it.
    #[must_use]
    pub fn assembly_of_size(self, size: usize) -> Option<Assembly> {
        let mut all = (1..=3).filter_map(|instance| self.assembly(instance));
        all.find(|assembly| assembly.size() == size)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn profiles_by_name() {
        for (name, profile) in Profile::NAMES {
            assert_eq!(profile.name(), name);
        }
        assert_eq!(Profile::NAMES[0].0, "baumer-encoder");
    }

    #[test]
    fn product_codes_of_the_manual() {
        assert_eq!(Profile::of_product_code(0x0A), Some(Profile::BaumerEncoder));
        assert_eq!(Profile::of_product_code(0x0B), Some(Profile::BaumerEncoder));
        assert_eq!(Profile::of_product_code(0x0C), None);
    }

    #[test]
    fn a_parameter_is_the_attribute_that_it_points_to() {
        let profile = Profile::BaumerEncoder;
        // Manual §7: instance 9 is the position, attribute 12 of class 2Fh.
        assert_eq!(profile.position_attribute(0x0F, 9, 1), Some(12));
        assert_eq!(profile.attribute(0x0F, 9, 1).unwrap().name, "Position value");
        assert_eq!(profile.attribute(0x2F, 1, 12).unwrap().name, "Position value");
        // What describes a parameter is of the class itself.
        assert_eq!(profile.attribute(0x0F, 9, 7).unwrap().name, "Parameter name");
        assert_eq!(profile.position_attribute(0x0F, 20, 1), None);
        assert_eq!(profile.position_attribute(0x2F, 2, 12), None);
        assert!(profile.attribute(0x2F, 1, 13).is_none());
    }

    #[test]
    fn classes_have_the_profiles_names() {
        assert_eq!(Profile::BaumerEncoder.class_name(0x2F), Some("Encoder Position"));
        assert_eq!(Profile::PositionSensor.class_name(0x2F), None);
        assert_eq!(Profile::BaumerEncoder.class_name(0x05), Some("Connection"));
    }

    #[test]
    fn assemblies_by_instance_and_by_size() {
        let profile = Profile::BaumerEncoder;
        let instances = [0, 1, 2, 3].map(|instance| profile.assembly(instance));
        let expected = [None, Some(Assembly::Position), Some(Assembly::PositionAndFlags), None];
        assert_eq!(instances, expected);
        assert_eq!(profile.assembly_of_size(5), Some(Assembly::PositionAndFlags));
        assert_eq!(profile.assembly_of_size(8), None);
        let sensor = Profile::PositionSensor;
        assert_eq!(sensor.assembly_of_size(8), Some(Assembly::PositionAndVelocity));
        assert_eq!(sensor.attribute(0x23, 1, 0x0A).unwrap().name, "Position value signed");
    }
}
