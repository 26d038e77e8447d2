//! Finding codes of CAN frames.

use crate::finding::{Code, Cure, Severity};

/// All of them.
pub static CODES: [&Code; 11] = [
    &ERROR_FRAME,
    &BUS_OFF,
    &CRC,
    &STUFF,
    &FORM,
    &TRUNCATED,
    &DROPPED,
    &NOT_ACKNOWLEDGED,
    &OVERLOAD,
    &WRONG_BITRATE,
    &HIGH_LOAD,
];

const TERMINATION: &str = "measure between CAN_H and CAN_L with the power off: about 60 Ω (121 Ω at both ends of the trunk and nowhere else)";
const LENGTHS: &str = "check the cable lengths: thick trunk 500/250/100 m at 125/250/500 kbit/s, thin trunk 100 m, a drop 6 m at most, all drops together 156/78/39 m";
const SUPPLY: &str = "measure the network supply at the farthest node, and the screen: it is grounded at one place only";
const RATE: &str = "compare the bit rate of every node; on Baumer encoders DIP switches 2 and 3: OFF-OFF 125, OFF-ON 250, ON-OFF 500, ON-ON 125 kbit/s";

/// A node found an error and destroyed the frame on the wire, or the tap's controller reports one.
pub static ERROR_FRAME: Code = Code {
    name: "can.error-frame",
    severity: Severity::Error,
    is_cause: false,
    meaning: "A node found an error and destroyed the frame on the wire, or the tap's controller reports one.",
    rule: "A node that sees a bit, stuff, form, CRC or acknowledge error sends an error flag of six equal bits; the frame is sent again (CAN 2.0, part A §6).",
    evidence: "An error frame of the log with its classes, or six equal bits where stuffing forbids them. Who sent it is not on the wire.",
    causes: &[
        "termination missing or doubled",
        "interference: frequency converter, contactor, missing screen",
        "a node with another bit rate, or one that was plugged in live",
        "cable too long for the bit rate",
    ],
    next: &[
        "look at the frames before and after: does it always hit the same station?",
        TERMINATION,
        LENGTHS,
        SUPPLY,
        RATE,
    ],
    cure: Cure { one: "check drop cable and plug", all: "check termination and cable" },
    say: |_, _, out| write!(out, "error frame"),
};

/// The tap's own controller left the bus: it saw too many errors while sending.
pub static BUS_OFF: Code = Code {
    name: "can.bus-off",
    severity: Severity::Error,
    is_cause: false,
    meaning: "The tap's own controller left the bus: it saw too many errors while sending.",
    rule: "At 256 transmit errors a controller goes bus-off (CAN 2.0, part A §7).",
    evidence: "An error frame of the log with the class bus-off. It concerns the tap, not the encoders: a passive tap never sends.",
    causes: &[
        "the adapter is not in listen-only mode and runs at another bit rate",
        "the adapter is alone on the bus: nobody acknowledges what it sends",
        "CAN_H and CAN_L are swapped or shorted",
    ],
    next: &[
        "set the adapter to listen-only: ip link set can0 type can bitrate 125000 listen-only on",
        RATE,
        TERMINATION,
    ],
    cure: Cure {
        one: "set the tap to listen-only at the drop",
        all: "set the tap to listen-only and check its bit rate",
    },
    say: |_, _, out| write!(out, "the tap's controller left the bus"),
};

/// The checksum of a frame does not fit its bits.
pub static CRC: Code = Code {
    name: "can.crc",
    severity: Severity::Error,
    is_cause: false,
    meaning: "The checksum of a frame does not fit its bits.",
    rule: "A CRC sequence of 15 bits, generator 4599h, over all bits before it (CAN 2.0, part A §3.1.1).",
    evidence: "The bits of the line, destuffed; or the place that the tap's controller reports for a protocol error.",
    causes: &[
        "interference, or reflections of a bad termination",
        "the tap samples the line at a bad place: too few samples a bit, a slow optocoupler",
    ],
    next: &["read again with more samples a bit", TERMINATION, LENGTHS],
    cure: Cure { one: "check drop cable and plug", all: "check termination and cable" },
    say: |_, _, out| write!(out, "the checksum does not fit"),
};

