//! Findings of process words.

use crate::field::Value;
use crate::finding::{Code, Cure, Finding, Severity, Span};
use crate::interbus::service::{MAGNET as MAGNET_BIT, Service};
use crate::record::Record;
use core::fmt;

const DEVICE: &str = "make sure that the device is an LA-66, and that the log has its words in this order: word 1 is bits 31 to 16 (--device 1=la66; the ring never tells which device it is)";
const PROGRAM: &str = "compare the program with the handshake of the LA-66 manual §4: lay data and service out, set the service bit one PLC cycle later, wait for IN's, withdraw, wait until IN's is gone";
const FINE: &str = "log every bus cycle, and say so with --every-cycle";
const RING: &str = "look at the master's diagnosis for transmission errors around this time";
const SKIPS: &str = "A log whose rows skip states proves nothing: it is judged where rows come at most 1 ms apart, where the log has shown handshakes state by state (6 steps, 8 in order for one that skips), or with --every-cycle; else it is withheld.";

/// The device acknowledges what nobody asked for.
pub static UNREQUESTED_ACKNOWLEDGE: Code = Code {
    name: "interbus.unrequested-acknowledge",
    severity: Severity::Error,
    is_cause: false,
    meaning: "The device acknowledges a service that nobody asked for: while it does, IN tells no position.",
    rule: "IN's service bit follows OUT's (LA-66 manual §4, steps 2 and 3).",
    evidence: "IN's service bit goes from 0 to 1 while OUT's is 0, and no request is open. Judged only with --every-cycle: a coarser log shows this on a healthy bus, and it is withheld.",
    causes: &[
        "OUT comes from another log, or another place in the controller, than IN",
        "a second program or tool writes the OUT data",
        "the device, or the words between it and the log",
    ],
    next: &[
        "make sure that the log has a row for every bus cycle, with OUT and IN of the same device",
        DEVICE,
        RING,
    ],
    cure: Cure {
        one: "check in the log that OUT and IN are those",
        all: "check that OUT and IN of the log belong together",
    },
    say: |_, _, out| write!(out, "acknowledged, and nobody had asked"),
};

/// The device acknowledges another service than it was asked for.
pub static SERVICE_MISMATCH: Code = Code {
    name: "interbus.service-mismatch",
    severity: Severity::Error,
    is_cause: false,
    meaning: "The device acknowledges another service than it was asked for.",
    rule: "Bits 31 to 24 of IN acknowledge the requested service, bit 29 aside (LA-66 manual §2.3).",
    evidence: "IN against OUT in the first row of the acknowledgement. Where OUT was changed after the request, either of its services fits.",
    causes: &[
        "the words of OUT or IN are swapped or shifted in the controller's address table",
        "OUT and IN of the log belong to different devices",
        "the program goes on to the next service before the device is back to normal",
    ],
    next: &[DEVICE, PROGRAM, RING],
    cure: Cure {
        one: "check the addresses of OUT and IN",
        all: "check the addresses of OUT and IN",
    },
    say: |finding, _, out| {
        let (asked, told) = (finding.expected, finding.actual);
        write!(out, "{} acknowledged, {} asked for", Code8(told), Code8(asked))
    },
};

/// The device acknowledges a write with other data than were written.
pub static ECHO_MISMATCH: Code = Code {
    name: "interbus.echo-mismatch",
    severity: Severity::Error,
    is_cause: false,
    meaning: "The device acknowledges other data than it was sent: what it keeps is not known.",
    rule: "A write service returns the OUT data in IN (LA-66 manual §2.3). The manual's §4 says so of read services instead, which is taken for an error; --read-echo echo follows it.",
    evidence: "Bits 23 to 0 of IN against those of OUT in the first row of the acknowledgement, where IN has no error bit. Not judged where OUT was changed after the request.",
    causes: &[
        "data and service bit were set in the same cycle, and the device took the old data",
        "data of a parameter were rounded or limited by the device",
        "a word of OUT or IN is swapped in the controller",
    ],
    next: &["read the parameter back and compare", PROGRAM, RING],
    cure: Cure { one: "read back the parameter", all: "read the parameters back" },
    say: |finding, _, out| {
        let (sent, told) = (finding.expected.unwrap_or(0), finding.actual.unwrap_or(0));
        write!(out, "{told} acknowledged, {sent} sent")
    },
};

