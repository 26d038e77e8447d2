//! What a wrong set-up of the tap looks like: swapped lines, another rate, another parity.

use super::codes;
use super::{Character, Format, Parity, ParityRule};
use crate::event::Break;
use crate::finding::Finding;

/// Characters the verdict rests on.
const LOOKED_AT: u32 = 256;

/// Characters it takes at least, where the capture has no more.
const ENOUGH: u32 = 16;

/// A long break counts as this many characters at most, so that one station with a broken driver
/// is not taken for swapped lines.
const BREAK_WEIGHT: u64 = 16;

/// Looks at the first characters of a bus and tells once what is wrong with the set-up.
#[derive(Clone, Default, Debug)]
pub struct Setup {
    /// Characters are expected to have even parity, and have not.
    is_other_format: bool,
    is_judged: bool,
    is_told: bool,
    heard: u32,
    damaged: u32,
    framing: u32,
    parity: u32,
    /// Breaks, and 00h without a stop bit: what idle looks like upside down.
    low: u32,
    pauses: u32,
    /// Intact 80h to 87h.
    requests: u32,
    /// Characters whose even parity bit would be 0, and those of them with a framing error.
    even: u32,
    even_framing: u32,
    has_parity: bool,
}

impl Setup {
    /// For a protocol with even parity, on a line of this format.
    #[must_use]
    pub fn with_even_parity(format: Format) -> Self {
        Setup { is_other_format: format.parity() != ParityRule::Even, ..Setup::default() }
    }

    /// Whether a finding about the bus, made by other means, is worth telling. Of the causes that
    /// a wrong set-up has, the first that is told explains the rest.
    pub fn is_news(&mut self, finding: &Finding) -> bool {
        let is_cause = codes::SETUP_CODES.contains(&finding.code);
        let is_news = !(is_cause && self.is_told);
        (self.is_judged, self.is_told) = (self.is_judged || is_cause, self.is_told || is_cause);
        is_news
    }

    /// Takes a character. Returns a finding if this was the last one it took to be sure.
    #[inline]
    pub fn hear(&mut self, character: &Character) -> Option<Finding> {
        if self.is_judged { None } else { self.look_at(character) }
    }

    fn look_at(&mut self, character: &Character) -> Option<Finding> {
        self.heard += 1;
        let framing = character.has_framing_error();
        let is_even = character.value().count_ones().is_multiple_of(2);
        self.damaged += u32::from(character.is_damaged());
        self.framing += u32::from(framing);
        self.parity += u32::from(character.parity() == Parity::Error);
        self.even += u32::from(is_even);
        self.even_framing += u32::from(is_even && framing);
        self.has_parity |= matches!(character.parity(), Parity::Ok | Parity::Error);
        if framing && character.value() == 0 {
            self.low += 1;
            self.pauses += 1;
        }
        let is_request = character.byte() & 0xF8 == 0x80 && !character.is_damaged();
        self.requests += u32::from(is_request);
        if self.heard >= LOOKED_AT { self.judge() } else { None }
    }

    /// Takes a break, which lasted about so many characters.
    pub fn hear_break(&mut self, event: &Break, character_ns: Option<i64>) -> Option<Finding> {
        if self.is_judged {
            return None;
        }
        let characters = match (event.duration, character_ns) {
            (Some(lasted), Some(one)) if one > 0 => lasted / one.unsigned_abs(),
            _ => 1,
        };
        let weight = u32::try_from(characters.clamp(1, BREAK_WEIGHT)).unwrap_or(1);
        self.heard += weight;
        self.low += weight;
        self.pauses += 1;
        if self.heard >= LOOKED_AT { self.judge() } else { None }
    }

    /// Nothing more will come.
    pub fn finish(&mut self) -> Option<Finding> {
        if self.is_judged {
            None
        } else if self.heard >= ENOUGH {
            self.judge()
        } else {
            self.judge_format()
        }
    }

