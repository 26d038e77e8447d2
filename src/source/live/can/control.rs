//! What the kernel says of a frame besides its bytes: control messages (`cmsg(3)`).
//!
//! Each is a header of its length, a level and a type, then data, padded to whole words.

use dissectors::event::Moment;
use nom::bytes::complete::take;
use nom::number::Endianness::Native;
use nom::number::complete::{i32, i64, u32, u64};
use nom::{IResult, Parser};

const WORD: usize = size_of::<usize>();

/// Of the header: a length of one word, a level and a type.
const HEADER: usize = WORD + 8;

/// What is known of a frame.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct Remarks {
    /// When the kernel took it from the controller, if it stamped it.
    pub stamp: Moment,
    /// Frames that the socket had to drop before this one since it was opened, modulo 2³²: only
    /// told once there are any.
    pub dropped: Option<u32>,
}

impl Remarks {
    /// Reads control messages. What is not understood is left out.
    pub fn of(mut control: &[u8]) -> Remarks {
        let mut remarks = Remarks::default();
        while let Ok((rest, (level, kind, data))) = message(control) {
            match (level, kind) {
                (libc::SOL_SOCKET, libc::SCM_TIMESTAMPNS) => {
                    remarks.stamp = time(data).map_or(Moment::UNKNOWN, |(_, stamp)| stamp);
                }
                (libc::SOL_SOCKET, libc::SO_RXQ_OVFL) => {
                    remarks.dropped = count(data).map(|(_, count)| count).ok();
                }
                _ => {}
            }
            control = rest;
        }
        remarks
    }
}

/// Level, type and data of the next one.
fn message(control: &[u8]) -> IResult<&[u8], (i32, i32, &[u8])> {
    let (rest, length) = word(control)?;
    let (rest, (level, kind)) = (i32(Native), i32(Native)).parse(rest)?;
    let (rest, data) = take(length.saturating_sub(HEADER)).parse(rest)?;
    let padding = length.next_multiple_of(WORD) - length;
    // The last one need not be padded.
    let (rest, _) = take(padding.min(rest.len())).parse(rest)?;
    Ok((rest, (level, kind, data)))
}

/// A length; one that no buffer has is cut to one that is refused just so.
fn word(bytes: &[u8]) -> IResult<&[u8], usize> {
    let most = usize::try_from(i32::MAX).unwrap_or(usize::MAX);
    let (rest, length) = match WORD {
        8 => u64(Native).map(|length| usize::try_from(length).unwrap_or(most)).parse(bytes)?,
        _ => u32(Native).map(|length| usize::try_from(length).unwrap_or(most)).parse(bytes)?,
    };
    Ok((rest, length.min(most)))
}

/// A `struct timespec`, whose members are words.
fn time(data: &[u8]) -> IResult<&[u8], Moment> {
    let (rest, (seconds, ns)) = match data.len() {
        16 => (i64(Native), i64(Native)).parse(data)?,
        _ => (i32(Native).map(i64::from), i32(Native).map(i64::from)).parse(data)?,
    };
    let ns = seconds.saturating_mul(1_000_000_000).saturating_add(ns);
    Ok((rest, Moment::from_ns(ns)))
}

fn count(data: &[u8]) -> IResult<&[u8], u32> {
    u32(Native).parse(data)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A control message as the kernel lays it out on a 64-bit machine.
    fn cmsg(level: i32, kind: i32, data: &[u8]) -> Vec<u8> {
        let mut bytes = (HEADER + data.len()).to_ne_bytes().to_vec();
        bytes.extend(level.to_ne_bytes());
        bytes.extend(kind.to_ne_bytes());
        bytes.extend(data);
        bytes.resize(bytes.len().next_multiple_of(WORD), 0);
        bytes
    }

    fn stamp(seconds: i64, ns: i64) -> Vec<u8> {
        let data = [seconds.to_ne_bytes(), ns.to_ne_bytes()].concat();
        cmsg(libc::SOL_SOCKET, libc::SCM_TIMESTAMPNS, &data)
    }

    fn overflow(count: u32) -> Vec<u8> {
        cmsg(libc::SOL_SOCKET, libc::SO_RXQ_OVFL, &count.to_ne_bytes())
    }

    #[test]
    fn stamp_and_drops_are_found_in_any_order() {
        let expected = Remarks {
            stamp: Moment::from_ns(1_700_000_000_123_456_789),
            dropped: Some(0xFFFF_FFFE),
        };
        let (stamp, overflow) = (stamp(1_700_000_000, 123_456_789), overflow(0xFFFF_FFFE));
        assert_eq!(Remarks::of(&[stamp.clone(), overflow.clone()].concat()), expected);
        // The last one may come without its padding, and there may be others in between.
        let other = cmsg(libc::SOL_SOCKET, 1, &[1, 2, 3]);
        let unpadded = &overflow[..HEADER + 4];
        assert_eq!(Remarks::of(&[&stamp[..], &other, unpadded].concat()), expected);
    }

    #[test]
    fn nothing_is_read_out_of_what_is_cut_or_lies_about_its_length() {
        assert_eq!(Remarks::of(&[]), Remarks::default());
        let whole = stamp(1, 2);
        for length in 0..whole.len() {
            assert_eq!(Remarks::of(&whole[..length]), Remarks::default(), "{length} bytes");
        }
        for length in [0_usize, 3, HEADER - 1, HEADER, usize::MAX] {
            let mut bytes = whole.clone();
            bytes[..WORD].copy_from_slice(&length.to_ne_bytes());
            Remarks::of(&bytes);
        }
    }
}
