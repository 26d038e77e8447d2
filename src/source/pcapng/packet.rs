//! What blocks that come again and again say: packets, and an interface's statistics.

use super::super::tap_note;
use super::fields::{Options, Order};
use dissectors::can::Direction;
use dissectors::event::LossCause;
use nom::IResult;
use nom::error::{Error, ErrorKind};

const COMMENT: u16 = 1;
const EPB_FLAGS: u16 = 2;
const EPB_DROPCOUNT: u16 = 4;
const ISB_ENDTIME: u16 = 3;
const ISB_IFDROP: u16 = 5;
const ISB_OSDROP: u16 = 7;

/// An enhanced packet, or one of the obsolete form.
pub struct PacketFields<'a> {
    pub interface: u32,
    pub ticks: u64,
    pub bytes: &'a [u8],
    pub original_length: u32,
    /// Packets lost before this one.
    pub dropped: Option<u64>,
    /// Why they were.
    pub loss_cause: LossCause,
    /// Who sent it, if that is told.
    pub direction: Option<Direction>,
    options: Options<'a>,
}

impl<'a> PacketFields<'a> {
    /// Comments on the packet, as they stand there.
    pub fn comments(self) -> impl Iterator<Item = &'a [u8]> {
        comments(self.options)
    }
}

/// Reads the body of an Enhanced Packet Block.
pub fn enhanced(body: &[u8], order: Order) -> IResult<&[u8], PacketFields<'_>> {
    let Some((&[a, b, c, d, rest @ ..], _)) = body.split_first_chunk::<20>() else {
        return Err(short(body));
    };
    packet(body, order, order.u32([a, b, c, d]), None, rest)
}

/// Reads the body of an obsolete Packet Block, which has two shorter fields in place of one.
pub fn obsolete(body: &[u8], order: Order) -> IResult<&[u8], PacketFields<'_>> {
    let Some((&[a, b, c, d, rest @ ..], _)) = body.split_first_chunk::<20>() else {
        return Err(short(body));
    };
    // FFFFh: not known.
    let dropped = Some(order.u16([c, d])).filter(|count| *count != u16::MAX).map(u64::from);
    packet(body, order, order.u16([a, b]).into(), dropped, rest)
}

/// What both forms have in common: u32 stamp high, u32 low, u32 captured, u32 original length.
fn packet(
    body: &[u8],
    order: Order,
    interface: u32,
    mut dropped: Option<u64>,
    head: [u8; 16],
) -> IResult<&[u8], PacketFields<'_>> {
    let [ticks @ .., a, b, c, d, e, f, g, h] = head;
    let captured = order.u32([a, b, c, d]) as usize;
    let Some((bytes, rest)) = body[20..].split_at_checked(captured) else {
        return Err(short(body));
    };
    // Padding to four bytes.
    let options = rest.get(captured.next_multiple_of(4) - captured..).unwrap_or_default();
    let (mut direction, mut loss_cause) = (None, LossCause::Capture);
    for (code, value) in Options::new(order, options) {
        match code {
            EPB_DROPCOUNT => {
                dropped = value.try_into().map(|count| order.u64(count)).ok().or(dropped)
            }
            COMMENT => loss_cause = tap_note::cause_of(value).unwrap_or(loss_cause),
            EPB_FLAGS => direction = value.try_into().ok().and_then(|f| side(order.u32(f))),
            _ => {}
        }
    }
    let packet = PacketFields {
        interface,
        ticks: order.ticks(ticks),
        bytes,
        original_length: order.u32([e, f, g, h]),
        dropped,
        loss_cause,
        direction,
        options: Options::new(order, options),
    };
    Ok((&[], packet))
}

/// Bits 0 and 1 of the flags: 1 is inbound, 2 outbound.
const fn side(flags: u32) -> Option<Direction> {
    match flags & 3 {
        1 => Some(Direction::Received),
        2 => Some(Direction::Sent),
        _ => None,
    }
}

/// An Interface Statistics Block.
pub struct Statistics<'a> {
    pub interface: u32,
    /// When the capture ended, in the interface's ticks.
    pub end: Option<u64>,
    /// Packets the interface and the system lost, all in all.
    pub dropped: u64,
    options: Options<'a>,
}

impl<'a> Statistics<'a> {
    /// Comments, as they stand there.
    pub fn comments(self) -> impl Iterator<Item = &'a [u8]> {
        comments(self.options)
    }
}

/// Reads the body of an Interface Statistics Block.
pub fn statistics(body: &[u8], order: Order) -> IResult<&[u8], Statistics<'_>> {
    // u32 interface, and when the block was written.
    let Some((&[a, b, c, d, ..], options)) = body.split_first_chunk::<12>() else {
        return Err(short(body));
    };
    let (mut end, mut dropped) = (None, 0_u64);
    for (code, value) in Options::new(order, options) {
        let Ok(value) = value.try_into() else { continue };
        match code {
            ISB_ENDTIME => end = Some(order.ticks(value)),
            ISB_IFDROP | ISB_OSDROP => dropped = dropped.saturating_add(order.u64(value)),
            _ => {}
        }
    }
    let interface = order.u32([a, b, c, d]);
    Ok((&[], Statistics { interface, end, dropped, options: Options::new(order, options) }))
}

fn comments<'a>(options: Options<'a>) -> impl Iterator<Item = &'a [u8]> {
    options.filter(|(code, _)| *code == COMMENT).map(|(_, value)| value)
}

fn short(body: &[u8]) -> nom::Err<Error<&[u8]>> {
    nom::Err::Error(Error::new(body, ErrorKind::Eof))
}