/// IN has the error bit set.
pub static ERROR_BIT: Code = Code {
    name: "interbus.error-bit",
    severity: Severity::Error,
    is_cause: false,
    meaning: "The device reports an error: in an acknowledgement, that it could not do the service; beside a position, that something is wrong with the position.",
    rule: "Bit 29 of IN: 1 = error (LA-66 manual §2.3; its sentence \"if the system could not carry out the service without errors, the error bit is 0\" has a \"not\" too many, as the same text in the manual of the 582 encoders shows).",
    evidence: "The bit as it was logged; told when it comes and, once IN shows a position without it, when it goes; the rows between are counted. An acknowledgement without it does not end it. It goes by \"a data check service\" only, which the manual does not define: the end tells which service was acknowledged last before it.",
    causes: &[
        "the magnet is outside the measuring range: the only cause that the manual defines",
        "the service that was asked for does not exist, or its data are not possible",
        "the device is defective",
    ],
    next: &[
        "read the error status: OUT 08000000, then 88000000; bit 5 of the answer is the magnet",
        "look where the magnet stands: within the measuring range, at the distance of the data sheet?",
        "where a service was refused, compare service and data with the manual's §3",
    ],
    cure: Cure {
        one: "check the position of the magnet, read the error status (88h)",
        all: "check the magnets, read the error status (88h)",
    },
    say: say_error_bit,
};

fn say_error_bit(finding: &Finding, record: &Record<'_>, out: &mut dyn fmt::Write) -> fmt::Result {
    use crate::finding::State;
    match (finding.state, finding.actual) {
        (Some(State::End(_)), Some(last)) => {
            write!(out, "error bit (the last service before was {last:02X}h)")
        }
        (Some(State::End(_)), None) => write!(out, "error bit"),
        (_, None) if record.kind == "service-acknowledge" => {
            write!(out, "error bit: the device could not do it")
        }
        (_, Some(status)) if status & i64::from(MAGNET_BIT) != 0 => {
            write!(out, "error bit: the magnet is outside the measuring range")
        }
        (_, Some(status)) => write!(out, "error bit; the error status was {status:04X}h"),
        (_, None) => {
            write!(out, "error bit: the only defined cause is the magnet outside the range")
        }
    }
}

/// A service that the manual does not define.
pub static UNDEFINED_SERVICE: Code = Code {
    name: "interbus.undefined-service",
    severity: Severity::Error,
    is_cause: true,
    meaning: "The master asks for a service that the device does not have.",
    rule: "The LA-66 has the services 1, 2, 4, 6 and 8 (manual §3).",
    evidence: "Bits 27 to 24 of OUT with the service bit set, on the first row of the request. That the device is an LA-66 is assumed where --device does not say so.",
    causes: &[
        "the program was written for another device",
        "words or bytes of OUT are swapped",
        "the service bit is set by data that are not meant for this device",
    ],
    next: &[DEVICE, "compare bits 31 to 24 of OUT with the tables of the manual's §3"],
    cure: Cure {
        one: "compare the services of the program with the manual",
        all: "compare the services of the program with the manual",
    },
    say: |finding, _, out| {
        write!(out, "there is no service {}", finding.actual.unwrap_or_default())
    },
};

/// A service in a direction it does not have.
pub static ACCESS: Code = Code {
    name: "interbus.access",
    severity: Severity::Error,
    is_cause: true,
    meaning: "The master reads what can only be written, or writes what can only be read.",
    rule: "The preset adjustment, service 6, can only be written; the error status, service 8, can only be read (LA-66 manual §3.4, §3.5): 86h and C8h do not exist.",
    evidence: "Bits 30 and 27 to 24 of OUT with the service bit set, on the first row of the request.",
    causes: &["bit 30 of OUT is wrong: 0 reads, 1 writes", "the wrong service number"],
    next: &["compare bits 31 to 24 of OUT with the tables of the manual's §3", DEVICE],
    cure: Cure {
        one: "check the read-write bit in the program",
        all: "check the read-write bit in the program",
    },
    say: |finding, _, out| match finding.actual.map(|code| code & 0xF) {
        Some(6) => write!(out, "86h: the preset adjustment can only be written"),
        _ => write!(out, "C8h: the error status can only be read"),
    },
};

