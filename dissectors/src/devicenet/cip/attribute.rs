//! Attributes: one row of a class's table, and how a value of it reads in words.

use super::{DataType, Value, WrongLength};
use core::fmt;

/// Who may write an attribute.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Access {
    /// It can only be read.
    Get,
    /// It can be read and written.
    GetSet,
}

/// One attribute of a class.
#[derive(Clone, Copy, Debug)]
pub struct Attribute {
    /// Its number.
    pub id: u8,
    /// Its name, as its manual prints it.
    pub name: &'static str,
    /// How its bytes read.
    pub kind: DataType,
    /// Who may write it.
    pub access: Access,
    /// The unit of its value, or `""`.
    pub unit: &'static str,
    /// What its values are called.
    pub words: Words,
}

/// What the values of an attribute are called.
#[derive(Clone, Copy, Debug)]
pub enum Words {
    /// Nothing: they are quantities.
    None,
    /// One of these.
    OneOf(&'static [(u16, &'static str)]),
    /// One of a longer list.
    Named(fn(u16) -> Option<&'static str>),
    /// Each bit for itself.
    Bits(&'static [Bit]),
    /// Otherwise.
    Told(fn(i64, &mut fmt::Formatter<'_>) -> fmt::Result),
}

/// One bit of a word.
#[derive(Clone, Copy, Debug)]
pub struct Bit {
    /// Its number, from 0.
    pub number: u8,
    /// What it says when set.
    pub set: &'static str,
    /// What it says when clear; `""` where that is nothing.
    pub clear: &'static str,
}

impl Attribute {
    /// Whether it can be written.
    #[must_use]
    pub const fn is_settable(&self) -> bool {
        matches!(self.access, Access::GetSet)
    }

    /// The value in these bytes.
    ///
    /// # Errors
    /// Data is missing or left over.
    pub fn decode<'a>(&self, data: &'a [u8]) -> Result<Value<'a>, WrongLength> {
        self.kind.decode(data)
    }

    /// A value with its unit and what it is called: `2500 ms`, `3 (established)`.
    #[must_use]
    pub const fn in_words<'a>(&self, value: Value<'a>) -> InWords<'a> {
        InWords { value, unit: self.unit, words: self.words }
    }
}

/// The attribute with this number in a table, which is sorted by number.
#[must_use]
pub fn find(table: &'static [Attribute], id: u8) -> Option<&'static Attribute> {
    table.binary_search_by_key(&id, |attribute| attribute.id).ok().map(|index| &table[index])
}

/// A value as a sentence says it.
#[derive(Clone, Copy, Debug)]
pub struct InWords<'a> {
    value: Value<'a>,
    unit: &'static str,
    words: Words,
}

impl fmt::Display for InWords<'_> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}", self.value)?;
        if !self.unit.is_empty() {
            write!(out, " {}", self.unit)?;
        }
        if let Value::Path(path) = self.value {
            return path.assembly().map_or(Ok(()), |number| write!(out, " (Assembly {number})"));
        }
        let Some(number) = self.value.number() else { return Ok(()) };
        match self.words {
            Words::None => Ok(()),
            Words::OneOf(words) => {
                let word = words.iter().find(|(value, _)| i64::from(*value) == number);
                word.map_or(Ok(()), |(_, word)| write!(out, " ({word})"))
            }
            Words::Named(name) => {
                let word = u16::try_from(number).ok().and_then(name);
                word.map_or(Ok(()), |word| write!(out, " ({word})"))
            }
            Words::Bits(bits) => {
                write!(out, " (")?;
                write_bits(bits, number, out)?;
                write!(out, ")")
            }
            Words::Told(tell) => {
                write!(out, " (")?;
                tell(number, out)?;
                write!(out, ")")
            }
        }
    }
}

fn write_bits(bits: &[Bit], number: i64, out: &mut fmt::Formatter<'_>) -> fmt::Result {
    let said = bits.iter().map(|bit| match number >> bit.number & 1 {
        1 => bit.set,
        _ => bit.clear,
    });
    let mut is_silent = true;
    for word in said.filter(|word| !word.is_empty()) {
        write!(out, "{}{word}", if is_silent { "" } else { ", " })?;
        is_silent = false;
    }
    if is_silent { write!(out, "nothing") } else { Ok(()) }
}

/// Declares a class's attributes, a line each: number, access, name, type, and where there are
/// such the unit after `in` and the words after `is`.
macro_rules! attributes {
    ($(#[$meta:meta])* $vis:vis static $table:ident {
        $($id:literal $access:ident $name:literal $kind:ident $(($size:literal))?
            $(in $unit:literal)? $(is $words:expr)?;)*
    }) => {
        $(#[$meta])*
        $vis static $table: &[$crate::devicenet::cip::Attribute] = &[$(
            $crate::devicenet::cip::Attribute {
                id: $id,
                name: $name,
                kind: $crate::devicenet::cip::DataType::$kind $(($size))?,
                access: $crate::devicenet::cip::Access::$access,
                unit: $crate::devicenet::cip::attributes!(@or "" $($unit)?),
                words: $crate::devicenet::cip::attributes!(
                    @or $crate::devicenet::cip::Words::None, $($words)?
                ),
            }
        ),*];
    };
    (@or $default:literal) => { $default };
    (@or $default:literal $given:literal) => { $given };
    (@or $default:expr, ) => { $default };
    (@or $default:expr, $given:expr) => { $given };
}
pub(crate) use attributes;

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;

    const BITS: &[Bit] =
        &[Bit { number: 0, set: "CCW", clear: "CW" }, Bit { number: 2, set: "scaling", clear: "" }];

    fn said(words: Words, unit: &'static str, value: Value<'_>) -> alloc::string::String {
        InWords { value, unit, words }.to_string()
    }

    #[test]
    fn a_value_is_told_with_its_unit_and_words() {
        assert_eq!(said(Words::None, "ms", Value::Unsigned(2500)), "2500 ms");
        let states = Words::OneOf(&[(3, "established")]);
        assert_eq!(said(states, "", Value::Unsigned(3)), "3 (established)");
        assert_eq!(said(states, "", Value::Unsigned(9)), "9");
        assert_eq!(said(Words::Bits(BITS), "", Value::Unsigned(5)), "5 (CCW, scaling)");
        assert_eq!(said(Words::Bits(BITS), "", Value::Unsigned(0)), "0 (CW)");
        assert_eq!(said(Words::Bits(&BITS[1..]), "", Value::Unsigned(0)), "0 (nothing)");
        // What is no number has no words.
        assert_eq!(said(states, "", Value::Bytes(&[3, 4])), "0304");
    }
}
