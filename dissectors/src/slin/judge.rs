//! The rules of SLIN, each as a check that leaves a finding or not.

use super::codes;
use super::exchange::{Exchange, Part};
use super::grammar::NOISE;
use super::profile::{Expectation, Window};
use super::word::{Address, Footer, MAX_DATA_WORDS, Response};
use crate::finding::{Code, Finding};
use crate::uart::{self, Character, Wire};
use alloc::vec::Vec;

/// What was found out about one record.
#[derive(Default, Debug)]
pub(super) struct Verdict {
    pub findings: Vec<Finding>,
    /// States that were told before and go on.
    pub ongoing: Vec<&'static Code>,
    pub withheld: Vec<&'static Code>,
}

impl Verdict {
    pub fn clear(&mut self) {
        self.findings.clear();
        self.ongoing.clear();
        self.withheld.clear();
    }

    pub fn add(&mut self, finding: Finding) {
        self.findings.push(finding);
    }

    /// Parity and framing errors, and glitches, of these characters.
    pub fn judge_damage(&mut self, characters: &[Character], parts: &[Part]) {
        if characters.iter().all(|character| !character.is_damaged()) {
            return;
        }
        let (mut parity, mut framing, mut noise) = (0, 0, 0);
        for (index, (character, part)) in characters.iter().zip(parts).enumerate() {
            let bit = 1_u64 << index;
            if is_noise(character, *part) {
                noise |= bit;
            } else if character.has_framing_error() {
                framing |= bit;
            }
            if character.parity() == uart::Parity::Error && noise & bit == 0 {
                parity |= bit;
            }
        }
        for (code, mask) in
            [(&codes::PARITY, parity), (&uart::FRAMING, framing), (&codes::GLITCH, noise)]
        {
            if mask != 0 {
                self.add(Finding::new(code).on_characters(mask));
            }
        }
    }

    /// Whether the words of an answer are as they should be.
    pub fn judge_words(&mut self, response: &Response<'_>) {
        let words = response.data.len();
        if response.footer.is_none() {
            self.add(Finding::new(&codes::MISSING_FOOTER));
        }
        if words > MAX_DATA_WORDS {
            let limit = MAX_DATA_WORDS as i64;
            self.add(Finding::new(&codes::TOO_MANY_WORDS).actual(words as i64).limit(limit));
        }
        if words == 0 {
            self.add(Finding::new(&codes::NO_DATA_WORDS));
        }
    }

    /// Whether the footer names the station that was asked. Where one of the two may be damaged, an
    /// adapter that marks whole packets leaves open which.
    pub fn judge_address(&mut self, exchange: &Exchange, footer: Footer, asked: Address) {
        let is_suspect = |it: Option<&Character>| {
            it.is_some_and(|character| character.parity() == uart::Parity::Suspect)
        };
        if footer.address == asked {
            return;
        }
        if is_suspect(exchange.request()) || is_suspect(exchange.footer()) {
            self.withheld.push(&codes::ADDRESS_MISMATCH);
            return;
        }
        let mismatch = Finding::new(&codes::ADDRESS_MISMATCH)
            .expected(i64::from(asked.get()))
            .actual(i64::from(footer.address.get()));
        self.add(mismatch);
    }

    /// Whether the checksum is one that the station may send. There is no rule for more than four
    /// words.
    pub fn judge_checksum(&mut self, data: &[u8], footer: Footer, expected: u8) {
        if data.len() <= MAX_DATA_WORDS && footer.checksum != expected {
            let wrong = Finding::new(&codes::CHECKSUM)
                .expected(i64::from(expected))
                .actual(i64::from(footer.checksum));
            self.add(wrong);
        }
    }

    /// Whether the answer began within the window. Limits are broken, kept, or too close to call.
    pub fn judge_time(&mut self, taken: Option<Interval>, window: Window, wire: Wire) {
        let bit = wire.bit_ns();
        let (Some(Interval { ns, uncertainty }), Some(bit)) = (taken, bit) else {
            self.withheld.push(&codes::LATE_RESPONSE);
            if window.earliest.is_some() {
                self.withheld.push(&codes::EARLY_RESPONSE);
            }
            return;
        };
        let late_by = ns - window.latest;
        if late_by > uncertainty + bit {
            let late = Finding::new(&codes::LATE_RESPONSE).actual(ns).limit(window.latest);
            self.add(late);
        } else if late_by.abs() <= uncertainty {
            self.withheld.push(&codes::LATE_RESPONSE);
        }
        let Some(earliest) = window.earliest else { return };
        let early_by = earliest - ns;
        if earliest < bit || early_by.abs() <= uncertainty {
            self.withheld.push(&codes::EARLY_RESPONSE);
        } else if early_by > uncertainty + bit {
            self.add(Finding::new(&codes::EARLY_RESPONSE).actual(ns).limit(earliest));
        }
    }
}

/// A measured span of time.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Interval {
    pub ns: i64,
    /// ± of it.
    pub uncertainty: i64,
}

impl Interval {
    /// From the end of one character's stop bit to the start bit of another: with the ± of both
    /// stamps and 1 % of a character, since the end is calculated.
    pub fn between(earlier: &Character, later: &Character, wire: Wire) -> Option<Interval> {
        let character = wire.character_ns()?;
        let ns = later.start.since(earlier.start)? - character;
        let stamps = i64::from(earlier.uncertainty) + i64::from(later.uncertainty);
        Some(Interval { ns, uncertainty: stamps + character / 100 })
    }

    /// Whether it may lie within the window.
    pub fn may_lie_in(self, window: Window, wire: Wire) -> bool {
        let slack = self.uncertainty + wire.bit_ns().unwrap_or_default();
        self.ns >= window.earliest.unwrap_or(0) - slack && self.ns <= window.latest + slack
    }
}

/// Whether a character is the trace of a glitch.
pub(super) fn is_noise(character: &Character, part: Part) -> bool {
    part == Part::Stray && character.byte() == NOISE && character.is_damaged()
}

/// The checksum that the station would have sent: the one received, where a rule that is left
/// explains it.
pub(super) fn expected_checksum(data: &[u8], footer: Footer, expectation: Expectation) -> u8 {
    let fitting = super::checksum::Rules::fitting(data, footer.checksum);
    if !fitting.and(expectation.rules).is_empty() {
        return footer.checksum;
    }
    expectation.rules.first().map_or(footer.checksum, |rule| rule.checksum(data))
}

/// Whether an exchange is right in every way that can be seen: it can teach and be built on.
pub(super) fn is_sound(exchange: &Exchange, expected: u8) -> bool {
    let response = exchange.response();
    let Some(footer) = response.footer else { return false };
    response.data.len() <= MAX_DATA_WORDS
        && footer.checksum == expected
        && exchange.asked().is_none_or(|asked| asked == footer.address)
        && exchange
            .characters()
            .iter()
            .zip(exchange.parts())
            .all(|(character, part)| *part == Part::Stray || !character.is_damaged())
}
