//! Finding codes of the serial line itself.

use crate::finding::{Code, Cure, Finding, Severity, Span};
use crate::record::{Heard, Record};
use core::fmt;

/// All of them.
pub static CODES: [&Code; 7] =
    [&FRAMING, &BREAK, &OVERRUN, &LOST, &SWAPPED_LINES, &WRONG_RATE, &WRONG_PARITY];

/// Those that tell of a wrong set-up, which explains everything else that is found.
pub static SETUP_CODES: [&Code; 3] = [&SWAPPED_LINES, &WRONG_RATE, &WRONG_PARITY];

/// A stop bit was not there.
pub static FRAMING: Code = Code {
    name: "uart.framing",
    severity: Severity::Error,
    is_cause: false,
    meaning: "A character's stop bit was low: the bits of this character cannot be trusted.",
    rule: "Every character ends with a stop bit, which is high (Baumer SLIN §3.2, TR SLIN §6; IEC 60870-5-1, FT1.2).",
    evidence: "The stop bit, by a vote around its middle in line captures, or the receiver's own framing error flag. A break is told as uart.break instead.",
    causes: &[
        "two stations drive the line at the same time",
        "reflections or interference: termination missing, doubled, or at the wrong station",
        "a rate or format that is not the line's (then nearly every character is bad: see uart.wrong-rate)",
        "the line floats between telegrams and the receiver sees edges of its own",
    ],
    next: &[
        "look whether one station's telegrams are hit or all: `fieldtap stats` counts by station",
        "unpowered, measure between the two lines: about 60 Ω is right (120 Ω at the first and at the last station only)",
        "check that no two stations have the same Ident jumpers",
        "check the cable screen and its distance to motor cables",
    ],
    cure: Cure { one: "check drop cable and plug", all: "check termination, bias and screen" },
    say: |finding, record, out| {
        write!(out, "stop bit missing in ")?;
        name_characters(finding, record, out)
    },
};

/// The line was held low.
pub static BREAK: Code = Code {
    name: "uart.break",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "The line stayed at the start-bit level for longer than a character.",
    rule: "Idle is high, and every character brings a high stop bit (IEC 60870-5-1, FT1.2); SLIN knows no break.",
    evidence: "The line level over a whole character and its stop bit, or the receiver's break flag.",
    causes: &[
        "a station lost its supply or its driver stays switched on",
        "a short between the lines, or of one line to ground",
        "the bias that holds the idle line high is missing and the receiver reads idle as low",
        "lines A and B swapped (then it is the usual state: see uart.swapped-lines)",
    ],
    next: &[
        "measure the idle voltage between the lines: the receiver needs more than 200 mV; with 120 Ω at both ends and 4.7 kΩ up and down in each encoder it takes 7 encoders to reach that, fewer need bias at the master",
        "unplug stations one by one until the breaks stop",
        "unpowered, measure between the lines: about 60 Ω",
    ],
    cure: Cure { one: "check supply and driver", all: "check bias and drivers" },
    say: |_, record, out| match record.heard {
        Heard::Break(event) => match event.duration {
            Some(ns) => write!(out, "line held low for {}", Span(ns.cast_signed())),
            None => write!(out, "line held low for longer than a character"),
        },
        _ => write!(out, "line held low for longer than a character"),
    },
};

/// The receiver was too slow.
pub static OVERRUN: Code = Code {
    name: "uart.overrun",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "The receiver was overrun: characters were on the wire that are not in the capture.",
    rule: "What is not in the capture is not judged; telegrams around the gap may be torn.",
    evidence: "The overflow event of the capture, or the overrun counters of a live port's driver.",
    causes: &[
        "the computer was too busy to fetch the characters in time",
        "the adapter's buffer is small for this rate",
    ],
    next: &[
        "record again with less running beside it, or with an adapter that has a larger buffer",
        "do not take findings next to the gap for faults of the bus",
    ],
    cure: Cure {
        one: "record with less running beside it the traffic",
        all: "record again with less running beside it",
    },
    say: |_, record, out| lost(record, out, "the receiver was overrun"),
};

/// The capture has a hole.
pub static LOST: Code = Code {
    name: "uart.lost",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "The capture says that something was lost here.",
    rule: "What is not in the capture is not judged; telegrams around the gap may be torn.",
    evidence: "The loss event of the capture, or a gap between two pieces of it. Where nobody listened, the sentence says so: then what was on the line meanwhile is not known.",
    causes: &[
        "the program that captured could not keep up, was stopped, or the computer's clock was set",
        "nobody listened: the adapter was unplugged or lost its supply, and came back",
        "the logic analyzer was switched off or its channel was not recorded for a while",
    ],
    next: &[
        "where nobody listened, check plug, cable and supply of the adapter",
        "record again; a lower sample rate (8 samples a bit are plenty) makes logic analyzers lose less",
        "do not take findings next to the gap for faults of the bus",
    ],
    cure: Cure {
        one: "judge nothing next to the gap; record again the traffic",
        all: "record again; judge nothing next to the gap",
    },
    say: |_, record, out| match record.is_deaf() {
        true => write!(
            out,
            "nobody listened: the port was gone, and what was on the line meanwhile is not known"
        ),
        false => lost(record, out, "the capture has a gap"),
    },
};

