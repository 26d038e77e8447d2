//! Codes about I/O connections.

use super::super::layer;
use super::{ERRORS, PLUG, SUPPLY};
use crate::field::Value;
use crate::finding::{Code, Cure, Severity, Span, State};
use crate::record::Record;
use core::fmt;

const SCAN_LIST: &str = "compare the sizes in the scan list with what the device produces and consumes: class 5 attributes 7 and 8, or the EDS";
const DELTA: &str = "raise the COS delta of the encoder: class 2Fh attribute 11";
const INHIBIT: &str = "raise the production inhibit time: class 5 instance 4 attribute 17";

/// Connections that carry no I/O.
const MESSAGES: [&str; 3] = ["explicit", "ucmm", "unconnected"];

fn connection(record: &Record<'_>, out: &mut dyn fmt::Write) -> fmt::Result {
    match record.get(layer::CONNECTION) {
        Value::Text(name) => write!(out, "{name} connection")?,
        _ => write!(out, "connection")?,
    }
    whose(record, out)
}

/// The same of I/O: where it ends, the record is about the release or the restart.
fn io_connection(record: &Record<'_>, out: &mut dyn fmt::Write) -> fmt::Result {
    write!(out, "{} connection", io_name(record))?;
    whose(record, out)
}

fn io_name<'a>(record: &'a Record<'_>) -> &'a str {
    match record.get(layer::CONNECTION) {
        Value::Text(name) if !MESSAGES.contains(&name) => name,
        _ => "I/O",
    }
}

fn whose(record: &Record<'_>, out: &mut dyn fmt::Write) -> fmt::Result {
    match record.station {
        Some(station) => write!(out, " of {station}"),
        None => Ok(()),
    }
}

/// An I/O connection timed out.
pub static CONNECTION_TIMEOUT: Code = Code {
    name: "devicenet.connection-timeout",
    severity: Severity::Error,
    is_cause: false,
    meaning: "Nothing came on an I/O connection for so long that it timed out.",
    rule: "A connection times out after four times its expected packet rate (attribute 9; attribute 18 allows more), before its first message not before 10 s (CIP Vol. 1, chapter 3: inactivity/watchdog timer).",
    evidence: "The rate that the slave answered when it was set, and the silence since the last message. Told when it begins and when it ends; not judged where the rate was not seen, or across a gap.",
    causes: &[
        "the master stopped: in program mode, faulted, restarting",
        "the slave stopped answering: supply, plug, restart",
        "the bus is so busy that messages wait",
        "the expected packet rate is too short for the scan",
    ],
    next: &[
        "see who fell silent first: the record that `about` names is the last message",
        SUPPLY,
        PLUG,
        "compare the scan time with the expected packet rate",
    ],
    cure: Cure { one: "check supply and plug", all: "check the master and the supply" },
    say: |finding, record, out| {
        if let Some(State::End(_)) = finding.state {
            write!(out, "{} time-out", io_name(record))?;
            return whose(record, out);
        }
        io_connection(record, out)?;
        match finding.limit {
            Some(limit) => write!(out, " timed out: nothing for {}", Span(limit)),
            None => write!(out, " timed out"),
        }
    },
};

/// A poll was not answered.
pub static NO_POLL_RESPONSE: Code = Code {
    name: "devicenet.no-poll-response",
    severity: Severity::Error,
    is_cause: false,
    meaning: "A slave did not answer a poll.",
    rule: "A slave answers every poll command (CIP Vol. 3, chapter 3); masters take 2 ms for usual.",
    evidence: "The next poll came first: it is told there. Not judged while the connection is not allocated or has timed out, nor before the slave answered a poll or its rate was set.",
    causes: &[
        "the slave is gone: supply, plug, restart",
        "the slave timed out or was released, and waits for its master",
        "the data of the poll has the wrong size: a slave ignores it",
        "the master polls faster than the slave can answer",
    ],
    next: &[SUPPLY, PLUG, ERRORS, SCAN_LIST],
    cure: Cure { one: "check supply and plug", all: "check supply and scan time" },
    say: |finding, record, out| {
        let station = record.station.unwrap_or_default();
        match finding.actual {
            Some(ns) => {
                write!(out, "slave {station} did not answer the poll of {} before", Span(ns))
            }
            None => write!(out, "slave {station} did not answer the poll before"),
        }
    },
};

