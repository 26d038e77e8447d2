//! Codes about explicit messages.

use super::super::cip::Refusal;
use super::super::layer;
use super::{ERRORS, LENGTHS, PLUG, SUPPLY, SWITCHES, TERMINATION};
use crate::field::Value;
use crate::finding::{Code, Cure, Severity, Span};
use crate::record::Record;
use core::fmt;

/// The status of the error response that a record is, in words.
fn refusal(record: &Record<'_>, out: &mut dyn fmt::Write) -> fmt::Result {
    let number = |name| match record.named(name) {
        Value::Int(number) => u8::try_from(number).ok(),
        _ => None,
    };
    let [general, additional] =
        ["devicenet.error.general", "devicenet.error.additional"].map(number);
    let (Some(general), Some(additional)) = (general, additional) else {
        return write!(out, " without a status");
    };
    let is_of_allocation = record.kind == layer::kind::UNCONNECTED_RESPONSE
        || [number("devicenet.class"), number("devicenet.instance")] == [Some(3), Some(1)];
    write!(out, ": status {}", Refusal { general, additional, is_of_allocation })
}

/// A message is not built as it must be.
pub static MALFORMED: Code = Code {
    name: "devicenet.malformed",
    severity: Severity::Error,
    is_cause: false,
    meaning: "A message is not built as the specification says.",
    rule: "Services 00, 14 (as a request), 1E to 31 and 64 to 7F are reserved; the R/R bit fits the identifier; the unconnected ports take Allocate and Release, or Open and Close, only; lengths are those of the service (CIP Vol. 1, appendix A; CIP Vol. 3, chapter 4).",
    evidence: "The bytes of the message; `defect` says what is wrong. Lengths are not judged where the message body format is only assumed.",
    causes: &[
        "a master program or a tool builds messages by hand",
        "the device does not keep to the specification",
        "what is on this identifier is no DeviceNet message",
    ],
    next: &[
        "compare the bytes with the device's manual",
        "see whether it always comes from the same node: then it is its program",
    ],
    cure: Cure { one: "compare with the manual", all: "compare with the manuals" },
    say: |_, record, out| match record.get(layer::DEFECT) {
        Value::Text(defect) => write!(out, "malformed: {defect}"),
        _ => write!(out, "malformed"),
    },
};

/// Nobody answered an explicit request.
pub static NO_RESPONSE: Code = Code {
    name: "devicenet.no-response",
    severity: Severity::Error,
    is_cause: false,
    meaning: "An explicit request was not answered.",
    rule: "Every request has an answer, be it an error (CIP Vol. 3, chapter 4). No time is specified: 1 s is the limit here, counted from the acknowledgement of the last fragment where there are several.",
    evidence: "Nothing that fits the request by server, client, transaction id and service came in time. From the third in a row on it is told once, when it begins, and when it ends. An Open that nobody answers is normal.",
    causes: &[
        "there is no node with that MAC ID: switched off, unplugged, another switch setting",
        "the node has no connection to this master: it ignores the request",
        "the node is busy, or restarts",
    ],
    next: &[
        SWITCHES,
        SUPPLY,
        PLUG,
        "see whether another master owns the node: class 3 instance 1 attribute 5",
    ],
    cure: Cure { one: "check switches, supply and plug", all: "check supply and trunk" },
    say: |finding, record, out| {
        let limit = Span(finding.limit.unwrap_or_default());
        match (record.station, finding.state) {
            (Some(station), Some(_)) => write!(out, "node {station} does not answer any more"),
            (Some(station), None) => write!(out, "node {station} did not answer within {limit}"),
            _ => write!(out, "no answer"),
        }
    },
};

/// A fragment does not follow the one before.
pub static FRAGMENT_SEQUENCE: Code = Code {
    name: "devicenet.fragment-sequence",
    severity: Severity::Error,
    is_cause: false,
    meaning: "A fragment is missing, or does not follow the one before.",
    rule: "The first fragment has count 0 (or 3Fh, if it is the only one), each next one more, modulo 64 in explicit messages (CIP Vol. 3, chapter 4: fragmentation protocols).",
    evidence: "Type and count against what was due. Told once a message; its rest is left out. What began before the capture or a gap is not judged.",
    causes: &[
        "frames are missing in the capture: look for can.dropped",
        "the sender gave the message up and began another",
        "the sender numbers fragments wrongly",
    ],
    next: &[
        "capture again on an idle computer",
        ERRORS,
        "see whether it always comes from the same node: then it is its program",
    ],
    cure: Cure { one: "capture again; check the program", all: "capture again" },
    say: |finding, _, out| match (finding.expected, finding.actual) {
        (Some(expected), Some(actual)) => {
            write!(out, "fragment {} came where {} was due", actual & 0x3F, expected & 0x3F)
        }
        (Some(expected), None) => {
            write!(out, "the message ended before its fragment {}", expected & 0x3F)
        }
        _ => write!(out, "fragments out of sequence"),
    },
};

