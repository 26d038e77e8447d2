//! Baumer's absolute encoders with DeviceNet: the dictionary of their manual (firmware from 1.01).

use super::Kind;
use crate::devicenet::cip::{Bit, Words, attributes, class, service};
use core::fmt;

/// The encoder position object, class 2Fh (manual §8). It is the maker's own, though its number and
/// those of its attributes are in CIP's range.
pub const ENCODER_POSITION: u16 = 0x2F;

/// Attributes of the encoder position object that others speak of.
pub mod attribute {
    /// CW or CCW.
    pub const SENSE_OF_ROTATION: u8 = 3;
    /// Writing it changes the total resolution too.
    pub const STEPS_PER_TURN: u8 = 7;
    /// Steps of the whole measuring range.
    pub const TOTAL_RESOLUTION: u8 = 8;
    /// Writing it moves the position.
    pub const PRESET: u8 = 10;
    /// By how much the position must change to be sent, in change of state mode.
    pub const COS_DELTA: u8 = 11;
    /// The position.
    pub const POSITION: u8 = 12;
    /// What is wrong.
    pub const ALARMS: u8 = 83;
    /// What is about to be.
    pub const WARNINGS: u8 = 86;
    /// Alarm flag.
    pub const ALARM_FLAG: u8 = 85;
    /// Warning flag.
    pub const WARNING_FLAG: u8 = 88;
    /// What the preset adds to the position.
    pub const OFFSET: u8 = 91;
    /// Singleturn or multiturn.
    pub const ENCODER_TYPE: u8 = 95;
}

attributes! {
    /// Encoder position object, class 2Fh (manual §8): 1 to 12 for the position, 80 to 95 for
    /// diagnosis.
    pub static ATTRIBUTES {
        1  Get    "Number of attributes"         Usint;
        2  Get    "Attributes"                   UsintList;
        3  GetSet "Sense of rotation"            Bool  is Words::OneOf(&[(0, "CW"), (1, "CCW")]);
        4  Get    "Internal diagnostic function (not used)" Bool is Words::OneOf(OFF_ON);
        5  Get    "Scaling function"             Bool  is Words::OneOf(OFF_ON);
        6  Get    "Position format"              Usint is Words::OneOf(&[(0, "steps")]);
        7  GetSet "Steps per turn"               Udint in "steps";
        8  GetSet "Total resolution"             Udint in "steps";
        9  Get    "Measurement steps (not used)" Udint;
        10 GetSet "Preset value"                 Udint in "steps";
        11 GetSet "COS delta"                    Dint  in "steps";
        12 Get    "Position value"               Dint  in "steps";
        80 Get    "Operating status"             Usint is Words::Bits(OPERATING_STATUS);
        81 Get    "Singleturn resolution"        Udint in "steps";
        // 65536 turns do not fit into its 16 bits.
        82 Get    "Number of revolutions"        Uint  is Words::OneOf(&[(0, "65536?")]);
        83 Get    "Alarm signals"                Uint  is Words::Bits(ALARMS);
        84 Get    "Supported alarm signals"      Uint  is Words::Bits(SUPPORTED_ALARMS);
        85 Get    "Alarm flag"                   Bool  is Words::OneOf(&[(0, "OK"), (1, "alarm")]);
        86 Get    "Warning messages"             Uint  is Words::Bits(WARNINGS);
        87 Get    "Supported warning messages"   Uint  is Words::Bits(SUPPORTED_WARNINGS);
        88 Get    "Warning flag"                 Bool  is Words::OneOf(&[(0, "OK"), (1, "warning")]);
        89 Get    "Profile and software version" Udint is Words::Told(tell_versions);
        91 Get    "Offset value"                 Dint  in "steps";
        95 Get    "Encoder type"                 Uint  is Words::OneOf(ENCODER_TYPES);
    }
}

const OFF_ON: &[(u16, &str)] = &[(0, "off"), (1, "on")];
const OPERATING_STATUS: &[Bit] = &[
    Bit { number: 0, set: "CCW", clear: "CW" },
    Bit { number: 1, set: "diagnosis supported", clear: "diagnosis not supported" },
    Bit { number: 2, set: "scaling on", clear: "scaling off" },
];
/// The only alarm there is.
const ALARMS: &[Bit] = &[Bit { number: 0, set: "position error", clear: "no position error" }];
const SUPPORTED_ALARMS: &[Bit] =
    &[Bit { number: 0, set: "position error", clear: "position error not supported" }];
/// The only warning there is.
const WARNINGS: &[Bit] = &[Bit {
    number: 4,
    set: "voltage of the lithium cell too low",
    clear: "voltage of the lithium cell OK",
}];
const SUPPORTED_WARNINGS: &[Bit] =
    &[Bit { number: 4, set: "lithium cell", clear: "lithium cell not supported" }];
const ENCODER_TYPES: &[(u16, &str)] = &[(1, "absolute, singleturn"), (2, "absolute, multiturn")];

