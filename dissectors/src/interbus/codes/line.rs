//! What is found on the line of a ring.

use super::super::line::{Crc, Trouble};
use crate::finding::{Code, Cure, Severity, Span};
use crate::record::Heard;
use core::fmt;

const PLUGS: &str = "check the plugs of the segment: the bridge from 5 to 9 in the outgoing plug, the screen, the pairs 1/6 and 2/7";
const HOP: &str = "move the tap along the ring: every device sends its own checksum, so that the fault lies between the last place where it fits and the first where it does not";
const LENGTH: &str =
    "check the cable: 400 m at most from one remote bus device to the next, away from power cables";
const MASTER: &str =
    "read the master's diagnostic register and its list of transmission errors by segment";

/// The checksum of a cycle does not fit.
pub static CRC: Code = Code {
    name: "interbus.crc",
    severity: Severity::Error,
    is_cause: false,
    meaning: "The checksum of a cycle does not fit what it covers.",
    rule: "16 bits, checked by every device from its neighbour (Phoenix Contact); the polynomial is that of CCITT (ACURO). Everything else about it is in no document that was at hand.",
    evidence: "The checksum as it was found from the capture itself, and only once at least three independent pairs of frames fitted one form of it; before that it is unverified, and nothing is judged. The profile in `stats` says which form, and by how many pairs.",
    causes: &[
        "interference, or a bad plug, between the tap and the device before it",
        "a cable too long, or without screen",
        "the tap itself: too few samples a bit, or a probe that loads the pair",
    ],
    next: &[HOP, PLUGS, LENGTH, MASTER],
    cure: Cure { one: "check cable and plugs", all: "check cable and plugs before the tap" },
    say: |_, record, out| {
        let Heard::Cycle(cycle) = record.heard else { return write!(out, "the CRC does not fit") };
        match cycle.crc() {
            Crc::Bad { expected, actual } => {
                write!(out, "CRC {actual:04X} should be {expected:04X}")
            }
            _ => write!(out, "the CRC does not fit"),
        }
    },
};

/// The line was silent for so long that all devices reset.
pub static RESET: Code = Code {
    name: "interbus.reset",
    severity: Severity::Warning,
    is_cause: true,
    meaning: "The line was silent for so long that all devices reset their outputs.",
    rule: "The master fills every pause with status telegrams; where they are absent for more than 25 ms, all devices take it as an interruption and go to a safe state (Phoenix Contact; others say 20 ms).",
    evidence: "No telegram of either kind on the wire away from the master for that long: `silence_reset_ms` of the profile. It is told where the time is over, and not judged at the capture's end or across a gap.",
    causes: &[
        "the master was stopped, restarted, or lost its supply",
        "the cable before the tap was interrupted",
        "the probe slipped off",
    ],
    next: &[
        "look what came before: cycles that failed, or an orderly stop",
        "look what comes next: ID cycles are the master starting the ring anew",
        MASTER,
        PLUGS,
    ],
    cure: Cure { one: "check master and cable", all: "check master and the cable before the tap" },
    say: |finding, _, out| match finding.limit {
        Some(limit) => write!(out, "silent for more than {}: all devices reset", Span(limit)),
        None => write!(out, "silent: all devices reset"),
    },
};

/// A cycle is not as a cycle should be, or not as those before.
pub static LINE: Code = Code {
    name: "interbus.line",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "A cycle is damaged, the ring is not as it was before, or the master reports errors of transmission.",
    rule: "A cycle is loopback word, registers, checksum, control word, in characters with a stop bit; the loopback word comes back as it was sent (Phoenix Contact, Schneider).",
    evidence: "Stop bits that are none, a cycle without its end, on one of two wires only or with more characters on one than on the other, a loopback word that came back as another, a control word that is another after twenty equal ones, or data cycles of another length: the ring was reconfigured. What the bits of the control word mean is not known. Cycles at the beginning of a capture are not judged. In logs of diagnostic registers: BUS or QUALITY (generation 4), RB or LB (generation 3, where the order of its bits is known), W1Err or W2Err of a slave, told when they come. CTRL, SYSFAIL, USER and PF are faults of the master, its host or a device's periphery, and not of the line.",
    causes: &[
        "interference, or a bad plug",
        "a device was switched off, added or removed: the ring has another length",
        "the tap: too few samples a bit, or a probe on one wire of the pair",
    ],
    next: &[
        "see whether it comes with errors of the checksum, or alone",
        "where the length changed, compare the ring before and after: which register is missing?",
        PLUGS,
        MASTER,
    ],
    cure: Cure { one: "check cable and plugs", all: "check cable and plugs" },
    say: |_, record, out| match record.heard {
        Heard::Cycle(cycle) => cycle.trouble.map_or(Ok(()), |trouble| say(trouble, out)),
        Heard::Row(row) if row.device.is_some() => {
            write!(out, "the coupler reports a bad interface")
        }
        _ => write!(out, "the master reports trouble on the line"),
    },
};

fn say(trouble: Trouble, out: &mut dyn fmt::Write) -> fmt::Result {
    match trouble {
        Trouble::StopBits(1) => write!(out, "1 character without stop bit"),
        Trouble::StopBits(count) => write!(out, "{count} characters without stop bit"),
        Trouble::Cut(count) => write!(out, "cut after {count} characters"),
        Trouble::Missing => write!(out, "on one of the two wires only"),
        Trouble::Uneven { sent, back } => write!(out, "{sent} characters sent, {back} came back"),
        Trouble::Loopback { sent, back } => {
            write!(out, "loopback word {sent:04X} came back as {back:04X}")
        }
        Trouble::Control { before, now } => write!(out, "control word {now:04X}, was {before:04X}"),
        Trouble::Length { before, now } => write!(out, "{now} bytes go round, were {before}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::String;

    #[test]
    fn trouble_is_told_with_its_numbers() {
        let told = |trouble| {
            let mut text = String::new();
            say(trouble, &mut text).unwrap();
            text
        };
        assert_eq!(told(Trouble::Cut(3)), "cut after 3 characters");
        let back = Trouble::Loopback { sent: 0xB5E3, back: 0xB5E1 };
        assert_eq!(told(back), "loopback word B5E3 came back as B5E1");
        assert_eq!(told(Trouble::Length { before: 8, now: 4 }), "4 bytes go round, were 8");
    }

    #[test]
    fn codes_are_those_of_the_contract() {
        let severities = [&CRC, &RESET, &LINE].map(|code| (code.name, code.severity));
        assert_eq!(
            severities,
            [
                ("interbus.crc", Severity::Error),
                ("interbus.reset", Severity::Warning),
                ("interbus.line", Severity::Warning)
            ]
        );
    }
}