/// Six equal bits stand where the sixth should be of the other level.
pub static STUFF: Code = Code {
    name: "can.stuff",
    severity: Severity::Error,
    is_cause: false,
    meaning: "Six equal bits stand where the sixth should be of the other level.",
    rule: "After five equal bits one of the other level is stuffed in, from the start of frame to the CRC sequence (CAN 2.0, part A §5).",
    evidence: "The bits of the line, or the kind of protocol error that the tap's controller reports. It is how other nodes see an error flag.",
    causes: &["another node sent an error flag", "interference", "a node with another bit rate"],
    next: &["look for the first error of a burst: the others follow from it", TERMINATION, RATE],
    cure: Cure { one: "check drop cable and plug", all: "check termination and bit rates" },
    say: |_, _, out| write!(out, "stuffing violated"),
};

/// A bit of fixed form has the other level: a delimiter or the end of frame.
pub static FORM: Code = Code {
    name: "can.form",
    severity: Severity::Error,
    is_cause: false,
    meaning: "A bit of fixed form has the other level: a delimiter or the end of frame.",
    rule: "CRC delimiter, acknowledge delimiter and end of frame are recessive (CAN 2.0, part A §6).",
    evidence: "The bits of the line, or the kind of protocol error that the tap's controller reports.",
    causes: &[
        "two nodes send with the same identifier",
        "interference",
        "a node with another bit rate or sample point",
    ],
    next: &["look for a duplicate MAC ID", TERMINATION, RATE],
    cure: Cure { one: "check drop cable and plug", all: "check termination and bit rates" },
    say: |_, _, out| write!(out, "a bit of fixed form has the other level"),
};

/// The capture has fewer data bytes than the frame had.
pub static TRUNCATED: Code = Code {
    name: "can.truncated",
    severity: Severity::Error,
    is_cause: false,
    meaning: "The capture has fewer data bytes than the frame had.",
    rule: "The data length code says how many data bytes follow, eight at most.",
    evidence: "The length that the frame claims against the bytes that are in the capture.",
    causes: &["the capture was made with a snap length", "the line of the log was cut or edited"],
    next: &["capture again without a snap length (tcpdump -s 0)"],
    cure: Cure { one: "capture again in full the frames", all: "capture again in full" },
    say: |finding, _, out| match (finding.actual, finding.expected) {
        (Some(actual), Some(expected)) => {
            write!(out, "cut: {actual} of {expected} data bytes")
        }
        _ => write!(out, "cut"),
    },
};

/// Frames were on the wire that are not in the capture.
pub static DROPPED: Code = Code {
    name: "can.dropped",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "Frames were on the wire that are not in the capture.",
    rule: "Nothing is judged across a loss: neither time-outs nor sequences.",
    evidence: "What the log or the tap's controller says: dropped frames, a controller overrun. Where nobody listened, the sentence says so: then what was on the bus meanwhile is not known.",
    causes: &[
        "the capturing computer was too slow or its buffer too small",
        "the adapter was overrun",
        "nobody listened: the interface went down, or the adapter was unplugged or lost its supply",
    ],
    next: &[
        "where nobody listened, check plug and supply of the adapter, and who sets the interface down: ip link show can0",
        "capture on an idle computer, or with a larger buffer",
        "compare with the number of frames that the interface counted: ip -s link show can0",
    ],
    cure: Cure { one: "capture again the frames", all: "capture again on an idle computer" },
    say: |_, record, out| match record.lost() {
        _ if record.is_deaf() => write!(
            out,
            "nobody listened: the interface was down or gone, and what was on the bus meanwhile is \
             not known"
        ),
        Some(1) => write!(out, "one frame was lost"),
        Some(count) => write!(out, "{count} frames were lost"),
        None => write!(out, "frames were lost"),
    },
};

/// What to do first where nobody listened.
pub static LISTEN_AGAIN: Cure = Cure {
    one: "check plug and supply of the tap, not judging meanwhile the frames",
    all: "nobody listened meanwhile: check plug and supply of the adapter, ip link show",
};