/// What to do first where nobody listened.
pub static LISTEN_AGAIN: Cure = Cure {
    one: "check plug and supply of the tap, not judging meanwhile the traffic",
    all: "nobody listened meanwhile: check plug, cable and supply of the adapter",
};

/// A and B are swapped.
pub static SWAPPED_LINES: Code = Code {
    name: "uart.swapped-lines",
    severity: Severity::Warning,
    is_cause: true,
    meaning: "The line looks upside down: A and B of the tap are probably swapped.",
    rule: "Idle is high (IEC 60870-5-1, FT1.2). Of two swapped lines a receiver sees idle as a break.",
    evidence: "Of the first characters nearly all are breaks, or 00h with a missing stop bit. Told once.",
    causes: &[
        "A and B swapped at the tap (makers do not agree on which line is A: try it)",
        "the line is idle without bias and the receiver takes that for low",
        "a logic analyzer on the inverting line, with --invert no",
    ],
    next: &[
        "swap the two wires of the tap; a logic capture is turned by itself, unless --invert no was given",
        "if that makes it worse, measure the idle voltage: it must be above 200 mV",
    ],
    cure: Cure { one: "swap A and B at the tap beside the plug", all: "swap A and B at the tap" },
    say: |finding, _, out| {
        write!(
            out,
            "{} of the first {} characters are breaks or 00h without a stop bit: A and B are probably swapped",
            finding.actual.unwrap_or_default(),
            finding.limit.unwrap_or_default()
        )
    },
};

/// The rate is not the line's.
pub static WRONG_RATE: Code = Code {
    name: "uart.wrong-rate",
    severity: Severity::Warning,
    is_cause: true,
    meaning: "The rate that was set is probably not the rate of the line.",
    rule: "SLIN runs at 9600, 19200 or 115200 Bd (Baumer SLIN §3.1); TR also at 345594 Bd (TR SLIN §1).",
    evidence: "Of the first characters many have a missing stop bit or wrong parity, and hardly one is a request. Told once.",
    causes: &[
        "the tap is set to another rate than master and encoders",
        "A and B are swapped, and the receiver waits for an edge after a break (see uart.swapped-lines)",
        "one station runs at another rate than the rest (then only its answers are bad)",
    ],
    next: &[
        "let it be found: --baud auto, or try 115200, 19200, 9600 and 345594",
        "read the rate from the encoders' type plates and from the master's configuration",
    ],
    cure: Cure {
        one: "--baud auto for line captures, or set the tap to the rate",
        all: "set the rate of the tap, or --baud auto for line captures",
    },
    say: |finding, record, out| match (finding.expected, record.wire.baud()) {
        (Some(found), Some(set)) => {
            write!(out, "read at {set} Bd, but the line runs at {found} Bd")
        }
        _ => write!(
            out,
            "{} of the first {} characters have a missing stop bit or wrong parity: probably another rate",
            finding.actual.unwrap_or_default(),
            finding.limit.unwrap_or_default()
        ),
    },
};

/// The parity setting is not the line's.
pub static WRONG_PARITY: Code = Code {
    name: "uart.wrong-parity",
    severity: Severity::Warning,
    is_cause: true,
    meaning: "The parity that was set is probably not the parity of the line.",
    rule: "SLIN characters have 8 data bits and even parity: 8E1 (TR SLIN §6; Baumer SLIN §3.2 with \"11 UART character bits\").",
    evidence: "Nearly every one of the first characters has a parity error and none a framing error (odd for even), or those whose even parity bit would be 0 have a framing error and the others none (no parity for even); or the line has another format than SLIN. Told once.",
    causes: &[
        "the tap is set to 8O1 or 8N1 instead of 8E1",
        "master and encoders were configured with odd parity",
    ],
    next: &[
        "set the tap to 8E1, or let it be found: --frame auto",
        "if the line really has odd parity, this is not a SLIN bus as the manuals describe it",
    ],
    cure: Cure {
        one: "--frame auto for line captures, or set the tap to the format",
        all: "set the tap to 8E1, or --frame auto for line captures",
    },
    say: |finding, record, out| match finding.limit {
        Some(all) => write!(
            out,
            "{} of the first {all} characters fail in the way of a wrong parity setting",
            finding.actual.unwrap_or_default()
        ),
        None => write!(out, "the characters are {}, SLIN's are 8E1", record.wire.format()),
    },
};

/// Writes which characters a finding rests on: `data word 1 (12h), footer (88h)`.
pub(crate) fn name_characters(
    finding: &Finding,
    record: &Record<'_>,
    out: &mut dyn fmt::Write,
) -> fmt::Result {
    let mut separator = "";
    for (index, character) in record.characters().iter().enumerate() {
        if index < 64 && finding.characters >> index & 1 == 1 {
            write!(out, "{separator}")?;
            record.layer.name_character(index, out)?;
            write!(out, " ({:02X}h)", character.value())?;
            separator = ", ";
        }
    }
    Ok(())
}

fn lost(record: &Record<'_>, out: &mut dyn fmt::Write, cause: &str) -> fmt::Result {
    match record.lost() {
        Some(1) => write!(out, "{cause}: 1 character lost"),
        Some(count) => write!(out, "{cause}: {count} characters lost"),
        None => write!(out, "{cause}: an unknown number of characters lost"),
    }
}
