//! Position Sensor, class 23h: the encoder profile of CIP (device type 22h).
//!
//! Its attributes are known from manuals of encoders on EtherNet/IP, which has the same object. Old
//! DeviceNet encoders number them otherwise: IDEACOD's MHK5 has its resolution in 71h to 73h.

use super::attribute::{Bit, Words, attributes};

attributes! {
    /// Position Sensor, class 23h (CIP Vol. 1 §5-23).
    pub static POSITION_SENSOR {
        0x01 Get    "Number of attributes"          Usint;
        0x02 Get    "Attribute list"                UsintList;
        0x03 Get    "Position value unsigned"       Udint;
        0x0A Get    "Position value signed"         Dint;
        0x0B Get    "Position sensor type"          Uint is Words::OneOf(SENSOR_TYPES);
        0x0C GetSet "Direction counting toggle"     Bool is Words::OneOf(&[(0, "CW"), (1, "CCW")]);
        0x0D GetSet "Commissioning diagnostic control" Bool is Words::OneOf(OFF_ON);
        0x0E GetSet "Scaling function control"      Bool is Words::OneOf(OFF_ON);
        0x0F GetSet "Position format"               Engunit is Words::OneOf(&[(0x1001, "steps")]);
        0x10 GetSet "Measuring units per span"      Udint;
        0x11 GetSet "Total measuring range"         Udint;
        0x12 GetSet "Position measuring increment"  Udint;
        0x13 GetSet "Preset value"                  Dint;
        0x15 Get    "Position state register"       Byte;
        0x16 GetSet "Position low limit"            Dint;
        0x17 GetSet "Position high limit"           Dint;
        0x18 Get    "Velocity value"                Dint;
        0x19 GetSet "Velocity format"               Engunit;
        0x1A GetSet "Velocity resolution"           Udint;
        0x1B GetSet "Minimum velocity setpoint"     Dint;
        0x1C GetSet "Maximum velocity setpoint"     Dint;
        0x1D Get    "Acceleration value"            Dint;
        0x1E GetSet "Acceleration format"           Engunit;
        0x1F GetSet "Acceleration resolution"       Udint;
        0x20 GetSet "Minimum acceleration setpoint" Dint;
        0x21 GetSet "Maximum acceleration setpoint" Dint;
        0x29 Get    "Operating status"              Byte is Words::Bits(OPERATING_STATUS);
        0x2A Get    "Physical resolution span"      Udint;
        0x2B Get    "Number of spans"               Uint;
        0x2C Get    "Alarms"                        Word;
        0x2D Get    "Supported alarms"              Word;
        0x2E Get    "Alarm flag"                    Bool is Words::OneOf(ALARM);
        0x2F Get    "Warnings"                      Word;
        0x30 Get    "Supported warnings"            Word;
        0x31 Get    "Warning flag"                  Bool is Words::OneOf(WARNING);
        0x33 Get    "Offset value"                  Dint;
    }
}

const SENSOR_TYPES: &[(u16, &str)] = &[
    (1, "absolute singleturn"),
    (2, "absolute multiturn"),
    (4, "incremental"),
    (6, "incremental linear"),
    (8, "absolute linear"),
    (10, "multi-sensor"),
];
const OFF_ON: &[(u16, &str)] = &[(0, "off"), (1, "on")];
const ALARM: &[(u16, &str)] = &[(0, "OK"), (1, "alarm")];
const WARNING: &[(u16, &str)] = &[(0, "OK"), (1, "warning")];
const OPERATING_STATUS: &[Bit] = &[
    Bit { number: 0, set: "CCW", clear: "CW" },
    Bit { number: 1, set: "scaling on", clear: "scaling off" },
    Bit { number: 5, set: "diagnostics", clear: "" },
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devicenet::cip::attribute;
    use alloc::string::ToString;

    #[test]
    fn the_table_is_in_order_and_complete() {
        // 01-03, 0A-13, 15-21, 29-31, 33 of the specification's table.
        assert_eq!(POSITION_SENSOR.len(), 3 + 10 + 13 + 9 + 1);
        assert!(POSITION_SENSOR.is_sorted_by(|a, b| a.id < b.id));
    }

    #[test]
    fn values_in_words() {
        for (id, data, said) in [
            (0x0B, &[2, 0][..], "2 (absolute multiturn)"),
            (0x0F, &[0x01, 0x10], "1001h (steps)"),
            (0x29, &[0x03], "03h (CCW, scaling on)"),
            (0x0A, &[0xFF, 0xFF, 0xFF, 0xFF], "-1"),
            (0x03, &[0x45, 0x23, 0x01, 0x00], "74565"),
        ] {
            let attribute = attribute(0x23, 1, id).unwrap();
            let value = attribute.decode(data).unwrap();
            assert_eq!(attribute.in_words(value).to_string(), said);
        }
        // X11 sets attribute 73h, which is the maker's own.
        assert!(attribute(0x23, 1, 0x73).is_none());
    }
}