/// Profile in the low word, software in the high word; the manual does not say how they count.
fn tell_versions(versions: i64, out: &mut fmt::Formatter<'_>) -> fmt::Result {
    write!(out, "profile {:04X}h, software {:04X}h", versions & 0xFFFF, versions >> 16 & 0xFFFF)
}

impl Kind {
    /// What attribute 95 says.
    #[must_use]
    pub const fn of_encoder_type(encoder_type: u16) -> Option<Self> {
        match encoder_type {
            1 => Some(Kind::Singleturn),
            2 => Some(Kind::Multiturn),
            _ => None,
        }
    }
}

/// What kind of encoder a product code stands for (manual §1.2).
#[must_use]
pub const fn kind_of_product(product_code: u16) -> Option<Kind> {
    match product_code {
        0x0A => Some(Kind::Multiturn),
        0x0B => Some(Kind::Singleturn),
        _ => None,
    }
}

/// An instance of the class Parameter: another way to an attribute of the encoder position object.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Parameter {
    /// The attribute that it points to.
    pub attribute: u8,
    /// Its name in the manual.
    pub name: &'static str,
}

/// The parameter of an instance of class 0Fh (manual §7). None points to attribute 11, 91 or 95.
#[must_use]
pub fn parameter(instance: u16) -> Option<&'static Parameter> {
    PARAMETERS.get(usize::from(instance).checked_sub(1)?)
}

/// Instances 1 to 19.
static PARAMETERS: [Parameter; 19] = [
    Parameter { attribute: 3, name: "Sense of rotation" },
    Parameter { attribute: 4, name: "Internal diagnostic function (not used)" },
    Parameter { attribute: 5, name: "Scaling function" },
    Parameter { attribute: 6, name: "Position format" },
    Parameter { attribute: 7, name: "Steps per turn" },
    Parameter { attribute: 8, name: "Total resolution in steps" },
    Parameter { attribute: 9, name: "Measurement steps (not used)" },
    Parameter { attribute: 10, name: "Preset value" },
    Parameter { attribute: 12, name: "Position value" },
    Parameter { attribute: 80, name: "Operating status" },
    Parameter { attribute: 81, name: "Singleturn resolution" },
    Parameter { attribute: 82, name: "Number of revolutions" },
    Parameter { attribute: 85, name: "Alarm flag" },
    Parameter { attribute: 83, name: "Alarm signals" },
    Parameter { attribute: 84, name: "Supported alarm signals" },
    Parameter { attribute: 88, name: "Warning flag" },
    Parameter { attribute: 86, name: "Warning messages" },
    Parameter { attribute: 87, name: "Supported warning messages" },
    Parameter { attribute: 89, name: "Profile / software version" },
];

/// A service that concerns all parameters at once (manual §7, §8).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Command {
    /// Every parameter takes its default value.
    Reset,
    /// Every parameter takes its saved value.
    Restore,
    /// Every parameter is saved.
    Save,
}

impl Command {
    /// What a service of the class Parameter or of the encoder position object does.
    #[must_use]
    pub const fn of(class: u16, service: u8) -> Option<Self> {
        match (class, service) {
            (class::PARAMETER | ENCODER_POSITION, service::RESET) => Some(Command::Reset),
            (class::PARAMETER | ENCODER_POSITION, service::RESTORE) => Some(Command::Restore),
            (class::PARAMETER | ENCODER_POSITION, service::SAVE) => Some(Command::Save),
            _ => None,
        }
    }

    /// What it does, as a sentence goes on after "the encoder".
    #[must_use]
    pub const fn effect(self) -> &'static str {
        match self {
            Command::Reset => "sets all parameters to their default values",
            Command::Restore => "loads all parameters from the non-volatile memory",
            Command::Save => "saves all parameters in the non-volatile memory",
        }
    }
}

/// What a parameter is after a reset (manual §4), as the number that its bytes hold. The manual
/// gives no default for the COS delta, and the total resolution depends on the kind of encoder.
#[must_use]
pub const fn default_value(attribute: u8, kind: Option<Kind>) -> Option<i64> {
    match (attribute, kind) {
        (attribute::SENSE_OF_ROTATION | attribute::PRESET, _) => Some(0),
        (attribute::STEPS_PER_TURN, _) => Some(8192),
        // "In the case of singleturn encoders, the measurement range = the resolution".
        (attribute::TOTAL_RESOLUTION, Some(Kind::Singleturn)) => Some(8192),
        (attribute::TOTAL_RESOLUTION, Some(Kind::Multiturn)) => Some(536_870_912),
        _ => None,
    }
}

/// Attributes whose value is another one once this one was written: what was read of them before
/// does not hold any more. A new number of steps changes the total resolution, a preset the offset
/// and the position (manual §8).
#[must_use]
pub const fn changed_by(written: u8) -> &'static [u8] {
    match written {
        attribute::STEPS_PER_TURN => &[attribute::TOTAL_RESOLUTION, attribute::POSITION],
        attribute::SENSE_OF_ROTATION | attribute::TOTAL_RESOLUTION => &[attribute::POSITION],
        attribute::PRESET => &[attribute::POSITION, attribute::OFFSET],
        _ => &[],
    }
}