/// A fragment was not acknowledged.
pub static FRAGMENT_UNACKNOWLEDGED: Code = Code {
    name: "devicenet.fragment-unacknowledged",
    severity: Severity::Error,
    is_cause: false,
    meaning: "A fragment of an explicit message was not acknowledged: the message is lost.",
    rule: "Every explicit fragment is acknowledged; after 1 s it is sent once more, after another second given up (CIP Vol. 3, chapter 4).",
    evidence: "No acknowledgement 1 s after the second sending, or 2 s after an only one.",
    causes: &[
        "the receiver is gone: supply, plug, restart",
        "the receiver does not support fragmentation on this connection",
        "frames are lost on the wire",
    ],
    next: &[SUPPLY, PLUG, ERRORS, LENGTHS],
    cure: Cure { one: "check supply and plug", all: "check supply and trunk" },
    say: |finding, _, out| match finding.actual {
        Some(sendings) if sendings > 1 => {
            write!(out, "a fragment was not acknowledged, though sent {sendings} times")
        }
        _ => write!(out, "a fragment was not acknowledged"),
    },
};

/// A service was refused.
pub static ERROR_RESPONSE: Code = Code {
    name: "devicenet.error-response",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "A node refused what it was asked.",
    rule: "Error response 94h with a general and an additional status; FF: no additional one (CIP Vol. 1, appendix B).",
    evidence: "The status that the node sent.",
    causes: &[
        "the master asks for an object, attribute or service that the device has not",
        "the value is out of range, or the attribute is read-only",
        "the device is in a state in which it does not allow this",
    ],
    next: &[
        "compare class, instance and attribute with the device's manual or EDS",
        "see what was asked: the record that `request` names",
    ],
    cure: Cure { one: "compare the request with the EDS", all: "compare requests with the EDS" },
    say: |_, record, out| {
        write!(out, "node {} refuses", record.station.unwrap_or_default())?;
        refusal(record, out)
    },
};

/// An answer that nobody asked for.
pub static UNSOLICITED_RESPONSE: Code = Code {
    name: "devicenet.unsolicited-response",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "An answer came that no request fits.",
    rule: "A server sends an answer for each request, with its transaction id and service (CIP Vol. 3, chapter 4); a slave answers each poll or strobe once.",
    evidence: "No open request of that client fits by transaction id and service, or the command was answered before. The first answer of a connection whose beginning was not seen is assumed to be asked for.",
    causes: &[
        "two nodes answer: a duplicate MAC ID",
        "the request is missing in the capture",
        "the node answers twice, or late",
    ],
    next: &[SWITCHES, "look for can.dropped", ERRORS],
    cure: Cure {
        one: "look for a second node with the MAC ID",
        all: "compare all MAC ID switches",
    },
    say: |_, record, out| match record.station {
        Some(station) => write!(out, "node {station} answers what was not asked"),
        None => write!(out, "an answer to nothing"),
    },
};

/// A fragment was sent again.
pub static FRAGMENT_RETRY: Code = Code {
    name: "devicenet.fragment-retry",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "A fragment of an explicit message was sent again.",
    rule: "A fragment that is not acknowledged within 1 s is sent once more (CIP Vol. 3, chapter 4).",
    evidence: "The same type and count as the fragment before.",
    causes: &[
        "the receiver is slow, or lost the fragment or its acknowledgement",
        "errors on the wire",
    ],
    next: &[ERRORS, TERMINATION, "see how long the receiver's other acknowledgements take"],
    cure: Cure { one: "check plug and load", all: "check termination and load" },
    say: |finding, _, out| match finding.actual {
        Some(sendings) => write!(out, "the fragment was sent {sendings} times"),
        None => write!(out, "the fragment was sent again"),
    },
};

