//! Names of classes, device types and vendors, and whose a number is.

/// Whose numbers these are.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Range {
    /// Defined by CIP.
    Open,
    /// Defined by the maker of the device.
    Vendor,
    /// Defined by the class.
    ClassSpecific,
    /// Not to be used.
    Reserved,
}

/// The name of a class of CIP. A device may use such a number for a class of its own: 2Fh, for one,
/// is in CIP's range and in no list of CIP.
#[must_use]
pub fn class_name(class: u16) -> Option<&'static str> {
    find(&CLASSES, class)
}

/// Whose class this number is.
#[must_use]
pub const fn class_range(class: u16) -> Range {
    match class {
        0x00..=0x63 | 0x100..=0x2FF => Range::Open,
        0x64..=0xC7 | 0x300..=0x4FF => Range::Vendor,
        _ => Range::Reserved,
    }
}

/// The name of a device type: Identity attribute 2.
#[must_use]
pub fn device_type_name(device_type: u16) -> Option<&'static str> {
    find(&DEVICE_TYPES, device_type)
}

/// The name of a vendor. The list is not complete: who is not in it is unknown, no more.
#[must_use]
pub fn vendor_name(vendor: u16) -> Option<&'static str> {
    find(&VENDORS, vendor)
}

fn find(table: &[(u16, &'static str)], number: u16) -> Option<&'static str> {
    let index = table.binary_search_by_key(&number, |row| row.0).ok()?;
    Some(table[index].1)
}

static CLASSES: [(u16, &str); 54] = [
    (0x01, "Identity"),
    (0x02, "Message Router"),
    (0x03, "DeviceNet"),
    (0x04, "Assembly"),
    (0x05, "Connection"),
    (0x06, "Connection Manager"),
    (0x07, "Register"),
    (0x08, "Discrete Input Point"),
    (0x09, "Discrete Output Point"),
    (0x0A, "Analog Input Point"),
    (0x0B, "Analog Output Point"),
    (0x0E, "Presence Sensing"),
    (0x0F, "Parameter"),
    (0x10, "Parameter Group"),
    (0x12, "Group"),
    (0x1D, "Discrete Input Group"),
    (0x1E, "Discrete Output Group"),
    (0x1F, "Discrete Group"),
    (0x20, "Analog Input Group"),
    (0x21, "Analog Output Group"),
    (0x22, "Analog Group"),
    (0x23, "Position Sensor"),
    (0x24, "Position Controller Supervisor"),
    (0x25, "Position Controller"),
    (0x26, "Block Sequencer"),
    (0x27, "Command Block"),
    (0x28, "Motor Data"),
    (0x29, "Control Supervisor"),
    (0x2A, "AC/DC Drive"),
    (0x2B, "Acknowledge Handler"),
    (0x2C, "Overload"),
    (0x2D, "Softstart"),
    (0x2E, "Selection"),
    (0x30, "S-Device Supervisor"),
    (0x31, "S-Analog Sensor"),
    (0x32, "S-Analog Actuator"),
    (0x33, "S-Single Stage Controller"),
    (0x34, "S-Gas Calibration"),
    (0x35, "Trip Point"),
    (0x37, "File"),
    (0x38, "S-Partial Pressure"),
    (0x39, "Safety Supervisor"),
    (0x3A, "Safety Validator"),
    (0x3B, "Safety Discrete Output Point"),
    (0x3C, "Safety Discrete Output Group"),
    (0x3D, "Safety Discrete Input Point"),
    (0x3E, "Safety Discrete Input Group"),
    (0x3F, "Safety Dual Channel Output"),
    (0x40, "S-Sensor Calibration"),
    (0x41, "Event Log"),
    (0xF0, "ControlNet"),
    (0xF4, "Port"),
    (0xF5, "TCP/IP Interface"),
    (0xF6, "Ethernet Link"),
];

static DEVICE_TYPES: [(u16, &str); 29] = [
    (0x00, "generic device"),
    (0x02, "AC drive"),
    (0x03, "motor overload"),
    (0x04, "limit switch"),
    (0x05, "inductive proximity switch"),
    (0x06, "photoelectric sensor"),
    (0x07, "general purpose discrete I/O"),
    (0x09, "resolver"),
    (0x0C, "communications adapter"),
    (0x0E, "programmable logic controller"),
    (0x10, "position controller"),
    (0x13, "DC drive"),
    (0x15, "contactor"),
    (0x16, "motor starter"),
    (0x17, "soft start"),
    (0x18, "human-machine interface"),
    (0x1A, "mass flow controller"),
    (0x1B, "pneumatic valve"),
    (0x1C, "vacuum pressure gauge"),
    (0x1D, "process control valve"),
    (0x1E, "residual gas analyzer"),
    (0x1F, "DC power generator"),
    (0x20, "RF power generator"),
    (0x21, "turbomolecular pump"),
    (0x22, "encoder"),
    (0x23, "safety discrete I/O"),
    (0x24, "fluid flow controller"),
    (0x27, "mass flow controller, enhanced"),
    (0x2B, "generic device, keyable"),
];

static VENDORS: [(u16, &str); 32] = [
    (1, "Rockwell Automation/Allen-Bradley"),
    (8, "Molex"),
    (26, "Festo"),
    (34, "Hohner"),
    (36, "MKS"),
    (47, "Omron"),
    (48, "Turck"),
    (57, "Pepperl+Fuchs"),
    (78, "Escort Memory Systems"),
    (86, "Horner"),
    (109, "National Instruments"),
    (248, "Moeller"),
    (256, "Turck"),
    (283, "Hilscher"),
    (322, "ifm"),
    (324, "IDEACOD-Hohner"),
    (354, "FRABA Posital"),
    (404, "VAT"),
    (442, "Hengstler"),
    (468, "Baumer IVO"),
    (503, "Danaher Controls"),
    (511, "SICK Stegmann GmbH"),
    (665, "Lika"),
    (702, "Leine & Linde"),
    (706, "Bronkhorst"),
    (763, "Baumer Ident"),
    (771, "SICK Stegmann Inc."),
    (779, "Kübler"),
    (808, "SICK AG"),
    (1056, "Scancon"),
    (1137, "TR-Electronic"),
    (1441, "Wachendorff"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_in_order() {
        for table in [&CLASSES[..], &DEVICE_TYPES, &VENDORS] {
            assert!(table.is_sorted_by(|a, b| a.0 < b.0));
        }
    }

    #[test]
    fn classes_of_the_encoder() {
        let names = [0x01, 0x02, 0x03, 0x04, 0x05, 0x0F, 0x2B].map(class_name);
        let expected = [
            "Identity",
            "Message Router",
            "DeviceNet",
            "Assembly",
            "Connection",
            "Parameter",
            "Acknowledge Handler",
        ];
        assert_eq!(names, expected.map(Some));
        assert_eq!(class_name(0x23), Some("Position Sensor"));
        // What Baumer calls Encoder Position stands in no list of CIP.
        assert_eq!((class_name(0x2F), class_range(0x2F)), (None, Range::Open));
    }

    #[test]
    fn whose_class_a_number_is() {
        let ranges = [0x63, 0x64, 0xC7, 0xC8, 0xFF, 0x100, 0x2FF, 0x300, 0x356, 0x4FF, 0x500];
        let expected = {
            use Range::{Open as O, Reserved as R, Vendor as V};
            [O, V, V, R, R, O, O, V, V, V, R]
        };
        assert_eq!(ranges.map(class_range), expected);
    }

    #[test]
    fn makers_of_encoders() {
        assert_eq!(vendor_name(468), Some("Baumer IVO"));
        assert_eq!(vendor_name(1), Some("Rockwell Automation/Allen-Bradley"));
        // X16: ICP DAS, which the list does not have.
        assert_eq!(vendor_name(803), None);
        assert_eq!(device_type_name(0x22), Some("encoder"));
        assert_eq!(device_type_name(0x01), None);
    }
}
