//! Finding codes of encoders on DeviceNet.

use super::baumer::{self, Command};
use crate::devicenet::cip::class;
use crate::field::Value;
use crate::finding::{Code, Cure, Finding, Severity};
use crate::record::Record;
use core::fmt;

/// All of them.
pub static CODES: [&Code; 9] = [
    &ALARM,
    &WARNING,
    &VALUE_OUT_OF_RANGE,
    &NOT_SETTABLE,
    &UNSAVED_PARAMETER,
    &PRESET_WHILE_MOVING,
    &POSITION_OUT_OF_RANGE,
    &TURNS_NOT_POWER_OF_TWO,
    &WRITTEN,
];

const BOUND: &str = "is the station bound to the right profile? --device STATION=baumer-encoder says so, or the product code 0Ah or 0Bh with a successful access to class 2Fh or an EDS that has it";

/// The encoder says that its position may be wrong.
pub static ALARM: Code = Code {
    name: "encoder.alarm",
    severity: Severity::Error,
    is_cause: false,
    meaning: "The encoder says that its position may be wrong.",
    rule: "Alarm flag of assembly 2 or attribute 85, bit 0 of attribute 83: position error, the only alarm that is defined (Baumer DeviceNet manual §6, §8).",
    evidence: "The flag as it was sent, with the time of the first and last message that had it. The encoder clears it by itself after 2.5 s: a slow poll may miss it. Assembly 1, the default, carries no flags: then nothing is known. Of encoders with CIP's position sensor (class 23h) only the flag is read: what it stands for is in attribute 2Ch.",
    causes: &[
        "the code disc or its scanning is dirty or damaged",
        "strong vibration, or a shaft that turns faster than allowed",
        "interference at the encoder's supply",
    ],
    next: &[
        "compare the position with the machine: is it off, and does it stay so?",
        "check the supply at the encoder while the drive accelerates",
        "if it comes back, have the encoder checked",
        BOUND,
    ],
    cure: Cure { one: "check disc and supply", all: "check the encoders and their supply" },
    say: |_, _, out| write!(out, "alarm: position error, the only one that Baumer defines"),
};

/// The encoder says that something is out of tolerance; its position is right.
pub static WARNING: Code = Code {
    name: "encoder.warning",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "The encoder says that something is out of tolerance; its position is right.",
    rule: "Warning flag of assembly 2 or attribute 88, bit 4 of attribute 86: lithium cell, the only warning that is defined (Baumer DeviceNet manual §6, §8).",
    evidence: "The flag as it was sent. Assembly 1, the default, carries no flags: then nothing is known. Of encoders with CIP's position sensor (class 23h) only the flag is read: what it stands for is in attribute 2Fh.",
    causes: &["the lithium cell, which counts turns while the supply is off, is empty"],
    next: &["have the cell replaced with the supply on: without both, the turns are lost", BOUND],
    cure: Cure { one: "replace the lithium cell", all: "replace the lithium cells" },
    say: |_, _, out| write!(out, "warning: lithium cell, the only one that Baumer defines"),
};

/// A value was written that the encoder cannot take.
pub static VALUE_OUT_OF_RANGE: Code = Code {
    name: "encoder.value-out-of-range",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "A value was written that the encoder cannot take.",
    rule: "The ranges of the manual: steps per turn 1 to 8192, total resolution 1 to 2^29 (8192 for a singleturn encoder), preset 0 to total resolution - 1, COS delta 1 to total resolution, sense of rotation 0 or 1 (Baumer DeviceNet manual §4, §8).",
    evidence: "The value of the Set request against the range; the total resolution as it was last seen, else the highest.",
    causes: &[
        "the program writes a value of another encoder",
        "bytes in the wrong order, or another length",
    ],
    next: &["compare the value with the data sheet of this encoder", BOUND],
    cure: Cure { one: "check the program that writes parameters", all: "check the values written" },
    say: |finding, _, out| match (finding.actual, finding.expected, finding.limit) {
        (Some(value), Some(lowest), Some(highest)) => {
            write!(out, "{value} is out of range: {lowest} to {highest}")
        }
        _ => write!(out, "the value has the wrong length"),
    },
};

/// An attribute was written that can only be read.
pub static NOT_SETTABLE: Code = Code {
    name: "encoder.not-settable",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "An attribute was written that can only be read.",
    rule: "Access column of the object dictionary (Baumer DeviceNet manual §8).",
    evidence: "The attribute of the Set request against the manual's table.",
    causes: &[
        "the program writes to the wrong attribute",
        "the parameter list skips some attributes: parameter 9 is attribute 12",
    ],
    next: &["compare class, instance and attribute with the manual's table", BOUND],
    cure: Cure {
        one: "check the program that writes attributes",
        all: "check the attributes written",
    },
    say: |_, record, out| match record.named("devicenet.attribute_name") {
        Value::Text(_) => write!(out, "this attribute can only be read"),
        _ => write!(out, "the encoder has no such attribute"),
    },
};

/// Parameters were written, and the encoder restarted before they were saved: they have their old values again.
pub static UNSAVED_PARAMETER: Code = Code {
    name: "encoder.unsaved-parameter",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "Parameters were written, and the encoder restarted before they were saved: they have their old values again.",
    rule: "A Set is volatile until the service Save, 16h (Baumer DeviceNet manual §7).",
    evidence: "Set responses with success, no successful Save after them, and then a restart of the same node.",
    causes: &["the program sends no Save", "the supply failed between Set and Save"],
    next: &[
        "send Save (16h) to class 2Fh or 0Fh, instance 1, after the last Set",
        "read the values back after the restart",
    ],
    cure: Cure { one: "save the parameters", all: "send Save after Set" },
    say: |finding, _, out| match finding.actual {
        Some(1) => write!(out, "one written parameter was not saved before the restart"),
        count => {
            let count = count.unwrap_or_default();
            write!(out, "{count} written parameters were not saved before the restart")
        }
    },
};

