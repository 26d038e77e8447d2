//! The objects of every DeviceNet device: their attributes.
//!
//! Access is that of the predefined master/slave set; devices differ, and so a refused or accepted
//! write proves more than these tables.

use super::attribute::{Attribute, Bit, Words, attributes, find};
use super::names::{device_type_name, vendor_name};
use super::{DataType, POSITION_SENSOR, class};
use core::fmt;

/// An attribute of a class that CIP defines. Instance 0 is the class itself.
#[must_use]
pub fn attribute(class: u16, instance: u16, attribute: u8) -> Option<&'static Attribute> {
    if instance == 0 {
        let own = if class == class::PARAMETER { find(PARAMETER_CLASS, attribute) } else { None };
        return own.or_else(|| find(CLASS, attribute));
    }
    find(table(class)?, attribute)
}

fn table(class: u16) -> Option<&'static [Attribute]> {
    Some(match class {
        class::IDENTITY => IDENTITY,
        class::MESSAGE_ROUTER => MESSAGE_ROUTER,
        class::DEVICENET => DEVICENET,
        class::ASSEMBLY => ASSEMBLY,
        class::CONNECTION => CONNECTION,
        class::PARAMETER => PARAMETER,
        class::POSITION_SENSOR => POSITION_SENSOR,
        class::ACKNOWLEDGE_HANDLER => ACKNOWLEDGE_HANDLER,
        _ => return None,
    })
}

attributes! {
    /// Attributes of a class itself (CIP Vol. 1 §4-4).
    pub static CLASS {
        1 Get "Revision"                     Uint;
        2 Get "Max instance"                 Uint;
        3 Get "Number of instances"          Uint;
        4 Get "Optional attribute list"      CountedUintList;
        5 Get "Optional service list"        CountedUintList;
        6 Get "Max class attribute ID"       Uint;
        7 Get "Max instance attribute ID"    Uint;
    }
}

attributes! {
    /// Identity, class 01h (CIP Vol. 1 §5-2).
    pub static IDENTITY {
        1  Get    "Vendor ID"                       Uint        is Words::Named(vendor_name);
        2  Get    "Device type"                     Uint        is Words::Named(device_type_name);
        3  Get    "Product code"                    Uint;
        4  Get    "Revision"                        Revision;
        5  Get    "Status"                          Word        is Words::Told(tell_status);
        6  Get    "Serial number"                   Udint       is Words::Told(tell_serial);
        7  Get    "Product name"                    ShortString;
        8  Get    "State"                           Usint       is Words::OneOf(DEVICE_STATES);
        9  Get    "Configuration consistency value" Uint;
        10 GetSet "Heartbeat interval"              Usint       in "s";
    }
}

const DEVICE_STATES: &[(u16, &str)] = &[
    (0, "nonexistent"),
    (1, "self-testing"),
    (2, "standby"),
    (3, "operational"),
    (4, "major recoverable fault"),
    (5, "major unrecoverable fault"),
];

/// Identity attribute 5: single bits, and what is going on in bits 4 to 7.
fn tell_status(status: i64, out: &mut fmt::Formatter<'_>) -> fmt::Result {
    const BITS: [(u8, &str); 5] = [
        (2, "configured"),
        (8, "minor recoverable fault"),
        (9, "minor unrecoverable fault"),
        (10, "major recoverable fault"),
        (11, "major unrecoverable fault"),
    ];
    const EXTENDED: [&str; 8] = [
        "",
        "firmware update",
        "I/O connection faulted",
        "no I/O connection",
        "non-volatile configuration bad",
        "major fault",
        "I/O connection in run",
        "I/O connections idle",
    ];
    write!(out, "{}", if status & 1 == 1 { "owned" } else { "not owned" })?;
    for (bit, word) in BITS {
        if status >> bit & 1 == 1 {
            write!(out, ", {word}")?;
        }
    }
    match EXTENDED.get((status >> 4 & 0xF) as usize) {
        Some(word) if !word.is_empty() => write!(out, ", {word}"),
        _ => Ok(()),
    }
}

/// Serial numbers are printed in hex on labels.
fn tell_serial(serial: i64, out: &mut fmt::Formatter<'_>) -> fmt::Result {
    write!(out, "{serial:08X}h")
}

attributes! {
    /// Message Router, class 02h (CIP Vol. 1 §5-3).
    pub static MESSAGE_ROUTER {
        1 Get "Object list"        CountedUintList;
        2 Get "Number available"   Uint;
        3 Get "Number active"      Uint;
        4 Get "Active connections" UintList;
    }
}

