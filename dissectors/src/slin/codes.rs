//! Finding codes of SLIN.

use crate::finding::{Code, Cure, Severity, Span, State};
use crate::uart::{Character, name_characters};

/// All of them.
pub static CODES: [&Code; 18] = [
    &PARITY,
    &CHECKSUM,
    &ADDRESS_MISMATCH,
    &NO_RESPONSE,
    &MISSING_FOOTER,
    &TOO_MANY_WORDS,
    &DUPLICATE_ADDRESS,
    &LATE_RESPONSE,
    &EARLY_RESPONSE,
    &RESERVED_BITS,
    &STRAY_DATA,
    &LATE_ANSWER,
    &POSITION_JUMP,
    &NOT_SLIN,
    &GLITCH,
    &NO_DATA_WORDS,
    &AMBIGUOUS,
    &NEVER_ANSWERED,
];

const WIRING: &str = "check the wiring of TR SLIN §3: 120 Ω at the first and at the last station only; unpowered, about 60 Ω between the lines; 4.7 kΩ from each line to Bus (+5 V) and Bus (0 V)";
const BIAS: &str = "measure the idle voltage between the lines: below 200 mV a receiver may see anything; with both terminations it takes 7 encoders with 4.7 kΩ each to get there, fewer need bias at the master";
const LENGTH: &str = "check the cable: twisted and screened, 1200 m at most and 600 m in reason, no stubs (TR SLIN §1, §2)";
const POTENTIAL: &str = "measure between the Bus (0 V) of the stations: within ±2 V, else a potential compensation line with 100 Ω at every station (TR SLIN §4)";
const IDENT: &str = "check the Ident jumpers in the connectors: Ident 0, 1, 2 count 1, 2, 4 (TR SLIN §5); the manual does not say whether an open jumper is 0 or 1, so look for the silent address's mirror image too";

/// A parity bit does not fit.
pub static PARITY: Code = Code {
    name: "slin.parity",
    severity: Severity::Error,
    is_cause: false,
    meaning: "A character's parity bit does not fit its data bits: an odd number of its bits is wrong.",
    rule: "Even parity on every character (TR SLIN §6; Baumer SLIN §3.1 \"data backup by parity and checksum\", §3.2).",
    evidence: "The parity bit of the line, or the receiver's parity flag, for the characters named. Characters of an adapter that marks whole packets are `suspect` and not counted. Two wrong bits in one character are not seen.",
    causes: &[
        "interference: frequency converter, contactor, missing screen (then all stations are hit)",
        "a bad plug or drop cable (then one station is hit)",
        "two encoders with the same address answer at once (then one address is hit, in most of its answers: see slin.duplicate-address)",
        "termination missing or doubled: reflections, worse with length and rate",
    ],
    next: &[
        "compare stations: `fieldtap stats` counts findings by station",
        "one station only: its drop cable, plug and Ident jumpers",
        WIRING,
        BIAS,
        LENGTH,
        POTENTIAL,
    ],
    cure: Cure { one: "check drop cable and plug", all: "check termination, bias and screen" },
    say: |finding, record, out| {
        write!(out, "parity error in ")?;
        name_characters(finding, record, out)
    },
};

/// The checksum is wrong under every reading that is left.
pub static CHECKSUM: Code = Code {
    name: "slin.checksum",
    severity: Severity::Error,
    is_cause: false,
    meaning: "The checksum in the footer does not fit the data words.",
    rule: "Bits 4 to 6 of the footer are bits 4 to 6 of the sum of the data words: ADD (Baumer SLIN §3.3), ADDC over four words (TR SLIN §7).",
    evidence: "The words as received, under the rule of the profile or every rule that the evidence has not ruled out. The rules differ for about 1 position in 100, and then by one: while undecided, what any of them explains is no error.",
    causes: &[
        "a data word was lost or altered by interference (two wrong bits in one character pass the parity check)",
        "the other maker's checksum rule is set: errors in about 1 % of telegrams, off by one, always at the same shaft angles",
        "two encoders with the same address answer at once",
    ],
    next: &[
        "if the errors come and go with the shaft angle and are off by one, leave out --checksum and --profile where they were given: the rule is then found from the traffic",
        "if there are parity errors as well, follow `fieldtap explain slin.parity`",
        WIRING,
        LENGTH,
    ],
    cure: Cure { one: "check drop cable and plug", all: "check termination and cable" },
    say: |finding, _, out| {
        write!(
            out,
            "checksum {}, expected {}",
            finding.actual.unwrap_or_default(),
            finding.expected.unwrap_or_default()
        )
    },
};