/// The preset was written while the shaft was moving: the position is off by as much as it moved meanwhile.
pub static PRESET_WHILE_MOVING: Code = Code {
    name: "encoder.preset-while-moving",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "The preset was written while the shaft was moving: the position is off by as much as it moved meanwhile.",
    rule: "A preset is to be set at standstill (Baumer DeviceNet manual §8).",
    evidence: "The last two positions before the Set request differ by more than two steps; or they differ at all, and by more than two from one up to a quarter of a second before. The last is not older than twice the time between them.",
    causes: &["the program does not wait for standstill", "the axis is not braked"],
    next: &[
        "stop the axis, then preset",
        "compare the position after the preset with the preset value",
    ],
    cure: Cure { one: "stop the axis before the preset", all: "preset at standstill" },
    say: |finding, _, out| {
        let steps = finding.actual.unwrap_or_default();
        write!(out, "preset while the shaft moves: {steps} steps just before")
    },
};

/// A position is beyond the total resolution.
pub static POSITION_OUT_OF_RANGE: Code = Code {
    name: "encoder.position-out-of-range",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "A position is beyond the total resolution.",
    rule: "Positions go from 0 to the total resolution (Baumer DeviceNet manual §8; the manual's tables do not agree whether the total itself is one).",
    evidence: "The position as sent, and the total resolution as it was read or written in this capture; not judged without that.",
    causes: &[
        "the total resolution was changed and the encoder not restarted",
        "another device, or another assembly, than the profile is for",
    ],
    next: &["read attribute 8 of class 2Fh again", BOUND],
    cure: Cure { one: "read the total resolution", all: "read the total resolutions" },
    say: |finding, _, out| {
        let (position, total) =
            (finding.actual.unwrap_or_default(), finding.limit.unwrap_or_default());
        write!(out, "position {position} is beyond the total resolution {total}")
    },
};

/// The number of turns is no power of two: the encoder loses its place when it is turned past zero without power.
pub static TURNS_NOT_POWER_OF_TWO: Code = Code {
    name: "encoder.turns-not-power-of-two",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "The number of turns is no power of two: the encoder loses its place when it is turned past zero without power.",
    rule: "Turns are total resolution ÷ steps per turn; if not 1, 2, 4 … 65536, parameterizing has to be done anew after the zero point was passed without power (Baumer DeviceNet manual §8).",
    evidence: "Both numbers as they were read or written in this capture. 3600 x 256 is healthy: the steps need not be a power of two.",
    causes: &["the total resolution was chosen freely"],
    next: &[
        "choose turns of 1, 2, 4 … and the steps as needed",
        "or parameterize anew after every power failure",
    ],
    cure: Cure { one: "change the total resolution", all: "change the total resolutions" },
    say: |finding, _, out| match finding.actual {
        Some(turns) => write!(out, "{turns} turns are no power of two"),
        None => write!(out, "the turns are no whole number"),
    },
};

/// A parameter of the encoder was changed, saved, restored or reset.
pub static WRITTEN: Code = Code {
    name: "encoder.written",
    severity: Severity::Info,
    is_cause: false,
    meaning: "A parameter of the encoder was changed, saved, restored or reset.",
    rule: "Services 05h Reset, 10h Set_Attribute_Single, 15h Restore, 16h Save (Baumer DeviceNet manual §7).",
    evidence: "The encoder's response with success. The old value is told if it was seen in this capture.",
    causes: &["commissioning", "a program that writes parameters at every start"],
    next: &[
        "compare the new value with what the machine needs",
        "see whether Save follows: else the value is lost at the next restart",
    ],
    cure: Cure { one: "compare the values", all: "compare the values" },
    say: |finding, record, out| say_written(finding, record, out),
};

/// Who wrote, what, from and to what, and whether it stays.
fn say_written(finding: &Finding, record: &Record<'_>, out: &mut dyn fmt::Write) -> fmt::Result {
    let number = |name| match record.named(name) {
        Value::Int(number) => Some(number),
        _ => None,
    };
    match number("devicenet.destination") {
        Some(master) => write!(out, "{master} ")?,
        None => write!(out, "somebody ")?,
    }
    let class = number("devicenet.class").and_then(|class| u16::try_from(class).ok());
    let service = number("devicenet.service_code").and_then(|code| u8::try_from(code).ok());
    let command = class.zip(service).and_then(|(class, code)| Command::of(class, code));
    if let Some(command) = command {
        return write!(out, "had the encoder act on its parameters: it {}", command.effect());
    }
    match record.named("devicenet.attribute_name") {
        Value::Text(name) => write!(out, "set {name}")?,
        _ => write!(out, "set a parameter")?,
    }
    if let Some(old) = finding.expected {
        write!(out, " from {old}")?;
    }
    let attribute = number("devicenet.attribute").and_then(|id| u8::try_from(id).ok());
    let is_path = class.zip(attribute).is_some_and(|(c, a)| baumer::is_saved_at_once(c, a));
    if let Some(new) = finding.actual {
        write!(out, " to {}{new}", if is_path { "assembly " } else { "" })?;
    }
    match class {
        Some(class::CONNECTION) if is_path => write!(out, ", saved at once"),
        // Whether other profiles save at once, no source tells.
        Some(class::PARAMETER | baumer::ENCODER_POSITION) => write!(out, ", not saved yet"),
        _ => Ok(()),
    }
}