/// Bits are set that are always 0.
pub static RESERVED_BITS: Code = Code {
    name: "interbus.reserved-bits",
    severity: Severity::Error,
    is_cause: false,
    meaning: "Bits are set that are always 0: the words may not be those of an LA-66, or not in this order.",
    rule: "Bit 28 is always 0; beside a position, bits 31 to 24 of IN are 0 but for the error bit; all bits of the error status but bit 5 are always 0 (LA-66 manual §2.2, §2.3, §3.5).",
    evidence: "The words as they were logged. OUT is judged while its service bit is set. Beside a position it is told when such bits appear and when others do.",
    causes: &[
        "word 1 and word 2, or their bytes, are swapped in the log: 1388C200 for C2001388",
        "the device is another one, with more bits of position or with flags",
        "IN is of another device",
    ],
    next: &[DEVICE, "see whether the bits move with the axis: then they are position"],
    cure: Cure {
        one: "check word order and device profile",
        all: "check word order and device profile",
    },
    say: |finding, _, out| match finding.actual {
        Some(code @ 0..=0xFF) => write!(out, "reserved bits: {code:02X}h"),
        Some(status) => write!(out, "reserved bits in the error status: {status:06X}h"),
        None => write!(out, "reserved bits"),
    },
};

/// A value that the device does not have.
pub static VALUE_OUT_OF_RANGE: Code = Code {
    name: "interbus.value-out-of-range",
    severity: Severity::Error,
    is_cause: true,
    meaning: "A parameter has a value that does not exist.",
    rule: "The counting direction is 0, increasing, or 1, decreasing to the end of the rod (LA-66 manual §3.1). All other parameters take any 24 bits.",
    evidence: "Bits 23 to 0 of OUT of a write, and of IN of a read that is acknowledged without error bit.",
    causes: &["data of another service", "words or bytes are swapped"],
    next: &["compare the value with the manual's §3.1", DEVICE],
    cure: Cure {
        one: "check in the program the value for the parameter",
        all: "check the values that the program writes",
    },
    say: |finding, _, out| {
        let (value, highest) = (finding.actual.unwrap_or(0), finding.limit.unwrap_or(0));
        write!(out, "{value} is out of range: 0 to {highest}")
    },
};

/// The magnet is outside the measuring range.
pub static MAGNET: Code = Code {
    name: "interbus.magnet",
    severity: Severity::Error,
    is_cause: true,
    meaning: "The magnet is outside the valid measuring range: the position is not to be trusted.",
    rule: "Bit 5 of the error status (LA-66 manual §3.5).",
    evidence: "The device's own answer to service 8, on the first row of the acknowledgement.",
    causes: &[
        "the axis went beyond the rod's measuring range",
        "the magnet is loose, lost, or too far from the rod",
        "another magnet, or iron, is near the rod",
    ],
    next: &[
        "look where the magnet stands, and measure its distance from the rod",
        "compare the travel of the axis with the measuring length on the rod's label",
        "check the limit switches",
    ],
    cure: Cure { one: "check magnet and travel", all: "check the magnets and the travel" },
    say: |_, _, out| write!(out, "the magnet is outside the measuring range"),
};

/// A service is not acknowledged.
pub static NO_ACKNOWLEDGE: Code = Code {
    name: "interbus.no-acknowledge",
    severity: Severity::Error,
    is_cause: false,
    meaning: "A service is not acknowledged in time: the program waits, and nothing is read or written.",
    rule: "The device acknowledges a service by IN's service bit (LA-66 manual §4, step 3). The manual has no limit: 1 s is taken, another by --limit no-acknowledge=MS.",
    evidence: "From the first row with the request to the first row past the limit without IN's service bit, less both stamps' ±. In a log that skips states, 8 rows in a row must show it and services must be rare (1 row in 20), as rows may show several handshakes at the same place. Without times it is withheld; and where times are numbers, rows all more than 250 ms apart and yet with handshakes, it takes 4000 rows: --time-unit may be wrong.",
    causes: &[
        "the service, or its direction, does not exist in the device",
        "OUT does not reach the device: wrong address, or the segment is switched off",
        "IN's service bit is read from the wrong place",
        "the device is in an error, or defective",
    ],
    next: &[
        "see whether IN's position moves with the axis: then the device is on the bus",
        DEVICE,
        RING,
        "switch the device off and on, and read the counting direction: OUT 81000000",
    ],
    cure: Cure { one: "check address and bus plug", all: "check that OUT reaches the devices" },
    say: |finding, _, out| {
        write!(out, "not acknowledged for {}", Span(finding.actual.unwrap_or_default()))
    },
};