/// The footer names another station.
pub static ADDRESS_MISMATCH: Code = Code {
    name: "slin.address-mismatch",
    severity: Severity::Error,
    is_cause: false,
    meaning: "The footer names another station than the request.",
    rule: "The encoder that is asked ends its answer with its own address (Baumer SLIN §3.2, TR SLIN §6).",
    evidence: "Request and footer as received; withheld where either is suspect. Where the named station was silent when it was asked before, and it was heard before that or the answer is outside the window, it is slin.late-answer instead.",
    causes: &[
        "interference altered the request or the footer",
        "a second master sent a request into the answer",
        "an encoder answers to an address that is not its own: jumper or firmware",
    ],
    next: &[
        "look for parity errors in the same telegram",
        "see whether it is always the same pair of addresses: then it is that encoder's jumpers",
        IDENT,
        "make sure that there is one master only, and that no programming device is plugged in",
    ],
    cure: Cure { one: "check Ident jumpers", all: "check for a second master" },
    say: |finding, _, out| {
        write!(
            out,
            "the footer names station {}, station {} was asked",
            finding.actual.unwrap_or_default(),
            finding.expected.unwrap_or_default()
        )
    },
};

/// A station that was heard before is silent.
pub static NO_RESPONSE: Code = Code {
    name: "slin.no-response",
    severity: Severity::Error,
    is_cause: false,
    meaning: "A station that answered before did not answer this request.",
    rule: "The encoder answers within 1 ms (Baumer SLIN §3.2), after 0.1 to 0.4 ms (TR SLIN §6).",
    evidence: "Another control word, or silence for ten times the limit (10 ms while the maker is undecided). Heard before is a station with one undamaged answer that named itself; a damaged request is not counted, it may have been for another. From the third in a row it is a state: told when it begins and when it ends; `fieldtap stats` counts every request of it.",
    causes: &[
        "the station lost its supply, or its plug is loose",
        "the request was damaged on its way to the station (the tap may hear it better)",
        "the master asks faster than the encoder can answer",
        "the encoder is restarting",
    ],
    next: &[
        "measure the supply at the encoder while the machine moves",
        "wiggle plug and cable and watch whether the silence follows",
        "look whether other stations fall silent at the same time: then it is the line, not the encoder",
        WIRING,
    ],
    cure: Cure { one: "check supply and plug", all: "check supply and line" },
    say: |finding, record, out| {
        let station = record.station.unwrap_or_default();
        match finding.state {
            Some(State::Begin) => write!(
                out,
                "station {station} is silent, {} requests in a row",
                finding.actual.unwrap_or_default()
            ),
            Some(State::End(_)) => write!(
                out,
                "station {station} was silent for {} requests in a row",
                finding.actual.unwrap_or_default()
            ),
            None => write!(out, "station {station} did not answer"),
        }
    },
};

