//! Findings: what was wrong, with the numbers that prove it.

use crate::record::Record;
use core::fmt;

/// How bad it is.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Severity {
    /// Worth knowing; nothing is wrong.
    Info,
    /// Out of the ordinary; may be the cause of an error.
    Warning,
    /// Against a rule of the bus.
    Error,
}

impl Severity {
    /// The word that records carry.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Severity::Info => "info",
            Severity::Warning => "warning",
            Severity::Error => "error",
        }
    }
}

/// A kind of finding: the one place that says what it means and what to do about it.
#[derive(Debug)]
pub struct Code {
    /// `protocol.what-happened`, fixed for ever.
    pub name: &'static str,
    /// Its severity. The end of a state is [`Severity::Info`] under the same code.
    pub severity: Severity,
    /// It names a cause, which explains other findings, rather than what was seen.
    pub is_cause: bool,
    /// What it means, in one sentence.
    pub meaning: &'static str,
    /// The rule that was broken, and where it is written.
    pub rule: &'static str,
    /// What the verdict rests on, and when it is withheld.
    pub evidence: &'static str,
    /// The likeliest causes, likeliest first.
    pub causes: &'static [&'static str],
    /// What to measure or change next, in order.
    pub next: &'static [&'static str],
    /// The first of it in a few words: where one station is hit, and where all are.
    pub cure: Cure,
    /// Writes the sentence of one finding.
    pub say: fn(&Finding, &Record<'_>, &mut dyn fmt::Write) -> fmt::Result,
}

/// What to do first, in a few words.
#[derive(PartialEq, Eq, Debug)]
pub struct Cure {
    /// Where one station is hit: ` of ` and its number are put behind it, so it ends in something
    /// that a station has.
    pub one: &'static str,
    /// Where it is the bus.
    pub all: &'static str,
}

impl PartialEq for Code {
    fn eq(&self, other: &Self) -> bool {
        core::ptr::eq(self, other) || self.name == other.name
    }
}

impl Eq for Code {}

/// The edge of a condition that lasts.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum State {
    /// It begins here.
    Begin,
    /// It ended here, after so many ns, if the times are known.
    End(Option<i64>),
}

/// One finding about one record: a code and its evidence.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Finding {
    /// What kind.
    pub code: &'static Code,
    /// What the rule asks for, in the unit of the rule.
    pub expected: Option<i64>,
    /// What was seen.
    pub actual: Option<i64>,
    /// The limit that was passed.
    pub limit: Option<i64>,
    /// Which characters of the record it rests on: bit *n* is character *n*.
    pub characters: u64,
    /// Set where a lasting condition begins or ends.
    pub state: Option<State>,
    /// What to do first, where more is known of the cause than the code tells.
    better: Option<&'static Cure>,
}

impl Finding {
    /// A finding without numbers.
    #[must_use]
    pub const fn new(code: &'static Code) -> Self {
        Finding {
            code,
            expected: None,
            actual: None,
            limit: None,
            characters: 0,
            state: None,
            better: None,
        }
    }

    /// With what the rule asks for.
    #[must_use]
    pub const fn expected(mut self, value: i64) -> Self {
        self.expected = Some(value);
        self
    }

    /// With what was seen.
    #[must_use]
    pub const fn actual(mut self, value: i64) -> Self {
        self.actual = Some(value);
        self
    }

    /// With the limit that was passed.
    #[must_use]
    pub const fn limit(mut self, value: i64) -> Self {
        self.limit = Some(value);
        self
    }

    /// With the characters it rests on.
    #[must_use]
    pub const fn on_characters(mut self, mask: u64) -> Self {
        self.characters = mask;
        self
    }

    /// As the begin or end of a lasting condition.
    #[must_use]
    pub const fn state(mut self, state: State) -> Self {
        self.state = Some(state);
        self
    }

    /// With what to do first in place of what the code says.
    #[must_use]
    pub const fn cured_by(mut self, cure: &'static Cure) -> Self {
        self.better = Some(cure);
        self
    }

    /// What to do first.
    #[must_use]
    pub const fn cure(&self) -> &'static Cure {
        match self.better {
            Some(cure) => cure,
            None => &self.code.cure,
        }
    }

    /// The code's severity; the end of a state is only worth knowing.
    #[must_use]
    pub const fn severity(&self) -> Severity {
        match self.state {
            Some(State::End(_)) => Severity::Info,
            _ => self.code.severity,
        }
    }

    /// Writes the finding as a sentence about the record it was made for.
    ///
    /// # Errors
    /// Only where `out` fails.
    pub fn say(&self, record: &Record<'_>, out: &mut dyn fmt::Write) -> fmt::Result {
        if let Some(State::End(lasted)) = self.state {
            write!(out, "over: ")?;
            (self.code.say)(self, record, out)?;
            return match lasted {
                Some(ns) => write!(out, ", after {}", Span(ns)),
                None => Ok(()),
            };
        }
        (self.code.say)(self, record, out)
    }
}

/// A span of time in the unit a person would choose.
#[derive(Clone, Copy, Debug)]
pub struct Span(pub i64);

impl Span {
    /// Writes it.
    ///
    /// # Errors
    /// Only where `out` fails.
    pub(crate) fn say(self, out: &mut dyn fmt::Write) -> fmt::Result {
        let ns = self.0.unsigned_abs();
        if self.0 < 0 {
            out.write_char('-')?;
        }
        let mut number = itoa::Buffer::new();
        let (unit, name) = match ns {
            0..1_000 => {
                out.write_str(number.format(ns))?;
                return out.write_str(" ns");
            }
            1_000..1_000_000 => (1_000, " µs"),
            1_000_000..1_000_000_000 => (1_000_000, " ms"),
            _ => (1_000_000_000, " s"),
        };
        // Three significant digits at least, one decimal at most from ten on.
        let (whole, rest) = (ns / unit, ns % unit);
        out.write_str(number.format(whole))?;
        match whole {
            0..10 => {
                out.write_str(if rest * 100 / unit < 10 { ".0" } else { "." })?;
                out.write_str(number.format(rest * 100 / unit))?;
            }
            10..100 => {
                out.write_str(".")?;
                out.write_str(number.format(rest * 10 / unit))?;
            }
            _ => {}
        }
        out.write_str(name)
    }
}

impl fmt::Display for Span {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.say(f)
    }
}
