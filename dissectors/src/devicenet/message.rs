//! Explicit messages, as parsers over the data of a frame or a reassembled message.
//!
//! ```text
//! header      F x a a a a a a     FRAG, XID, MAC ID of the other end
//! fragment    t t c c c c c c     only if FRAG: type, count
//! service     r s s s s s s s     R/R bit (1: response), service code
//! body                            class, instance, attribute, data, by message body format
//! ```
//!
//! DeviceNet specification (CIP Vol. 3), chapter 4: explicit messaging.

use super::defect::Defect;
use super::identifier::MacId;
use nom::number::complete::{le_u16, u8};
use nom::{IResult, Parser};

/// The service codes that the grammar of messages rests on; all others are only named.
pub mod service {
    /// Reset of an object.
    pub const RESET: u8 = 0x05;
    /// Delete of an object.
    pub const DELETE: u8 = 0x09;
    /// `Get_Attribute_Single`.
    pub const GET: u8 = 0x0E;
    /// `Set_Attribute_Single`.
    pub const SET: u8 = 0x10;
    /// Error response: never a request.
    pub const ERROR: u8 = 0x14;
    /// Allocate of the DeviceNet object, Open of an unconnected port.
    pub const ALLOCATE: u8 = 0x4B;
    /// Release of the DeviceNet object, Close of an unconnected port.
    pub const RELEASE: u8 = 0x4C;
    /// Device heartbeat: only ever a response.
    pub const HEARTBEAT: u8 = 0x4D;
    /// Device shutdown: only ever a response.
    pub const SHUTDOWN: u8 = 0x4E;
}

/// The first byte of an explicit message.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Header {
    /// The fragment byte follows.
    pub is_fragment: bool,
    /// Transaction id: the client chooses, the server repeats it.
    pub xid: bool,
    /// The end of the connection that the identifier does not name.
    pub mac: MacId,
}

/// The byte after the header of a fragment, and the first byte of an I/O fragment.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Fragment {
    /// Which part of a message.
    pub part: Part,
    /// 0 to 63.
    pub count: u8,
}

/// Which part of a message a fragment is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Part {
    /// The first.
    First,
    /// Neither the first nor the last.
    Middle,
    /// The last.
    Last,
    /// None: the receiver acknowledges one.
    Acknowledge,
}

/// The count of a first fragment that is also the last.
pub const ONLY: u8 = 0x3F;

impl Fragment {
    /// The fragment byte.
    #[must_use]
    pub const fn of(byte: u8) -> Self {
        let part = match byte >> 6 {
            0 => Part::First,
            1 => Part::Middle,
            2 => Part::Last,
            _ => Part::Acknowledge,
        };
        Fragment { part, count: byte & 0x3F }
    }

    /// The byte again.
    #[must_use]
    pub const fn byte(self) -> u8 {
        (self.part as u8) << 6 | self.count
    }
}

impl Part {
    /// The name that records carry.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Part::First => "first",
            Part::Middle => "middle",
            Part::Last => "last",
            Part::Acknowledge => "ack",
        }
    }
}

/// The service byte.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Service {
    /// Without the R/R bit.
    pub code: u8,
    /// The R/R bit.
    pub is_response: bool,
}

impl Service {
    /// The service byte.
    #[must_use]
    pub const fn of(byte: u8) -> Self {
        Service { code: byte & 0x7F, is_response: byte & 0x80 != 0 }
    }

    /// Whether a request must not carry it: 00, 14, 1E-31 and 64-7F (CIP Vol. 1, appendix A).
    #[must_use]
    pub const fn is_reserved(self) -> bool {
        match self.code {
            0x00 | 0x1E..=0x31 | 0x64..=0x7F => true,
            service::ERROR => !self.is_response,
            _ => false,
        }
    }
}

/// How class and instance are written in requests of a connection.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum BodyFormat {
    /// 8-bit class, 8-bit instance.
    Byte8Instance8,
    /// 8-bit class, 16-bit instance.
    Byte8Instance16,
    /// 16-bit class, 16-bit instance.
    Word16Instance16,
    /// 16-bit class, 8-bit instance.
    Word16Instance8,
    /// A path, with its length in words before it.
    Path,
}

impl BodyFormat {
    /// The format of that code; `None` for the reserved ones.
    #[must_use]
    pub const fn of(code: u8) -> Option<Self> {
        Some(match code {
            0 => BodyFormat::Byte8Instance8,
            1 => BodyFormat::Byte8Instance16,
            2 => BodyFormat::Word16Instance16,
            3 => BodyFormat::Word16Instance8,
            4 => BodyFormat::Path,
            _ => return None,
        })
    }