/// Data words without an end.
pub static MISSING_FOOTER: Code = Code {
    name: "slin.missing-footer",
    severity: Severity::Error,
    is_cause: false,
    meaning: "An answer has data words but no footer: it was torn, and its position is not known.",
    rule: "The footer ends every answer (Baumer SLIN §3.2, TR SLIN §6).",
    evidence: "Silence, or the next request, came before a footer. With bit 3 low a footer and a request look alike: a control word followed by a data word is a request.",
    causes: &[
        "the encoder lost its supply or was reset while sending",
        "interference turned the footer into a data word, or the tap missed it",
        "a second master, or an impatient one, sent its request into the answer",
        "the profile is wrong: `--profile baumer` on a TR bus sees no footer at all",
    ],
    next: &[
        "if every answer is hit, leave out --profile if it was given",
        "look whether a request follows the last word at once: then look for the second master",
        "measure the encoder's supply",
        WIRING,
    ],
    cure: Cure {
        one: "check supply and plug",
        all: "leave out --profile if it was given; look for a second master",
    },
    say: |_, record, out| write!(out, "no footer after {} characters", record.characters().len()),
};

/// More than four data words.
pub static TOO_MANY_WORDS: Code = Code {
    name: "slin.too-many-words",
    severity: Severity::Error,
    is_cause: false,
    meaning: "An answer has more than four data words: it has no position.",
    rule: "At most four data bytes (Baumer SLIN §3.2); the checksum of TR SLIN §7 knows four.",
    evidence: "The data words between the request and the footer.",
    causes: &[
        "ghost characters: the line floats when a driver switches off, and the receiver reads 00h",
        "two encoders with the same address answer one after the other",
        "interference turned a footer into a data word",
    ],
    next: &[
        BIAS,
        "look at the additional word: always the same value at the same place is a ghost, changing values are a second encoder",
        IDENT,
    ],
    cure: Cure { one: "check bias, and the Ident jumpers", all: "check bias" },
    say: |finding, _, out| {
        write!(
            out,
            "{} data words, at most {} are allowed",
            finding.actual.unwrap_or_default(),
            finding.limit.unwrap_or_default()
        )
    },
};

/// Two encoders with one address.
pub static DUPLICATE_ADDRESS: Code = Code {
    name: "slin.duplicate-address",
    severity: Severity::Error,
    is_cause: true,
    meaning: "Two encoders seem to answer to the same address.",
    rule: "Every encoder has an address of its own (TR SLIN §5).",
    evidence: "The address gave two footers to one request, and not for the first time; or at least 5 of its last 10 answers have two or more damaged characters while no other address has any such answer.",
    causes: &[
        "two connectors with the same Ident jumpers, often after an encoder was replaced",
        "an Ident wire is broken: the address changes to one that is taken",
    ],
    next: &[
        "unplug one encoder after the other: if the address still answers, the other one is there",
        IDENT,
    ],
    cure: Cure {
        one: "look for a second encoder with the Ident jumpers",
        all: "check all Ident jumpers",
    },
    say: |finding, record, out| {
        let station = record.station.unwrap_or_default();
        match finding.limit {
            Some(answers) => write!(
                out,
                "{} of the last {answers} answers of station {station} are damaged in two or more characters, no other station's",
                finding.actual.unwrap_or_default()
            ),
            None => write!(
                out,
                "station {station} ended one answer twice, {} times so far",
                finding.actual.unwrap_or_default()
            ),
        }
    },
};

/// The answer came after the limit.
pub static LATE_RESPONSE: Code = Code {
    name: "slin.late-response",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "The answer began later than the maker allows.",
    rule: "Within 1 ms (Baumer SLIN §3.2), after 0.1 to 0.4 ms (TR SLIN §6), counted here from the end of the request's stop bit to the first start bit of the answer.",
    evidence: "Both stamps. Told where the limit is passed by more than their uncertainty, 1 % of a character and one bit; withheld where the limit lies within the uncertainty.",
    causes: &[
        "the encoder is another maker's than the profile says: Baumer allows 1 ms, TR 0.4 ms",
        "the encoder is busy, old, or too hot",
        "a gateway or a slow repeater between tap and encoder",
    ],
    next: &[
        "see `fieldtap stats` for this station's minimum, median and 99th percentile: a constant value is the encoder's habit",
        "leave out --profile if it was given, or name this encoder's maker with it",
        "check that the master's time-out is longer than what is measured",
    ],
    cure: Cure {
        one: "see stats for the response times",
        all: "leave out --profile if it was given",
    },
    say: |finding, _, out| {
        write!(
            out,
            "late: {}, limit {}",
            Span(finding.actual.unwrap_or_default()),
            Span(finding.limit.unwrap_or_default())
        )
    },
};