attributes! {
    /// DeviceNet, class 03h (CIP Vol. 3 §5-3).
    pub static DEVICENET {
        1  GetSet "MAC ID"                 Usint;
        2  GetSet "Baud rate"              Usint is Words::OneOf(BIT_RATES);
        3  GetSet "Bus-off interrupt"      Bool  is Words::OneOf(BUS_OFF);
        4  GetSet "Bus-off counter"        Usint;
        5  Get    "Allocation information" Allocation;
        6  Get    "MAC ID switch changed"  Bool  is Words::OneOf(CHANGED);
        7  Get    "Baud rate switch changed" Bool is Words::OneOf(CHANGED);
        8  Get    "MAC ID switch value"    Usint;
        9  Get    "Baud rate switch value" Usint is Words::OneOf(BIT_RATES);
        10 GetSet "QuickConnect"           Bool  is Words::OneOf(OFF_ON);
        11 Get    "Safety network number"  Bytes(6);
        12 Get    "Diagnostic counters"    Raw;
        13 Get    "Active node table"      Bytes(8);
    }
}

const BIT_RATES: &[(u16, &str)] = &[(0, "125 kbit/s"), (1, "250 kbit/s"), (2, "500 kbit/s")];
const BUS_OFF: &[(u16, &str)] = &[(0, "stay bus-off"), (1, "reset and go on")];
const CHANGED: &[(u16, &str)] = &[(0, "not since the last reset"), (1, "since the last reset")];
const OFF_ON: &[(u16, &str)] = &[(0, "off"), (1, "on")];

attributes! {
    /// Assembly, class 04h (CIP Vol. 1 §5-5).
    pub static ASSEMBLY {
        1 Get    "Number of members" Uint;
        2 GetSet "Member list"       Raw;
        3 GetSet "Data"              Raw;
        4 Get    "Size"              Uint in "bytes";
    }
}

attributes! {
    /// Connection, class 05h (CIP Vol. 3 §5-4).
    pub static CONNECTION {
        1   Get    "State"                                Usint is Words::OneOf(STATES);
        2   Get    "Instance type"                        Usint is Words::OneOf(INSTANCE_TYPES);
        3   GetSet "Transport class trigger"              Byte  is Words::Told(tell_transport);
        4   GetSet "Produced connection ID"               Uint  is Words::Told(tell_can_id);
        5   GetSet "Consumed connection ID"               Uint  is Words::Told(tell_can_id);
        6   GetSet "Initial communication characteristics" Byte is Words::Told(tell_initial);
        7   GetSet "Produced connection size"             Uint  in "bytes";
        8   GetSet "Consumed connection size"             Uint  in "bytes";
        9   GetSet "Expected packet rate"                 Uint  in "ms";
        10  GetSet "CIP produced connection ID"           Udint;
        11  GetSet "CIP consumed connection ID"           Udint;
        12  GetSet "Watchdog time-out action"             Usint is Words::OneOf(WATCHDOG);
        13  Get    "Produced connection path length"      Uint  in "bytes";
        14  GetSet "Produced connection path"             Epath;
        15  Get    "Consumed connection path length"      Uint  in "bytes";
        16  GetSet "Consumed connection path"             Epath;
        17  GetSet "Production inhibit time"              Uint  in "ms";
        18  GetSet "Connection time-out multiplier"       Usint is Words::OneOf(MULTIPLIERS);
        19  Get    "Connection binding list"              Raw;
        // Rockwell and Hilscher devices.
        100 GetSet "Consumed assembly"                    Usint;
        101 GetSet "Produced assembly"                    Usint;
    }
}

const STATES: &[(u16, &str)] = &[
    (0, "nonexistent"),
    (1, "configuring"),
    (2, "waiting for connection ID"),
    (3, "established"),
    (4, "timed out"),
    (5, "deferred delete"),
    (6, "closing"),
];
const INSTANCE_TYPES: &[(u16, &str)] = &[(0, "explicit"), (1, "I/O"), (2, "bridged")];
const WATCHDOG: &[(u16, &str)] =
    &[(0, "timed out"), (1, "auto delete"), (2, "auto reset"), (3, "deferred delete")];
const MULTIPLIERS: &[(u16, &str)] = &[
    (0, "x 4"),
    (1, "x 8"),
    (2, "x 16"),
    (3, "x 32"),
    (4, "x 64"),
    (5, "x 128"),
    (6, "x 256"),
    (7, "x 512"),
];