/// I/O has another size than its connection.
pub static SIZE_MISMATCH: Code = Code {
    name: "devicenet.size-mismatch",
    severity: Severity::Error,
    is_cause: true,
    meaning: "I/O data has another size than its connection.",
    rule: "Connection sizes are attributes 7 (produced) and 8 (consumed) of class 5; a consumer ignores data that is too long (CIP Vol. 1, chapter 3).",
    evidence: "The sizes that the slave told when it was asked, and the length of the data; of fragments, all together. Where it was not asked, the sizes that its EDS lists (--eds): then only data that fits none of them is wrong, and the sentence says `per EDS`. Empty data means idle and is never a wrong size. Told when it begins and when it ends; another wrong size begins anew.",
    causes: &[
        "the scan list has another size than the device: another assembly was chosen",
        "the device was exchanged for another, or its assembly changed (class 5 attribute 14)",
    ],
    next: &[SCAN_LIST, "read the produced path: class 5 instance 2 attribute 14"],
    cure: Cure { one: "compare the scan list entry", all: "compare the scan list" },
    say: |finding, record, out| {
        io_connection(record, out)?;
        match (finding.actual, finding.expected) {
            (Some(actual), Some(expected)) if is_assumed(record) => {
                write!(out, " carries {actual} bytes, per EDS {expected}")
            }
            (Some(actual), Some(expected)) => {
                write!(out, " carries {actual} bytes, its size is {expected}")
            }
            _ => write!(out, " carries data of the wrong size"),
        }
    },
};

/// Whether the size was not seen but taken.
fn is_assumed(record: &Record<'_>) -> bool {
    let Value::List(assumed) = record.named("devicenet.assumed") else { return false };
    (0..assumed.len()).any(|index| matches!(assumed.get(index), Value::Text("size")))
}

/// A slave did not answer a strobe.
pub static NO_STROBE_RESPONSE: Code = Code {
    name: "devicenet.no-strobe-response",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "A slave did not answer a bit-strobe.",
    rule: "Every strobed slave answers (CIP Vol. 3, chapter 3). Makers differ on whether it does so where its bit is 1: hence a warning.",
    evidence: "The master's next strobe came first. Judged for slaves whose allocation was seen, or that answered before.",
    causes: &[
        "the slave is gone: supply, plug, restart",
        "the slave answers only where its bit is 0",
    ],
    next: &[SUPPLY, PLUG, "compare with the strobes that it does answer: which bit has it there?"],
    cure: Cure { one: "check supply and plug", all: "check the supply" },
    say: |_, record, out| {
        write!(out, "slave {} did not answer the strobe", record.station.unwrap_or_default())
    },
};

/// A production came late.
pub static LATE_PRODUCTION: Code = Code {
    name: "devicenet.late-production",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "A slave produced later than its rate says.",
    rule: "A cyclic connection produces every expected packet rate; one by change of state at least that often (CIP Vol. 1, chapter 3: transmission trigger timer). One and a half times is the limit here.",
    evidence: "The gap between two messages and the rate that the slave answered when it was set; told on the late frame, or as an event where the capture ends before.",
    causes: &[
        "the bus is busy, or errors delay the message",
        "the slave is busy",
        "frames are missing in the capture: look for can.dropped",
    ],
    next: &[ERRORS, "look at the bus load with `fieldtap stats`"],
    cure: Cure {
        one: "look at load, and at errors around the messages",
        all: "look at the bus load",
    },
    say: |finding, _, out| match (finding.actual, finding.expected) {
        (Some(gap), Some(rate)) => {
            write!(out, "late: {} since the message before, rate {}", Span(gap), Span(rate))
        }
        (None, Some(rate)) => write!(out, "nothing came any more, rate {}", Span(rate)),
        _ => write!(out, "late"),
    },
};