/// The answer came before the window.
pub static EARLY_RESPONSE: Code = Code {
    name: "slin.early-response",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "The answer began earlier than the maker promises: the master may still be driving the line.",
    rule: "Not before 0.1 ms (TR SLIN §6). Baumer gives no lower limit.",
    evidence: "Both stamps. Told where the limit is missed by more than their uncertainty, 1 % of a character and one bit; withheld where it lies within the uncertainty, and wherever one bit is longer than the limit.",
    causes: &[
        "the encoder is another maker's than the profile says",
        "what answered is not the encoder: a second master, an echo, or a late answer of another station",
    ],
    next: &[
        "leave out --profile if it was given",
        "see `fieldtap stats` for the response times of this station",
        "check how fast the master's driver lets go of the line",
    ],
    cure: Cure {
        one: "see stats for the response times",
        all: "leave out --profile if it was given",
    },
    say: |finding, _, out| {
        write!(
            out,
            "early: {}, not before {}",
            Span(finding.actual.unwrap_or_default()),
            Span(finding.limit.unwrap_or_default())
        )
    },
};

/// Reserved bits are set.
pub static RESERVED_BITS: Code = Code {
    name: "slin.reserved-bits",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "Bits 4 to 6 of the request are reserved and should be low.",
    rule: "\"3 reserved bits (low)\" (Baumer SLIN §3.2, TR SLIN §6).",
    evidence: "The request as received.",
    causes: &[
        "the master's program builds the control word wrongly",
        "interference altered the request",
        "the profile is wrong: `--profile baumer` takes the footers of a TR bus for requests",
    ],
    next: &[
        "see whether every request has them: then it is the master's program",
        "leave out --profile if it was given",
    ],
    cure: Cure {
        one: "check in the master's program the request bytes",
        all: "check the master's program",
    },
    say: |finding, _, out| {
        write!(out, "reserved bits of the request are {:03b}", finding.actual.unwrap_or_default())
    },
};

/// Characters outside any exchange.
pub static STRAY_DATA: Code = Code {
    name: "slin.stray-data",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "Characters came that nobody asked for.",
    rule: "Every bus activity of an encoder is started by a control word of the master (Baumer SLIN §3.1, TR SLIN §6).",
    evidence: "Data words outside any exchange, or a second answer to one request. What the beginning or the end of the capture cut off is not counted.",
    causes: &[
        "ghost characters: the line floats between telegrams",
        "an encoder answers longer than its footer, or twice; two encoders share an address",
        "the request was lost on the way to the tap",
        "something on the line speaks another protocol",
    ],
    next: &[
        BIAS,
        IDENT,
        "look for the same bytes at the same distance from a telegram: that is a station, not noise",
    ],
    cure: Cure { one: "check bias, and Ident jumpers", all: "check bias" },
    say: |finding, _, out| {
        let count = finding.actual.unwrap_or_default();
        let plural = if count == 1 { "" } else { "s" };
        write!(out, "{count} character{plural} that nobody asked for")
    },
};