/// The device does not go back to its position.
pub static NO_RELEASE: Code = Code {
    name: "interbus.no-release",
    severity: Severity::Error,
    is_cause: false,
    meaning: "The request was withdrawn, and the device still acknowledges it: IN tells no position.",
    rule: "The device detects the end of a request, resets its service bit and tells the position again (LA-66 manual §4, step 5). The manual has no limit: 1 s is taken, another by --limit no-release=MS.",
    evidence: "From the first row with OUT's service bit gone to the first row past the limit that still has IN's, less both stamps' ±. In a log that skips states, 8 rows in a row must show it and services must be rare (1 row in 20). Where times are numbers and rows all more than 250 ms apart, it takes 4000 rows, and is withheld until then: --time-unit may be wrong.",
    causes: &[
        "OUT does not reach the device any more: the ring stopped, or the segment is switched off",
        "OUT is written by two programs",
        "the device is defective",
    ],
    next: &[
        "see whether IN changes at all: else the ring stands",
        RING,
        "switch the device off and on",
    ],
    cure: Cure { one: "check address and bus plug", all: "check that the ring is running" },
    say: |finding, _, out| {
        write!(out, "still acknowledged after {}", Span(finding.actual.unwrap_or_default()))
    },
};

/// Data and service bit came in the same cycle.
pub static DATA_WITH_SERVICE_BIT: Code = Code {
    name: "interbus.data-with-service-bit",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "Service and data were laid out in the same cycle in which the service bit was set: the device may take data of two cycles.",
    rule: "Data and service number are output first, the service bit one PLC cycle later, for data consistency between the master card and the PLC (LA-66 manual §4, note).",
    evidence: "OUT's other bits changed in the row in which its service bit went from 0 to 1; data of a read service do not count. Judged only with --every-cycle: a coarser log shows this on every healthy bus, and it is withheld.",
    causes: &["the program writes all 32 bits at once"],
    next: &[PROGRAM, "read the parameter back after it was written"],
    cure: Cure {
        one: "set the service bit one cycle after the data in the program",
        all: "set the service bit one cycle after the data",
    },
    say: |_, _, out| write!(out, "data and service bit in the same cycle"),
};

/// OUT changed while a service was going on.
pub static REQUEST_CHANGED: Code = Code {
    name: "interbus.request-changed",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "Service or data changed while the service bit was set: which of them the device took is not known.",
    rule: "The master outputs data and service, sets the service bit, and withdraws it once the device has acknowledged (LA-66 manual §4, steps 2 to 4).",
    evidence: "OUT differs from the row before, and both have the service bit. Told once a request. A log that skips states shows this on a healthy bus, as the handshakes of two services: there it is told only if IN still acknowledges the first one.",
    causes: &[
        "the program writes the next service before the handshake is over",
        "the data of the service are a running value of the program",
        "two programs write the OUT data",
    ],
    next: &[PROGRAM, "read the parameter back", FINE],
    cure: Cure {
        one: "keep OUT until the acknowledgement, in the program",
        all: "keep OUT until the acknowledgement",
    },
    say: |_, _, out| write!(out, "OUT changed before the handshake was over"),
};

/// The request was withdrawn before the acknowledgement.
pub static WITHDRAWN: Code = Code {
    name: "interbus.withdrawn",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "The master withdrew its request before the device acknowledged: whether it was done is not known.",
    rule: "The master resets the service bit once it has detected the execution (LA-66 manual §4, step 4).",
    evidence: SKIPS,
    causes: &[
        "the program sets the service bit for a fixed time instead of waiting",
        "its time-out is shorter than the device needs: an EEPROM takes some ms to write",
        "the program was stopped",
    ],
    next: &[PROGRAM, "compare the time-out with the response times in `fieldtap stats`", FINE],
    cure: Cure {
        one: "wait for the acknowledgement",
        all: "wait for the acknowledgement in the program",
    },
    say: |_, _, out| write!(out, "withdrawn before it was acknowledged"),
};