/// Productions follow each other too closely.
pub static INHIBIT_VIOLATED: Code = Code {
    name: "devicenet.inhibit-violated",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "A slave produced again before its inhibit time was over.",
    rule: "Two productions are at least the production inhibit time apart (class 5 attribute 17, ms; CIP Vol. 1, chapter 3). What is sent again for want of an acknowledge does not count.",
    evidence: "Both stamps and the time that was set or read. Told where the limit is missed by more than the stamps' uncertainty and one bit; withheld where it lies within.",
    causes: &[
        "the device does not keep to its inhibit time",
        "the first message waited for a busy bus, the second did not",
    ],
    next: &["read the attribute back: class 5 instance 4 attribute 17", "look at the bus load"],
    cure: Cure { one: "read back the inhibit time", all: "look at the bus load" },
    say: |finding, _, out| {
        write!(
            out,
            "only {} after the message before, inhibit time {}",
            Span(finding.actual.unwrap_or_default()),
            Span(finding.limit.unwrap_or_default())
        )
    },
};

/// A production was not acknowledged.
pub static IO_UNACKNOWLEDGED: Code = Code {
    name: "devicenet.io-unacknowledged",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "A change-of-state or cyclic message was not acknowledged.",
    rule: "Unless acknowledges were suppressed when it was allocated (choice bit 6), the master acknowledges every message of the slave (400h + 8 x slave + 2), and the slave those of its master (3C0h + slave); else the message is sent again (CIP Vol. 1, chapter 5: acknowledge handler).",
    evidence: "No acknowledgement within the slave's timer (class 2Bh attribute 1), or 24 ms where that was not read: an event at that time, with the first message that it holds for; or the same data again. Judged only where the Allocate was seen; what a master sends, from when the slave's rate was set.",
    causes: &[
        "who is to acknowledge is busy, stopped, or gone",
        "the slave was allocated with acknowledge, and the master believes without",
        "the acknowledge timer is shorter than the other side's reaction",
    ],
    next: &[
        "compare the acknowledge setting of the scan list with the slave's allocation",
        "read the slave's timer and retry limit: class 2Bh instance 1 attributes 1 and 2",
    ],
    cure: Cure { one: "compare the acknowledge setting", all: "check the master" },
    say: |finding, record, out| {
        io_connection(record, out)?;
        match (record.named("devicenet.source"), record.station) {
            (Value::Int(source), Some(station)) if source != i64::from(station) => {
                write!(out, ": {station} did not acknowledge its master")?;
            }
            _ => write!(out, ": the master did not acknowledge")?,
        }
        match finding.limit {
            Some(limit) => write!(out, " within {}", Span(limit)),
            None => write!(out, ", the message comes again"),
        }
    },
};

/// Change-of-state or cyclic messages take too much of the bus.
pub static IO_FLOOD: Code = Code {
    name: "devicenet.io-flood",
    severity: Severity::Warning,
    is_cause: true,
    meaning: "Change-of-state or cyclic messages take more than 30 % of the bus: others wait.",
    rule: "No rule: a limit of practice. Slave I/O has the highest priority, so what floods the bus delays everything else.",
    evidence: "The exact bits of all such messages within a second against the bit rate. Where that is not known, against 500 kbit/s, the fastest there is: they take at least so much, and a slower bus may be flooded without being told. Told once, on a message of the node that sends most.",
    causes: &[
        "an encoder by change of state on a moving shaft: it sends every step",
        "an inhibit time of 0, or a cyclic rate that is too fast",
    ],
    next: &[DELTA, INHIBIT, "use polling or a slower cyclic rate"],
    cure: Cure {
        one: "raise COS delta (2Fh/11) or inhibit time (5/17)",
        all: "raise COS deltas (2Fh/11) and inhibit times (5/17)",
    },
    say: |finding, record, out| {
        let permille = finding.actual.unwrap_or_default();
        let least = if record.wire.baud().is_some() { "" } else { "at least " };
        write!(
            out,
            "change-of-state and cyclic messages take {least}{}.{} % of the bus: raise the COS delta (class 2Fh attribute 11) or the inhibit time (class 5 attribute 17)",
            permille / 10,
            permille % 10
        )
    },
};

