//! Codes about nodes: who is there, and what does not belong on the bus.

use super::super::layer::kind;
use super::{ERRORS, PLUG, RATE, SUPPLY, SWITCHES, TERMINATION};
use crate::finding::{Code, Cure, Severity};

/// A reserved or invalid identifier is used.
pub static RESERVED_ID: Code = Code {
    name: "devicenet.reserved-id",
    severity: Severity::Error,
    is_cause: false,
    meaning: "A frame has an identifier that DeviceNet reserves or forbids.",
    rule: "7C0h to 7EBh are reserved, 7F0h to 7FFh must never appear (CIP Vol. 3, chapter 3: message groups).",
    evidence: "The identifier as received.",
    causes: &[
        "a device that does not speak DeviceNet is on the bus: CANopen uses 7xxh for its heartbeat",
        "the tap or a gateway alters identifiers",
        "the bus is no DeviceNet bus at all",
    ],
    next: &[
        "unplug devices one after the other until it is gone",
        "read with --protocol can if nothing else looks like DeviceNet",
    ],
    cure: Cure {
        one: "look for a foreign device with the identifiers",
        all: "read with --protocol can",
    },
    say: |_, record, out| {
        let id = record.frame().map_or(0, |frame| frame.id.value());
        write!(out, "identifier {id:03X}h is reserved")
    },
};

/// Two nodes have the same MAC ID.
pub static DUPLICATE_MAC: Code = Code {
    name: "devicenet.duplicate-mac",
    severity: Severity::Error,
    is_cause: true,
    meaning: "Two nodes have the same MAC ID: the second one must not go on line.",
    rule: "Before it goes on line, a node asks twice, 1 s apart, whether its MAC ID is taken; a node that is on line answers (CIP Vol. 3, chapter 6: duplicate MAC ID detection).",
    evidence: "An answer to such a request, or a request with another vendor or serial number than the node's. Both are told where both are seen.",
    causes: &[
        "two encoders have the same setting of the rotary switches",
        "a new device came with the MAC ID of delivery, 63 on most, while another is 63",
        "a node was exchanged: then the new one has another serial number, and this is no fault",
    ],
    next: &[
        SWITCHES,
        "unplug the node that was installed last: the DUO LED of a duplicate is red",
        "compare vendor and serial number of the record with the labels",
    ],
    cure: Cure { one: "compare the MAC ID switches", all: "compare all MAC ID switches" },
    say: |_, record, out| {
        let mac = record.station.unwrap_or_default();
        match record.kind {
            kind::DUP_MAC_RESPONSE => {
                write!(out, "MAC ID {mac} is taken: a second node is kept off the bus")
            }
            _ => write!(out, "another node than before asks for MAC ID {mac}"),
        }
    },
};

/// A node reports a fault of its own.
pub static DEVICE_FAULT: Code = Code {
    name: "devicenet.device-fault",
    severity: Severity::Error,
    is_cause: true,
    meaning: "A node reports a fault of its own in its heartbeat.",
    rule: "Heartbeat: state 4 is a major recoverable fault, 5 a major unrecoverable one; the flags DF, UF and SF stand for device, user and system fault (CIP Vol. 3, chapter 4: device heartbeat).",
    evidence: "State and flags of the heartbeat. Told when it begins and when it ends.",
    causes: &[
        "the device found a fault in itself: see its manual",
        "its configuration was lost or does not fit",
    ],
    next: &[
        "read its status: class 1 instance 1 attribute 5",
        "switch it off and on; if the fault comes back, replace it",
        SUPPLY,
    ],
    cure: Cure { one: "read status (class 1 attribute 5)", all: "check the network supply" },
    say: |finding, record, out| {
        write!(out, "node {} reports a fault", record.station.unwrap_or_default())?;
        match finding.actual {
            Some(state) => write!(out, ", state {state}"),
            None => Ok(()),
        }
    },
};

/// A frame that DeviceNet does not have.
pub static FOREIGN_FRAME: Code = Code {
    name: "devicenet.foreign-frame",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "A frame is on the bus that DeviceNet does not have: 29-bit identifier, remote or CAN FD.",
    rule: "DeviceNet uses data frames with 11-bit identifiers (CIP Vol. 3, chapter 3).",
    evidence: "The frame as received.",
    causes: &[
        "a device of another CAN protocol is on the bus",
        "a tool sends test frames",
        "CAN FD devices destroy the frames of others: they must not be on this bus",
    ],
    next: &["unplug devices one after the other until it is gone", TERMINATION],
    cure: Cure {
        one: "look for a foreign device with the identifiers",
        all: "unplug foreign devices",
    },
    say: |_, record, out| match record.frame() {
        Some(frame) if frame.id.is_extended() => {
            write!(out, "29-bit identifier: no DeviceNet frame")
        }
        Some(frame) if frame.kind == crate::can::FrameKind::Fd => {
            write!(out, "CAN FD: no DeviceNet frame")
        }
        _ => write!(out, "remote frame: DeviceNet has none"),
    },
};

/// A node that was on line checks its MAC ID anew.
pub static NODE_RESTART: Code = Code {
    name: "devicenet.node-restart",
    severity: Severity::Warning,
    is_cause: true,
    meaning: "A node that was on line started anew: its connections are gone.",
    rule: "A node checks its MAC ID when it starts, after a reset, and after bus-off (CIP Vol. 3, chapter 6).",
    evidence: "Its duplicate MAC ID check within 10 s of its last frame, not answered, with the same serial number. Told on the second request, or 1 s after the first. Requests that follow each other for want of an acknowledge are one check. Error frames since the node's last frame are counted: they make bus-off likely, without them look at its supply first.",
    causes: &[
        "its supply breaks down: a loose plug, a long thin cable, too many nodes on one supply",
        "it was reset by a tool, or by its own watchdog",
        "it went bus-off after errors on the wire",
    ],
    next: &[SUPPLY, PLUG, ERRORS, "look for a Reset (service 05h, class 1) shortly before"],
    cure: Cure { one: "check supply and plug", all: "check the network supply" },
    say: |finding, record, out| {
        write!(out, "node {} started anew", record.station.unwrap_or_default())?;
        match finding.actual {
            Some(1) => write!(out, " after an error frame: it may have been bus-off"),
            Some(errors) => write!(out, " after {errors} error frames: it may have been bus-off"),
            None => Ok(()),
        }
    },
};

/// A node announces that it goes off line.
pub static SHUTDOWN: Code = Code {
    name: "devicenet.shutdown",
    severity: Severity::Warning,
    is_cause: true,
    meaning: "A node announces that it goes off line.",
    rule: "Device shutdown message with class, instance and code; codes up to 1FFh are defined, 200h to 2FFh the vendor's, 300h to 4FFh the class's (CIP Vol. 3, chapter 4).",
    evidence: "The message as received.",
    causes: &[
        "somebody reset the device or changed its MAC ID or bit rate",
        "the device found a fault that it cannot live with",
    ],
    next: &[
        "look the shutdown code up in the device's manual",
        "look for a Reset or a Set of class 3 shortly before",
        SWITCHES,
        RATE,
    ],
    cure: Cure { one: "look the code up in the manual", all: "look the codes up" },
    say: |finding, record, out| {
        let code = finding.actual.unwrap_or_default();
        write!(out, "node {} goes off line, code {code:04X}h", record.station.unwrap_or_default())
    },
};
