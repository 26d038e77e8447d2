//! Packed paths: which object is meant.
//!
//! ```text
//! 001 ttt ss  value     logical segment: t 0 class, 1 instance, 2 member, 3 connection point,
//!                       4 attribute; s 0 one byte, 1 two, 2 four, the lowest first
//! 011 nnnnn   n bytes   symbol
//! ```
//!
//! Packed means that no pad byte stands before a value of two or four bytes, as in attributes 14
//! and 16 of connections, in EDS files and in message body format 4.

use super::{Text, class};
use core::fmt;
use nom::bytes::complete::take;
use nom::combinator::all_consuming;
use nom::multi::many0_count;
use nom::number::complete::{le_u16, le_u32, u8};
use nom::{IResult, Parser, error::ErrorKind};

/// One step of a path.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Segment<'a> {
    /// The class.
    Class(u32),
    /// An instance of it.
    Instance(u32),
    /// A member of an attribute that is a list.
    Member(u32),
    /// A connection point: for assemblies the same as the instance.
    ConnectionPoint(u32),
    /// An attribute.
    Attribute(u32),
    /// A name in place of numbers.
    Symbol(Text<'a>),
}

/// What a path points at.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Target {
    /// The class.
    pub class: u16,
    /// The instance; 0 is the class itself.
    pub instance: u16,
    /// The attribute, where the path goes as far.
    pub attribute: Option<u8>,
}

/// A path of whole, known segments.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Path<'a>(&'a [u8]);

impl<'a> Path<'a> {
    /// The path in all of these bytes; `None` where a segment is cut or not known. No bytes are an
    /// empty path.
    #[must_use]
    pub fn parse(bytes: &'a [u8]) -> Option<Self> {
        all_consuming(many0_count(segment)).parse(bytes).ok().map(|_| Path(bytes))
    }

    /// A path behind its length in words, as messages of body format 4 carry it.
    ///
    /// # Errors
    /// The input ends before the path, or a segment is cut or not known.
    pub fn counted(input: &'a [u8]) -> IResult<&'a [u8], Self> {
        let (rest, words) = u8(input)?;
        let (rest, bytes) = take(usize::from(words) * 2).parse(rest)?;
        match Path::parse(bytes) {
            Some(path) => Ok((rest, path)),
            None => Err(nom::Err::Error(nom::error::make_error(input, ErrorKind::Verify))),
        }
    }

    /// The bytes as sent.
    #[must_use]
    pub const fn bytes(self) -> &'a [u8] {
        self.0
    }

    /// Its segments in order.
    pub fn segments(self) -> impl Iterator<Item = Segment<'a>> {
        let mut rest = self.0;
        core::iter::from_fn(move || {
            let (after, segment) = segment(rest).ok()?;
            rest = after;
            Some(segment)
        })
    }

    /// What it points at: `None` without a class, without an instance, or beyond 16 bits.
    #[must_use]
    pub fn target(self) -> Option<Target> {
        let (mut class, mut instance, mut attribute) = (None, None, None);
        for segment in self.segments() {
            match segment {
                Segment::Class(number) => class = Some(number),
                Segment::Instance(number) | Segment::ConnectionPoint(number) => {
                    instance = Some(number);
                }
                Segment::Attribute(number) => attribute = Some(number),
                Segment::Member(_) | Segment::Symbol(_) => {}
            }
        }
        Some(Target {
            class: class?.try_into().ok()?,
            instance: instance?.try_into().ok()?,
            attribute: attribute.map(TryInto::try_into).transpose().ok()?,
        })
    }

    /// The assembly whose data it points at. Devices write `20 04 24 01`, `20 04 24 01 30 03` and
    /// `20 04 2C 01 30 03` for the same one.
    #[must_use]
    pub fn assembly(self) -> Option<u16> {
        let Target { class, instance, attribute } = self.target()?;
        (class == class::ASSEMBLY && matches!(attribute, None | Some(3))).then_some(instance)
    }
}