/// A connection is used that is not allocated.
pub static NOT_ALLOCATED: Code = Code {
    name: "devicenet.not-allocated",
    severity: Severity::Info,
    is_cause: false,
    meaning: "A connection is used that was released, has timed out, or went with a restart.",
    rule: "A slave takes messages only on connections that are allocated and established (CIP Vol. 3, chapter 5).",
    evidence: "The release, time-out or restart was seen, and no allocation since. Told on each such frame, until it is allocated anew. An explicit connection that nobody uses goes by itself after 10 s, or four times its rate: nothing is wrong with that, and it is told only here.",
    causes: &[
        "the master has not noticed yet that the slave timed out or restarted",
        "the slave's own rate is longer than what was seen",
    ],
    next: &["look how long the master takes to allocate anew", "look for the cause before it"],
    cure: Cure {
        one: "look at what happened before to the connections",
        all: "look what happened before",
    },
    say: |finding, record, out| {
        connection(record, out)?;
        match finding.limit {
            Some(limit) => write!(out, " timed out: nothing had come for {}", Span(limit)),
            None => write!(out, " is not allocated any more"),
        }
    },
};

/// An acknowledgement though it was suppressed.
pub static UNEXPECTED_ACK: Code = Code {
    name: "devicenet.unexpected-ack",
    severity: Severity::Info,
    is_cause: false,
    meaning: "A message is acknowledged though acknowledges were suppressed.",
    rule: "Choice bit 6 of Allocate suppresses acknowledges (CIP Vol. 3, chapter 5).",
    evidence: "The allocation was seen.",
    causes: &["the master's scan list does not fit its own allocation"],
    next: &["compare the acknowledge setting of the scan list: each needless frame costs bus time"],
    cure: Cure { one: "compare the acknowledge setting", all: "compare the scan list" },
    say: |_, _, out| write!(out, "acknowledged though that was suppressed"),
};

/// A change smaller than the delta is told.
pub static DELTA_IGNORED: Code = Code {
    name: "devicenet.delta-ignored",
    severity: Severity::Info,
    is_cause: false,
    meaning: "An encoder tells a change of position that is smaller than its COS delta.",
    rule: "By change of state the encoder sends when the position changed by the delta (Baumer DeviceNet manual, class 2Fh attribute 11).",
    evidence: "Two positions and the delta that was set or read; messages that the expected packet rate calls for are left out.",
    causes: &[
        "the delta was set but does not hold on this connection",
        "the alarm or warning flag changed instead of the position",
    ],
    next: &["read the delta back: class 2Fh instance 1 attribute 11"],
    cure: Cure { one: "read back the delta", all: "read the deltas back" },
    say: |finding, _, out| match (finding.actual, finding.limit) {
        (Some(step), Some(delta)) => write!(out, "a step of {step} is told, the delta is {delta}"),
        _ => write!(out, "a step below the delta is told"),
    },
};

/// Empty I/O: the master is idle.
pub static IDLE: Code = Code {
    name: "devicenet.idle",
    severity: Severity::Info,
    is_cause: false,
    meaning: "I/O is empty: the master is idle, or the slave has no valid data.",
    rule: "A message of length 0 means idle to a consumer of data (CIP Vol. 3, chapter 3); masters send it in program mode.",
    evidence: "An empty message on a connection that carries data otherwise. Told when it begins and when it ends.",
    causes: &["the controller is in program mode", "the slave is not ready yet"],
    next: &["put the controller into run mode"],
    cure: Cure { one: "put into run mode the controller", all: "put it into run mode" },
    say: |_, record, out| {
        io_connection(record, out)?;
        write!(out, " is idle")
    },
};