/// Direction in bit 7, trigger in bits 4 to 6, class in bits 0 to 3. A server has no trigger of
/// its own, though some devices fill it in.
fn tell_transport(byte: i64, out: &mut fmt::Formatter<'_>) -> fmt::Result {
    let class = byte & 0xF;
    if byte & 0x80 != 0 {
        return write!(out, "server, class {class}");
    }
    let trigger = match byte >> 4 & 0b111 {
        0 => "cyclic",
        1 => "change of state",
        2 => "application",
        _ => "reserved trigger",
    };
    write!(out, "client, {trigger}, class {class}")
}

fn tell_can_id(id: i64, out: &mut fmt::Formatter<'_>) -> fmt::Result {
    if id == 0xFFFF { write!(out, "none") } else { write!(out, "{id:03X}h") }
}

/// How messages are sent, in the high nibble, and how received, in the low one.
fn tell_initial(byte: i64, out: &mut fmt::Formatter<'_>) -> fmt::Result {
    let word = |nibble| match nibble {
        0x0 => "group 1",
        0x1 => "group 2 destination MAC ID",
        0x2 => "group 2 source MAC ID",
        0x3 => "group 3",
        0xF => "nothing",
        _ => "reserved",
    };
    write!(out, "produces {}, consumes {}", word(byte >> 4 & 0xF), word(byte & 0xF))
}

attributes! {
    /// Parameter, class 0Fh (CIP Vol. 1 §5-14): 1 to 6 of a stub, 7 to 24 of a full instance.
    pub static PARAMETER {
        1  GetSet "Parameter value"     Raw;
        2  Get    "Link path size"      Usint in "bytes";
        3  GetSet "Link path"           Epath;
        4  Get    "Descriptor"          Word  is Words::Bits(DESCRIPTOR);
        5  Get    "Data type"           Usint is Words::Named(data_type_name);
        6  Get    "Data size"           Usint in "bytes";
        7  Get    "Parameter name"      ShortString;
        8  Get    "Units"               ShortString;
        9  Get    "Help"                ShortString;
        10 Get    "Minimum value"       Raw;
        11 Get    "Maximum value"       Raw;
        12 Get    "Default value"       Raw;
        13 Get    "Scaling multiplier"  Uint;
        14 Get    "Scaling divisor"     Uint;
        15 Get    "Scaling base"        Uint;
        16 Get    "Scaling offset"      Int;
        17 Get    "Multiplier link"     Uint;
        18 Get    "Divisor link"        Uint;
        19 Get    "Base link"           Uint;
        20 Get    "Offset link"         Uint;
        21 Get    "Decimal precision"   Usint;
        22 Get    "International name"  Stringi;
        23 Get    "International units" Stringi;
        24 Get    "International help"  Stringi;
    }
}

attributes! {
    /// What the class Parameter has besides other classes.
    static PARAMETER_CLASS {
        8  Get    "Parameter class descriptor"      Word is Words::Bits(CLASS_DESCRIPTOR);
        9  Get    "Configuration assembly instance" Uint;
        10 GetSet "Native language"                 Usint is Words::OneOf(&[(1, "English")]);
    }
}

const DESCRIPTOR: &[Bit] = &[
    Bit { number: 0, set: "settable path", clear: "" },
    Bit { number: 1, set: "enumerated", clear: "" },
    Bit { number: 2, set: "scaled", clear: "" },
    Bit { number: 3, set: "scaling links", clear: "" },
    Bit { number: 4, set: "read only", clear: "" },
    Bit { number: 5, set: "monitored", clear: "" },
    Bit { number: 6, set: "extended precision", clear: "" },
];
const CLASS_DESCRIPTOR: &[Bit] = &[
    Bit { number: 0, set: "instances", clear: "no instances" },
    Bit { number: 1, set: "full attributes", clear: "stubs" },
];

fn data_type_name(code: u16) -> Option<&'static str> {
    DataType::of_code(code.try_into().ok()?).map(DataType::name)
}