    fn judge(&mut self) -> Option<Finding> {
        self.is_judged = true;
        let at_least = |part: u32, percent: u32| part * 100 >= self.heard * percent;
        let upside_down = at_least(self.low, 60) && self.pauses >= 3 && self.requests == 0;
        let odd_for_even = at_least(self.parity, 90) && !at_least(self.framing, 5);
        let odd_framing = self.framing - self.even_framing;
        let none_for_even = !self.has_parity
            && at_least(self.framing, 15)
            && self.even_framing * 10 >= self.even * 9
            && odd_framing * 10 <= self.heard - self.even;
        let other_rate =
            at_least(self.damaged, 33) && at_least(self.framing, 5) && !at_least(self.requests, 5);
        let (code, count) = if upside_down {
            (&codes::SWAPPED_LINES, self.low)
        } else if odd_for_even {
            (&codes::WRONG_PARITY, self.parity)
        } else if none_for_even {
            (&codes::WRONG_PARITY, self.framing)
        } else if other_rate {
            (&codes::WRONG_RATE, self.damaged)
        } else {
            return self.judge_format();
        };
        self.is_told = true;
        Some(Finding::new(code).actual(i64::from(count)).limit(i64::from(self.heard)))
    }

    fn judge_format(&mut self) -> Option<Finding> {
        self.is_judged = true;
        self.is_told = self.is_other_format && self.heard > 0;
        self.is_told.then(|| Finding::new(&codes::WRONG_PARITY))
    }

    /// Whether something was wrong.
    #[must_use]
    pub const fn told(&self) -> bool {
        self.is_told
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::Moment;

    fn told(characters: impl Iterator<Item = Character>) -> Option<&'static str> {
        let mut setup = Setup::default();
        let mut found = None;
        for character in characters {
            found = found.or(setup.hear(&character));
        }
        found.or(setup.finish()).map(|finding| finding.code.name)
    }

    fn character(value: u16, parity: Parity) -> Character {
        Character::new(Moment::UNKNOWN, 0, value, parity)
    }

    /// The bytes of a TR encoder's exchange again and again (TR SLIN §6).
    fn bus() -> impl Iterator<Item = u16> {
        [0x80, 0x1A, 0x01, 0x90, 0x81, 0x3A, 0xB1].into_iter().cycle().take(300)
    }

    #[test]
    fn a_healthy_bus_is_set_up_well() {
        assert_eq!(told(bus().map(|value| character(value, Parity::Ok))), None);
        assert_eq!(told(bus().map(|value| character(value, Parity::Unknown))), None);
    }

    #[test]
    fn odd_for_even_parity_fails_everywhere() {
        let all = bus().map(|value| character(value, Parity::Error));
        assert_eq!(told(all), Some("uart.wrong-parity"));
    }

    #[test]
    fn no_parity_for_even_fails_where_the_parity_bit_is_0() {
        let all = bus().map(|value| {
            let plain = character(value, Parity::None);
            if value.count_ones() % 2 == 0 { plain.with_framing_error() } else { plain }
        });
        assert_eq!(told(all), Some("uart.wrong-parity"));
    }

    #[test]
    fn swapped_lines_are_zeros_without_stop_bits() {
        let zeros = core::iter::repeat_n(character(0, Parity::Ok).with_framing_error(), 20);
        assert_eq!(told(zeros.clone()), Some("uart.swapped-lines"));
        assert_eq!(told(zeros.take(15)), None, "too few to be sure");
    }

    #[test]
    fn twice_the_rate_makes_no_parity_errors() {
        // Every bit is read twice, so ones come in pairs; half of the stop bits are data bits.
        let pairs = (0..100).map(|n| {
            let character = character([0x0C, 0x30, 0x3C, 0xC0][n % 4], Parity::Ok);
            if n % 2 == 0 { character.with_framing_error() } else { character }
        });
        assert_eq!(told(pairs), Some("uart.wrong-rate"));
    }

    #[test]
    fn another_rate_is_a_mixture_of_errors() {
        let mixture = (0..100).map(|n| match n % 3 {
            0 => character(0x60 + n, Parity::Ok).with_framing_error(),
            1 => character(0x0F ^ n, Parity::Error),
            _ => character(0x70, Parity::Ok),
        });
        assert_eq!(told(mixture), Some("uart.wrong-rate"));
    }
}