/// A position that no axis can reach.
pub static POSITION_JUMP: Code = Code {
    name: "interbus.position-jump",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "The position jumps, and no service of the log did it.",
    rule: "No manual has such a rule. Positions jump by the preset adjustment (service 6) and by the external preset input, which sets preset value 1 (LA-66 manual §3.3, §3.4): a jump to the preset value 1 that was read or written before is told as such an event, without a finding.",
    evidence: "The step to this position differs from the steps before and after it by more than 127, by more than 8 times the largest other change of step among the device's last 100, and by more than an axis with 100 m/s² can do between two rows (0.1 mm at 1 ms, 10 mm at 10 ms, 250 mm at 50 ms; steps of 0.01 mm where the resolution is not known). Both differences have the same sign, and at least 4 changes of step were seen before. Steps are counted modulo the measuring length in steps, where it was read or written. Steps across services, gaps and rows with an error bit are left out. Where rows may have skipped a service, only a spike is told, and only if no service that moves positions was seen; else it is withheld.",
    causes: &[
        "the external preset input was triggered, and the log does not show preset value 1",
        "the magnet left the measuring range, or a second magnet is near",
        "a preset by a service that the log does not show",
        "interference on the rod or on the bus",
    ],
    next: &[
        "compare the position with preset value 1: read it with OUT 84000000",
        "look at the wiring of the external preset input",
        "read the error status: OUT 88000000",
        FINE,
    ],
    cure: Cure {
        one: "check the external preset input and the magnet",
        all: "check the external preset inputs and the magnets",
    },
    say: |finding, record, out| {
        let (position, led) = (finding.actual.unwrap_or(0), finding.expected.unwrap_or(0));
        match record.station {
            Some(device) => write!(out, "{device} jumps to {position}")?,
            None => write!(out, "the position jumps to {position}")?,
        }
        write!(out, ", the ones before lead to {led}")
    },
};

/// A parameter is written again and again.
pub static REPEATED_WRITE: Code = Code {
    name: "interbus.repeated-write",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "The same value is written again and again: the EEPROM that keeps it wears out.",
    rule: "Parameters are saved permanently in an EEPROM (LA-66 manual §3); EEPROMs of this kind last some 100 000 writes, the manual has no number.",
    evidence: "Ten acknowledged writes of one value to one service within 60 s; told once, until it pauses. A log that skips handshakes shows fewer than there are. Where times are numbers and rows closer than bus cycles, it is withheld.",
    causes: &[
        "the program writes parameters in every cycle, or at every start of a sequence",
        "the program does not see the acknowledgement and tries again",
    ],
    next: &[
        "write parameters once, on commissioning; or read first and write only what differs",
        PROGRAM,
    ],
    cure: Cure {
        one: "stop repeated writes in the program",
        all: "stop the program from repeating writes",
    },
    say: |finding, _, out| {
        write!(out, "{} was written ten times in a minute", finding.actual.unwrap_or_default())
    },
};

/// A parameter was written.
pub static WRITTEN: Code = Code {
    name: "interbus.written",
    severity: Severity::Info,
    is_cause: false,
    meaning: "A parameter of the device was written.",
    rule: "Services with bit 30 set; parameters are saved permanently in an EEPROM (LA-66 manual §3).",
    evidence: "The device's acknowledgement without error bit. The old value is told if it was read or written in this log. A handshake that the log skipped is not seen.",
    causes: &["commissioning", "a program that writes parameters at every start"],
    next: &["compare the new value with what the machine needs"],
    cure: Cure { one: "compare the values", all: "compare the values" },
    say: |finding, record, out| {
        let number = |name| match record.named(name) {
            Value::Int(number) => u8::try_from(number).ok(),
            _ => None,
        };
        match number("interbus.service").and_then(Service::numbered) {
            Some(service) => write!(out, "{}", service.name)?,
            None => write!(out, "a parameter")?,
        }
        if let Some(device) = record.station {
            write!(out, " of {device}")?;
        }
        match finding.expected {
            Some(old) => write!(out, " from {old}")?,
            None => write!(out, " (not known before)")?,
        }
        write!(out, " to {}, kept in the EEPROM", finding.actual.unwrap_or_default())
    },
};

/// Bits 31 to 24 of a word, as the manual writes them.
struct Code8(Option<i64>);

impl fmt::Display for Code8 {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:02X}h", self.0.unwrap_or_default())
    }
}
