//! Values of attributes, as sentences and as fields.

use super::{DeviceIdentity, Path};
use crate::field;
use core::fmt;

/// What the bytes of an attribute mean.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Value<'a> {
    /// A truth.
    Bool(bool),
    /// A number with a sign.
    Signed(i64),
    /// A number without.
    Unsigned(u64),
    /// A number with a fraction.
    Real(f64),
    /// A word of bits.
    Bits {
        /// The bits.
        bits: u64,
        /// How many bytes they take.
        bytes: u8,
    },
    /// A text.
    Text(Text<'a>),
    /// A path to an object.
    Path(Path<'a>),
    /// Numbers of one width.
    List(List<'a>),
    /// Revision of a device.
    Revision(Revision),
    /// All that a device says of itself.
    Identity(DeviceIdentity<'a>),
    /// Which connections of a slave are allocated, and by whom.
    Allocation(Allocation),
    /// Bytes whose meaning is not known.
    Bytes(&'a [u8]),
}

impl<'a> Value<'a> {
    /// The value as a whole number, where it is one.
    #[must_use]
    pub fn number(&self) -> Option<i64> {
        match *self {
            Value::Bool(truth) => Some(i64::from(truth)),
            Value::Signed(number) => Some(number),
            Value::Unsigned(number) | Value::Bits { bits: number, .. } => number.try_into().ok(),
            _ => None,
        }
    }

    /// The value as the field of a record. Paths and bytes are hex digits; what has parts is a
    /// list; a number that no signed 64-bit number holds is a float, and so is no number lost.
    #[must_use]
    pub fn field(&self) -> field::Value<'_> {
        match self {
            Value::Bool(truth) => field::Value::Bool(*truth),
            Value::Signed(number) => field::Value::Int(*number),
            Value::Unsigned(number) | Value::Bits { bits: number, .. } => i64::try_from(*number)
                .map_or(field::Value::Float(*number as f64), field::Value::Int),
            // JSON has no word for what is not a number.
            Value::Real(number) if number.is_finite() => field::Value::Float(*number),
            Value::Real(_) => field::Value::Text("not a finite number"),
            Value::Text(text) => {
                text.as_str().map_or(field::Value::Hex(text.0), field::Value::Text)
            }
            Value::Path(path) => field::Value::Hex(path.bytes()),
            Value::List(list) => field::Value::List(list),
            Value::Revision(revision) => field::Value::List(revision),
            Value::Identity(identity) => field::Value::List(identity),
            Value::Allocation(allocation) => field::Value::List(allocation),
            Value::Bytes(bytes) => field::Value::Hex(bytes),
        }
    }
}

impl fmt::Display for Value<'_> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Value::Bool(truth) => write!(out, "{}", u8::from(*truth)),
            Value::Signed(number) => write!(out, "{number}"),
            Value::Unsigned(number) => write!(out, "{number}"),
            Value::Real(number) => write!(out, "{number}"),
            Value::Bits { bits, bytes } => {
                write!(out, "{bits:0width$X}h", width = usize::from(*bytes) * 2)
            }
            Value::Text(text) => write!(out, "{text}"),
            Value::Path(path) => write!(out, "{path}"),
            Value::List(list) => write!(out, "{list}"),
            Value::Revision(revision) => write!(out, "{revision}"),
            Value::Identity(identity) => write!(out, "{identity}"),
            Value::Allocation(allocation) => write!(out, "{allocation}"),
            Value::Bytes(bytes) => bytes.iter().try_for_each(|byte| write!(out, "{byte:02X}")),
        }
    }
}

/// A text of a device, in Latin-1 as far as CIP says.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Text<'a>(pub &'a [u8]);

impl<'a> Text<'a> {
    /// The text, where its bytes are valid UTF-8 as they stand.
    #[must_use]
    pub fn as_str(self) -> Option<&'a str> {
        core::str::from_utf8(self.0).ok()
    }
}

/// What cannot be printed is a dot.
impl fmt::Display for Text<'_> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let printable = |c: char| if c.is_control() { '.' } else { c };
        self.0.iter().try_for_each(|byte| write!(out, "{}", printable(char::from(*byte))))
    }
}

/// Numbers of one width, one after the other.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct List<'a> {
    bytes: &'a [u8],
    width: usize,
}

impl<'a> List<'a> {
    /// Numbers of one byte.
    pub(super) const fn of_bytes(bytes: &'a [u8]) -> Self {
        List { bytes, width: 1 }
    }

    /// Numbers of two bytes, the lower first. An odd byte at the end is left out.
    pub(super) const fn of_words(bytes: &'a [u8]) -> Self {
        List { bytes, width: 2 }
    }

    /// The numbers.
    pub fn numbers(self) -> impl ExactSizeIterator<Item = u16> {
        self.bytes.chunks_exact(self.width).map(|number| super::little_endian(number) as u16)
    }
}

impl field::List for List<'_> {
    fn len(&self) -> usize {
        self.numbers().len()
    }

    fn get(&self, index: usize) -> field::Value<'_> {
        self.numbers().nth(index).map(i64::from).into()
    }
}

impl fmt::Display for List<'_> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, number) in self.numbers().enumerate() {
            write!(out, "{}{number}", if index == 0 { "" } else { " " })?;
        }
        Ok(())
    }
}

/// Revision of a device: Identity attribute 4.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Revision {
    /// 1 to 127; changes where the device behaves differently. Bit 7 is reserved and not in it.
    pub major: u8,
    /// Small changes.
    pub minor: u8,
}

impl field::List for Revision {
    fn len(&self) -> usize {
        2
    }

    fn get(&self, index: usize) -> field::Value<'_> {
        [self.major, self.minor].get(index).copied().map(i64::from).into()
    }
}

impl fmt::Display for Revision {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}.{}", self.major, self.minor)
    }
}

/// Who owns which connections of a slave: DeviceNet attribute 5.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Allocation {
    /// The connections, one a bit.
    pub choice: u8,
    /// MAC ID of the master; [`Allocation::NOBODY`] where there is none.
    pub master: u8,
}

impl Allocation {
    /// The master of a slave that nobody owns.
    pub const NOBODY: u8 = 0xFF;

    /// The connections of the predefined set by their bit in a choice, and at last how they are
    /// acknowledged.
    pub const CHOICES: [&'static str; 7] =
        ["explicit", "poll", "strobe", "multicast", "cos", "cyclic", "without acknowledge"];
}

impl field::List for Allocation {
    fn len(&self) -> usize {
        2
    }

    fn get(&self, index: usize) -> field::Value<'_> {
        [self.choice, self.master].get(index).copied().map(i64::from).into()
    }
}

impl fmt::Display for Allocation {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.master == Self::NOBODY {
            return write!(out, "not owned");
        }
        write!(out, "master {}:", self.master)?;
        let chosen =
            Self::CHOICES.iter().enumerate().filter(|(bit, _)| self.choice >> bit & 1 == 1);
        chosen.enumerate().try_for_each(|(index, (_, name))| {
            write!(out, "{}{name}", if index == 0 { " " } else { ", " })
        })
    }
}
