//! Words that stand beside findings and times, and that no finding explains.

/// A word of the output.
pub struct Word {
    /// The word itself.
    pub name: &'static str,
    /// What it means, in a line.
    pub meaning: &'static str,
    /// What follows from it, and what to do.
    pub next: &'static str,
}

/// All of them, in the order they are listed.
pub static WORDS: [Word; 12] = [
    Word {
        name: "withheld",
        meaning: "A limit that was not judged: what was heard cannot tell on which side of it it lies.",
        next: "Nothing is known to be wrong, and nothing to be right. OPEN says why: mostly the clock, \
               whose ± is larger than the limit. A logic analyzer on the line, or an adapter with \
               smaller ±, can judge it; so can a source that has times where this one has none.",
    },
    Word {
        name: "suspect",
        meaning: "A character that came in one packet with a parity error; which of them had it is not known.",
        next: "Adapters with FTDI and Prolific chips mark the whole packet. Do not count suspect \
               characters as errors: of each packet at least one is. Where it matters which, take a \
               logic analyzer, a native port, or an adapter with a CP210x, which mark the character. \
               `fieldtap ports` says what yours does.",
    },
    Word {
        name: "unknown",
        meaning: "The parity of a character was not told by the source: it may have been right or wrong.",
        next: "Adapters with CH340 and CDC chips mark no parity errors, and files of bytes alone have no \
               place for them. Checksum and framing are judged all the same. To have parity judged, \
               take an adapter that marks it (`fieldtap ports` says what yours does) or a logic \
               analyzer.",
    },
    Word {
        name: "interpolated",
        meaning: "A character whose time was reckoned: it came in one lump with others, which have one stamp.",
        next: "Its time follows from the rate, as if the characters of the lump had come one behind the \
               other without a gap. Its ± holds for it too. Gaps within a lump cannot be seen: response \
               times need an adapter with a shorter latency, or a logic analyzer.",
    },
    Word {
        name: "assumed",
        meaning: "Something that was not heard on the bus, and is taken for true because the rest fits it.",
        next: "On DeviceNet: that a connection was allocated, its size, how messages are laid out, where it \
               began. Capture from before the scanner starts, and it is heard instead. Of characters: that \
               they followed each other without a gap; --baud and a source with times tell better.",
    },
    Word {
        name: "±",
        meaning: "What a time is worth: it lies this far before or behind the stamp at most.",
        next: "A time between two stamps, such as a response time, has the ± of both added up. Where it \
               is less than that, it is told by what it is at most (`under 4.00 ms`), and limits within \
               it are withheld. For less ± see hardware and sample.",
    },
    Word {
        name: "hardware",
        meaning: "Clock: the interface itself stamped what it heard. The computer's delays are not in it.",
        next: "The best clock of a live tap. An adapter that counts milliseconds is worth ±1 ms even so.",
    },
    Word {
        name: "sample",
        meaning: "Clock: the sample counter of a logic analyzer.",
        next: "The best clock there is for times on the line: its ± is a sample or two. Sample a serial line \
               at ten times its rate or faster.",
    },
    Word {
        name: "kernel",
        meaning: "Clock: the operating system stamped frames when they arrived.",
        next: "Worth ±0.2 ms for a CAN controller on the board, ±1 ms for one on USB.",
    },
    Word {
        name: "read",
        meaning: "Clock: a program stamped characters when it was handed them, after adapter and system.",
        next: "Worth what the adapter keeps characters for, and 2 ms for the computer. Times of a line's \
               response drown in that. An FTDI adapter improves with its latency timer at 1 ms \
               (`fieldtap ports` says how); beyond that take a logic analyzer.",
    },
    Word {
        name: "log",
        meaning: "Clock: the times stand in a file that does not say who stamped them.",
        next: "Their ± is that of their last digit, and may be more. Where response times matter, find out \
               what wrote the file.",
    },
    Word {
        name: "lost",
        meaning: "Something was on the bus that did not get through to fieldtap: here the record has a hole.",
        next: "What stands on both sides is not joined, and no answer is called missing across it. Where \
               the count is known it is told. Lost on a live tap: close other programs, take another USB \
               port or a faster disk. Lost on the line: see the finding beside it.",
    },
];

/// The word of that name.
pub fn word(name: &str) -> Option<&'static Word> {
    let name = if name == "+-" || name == "+/-" { "±" } else { name };
    WORDS.iter().find(|word| word.name == name)
}