    /// Guesses from the body of a `Get_Attribute_Single`, which has no data: its length decides,
    /// and where two formats are equally long, which byte is 0.
    #[must_use]
    pub fn guess(body: &[u8]) -> Option<Self> {
        Some(match *body {
            [_, _, _] => BodyFormat::Byte8Instance8,
            [_, high, _, _] if high == 0 && body[2] != 0 => BodyFormat::Word16Instance8,
            [_, _, _, _] => BodyFormat::Byte8Instance16,
            // A path begins with a class, of 8 or 16 bits.
            [words, 0x20 | 0x21, ..] if usize::from(words) * 2 + 1 == body.len() => {
                BodyFormat::Path
            }
            [_, _, _, _, _] => BodyFormat::Word16Instance16,
            _ => return None,
        })
    }
}

/// What a request is about.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct Target {
    /// Object class.
    pub class: Option<u16>,
    /// Instance of it; 0 is the class itself.
    pub instance: Option<u16>,
    /// Attribute of the instance.
    pub attribute: Option<u16>,
}

impl Target {
    /// Whether it is this instance of this class.
    #[must_use]
    pub fn is(&self, class: u16, instance: u16) -> bool {
        self.class == Some(class) && self.instance == Some(instance)
    }
}

/// The header of an explicit message.
///
/// # Errors
/// The input is empty.
pub fn header(input: &[u8]) -> IResult<&[u8], Header> {
    u8.map(|byte| Header {
        is_fragment: byte & 0x80 != 0,
        xid: byte & 0x40 != 0,
        mac: MacId::of(byte),
    })
    .parse(input)
}

/// The fragment byte.
///
/// # Errors
/// The input is empty.
pub fn fragment(input: &[u8]) -> IResult<&[u8], Fragment> {
    u8.map(Fragment::of).parse(input)
}

/// The service byte.
///
/// # Errors
/// The input is empty.
pub fn service_byte(input: &[u8]) -> IResult<&[u8], Service> {
    u8.map(Service::of).parse(input)
}

/// Class, instance and attribute of a request; what is left is its data.
///
/// # Errors
/// The input ends before them.
pub fn target(service: u8, format: BodyFormat) -> impl Fn(&[u8]) -> IResult<&[u8], Target> {
    move |input| {
        if format == BodyFormat::Path {
            return path(input);
        }
        let (input, class) = match format {
            BodyFormat::Byte8Instance8 | BodyFormat::Byte8Instance16 => byte_wide(input)?,
            _ => le_u16(input)?,
        };
        let (input, instance) = match format {
            BodyFormat::Byte8Instance8 | BodyFormat::Word16Instance8 => byte_wide(input)?,
            _ => le_u16(input)?,
        };
        let (input, attribute) =
            if has_attribute(service) { byte_wide.map(Some).parse(input)? } else { (input, None) };
        Ok((input, Target { class: Some(class), instance: Some(instance), attribute }))
    }
}

/// The services whose first data byte is the attribute (CIP Vol. 1, appendix A).
const fn has_attribute(code: u8) -> bool {
    matches!(code, service::GET | service::SET | 0x18..=0x1B)
}

fn byte_wide(input: &[u8]) -> IResult<&[u8], u16> {
    u8.map(u16::from).parse(input)
}

/// A path with its length in words before it: the logical segments that name class, instance and
/// attribute (CIP Vol. 1, appendix C). Other segments are passed over.
fn path(input: &[u8]) -> IResult<&[u8], Target> {
    let (input, words) = u8(input)?;
    let (rest, mut segments) = nom::bytes::complete::take(usize::from(words) * 2).parse(input)?;
    let mut target = Target::default();
    while let Ok((after, (kind, value))) = logical(segments) {
        segments = after;
        let place = match kind {
            0x20 => &mut target.class,
            0x24 => &mut target.instance,
            0x30 => &mut target.attribute,
            _ => continue,
        };
        *place = Some(value);
    }
    Ok((rest, target))
}

/// A logical segment: its kind without the size, and its value.
fn logical(input: &[u8]) -> IResult<&[u8], (u8, u16)> {
    let (input, segment) = u8(input)?;
    let (input, value) = match segment & 3 {
        0 => byte_wide(input)?,
        // Some put a pad byte before 16 bits, some do not: packed is the rule on DeviceNet.
        _ => le_u16(input)?,
    };
    Ok((input, (segment & !3, value)))
}