/// An answer after everybody had given up waiting.
pub static LATE_ANSWER: Code = Code {
    name: "slin.late-answer",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "An answer came after its request had been given up.",
    rule: "Within 1 ms (Baumer SLIN §3.2), after 0.1 to 0.4 ms (TR SLIN §6).",
    evidence: "Words with a footer that names the station that was silent before, after the next request or after ten response limits.",
    causes: &[
        "the encoder is far too slow: busy, overheated, restarting",
        "a gateway or repeater delays answers",
        "the master asks the next station before this one had its time",
    ],
    next: &[
        "compare the master's time-out with this answer's delay",
        "see whether it is always the same station: then exchange it with another of its kind",
    ],
    cure: Cure {
        one: "compare the master's time-out with the response times",
        all: "compare the master's time-out",
    },
    say: |finding, record, out| {
        let station = record.station.unwrap_or_default();
        match finding.actual {
            Some(ns) => write!(out, "station {station} answers {} after its request", Span(ns)),
            None => write!(out, "station {station} answers a request it had missed"),
        }
    },
};

/// One position does not fit its neighbours.
pub static POSITION_JUMP: Code = Code {
    name: "slin.position-jump",
    severity: Severity::Warning,
    is_cause: false,
    meaning: "A position does not fit the ones before and after it: perhaps a wrong value without any error mark.",
    rule: "No manual has such a rule. Parity misses two wrong bits in a character, and the checksum misses 1 in 5 of those.",
    evidence: "The step to this position differs from the steps before and after it by more than 127 and by more than 8 times the largest other change of step among the station's last 100. Both differences have the same sign, and at least 4 changes of step were seen before. Steps are counted modulo the resolution of --stations, else modulo the smallest power of two above every position shown. Steps across gaps, missed and damaged telegrams are left out. A spike is told once, not its return.",
    causes: &[
        "interference that parity and checksum did not catch",
        "a lost data word: the lower part of the position alone passes 1 check in 8",
        "the encoder itself: code disc, sensor, or preset while running",
        "the axis really did it",
    ],
    next: &[
        "look at the telegram's words with -v: single bits or a missing word point to the line",
        "look for parity errors around it: where some are caught, others pass",
        "if it is always the same position, it is the encoder's disc",
    ],
    cure: Cure {
        one: "look at the words with -v, check cable and disc",
        all: "check termination and screen",
    },
    say: |finding, record, out| {
        write!(
            out,
            "position {} of station {} does not fit its neighbours, which lead to {}",
            finding.actual.unwrap_or_default(),
            record.station.unwrap_or_default(),
            finding.expected.unwrap_or_default()
        )
    },
};

/// The traffic is not SLIN.
pub static NOT_SLIN: Code = Code {
    name: "slin.not-slin",
    severity: Severity::Warning,
    is_cause: true,
    meaning: "What is on this line does not speak SLIN.",
    rule: "Request 80h to 87h, data words, footer (Baumer SLIN §3.2, TR SLIN §6). Baumer's other RS485 protocol: 38400 Bd, 8N1, request 01 80 address 80 04, answer with six bytes between 01 and LRC 04.",
    evidence: "Requests of Baumer's other protocol, at least one for every two exchanges that seem complete: in the whole capture where it was read as SLIN, in its first 256 characters or 2 s where auto decides. Or no complete exchange in a whole capture of at least 16 characters that was read as SLIN, less than half of them damaged, less than half of them requests and answers under these settings, less than a quarter of the control words footers under any, and no wrong set-up of the tap to explain it. Told once, at the end.",
    causes: &[
        "the encoder is a GXM7W/GXM7S with ordinary RS485: same housing and plug, another protocol",
        "another device or protocol on this line",
        "rate, format or polarity are wrong: see uart.wrong-rate, uart.wrong-parity, uart.swapped-lines",
    ],
    next: &[
        "compare the type code on the encoder with the order code for SLIN",
        "read as plain characters: --protocol uart",
    ],
    cure: Cure {
        one: "try --protocol uart; compare the type code",
        all: "compare the encoder's type code; --protocol uart",
    },
    say: |finding, _, out| match finding.actual {
        Some(requests) => {
            let plural = if requests == 1 { "" } else { "s" };
            write!(
                out,
                "{requests} request{plural} of Baumer's other RS485 protocol (01 80 address 80 04) in {} characters: an encoder without SLIN",
                finding.limit.unwrap_or_default()
            )
        }
        None => write!(
            out,
            "no complete exchange in {} characters: this does not speak SLIN",
            finding.limit.unwrap_or_default()
        ),
    },
};