/// A frame is sent again and again because nobody acknowledges it.
pub static NOT_ACKNOWLEDGED: Code = Code {
    name: "can.not-acknowledged",
    severity: Severity::Warning,
    is_cause: true,
    meaning: "A frame is sent again and again because nobody acknowledges it.",
    rule: "Every node that hears a frame without an error acknowledges it; else the sender repeats it (CAN 2.0, part A §6). A listen-only tap acknowledges nothing.",
    evidence: "The same frame eight times without a pause, or the class no-acknowledge of an error frame, or a recessive acknowledge slot.",
    causes: &[
        "the sender is the only node: one encoder and a listen-only tap never come up",
        "the other nodes are off, or run at another bit rate",
        "the line is broken between the sender and the others",
    ],
    next: &["count the nodes that are powered: it takes two besides the tap", RATE, TERMINATION],
    cure: Cure {
        one: "connect a second node to the bus",
        all: "connect a second node, check bit rates",
    },
    say: |finding, _, out| match finding.actual {
        Some(count) => write!(out, "nobody acknowledges: sent again {count} times without a pause"),
        None => write!(out, "nobody acknowledges"),
    },
};

/// A node asked for more time before the next frame.
pub static OVERLOAD: Code = Code {
    name: "can.overload",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "A node asked for more time before the next frame.",
    rule: "An overload flag may delay the next frame, twice at most (CAN 2.0, part A §3.1.4). Controllers of today do not send any.",
    evidence: "A dominant bit in the intermission, or the kind of protocol error that the tap's controller reports.",
    causes: &["a node with another bit rate or a bad clock", "a very old controller"],
    next: &[RATE, "find the node by unplugging one after the other"],
    cure: Cure { one: "check the clock", all: "check bit rates" },
    say: |_, _, out| write!(out, "overload frame"),
};

/// The bit rate of the tap is probably not that of the bus.
pub static WRONG_BITRATE: Code = Code {
    name: "can.wrong-bitrate",
    severity: Severity::Warning,
    is_cause: true,
    meaning: "The bit rate of the tap is probably not that of the bus.",
    rule: "DeviceNet runs at 125, 250 or 500 kbit/s.",
    evidence: "Sixteen error frames and not one good frame; or line levels whose pulses are those of another rate, or are upside down.",
    causes: &[
        "the tap was set to another bit rate",
        "CAN_H and CAN_L are swapped",
        "the rate of the bus was changed",
    ],
    next: &[
        "leave out --bitrate and --invert on line captures, where they were given: both are found; set a CAN interface to 125000, 250000, 500000 in turn",
        RATE,
    ],
    cure: Cure {
        one: "leave out --bitrate if it was given, check the bit rate",
        all: "set the tap to another bit rate",
    },
    say: |finding, _, out| match (finding.expected, finding.actual) {
        (Some(found), Some(set)) if found == set => {
            write!(out, "the pulses are those of {found} bit/s, but upside down")
        }
        (Some(found), Some(set)) => {
            write!(out, "read at {set} bit/s, but the pulses are those of {found} bit/s")
        }
        (_, Some(count)) => {
            write!(out, "{count} error frames and no good one: probably another bit rate")
        }
        _ => write!(out, "probably another bit rate"),
    },
};

/// The bus was busier than 80 % for a second: frames of low priority wait.
pub static HIGH_LOAD: Code = Code {
    name: "can.high-load",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "The bus was busier than 80 % for a second: frames of low priority wait.",
    rule: "Above 80 % of the bit rate, data of high identifiers comes late (a limit of practice, not of CAN).",
    evidence: "The exact bits of all frames of one second, stuff bits and intermission included, against the bit rate. Told when it begins, and again after a second below 70 %.",
    causes: &[
        "a change-of-state or cyclic encoder produces too often",
        "the scanner polls without a pause",
        "frames are sent again after errors",
    ],
    next: &[
        "`fieldtap stats` counts frames by station",
        "encoders: raise the COS delta (class 2Fh attribute 11) or the inhibit time (class 5 attribute 17)",
        "scanner: raise the interscan delay",
    ],
    cure: Cure {
        one: "produce less often: raise inhibit time or COS delta",
        all: "raise inhibit times or the interscan delay",
    },
    say: |finding, _, out| {
        let permille = finding.actual.unwrap_or_default();
        write!(out, "the bus is {}.{} % busy", permille / 10, permille % 10)
    },
};
