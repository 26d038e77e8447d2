//! What is odd about a file. Nothing of it keeps the rest from being read.

use alloc::vec::Vec;
use core::fmt;

/// Most warnings that are kept of one file.
const MAX_WARNINGS: usize = 100;

/// One thing that is odd, and where.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Warning {
    /// Line of the file, from 1.
    pub line: u32,
    /// What is odd there.
    pub problem: Problem,
}

/// What can be odd.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Problem {
    /// Neither a section nor an entry.
    NotUnderstood,
    /// `[Section` without its bracket.
    MissingBracket,
    /// An entry that the next one, a section or the end of the file cut short.
    MissingSemicolon,
    /// A text without its second quotation mark.
    MissingQuote,
    /// A field, counted from 1, that is no number.
    NoNumber(usize),
    /// A field, counted from 1, whose number is too large or negative.
    NumberOutOfRange(usize),
    /// A field, counted from 1, that is no path.
    NoPath(usize),
    /// A data type of this code is not known; the size is taken instead.
    UnknownType(i64),
    /// Data type and data size contradict each other; the size is taken.
    TypeAgainstSize,
    /// A scaling whose divisor or another factor is 0: it is left out.
    ZeroInScaling,
    /// This number or keyword was there before; the first one holds.
    Repeated,
    /// What it refers to is not in the file.
    NothingReferredTo,
    /// Neither vendor nor product: the file cannot be matched with a device.
    NoIdentity,
    /// More than this many of them, the rest is left out.
    TooMany(usize),
    /// The file is larger than this many bytes, the rest is left out.
    TooLarge(usize),
}

impl fmt::Display for Warning {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "line {}: {}", self.line, self.problem)
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Problem::NotUnderstood => write!(out, "not understood"),
            Problem::MissingBracket => write!(out, "section without ]"),
            Problem::MissingSemicolon => write!(out, "entry without ;"),
            Problem::MissingQuote => write!(out, "text without its second \""),
            Problem::NoNumber(field) => write!(out, "field {field} is no number"),
            Problem::NumberOutOfRange(field) => write!(out, "number of field {field} out of range"),
            Problem::NoPath(field) => write!(out, "field {field} is no path"),
            Problem::UnknownType(code) => write!(out, "unknown data type {code}"),
            Problem::TypeAgainstSize => write!(out, "data type and data size differ"),
            Problem::ZeroInScaling => write!(out, "scaling with 0, left out"),
            Problem::Repeated => write!(out, "there was such an entry before"),
            Problem::NothingReferredTo => write!(out, "refers to what is not in the file"),
            Problem::NoIdentity => write!(out, "no VendCode or no ProdCode: matches no device"),
            Problem::TooMany(most) => write!(out, "more than {most}, the rest is left out"),
            Problem::TooLarge(most) => write!(out, "more than {most} bytes, the rest is left out"),
        }
    }
}

/// The warnings of a file as they come.
#[derive(Default)]
pub(super) struct Warnings(Vec<Warning>);

impl Warnings {
    pub fn add(&mut self, line: u32, problem: Problem) {
        match self.0.len() + 1 {
            MAX_WARNINGS => {
                self.0.push(Warning { line, problem: Problem::TooMany(MAX_WARNINGS - 1) });
            }
            1..MAX_WARNINGS => self.0.push(Warning { line, problem }),
            _ => {}
        }
    }

    pub fn into_list(self) -> Vec<Warning> {
        self.0
    }
}