attributes! {
    /// Acknowledge Handler, class 2Bh (CIP Vol. 3 §5-5).
    pub static ACKNOWLEDGE_HANDLER {
        1 GetSet "Acknowledge timer"                 Uint in "ms";
        2 GetSet "Retry limit"                       Usint;
        3 GetSet "COS producing connection instance" Uint;
        4 Get    "Ack list size"                     Byte;
        5 Get    "Ack list"                          ByteCountedUintList;
        6 Get    "Data with ack path list size"      Byte;
        7 Get    "Data with ack path list"           Raw;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::{String, ToString};

    /// What an attribute's bytes say, in words.
    fn said(class: u16, instance: u16, id: u8, data: &[u8]) -> String {
        let attribute = attribute(class, instance, id).unwrap();
        attribute.in_words(attribute.decode(data).unwrap()).to_string()
    }

    #[test]
    fn tables_are_in_order_and_complete() {
        for (table, count) in [
            (CLASS, 7),
            (IDENTITY, 10),
            (MESSAGE_ROUTER, 4),
            (DEVICENET, 13),
            (ASSEMBLY, 4),
            (CONNECTION, 21),
            (PARAMETER, 24),
            (ACKNOWLEDGE_HANDLER, 7),
        ] {
            assert_eq!(table.len(), count);
            assert!(table.is_sorted_by(|a, b| a.id < b.id));
        }
    }

    #[test]
    fn identity() {
        // X01 and X20.
        assert_eq!(said(1, 1, 1, &[0x36, 0x00]), "54");
        assert_eq!(said(1, 1, 1, &[0x01, 0x00]), "1 (Rockwell Automation/Allen-Bradley)");
        assert_eq!(said(1, 1, 2, &[0x22, 0x00]), "34 (encoder)");
        assert_eq!(said(1, 1, 4, &[0x02, 0x02]), "2.2");
        assert_eq!(said(1, 1, 6, &[0x92, 0x39, 0x60, 0x60]), "1616918930 (60603992h)");
        assert_eq!(said(1, 1, 7, b"\x06AMG 11"), "AMG 11");
        assert_eq!(said(1, 1, 8, &[3]), "3 (operational)");
        assert_eq!(said(1, 1, 5, &[0x00, 0x00]), "0000h (not owned)");
        let run = said(1, 1, 5, &[0x65, 0x01]);
        let expected = "0165h (owned, configured, minor recoverable fault, I/O connection in run)";
        assert_eq!(run, expected);
    }

    #[test]
    fn connections() {
        assert_eq!(said(5, 1, 1, &[3]), "3 (established)");
        assert_eq!(said(5, 4, 1, &[4]), "4 (timed out)");
        assert_eq!(said(5, 1, 3, &[0x83]), "83h (server, class 3)");
        assert_eq!(said(5, 4, 3, &[0x12]), "12h (client, change of state, class 2)");
        assert_eq!(said(5, 4, 3, &[0x02]), "02h (client, cyclic, class 2)");
        assert_eq!(said(5, 4, 5, &[0xFF, 0xFF]), "65535 (none)");
        // The explicit connection of MAC ID 63: 5FBh.
        assert_eq!(said(5, 1, 4, &[0xFB, 0x05]), "1531 (5FBh)");
        let both = "21h (produces group 2 source MAC ID, consumes group 2 destination MAC ID)";
        assert_eq!(said(5, 1, 6, &[0x21]), both);
        // X14: the rate that the slave uses.
        assert_eq!(said(5, 4, 9, &[0x10, 0x0E]), "3600 ms");
        // X20: the scanner's choice.
        assert_eq!(said(5, 1, 12, &[3]), "3 (deferred delete)");
        assert_eq!(said(5, 2, 14, &[0x20, 0x04, 0x24, 0x02]), "20 04 24 02 (Assembly 2)");
        assert_eq!(said(5, 2, 14, &[0x20, 0x04, 0x24]), "200424");
    }

    #[test]
    fn the_node_itself() {
        assert_eq!(said(3, 1, 2, &[2]), "2 (500 kbit/s)");
        assert_eq!(said(3, 1, 5, &[0x03, 0x0A]), "master 10: explicit, poll");
        assert_eq!(said(3, 1, 5, &[0x00, 0xFF]), "not owned");
        assert_eq!(said(3, 1, 3, &[0]), "0 (stay bus-off)");
        assert_eq!(said(3, 0, 1, &[2, 0]), "2");
        assert_eq!(said(0x2B, 1, 1, &[16, 0]), "16 ms");
    }

    #[test]
    fn parameters() {
        assert_eq!(said(0x0F, 7, 4, &[0x14, 0x00]), "0014h (scaled, read only)");
        assert_eq!(said(0x0F, 7, 5, &[0xC8]), "200 (UDINT)");
        assert_eq!(said(0x0F, 0, 8, &[0x03, 0x00]), "0003h (instances, full attributes)");
        // 8 of an instance is something else.
        assert_eq!(said(0x0F, 7, 8, b"\x02ms"), "ms");
    }

    #[test]
    fn what_cip_does_not_define_has_no_table() {
        assert!(attribute(0x2F, 1, 12).is_none());
        assert!(attribute(0x64, 1, 1).is_none());
        assert!(attribute(0x05, 1, 20).is_none());
    }
}
