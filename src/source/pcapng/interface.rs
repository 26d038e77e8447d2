//! What an Interface Description Block says.

use super::super::tap_note::TapNote;
use super::fields::{Options, Order, Stamps};
use dissectors::uart::Baud;
use nom::IResult;
use nom::error::{Error, ErrorKind};

const COMMENT: u16 = 1;
const IF_NAME: u16 = 2;
const IF_SPEED: u16 = 8;
const IF_TSRESOL: u16 = 9;
const IF_TSOFFSET: u16 = 14;

/// An interface, as its block describes it.
#[derive(Debug)]
pub struct Description {
    pub link_type: u16,
    pub name: Option<String>,
    pub baud: Option<Baud>,
    pub stamps: Stamps,
    pub note: Option<TapNote>,
}

/// Reads the body of an Interface Description Block.
pub fn description(body: &[u8], order: Order) -> IResult<&[u8], Description> {
    // u16 link type, u16 reserved, u32 snap length.
    let Some((&[a, b, ..], options)) = body.split_first_chunk::<8>() else {
        return Err(nom::Err::Error(Error::new(body, ErrorKind::Eof)));
    };
    let (mut name, mut baud, mut note) = (None, None, None);
    let (mut resolution, mut offset) = (None, None);
    for (code, value) in Options::new(order, options) {
        match code {
            COMMENT => note = note.or_else(|| TapNote::parse(&String::from_utf8_lossy(value))),
            IF_NAME => name = Some(String::from_utf8_lossy(value).into_owned()),
            IF_SPEED => baud = eight(value).and_then(|speed| rate(order.u64(speed))),
            IF_TSRESOL => resolution = value.first().copied(),
            IF_TSOFFSET => offset = eight(value).map(|offset| order.u64(offset).cast_signed()),
            _ => {}
        }
    }
    let stamps = Stamps::new(resolution, offset);
    let name = name.filter(|name| !name.is_empty());
    Ok((&[], Description { link_type: order.u16([a, b]), name, baud, stamps, note }))
}

fn rate(bits_per_second: u64) -> Option<Baud> {
    u32::try_from(bits_per_second).ok().and_then(Baud::new)
}

fn eight(value: &[u8]) -> Option<[u8; 8]> {
    value.try_into().ok()
}