/// The receiver rejects a fragmented message.
pub static FRAGMENT_REJECTED: Code = Code {
    name: "devicenet.fragment-rejected",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "The receiver rejects a fragmented message: it is too long for it.",
    rule: "Acknowledge status 1: too much data (CIP Vol. 3, chapter 4).",
    evidence: "The status of the acknowledgement.",
    causes: &[
        "the message is longer than the receiver's connection size (class 5 attributes 7, 8)",
        "the master writes a value of the wrong size",
    ],
    next: &["compare the size of the value with the device's manual or EDS"],
    cure: Cure { one: "compare the size with the EDS", all: "compare sizes with the EDS" },
    say: |_, _, out| write!(out, "rejected: too much data"),
};

/// A slave refuses to be allocated.
pub static ALLOCATION_REFUSED: Code = Code {
    name: "devicenet.allocation-refused",
    severity: Severity::Warning,
    is_cause: true,
    meaning: "A slave refuses the connections that a master asks for.",
    rule: "Errors of Allocate: 0C/01 owned by another master, 09/02 invalid choice, 02/02 connection type not supported, 0B/02 allocated already, 02/04 resource missing (CIP Vol. 3, chapter 5: DeviceNet object).",
    evidence: "The error answer to Allocate, and its additional status.",
    causes: &[
        "another master owns the slave, or the same one before it restarted: wait for the time-out",
        "the scan list asks for a connection that the device has not, such as bit-strobe",
        "the slave still holds connections of before",
    ],
    next: &[
        "see who owns the slave: class 3 instance 1 attribute 5",
        "compare the connection type in the scan list with the EDS",
        "switch the slave off and on",
    ],
    cure: Cure { one: "compare owner and scan list entry", all: "compare the scan list" },
    say: |_, record, out| {
        write!(out, "slave {} refuses its allocation", record.station.unwrap_or_default())?;
        refusal(record, out)
    },
};

/// An allocation or release asks for what no slave can give.
pub static ALLOCATION_INVALID: Code = Code {
    name: "devicenet.allocation-invalid",
    severity: Severity::Warning,
    is_cause: true,
    meaning: "A master asks for an allocation or release that the specification forbids.",
    rule: "The choice must not be 0, have bit 7, both change of state and cyclic, or no acknowledge without either; a release must not have bits 6 and 7; the allocator is the sender (CIP Vol. 3, chapter 5).",
    evidence: "Choice and allocator as sent. Some makers' manuals release with bit 6 set: their slaves take it.",
    causes: &["the master's program builds the message wrongly", "the scan list entry is wrong"],
    next: &["compare the choice with the device's EDS", "correct the master's program"],
    cure: Cure { one: "correct the scan list entry", all: "correct the scan list" },
    say: |finding, _, out| {
        let choice = finding.actual.unwrap_or_default();
        write!(out, "choice {choice:02X}h or its allocator is not allowed")
    },
};

/// An explicit answer came late.
pub static LATE_RESPONSE: Code = Code {
    name: "devicenet.late-response",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "An explicit answer came late.",
    rule: "No time is specified: masters wait 1 s and more; 500 ms is the limit here, counted from the acknowledgement of the last fragment where there are several.",
    evidence: "Both stamps. Told where the limit is passed by more than their uncertainty and one bit; withheld where it lies within.",
    causes: &[
        "the device is busy: saving to its non-volatile memory takes time",
        "the bus is busy: explicit messages wait for I/O",
    ],
    next: &[
        "see whether it follows a Save (service 16h) or Restore: then it is its habit",
        "look at the bus load with `fieldtap stats`",
    ],
    cure: Cure { one: "see what was asked", all: "look at the bus load" },
    say: |finding, _, out| {
        write!(
            out,
            "late: {}, limit {}",
            Span(finding.actual.unwrap_or_default()),
            Span(finding.limit.unwrap_or_default())
        )
    },
};

/// A transaction id is used while its request is open.
pub static XID_BUSY: Code = Code {
    name: "devicenet.xid-busy",
    severity: Severity::Info,
    is_cause: false,
    meaning: "A client asks again with the same transaction id before the answer came.",
    rule: "One request may be open for each server, client and transaction id (CIP Vol. 3, chapter 4).",
    evidence: "The request before was neither answered nor given up.",
    causes: &["the client repeats a request that was not answered", "the client does not wait"],
    next: &["look how long the server takes for its other answers"],
    cure: Cure { one: "look at the response times", all: "look at the response times" },
    say: |_, _, out| write!(out, "asked again before the answer to the request before"),
};