/// Whether what is written there is saved at once: the path that selects the assembly (manual §6).
#[must_use]
pub const fn is_saved_at_once(class: u16, attribute: u8) -> bool {
    class == class::CONNECTION && attribute == 14
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devicenet::cip::{Attribute, DataType, find};
    use alloc::string::{String, ToString};
    use alloc::vec::Vec;

    fn said(id: u8, data: &[u8]) -> String {
        let attribute = find(ATTRIBUTES, id).unwrap();
        attribute.in_words(attribute.decode(data).unwrap()).to_string()
    }

    #[test]
    fn the_dictionary_is_the_manuals() {
        let ids: Vec<u8> = ATTRIBUTES.iter().map(|attribute| attribute.id).collect();
        let expected: Vec<u8> = (1..=12).chain(80..=89).chain([91, 95]).collect();
        assert_eq!(ids, expected);
        let settable = ATTRIBUTES.iter().filter(|attribute| attribute.is_settable());
        assert_eq!(settable.map(|a| a.id).collect::<Vec<_>>(), [3, 7, 8, 10, 11]);
        // Bytes of a Get response, less its two of header and service.
        let size = |attribute: &Attribute| attribute.kind.size();
        for (sizes, ids) in [
            (1, &[1, 3, 4, 5, 6, 80, 85, 88][..]),
            (2, &[82, 83, 84, 86, 87, 95]),
            (4, &[7, 8, 9, 10, 11, 12, 81, 89, 91]),
        ] {
            for id in ids {
                assert_eq!(find(ATTRIBUTES, *id).and_then(size), Some(sizes), "{id}");
            }
        }
        assert_eq!(find(ATTRIBUTES, 2).unwrap().kind, DataType::UsintList);
        assert_eq!(find(ATTRIBUTES, 11).unwrap().kind, DataType::Dint);
    }

    #[test]
    fn parameters_point_where_the_manual_says() {
        let attributes: Vec<u8> =
            (1..=19).map(|instance| parameter(instance).unwrap().attribute).collect();
        let manual = [3, 4, 5, 6, 7, 8, 9, 10, 12, 80, 81, 82, 85, 83, 84, 88, 86, 87, 89];
        assert_eq!(attributes, manual);
        assert!(parameter(0).is_none() && parameter(20).is_none());
        for instance in [2, 7] {
            assert!(parameter(instance).unwrap().name.ends_with("(not used)"));
        }
        for instance in 1..=19 {
            let parameter = parameter(instance).unwrap();
            assert!(find(ATTRIBUTES, parameter.attribute).is_some(), "{}", parameter.name);
        }
    }

    #[test]
    fn values_in_words() {
        for (id, data, words) in [
            (3, &[1][..], "1 (CCW)"),
            (6, &[0], "0 (steps)"),
            (7, &[0x10, 0x0E, 0, 0], "3600 steps"),
            (8, &[0, 0x10, 0x0E, 0], "921600 steps"),
            (10, &[0x45, 0x23, 0x01, 0x00], "74565 steps"),
            (80, &[0b110], "6 (CW, diagnosis supported, scaling on)"),
            (82, &[0, 1], "256"),
            (82, &[0, 0], "0 (65536?)"),
            (83, &[1, 0], "1 (position error)"),
            (83, &[0, 0], "0 (no position error)"),
            (86, &[0x10, 0], "16 (voltage of the lithium cell too low)"),
            (88, &[0], "0 (OK)"),
            (89, &[0x01, 0x01, 0x02, 0x01], "16908545 (profile 0101h, software 0102h)"),
            (95, &[2, 0], "2 (absolute, multiturn)"),
        ] {
            assert_eq!(said(id, data), words, "{id}");
        }
    }

    #[test]
    fn products_and_types() {
        assert_eq!(kind_of_product(0x0A), Some(Kind::Multiturn));
        assert_eq!(kind_of_product(0x0B), Some(Kind::Singleturn));
        assert_eq!(Kind::of_encoder_type(2), Some(Kind::Multiturn));
        assert_eq!(Kind::of_encoder_type(0), None);
        assert_eq!(default_value(8, Some(Kind::Multiturn)), Some(8192 * 65536));
        assert_eq!(default_value(8, None), None);
        assert_eq!(default_value(11, Some(Kind::Multiturn)), None);
    }

    #[test]
    fn services_by_class() {
        assert_eq!(Command::of(0x2F, 0x16), Some(Command::Save));
        assert_eq!(Command::of(0x0F, 0x05), Some(Command::Reset));
        // Reset of the class Identity restarts the node.
        assert_eq!(Command::of(0x01, 0x05), None);
        assert!(is_saved_at_once(5, 14) && !is_saved_at_once(0x2F, 7));
        assert!(changed_by(7).contains(&8) && changed_by(10).contains(&91));
    }
}