/// One segment.
fn segment(input: &[u8]) -> IResult<&[u8], Segment<'_>> {
    let (rest, head) = u8(input)?;
    let unknown = || nom::Err::Error(nom::error::make_error(input, ErrorKind::Switch));
    match head >> 5 {
        0b011 if head & 0x1F != 0 => {
            take(head & 0x1F).map(|name| Segment::Symbol(Text(name))).parse(rest)
        }
        0b001 => {
            let (rest, number) = match head & 0b11 {
                0 => u8.map(u32::from).parse(rest)?,
                1 => le_u16.map(u32::from).parse(rest)?,
                2 => le_u32.parse(rest)?,
                _ => return Err(unknown()),
            };
            let segment = match head >> 2 & 0b111 {
                0 => Segment::Class(number),
                1 => Segment::Instance(number),
                2 => Segment::Member(number),
                3 => Segment::ConnectionPoint(number),
                4 => Segment::Attribute(number),
                _ => return Err(unknown()),
            };
            Ok((rest, segment))
        }
        _ => Err(unknown()),
    }
}

/// The bytes as manuals print them: `20 04 24 01`.
impl fmt::Display for Path<'_> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, byte) in self.0.iter().enumerate() {
            write!(out, "{}{byte:02X}", if index == 0 { "" } else { " " })?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;
    use alloc::vec::Vec;
    use proptest::prelude::*;

    fn target(bytes: &[u8]) -> Option<(u16, u16, Option<u8>)> {
        let target = Path::parse(bytes)?.target()?;
        Some((target.class, target.instance, target.attribute))
    }

    #[test]
    fn one_assembly_is_written_in_many_ways() {
        for bytes in [
            &[0x20, 0x04, 0x24, 0x01][..],
            &[0x20, 0x04, 0x24, 0x01, 0x30, 0x03],
            &[0x21, 0x04, 0x00, 0x25, 0x01, 0x00, 0x30, 0x03],
            &[0x22, 0x04, 0, 0, 0, 0x26, 0x01, 0, 0, 0],
            &[0x20, 0x04, 0x2C, 0x01, 0x30, 0x03],
        ] {
            assert_eq!(Path::parse(bytes).unwrap().assembly(), Some(1), "{bytes:02X?}");
        }
        let size = Path::parse(&[0x20, 0x04, 0x24, 0x01, 0x30, 0x04]).unwrap();
        assert_eq!(size.assembly(), None);
    }

    #[test]
    fn the_manual_prints_paths_in_hex() {
        let path = Path::parse(&[0x20, 0x04, 0x24, 0x02]).unwrap();
        assert_eq!((path.to_string().as_str(), path.assembly()), ("20 04 24 02", Some(2)));
    }

    #[test]
    fn a_symbol_stands_for_numbers() {
        let path = Path::parse(b"\x63333").unwrap();
        assert_eq!(path.segments().collect::<Vec<_>>(), [Segment::Symbol(Text(b"333"))]);
        assert_eq!((path.target(), path.assembly()), (None, None));
    }

    #[test]
    fn a_message_carries_its_path_behind_the_length_in_words() {
        // X25: Get_Attribute_Single, path of 3 words 20 01 24 01 30 01.
        let message = [0x03, 0x20, 0x01, 0x24, 0x01, 0x30, 0x01, 0xAA];
        let (rest, path) = Path::counted(&message).unwrap();
        assert_eq!((rest, path.target().unwrap().attribute), (&[0xAA][..], Some(1)));
        assert!(Path::counted(&message[..5]).is_err());
    }

    #[test]
    fn cut_and_unknown_segments_are_no_path() {
        assert_eq!(target(&[0x20, 0x04, 0x24]), None);
        assert_eq!(Path::parse(&[0x21, 0x04]), None);
        assert_eq!(Path::parse(&[0x23, 0x04]), None);
        assert_eq!(Path::parse(&[0x60]), None);
        assert_eq!(Path::parse(&[0x90, 0x00]), None);
        assert_eq!(Path::parse(&[]).map(Path::target), Some(None));
        // A class that DeviceNet cannot address.
        assert_eq!(target(&[0x22, 0, 0, 1, 0, 0x24, 1]), None);
    }

    proptest! {
        #[test]
        fn any_bytes_may_come(bytes in proptest::collection::vec(any::<u8>(), 0..40)) {
            let _ = Path::counted(&bytes);
            if let Some(path) = Path::parse(&bytes) {
                let _ = (path.segments().count(), path.target(), path.to_string());
            }
        }

        #[test]
        fn what_was_built_is_read(class: u16, instance: u16, attribute: u8) {
            let mut bytes = alloc::vec![0x21];
            bytes.extend(class.to_le_bytes());
            bytes.push(0x25);
            bytes.extend(instance.to_le_bytes());
            bytes.extend([0x30, attribute]);
            prop_assert_eq!(target(&bytes), Some((class, instance, Some(attribute))));
        }
    }
}