/// What is wrong with the data of a request whose length the service fixes.
#[must_use]
pub fn judge_data(service: u8, data: &[u8]) -> Option<Defect> {
    match (service, data) {
        (service::GET, [_, ..]) => Some(Defect::Excess),
        (service::SET, []) => Some(Defect::Missing),
        _ => None,
    }
}

/// The identity that the duplicate check, Who and the ownership messages carry.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Identity {
    /// Vendor id.
    pub vendor: u16,
    /// Serial number.
    pub serial: u32,
}

/// Vendor id and serial number.
///
/// # Errors
/// The input ends before them.
pub fn identity(input: &[u8]) -> IResult<&[u8], Identity> {
    (le_u16, nom::number::complete::le_u32)
        .map(|(vendor, serial)| Identity { vendor, serial })
        .parse(input)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(code: u8, format: BodyFormat, body: &[u8]) -> Option<(Target, Vec<u8>)> {
        let (data, target) = target(code, format)(body).ok()?;
        Some((target, data.to_vec()))
    }

    use alloc::vec::Vec;

    fn named(class: u16, instance: u16, attribute: Option<u16>) -> Target {
        Target { class: Some(class), instance: Some(instance), attribute }
    }

    #[test]
    fn the_five_body_formats_name_the_same_attribute() {
        // Get of class 05, instance 02, attribute 09, as CIP Vol. 3 table 4-2 lays them out.
        let wanted = Some((named(5, 2, Some(9)), Vec::new()));
        for (code, body) in [
            (0, &[5, 2, 9][..]),
            (1, &[5, 2, 0, 9]),
            (2, &[5, 0, 2, 0, 9]),
            (3, &[5, 0, 2, 9]),
            (4, &[3, 0x20, 5, 0x24, 2, 0x30, 9]),
        ] {
            let format = BodyFormat::of(code).unwrap();
            assert_eq!(read(service::GET, format, body), wanted, "format {code}");
            assert_eq!(BodyFormat::guess(body), Some(format), "guess {code}");
            let cut = &body[..body.len() - 1];
            assert_eq!(read(service::GET, format, cut), None, "format {code}, cut");
        }
        assert_eq!(BodyFormat::of(5), None);
        // Class 2, instance 1: as long as a path of two words, but no path.
        assert_eq!(BodyFormat::guess(&[2, 0, 1, 0, 1]), BodyFormat::of(2));
    }

    #[test]
    fn other_services_have_no_attribute() {
        // Allocate (4Bh) of class 3, instance 1: choice 03, allocator 0Ah are data.
        let (target, data) = read(0x4B, BodyFormat::Byte8Instance8, &[3, 1, 3, 0x0A]).unwrap();
        assert_eq!((target, data), (named(3, 1, None), [3, 0x0A].to_vec()));
    }

    #[test]
    fn paths_may_use_words() {
        // 21 class16, 25 instance16, as Rockwell devices write them.
        let body = [4, 0x21, 0x23, 0x01, 0x25, 0x01, 0x00, 0x30, 0x0A];
        let (target, _) = read(service::GET, BodyFormat::Path, &body).unwrap();
        assert_eq!(target, named(0x123, 1, Some(10)));
    }

    #[test]
    fn reserved_services() {
        // 00, 14 as a request, 1E-31, 64-7F; 32-4A belong to vendors (Pico manual: 32h).
        let reserved: Vec<u8> = (0..0x80).filter(|code| Service::of(*code).is_reserved()).collect();
        let wanted: Vec<u8> =
            [0x00, 0x14].into_iter().chain(0x1E..=0x31).chain(0x64..=0x7F).collect();
        assert_eq!(reserved, wanted);
        assert!(!Service::of(0x94).is_reserved());
    }

    #[test]
    fn bytes_of_header_and_fragment() {
        let (_, header) = header(&[0xCA]).unwrap();
        assert_eq!(header, Header { is_fragment: true, xid: true, mac: MacId::of(10) });
        for byte in 0..=0xFF {
            assert_eq!(Fragment::of(byte).byte(), byte);
        }
        let (_, identity) = identity(&[1, 0, 0x92, 0x39, 0x60, 0x60]).unwrap();
        assert_eq!((identity.vendor, identity.serial), (1, 0x6060_3992));
    }
}
