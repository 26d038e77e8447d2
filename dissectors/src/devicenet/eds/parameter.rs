//! A parameter of a device: how a value of it reads.

use crate::devicenet::cip::{DataType, Target, Value};
use alloc::string::String;
use alloc::vec::Vec;
use core::fmt;

/// Decimals that are worth printing.
const MAX_DECIMALS: usize = 9;

/// `ParamN` of the section `[Params]`, with its `EnumN`.
#[derive(Clone, PartialEq, Debug)]
pub struct Parameter {
    /// Its name.
    pub name: String,
    /// The unit of its value, or nothing.
    pub unit: String,
    /// What it is for, or nothing.
    pub help: String,
    /// The attribute that it stands for.
    pub target: Option<Target>,
    /// How its bytes read.
    pub kind: DataType,
    /// Its size in bytes, where the file tells.
    pub size: Option<u16>,
    /// Whether the file calls it read only.
    pub is_read_only: bool,
    /// Its lowest value, where that is a whole number.
    pub minimum: Option<i64>,
    /// Its highest value, where that is a whole number.
    pub maximum: Option<i64>,
    /// How its number becomes a quantity, where it does.
    pub scaling: Option<Scaling>,
    /// Decimals of the quantity.
    pub decimals: u8,
    /// What its values are called; of words of bits, what the bits are called.
    pub words: Vec<(i64, String)>,
}

/// quantity = (number + offset) × multiplier × base ÷ divisor.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Scaling {
    /// Not 0.
    pub multiplier: i64,
    /// Not 0.
    pub divisor: i64,
    /// Not 0.
    pub base: i64,
    /// Added first.
    pub offset: i64,
}

impl Scaling {
    /// The quantity of a number.
    #[must_use]
    pub fn apply(self, number: i64) -> f64 {
        let sum = number as f64 + self.offset as f64;
        sum * self.multiplier as f64 * self.base as f64 / self.divisor as f64
    }
}

impl Parameter {
    /// What a value is called.
    #[must_use]
    pub fn word(&self, number: i64) -> Option<&str> {
        self.words.iter().find(|(value, _)| *value == number).map(|(_, word)| word.as_str())
    }

    /// A value as a sentence says it: scaled, with its unit and what it is called.
    #[must_use]
    pub const fn in_words<'a>(&'a self, value: Value<'a>) -> Described<'a> {
        Described { parameter: self, value }
    }
}

/// A value as a sentence says it.
#[derive(Clone, Copy, Debug)]
pub struct Described<'a> {
    parameter: &'a Parameter,
    value: Value<'a>,
}

impl fmt::Display for Described<'_> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Parameter { scaling, decimals, unit, .. } = self.parameter;
        match (scaling, self.value.number()) {
            (Some(scaling), Some(number)) => {
                let decimals = usize::from(*decimals).min(MAX_DECIMALS);
                write!(out, "{:.*}", decimals, scaling.apply(number))?;
            }
            _ => write!(out, "{}", self.value)?,
        }
        if !unit.is_empty() {
            write!(out, " {unit}")?;
        }
        match self.value {
            Value::Bits { bits, .. } => self.write_bits(bits, out),
            _ => {
                let word = self.value.number().and_then(|number| self.parameter.word(number));
                word.map_or(Ok(()), |word| write!(out, " ({word})"))
            }
        }
    }
}

impl Described<'_> {
    /// In words of bits each bit has a name of its own (CIP Vol. 1 §5-14, Get_Enum_String).
    fn write_bits(&self, bits: u64, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let is_set = |(bit, _): &&(i64, String)| (0..64).contains(bit) && bits >> bit & 1 == 1;
        for (index, (_, word)) in self.parameter.words.iter().filter(is_set).enumerate() {
            write!(out, "{}{word}", if index == 0 { " (" } else { ", " })?;
        }
        let is_any = self.parameter.words.iter().any(|word| is_set(&word));
        if is_any { write!(out, ")") } else { Ok(()) }
    }
}
