//! I/O data of a device: its sizes, and what stands where in it.

use super::parameter::Parameter;
use crate::devicenet::cip::{DataType, Path, Target, Value};
use alloc::collections::BTreeMap;
use alloc::string::String;
use alloc::vec::Vec;

/// How I/O data is asked for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Mode {
    /// The master polls.
    Poll,
    /// The master strobes all slaves at once.
    Strobe,
    /// The device sends what changed.
    Cos,
    /// The device sends at intervals.
    Cyclic,
}

/// The section `[IO_Info]`.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct Io {
    /// What the device is used with by default, one mode a bit: 0 poll, 1 strobe, 2 change of state,
    /// 3 cyclic, 4 multicast poll.
    pub default: Option<u16>,
    /// What each mode carries, by [`Mode`].
    pub(super) modes: [Option<Carried>; 4],
    pub(super) inputs: BTreeMap<u16, Format>,
    pub(super) outputs: BTreeMap<u16, Format>,
}

/// What a mode carries by default: numbers of formats, 0 for nothing.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Carried {
    pub input: u16,
    pub output: u16,
}

/// `InputN` or `OutputN`: data that a connection can carry.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Format {
    /// Its size in bytes.
    pub size: u16,
    /// How many of its bits count; 0: all.
    pub bits: u16,
    /// Modes that can carry it, as in [`Io::default`].
    pub modes: u16,
    /// Its name, or nothing.
    pub name: String,
    /// The path to it, as bytes.
    pub path: Vec<u8>,
}

impl Format {
    /// The assembly that it is.
    #[must_use]
    pub fn assembly(&self) -> Option<u16> {
        Path::parse(&self.path)?.assembly()
    }
}

impl Io {
    /// What the device can produce.
    pub fn produced(&self) -> impl Iterator<Item = &Format> {
        self.inputs.values()
    }

    /// What it can consume.
    pub fn consumed(&self) -> impl Iterator<Item = &Format> {
        self.outputs.values()
    }

    /// What a mode carries by default: what is produced, and what is consumed.
    #[must_use]
    pub fn defaults(&self, mode: Mode) -> (Option<&Format>, Option<&Format>) {
        let Some(Carried { input, output }) = self.modes[mode as usize] else {
            return (None, None);
        };
        (self.inputs.get(&input), self.outputs.get(&output))
    }
}

/// Which of these formats data of so many bytes has: the default if that is its size, or else the
/// only one of that size. `None` where several have it.
#[must_use]
pub fn format_of_size<'a>(
    mut formats: impl Iterator<Item = &'a Format>,
    default: Option<&'a Format>,
    size: usize,
) -> Option<&'a Format> {
    let has_size = |format: &&Format| usize::from(format.size) == size;
    default.filter(has_size).or_else(|| {
        let only = formats.find(has_size)?;
        formats.all(|format| !has_size(&format)).then_some(only)
    })
}

/// `AssemN` of the section `[Assembly]`.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Assembly {
    /// Its name, or nothing.
    pub name: String,
    /// Its instance.
    pub instance: u16,
    /// Its size in bytes, where the file tells.
    pub size: Option<u16>,
    /// Its members in order.
    pub members: Vec<Member>,
}

/// A member of an assembly.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Member {
    /// Its size in bits; `None`: that of the parameter.
    pub bits: Option<u16>,
    /// What it is.
    pub content: Content,
}

/// What a member is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Content {
    /// The parameter with this number.
    Parameter(u16),
    /// This attribute.
    Attribute(Target),
    /// Always this number.
    Constant(i64),
    /// Nothing of interest.
    Padding,
}

/// A member of an assembly at its place.
#[derive(Clone, Copy, Debug)]
pub struct Cell<'a> {
    /// Bits before it.
    pub offset: u32,
    /// Its size in bits.
    pub bits: u16,
    /// What it is.
    pub content: Content,
    /// The parameter that it is, where the file has it.
    pub parameter: Option<&'a Parameter>,
}

impl Cell<'_> {
    /// Its name, where it has one.
    #[must_use]
    pub fn name(&self) -> Option<&str> {
        self.parameter.map(|parameter| parameter.name.as_str()).filter(|name| !name.is_empty())
    }

    /// Its value in I/O data, the lowest bit first. `None` where the data ends before it, or where
    /// it is broader than 64 bits and no parameter tells how it reads.
    #[must_use]
    pub fn value<'d>(&self, data: &'d [u8]) -> Option<Value<'d>> {
        if self.offset.is_multiple_of(8) && self.bits.is_multiple_of(8) && self.bits > 0 {
            let bytes = data.get(self.offset as usize / 8..)?.get(..usize::from(self.bits / 8))?;
            if let Some(value) = self.parameter.and_then(|known| known.kind.decode(bytes).ok()) {
                return Some(value);
            }
        }
        let bit = |index: u32| {
            let place = self.offset.checked_add(index)?;
            Some(u64::from(*data.get(place as usize / 8)? >> (place % 8) & 1))
        };
        let bits = (1..=64).contains(&self.bits).then_some(u32::from(self.bits))?;
        let number = (0..bits).try_fold(0, |number, index| Some(number | bit(index)? << index))?;
        let is_signed = self.parameter.is_some_and(|known| {
            matches!(known.kind, DataType::Sint | DataType::Int | DataType::Dint | DataType::Lint)
        });
        // The highest bit of fewer bits than its type has is its sign too.
        let unused = 64 - bits;
        Some(match is_signed {
            true => Value::Signed((number << unused).cast_signed() >> unused),
            false => Value::Unsigned(number),
        })
    }
}
