//! CAN frames in pcapng: LINKTYPE_CAN_SOCKETCAN.
//!
//! Identifier with its flags (big-endian), length, CAN FD flags, two reserved bytes of which the
//! second holds a DLC above eight, and the data.

use dissectors::can::{Direction, Frame, FrameKind, MAX_CLASSIC_DATA};

const EXTENDED: u32 = 0x8000_0000;
const REMOTE: u32 = 0x4000_0000;
const ERROR: u32 = 0x2000_0000;

/// The flag of CAN FD frames.
const FD: u8 = 0x04;

/// Directions in `epb_flags`.
const INBOUND: u32 = 1;
const OUTBOUND: u32 = 2;

/// The bytes of a frame's block.
pub fn compose(frame: &Frame, data: &mut Vec<u8>) {
    let kind = match frame.kind {
        FrameKind::Error => ERROR,
        FrameKind::Remote => REMOTE,
        FrameKind::Data | FrameKind::Fd => 0,
    };
    let is_extended = frame.id.is_extended() && frame.kind != FrameKind::Error;
    let id = frame.id.value() | kind | if is_extended { EXTENDED } else { 0 };
    let is_fd = frame.kind == FrameKind::Fd;
    let length = length(frame);
    let raw_dlc = if !is_fd && frame.dlc > MAX_CLASSIC_DATA as u8 { frame.dlc } else { 0 };
    data.clear();
    data.extend_from_slice(&id.to_be_bytes());
    data.extend_from_slice(&[
        length,
        if is_fd { FD | frame.fd_flags.bits() } else { 0 },
        0,
        raw_dlc,
    ]);
    data.extend_from_slice(frame.bytes());
}

/// The data bytes that a frame says to have: more than there are, where it was cut.
fn length(frame: &Frame) -> u8 {
    match frame.kind {
        FrameKind::Remote => frame.dlc.min(MAX_CLASSIC_DATA as u8),
        _ if frame.is_cut() => match frame.original_length {
            Some(length) => u8::try_from(length).unwrap_or(u8::MAX),
            None => frame.dlc.min(MAX_CLASSIC_DATA as u8),
        },
        _ => frame.bytes().len() as u8,
    }
}

/// Bytes of a frame's block that the capture does not have.
pub fn missing(frame: &Frame) -> usize {
    if frame.is_cut() { usize::from(length(frame)).saturating_sub(frame.bytes().len()) } else { 0 }
}

/// Who sent it, as `epb_flags` say it.
pub const fn flags(frame: &Frame) -> Option<u32> {
    match frame.direction {
        Some(Direction::Received) => Some(INBOUND),
        Some(Direction::Sent) => Some(OUTBOUND),
        None => None,
    }
}