/// A short pulse at turnaround.
pub static GLITCH: Code = Code {
    name: "slin.glitch",
    severity: Severity::Info,
    is_cause: false,
    meaning: "A short pulse was read as FFh with a parity or framing error: nobody sent that.",
    rule: "None: it is what a floating line does while one driver hands over to the next.",
    evidence: "FFh with a parity or framing error outside the words of a telegram, and no character right behind it. It is left out of the telegram and of its response time.",
    causes: &[
        "the idle line floats: no bias, or too few encoders to bias a doubly terminated line",
        "driver switching at turnaround, nearly always harmless",
    ],
    next: &[BIAS, WIRING],
    cure: Cure { one: "check bias at the drop cable", all: "check bias" },
    say: |finding, record, out| {
        let first = finding.characters.trailing_zeros() as usize;
        let read_as = record.characters().get(first).map_or(0xFF, Character::value);
        write!(out, "a short pulse, read as {read_as:02X}h")
    },
};

/// A footer alone.
pub static NO_DATA_WORDS: Code = Code {
    name: "slin.no-data-words",
    severity: Severity::Info,
    is_cause: false,
    meaning: "The answer is a footer alone; taken as position 0.",
    rule: "Data words are sent \"until no more relevant data are available\" (Baumer SLIN §3.2): neither manual says whether position 0 is one zero word or none.",
    evidence: "A footer with bit 3 high right after the request.",
    causes: &["position 0, sent without a word", "the data words were lost on the way"],
    next: &[
        "turn the shaft: if the station never sends one zero word at 0, this is its way of saying 0",
    ],
    cure: Cure { one: "turn the shaft", all: "turn the shafts" },
    say: |_, _, out| write!(out, "footer without data words, taken as position 0"),
};

/// A request, or a request and an empty answer.
pub static AMBIGUOUS: Code = Code {
    name: "slin.ambiguous",
    severity: Severity::Info,
    is_cause: false,
    meaning: "Two equal control words: a request and its repetition, or a request and an empty answer.",
    rule: "With bit 3 low, the footer of an answer without data words has the same bits as its request (TR SLIN §6).",
    evidence: "The second control word began where an answer may begin. Told in place of slin.no-response and slin.never-answered.",
    causes: &[
        "position 0, sent without a word",
        "the master asks again at once because nobody answered",
    ],
    next: &[
        "turn the shaft: if answers with data words appear, the station is alive",
        "compare with the master's time-out: a repetition comes after it",
    ],
    cure: Cure { one: "turn the shaft", all: "turn the shafts" },
    say: |_, record, out| {
        let station = record.station.unwrap_or_default();
        write!(
            out,
            "unanswered, or the next character is station {station}'s empty answer (position 0)"
        )
    },
};

/// An address where nobody was heard yet.
pub static NEVER_ANSWERED: Code = Code {
    name: "slin.never-answered",
    severity: Severity::Info,
    is_cause: false,
    meaning: "This address was asked and nobody has answered there so far.",
    rule: "None: masters scan addresses that are not in use. Up to 8 encoders (TR SLIN §1).",
    evidence: "Another control word, or silence for ten times the limit. A damaged request is not counted. Told once an address.",
    causes: &[
        "there is no encoder at this address, and the master asks in vain",
        "the encoder has another address than planned: Ident jumpers",
        "the encoder has no supply, or another rate",
    ],
    next: &[
        IDENT,
        "measure the encoder's supply",
        "try the other rates of the manual: 9600, 19200, 115200, 345594 Bd",
    ],
    cure: Cure { one: "check Ident jumpers and supply", all: "check rate and supply" },
    say: |_, record, out| {
        let station = record.station.unwrap_or_default();
        write!(out, "nobody answered as station {station} yet")
    },
};
