//! Whether frames look like DeviceNet.

use super::identifier::Port;
use super::ledger::is_foreign;
use super::message::{self, service};
use crate::can::{Frame, FrameKind, Identifier};
use crate::protocol::{Beginning, Speaks};
use alloc::format;

/// Frames that fit, of each sort, and those that do not.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
struct Signature {
    checks: u32,
    explicit: u32,
    io: u32,
    offline: u32,
    others: u32,
    /// A node opened connections: their identifiers may be any.
    has_open: bool,
}

/// Looks how many of the first frames fit the predefined master/slave connection set.
pub(super) fn speaks(beginning: &Beginning<'_>) -> Speaks {
    let mut seen = Signature::default();
    beginning.frames.iter().for_each(|frame| seen.add(frame));
    let Signature { checks, explicit, io, offline, others, .. } = seen;
    let fitting = checks + explicit + io + offline;
    if fitting <= others {
        return Speaks::No;
    }
    let all = fitting + others;
    Speaks::Yes(format!(
        "{fitting} of {all} frames fit the predefined master/slave connections: {io} I/O, {explicit} explicit, {checks} duplicate MAC ID checks, {offline} of the offline set"
    ))
}

impl Signature {
    fn add(&mut self, frame: &Frame) {
        if frame.kind == FrameKind::Error || frame.crc == Some(false) || frame.is_cut() {
            return;
        }
        let Identifier::Standard(id) = frame.id else {
            self.others += 1;
            return;
        };
        if is_foreign(frame) {
            self.others += 1;
            return;
        }
        let data = frame.bytes();
        let count = match Port::of(id) {
            Port::DuplicateMac(_) if data.len() == 7 => &mut self.checks,
            Port::ExplicitRequest(_) | Port::UnconnectedRequest(_) | Port::UcmmRequest(_)
                if is_explicit(data, false) =>
            {
                &mut self.explicit
            }
            Port::ExplicitResponse(_) | Port::UcmmResponse(_) if is_explicit(data, true) => {
                self.has_open |= id >= 0x740 && data.get(1) == Some(&(0x80 | service::ALLOCATE));
                &mut self.explicit
            }
            Port::PollCommand(_)
            | Port::PollResponse(_)
            | Port::Production(_)
            | Port::StrobeResponse(_)
            | Port::MulticastResponse(_)
            | Port::Acknowledge(_) => &mut self.io,
            Port::StrobeCommand(_) if data.len() == 8 => &mut self.io,
            Port::CommFaultRequest
            | Port::CommFaultResponse
            | Port::OwnershipRequest
            | Port::OwnershipResponse => &mut self.offline,
            Port::Free(_) if self.has_open => &mut self.explicit,
            _ => &mut self.others,
        };
        *count += 1;
    }
}

/// A legal header and service, in the right direction; or a fragment.
fn is_explicit(data: &[u8], from_server: bool) -> bool {
    let Ok((rest, header)) = message::header(data) else { return false };
    if header.is_fragment {
        return !rest.is_empty();
    }
    message::service_byte(rest)
        .is_ok_and(|(_, it)| it.is_response == from_server && !it.is_reserved())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::Moment;

    fn signature(frames: &[(u16, &[u8])]) -> Signature {
        let mut seen = Signature::default();
        for (id, data) in frames {
            let id = Identifier::Standard(*id);
            seen.add(&Frame::data(Moment::UNKNOWN, 0, id, data));
        }
        seen
    }

    #[test]
    fn the_start_of_a_scanner_fits() {
        let seen = signature(&[
            (0x407, &[0x00, 0x01, 0x00, 0x92, 0x39, 0x60, 0x60]),
            (0x780, &[0x02, 0x4B, 0x02, 0x34]),
            (0x416, &[0x00, 0x4B, 0x03, 0x01, 0x01, 0x00]),
            (0x415, &[4]),
            (0x7ED, &[0x3F, 0x4B, 0x02]),
        ]);
        let wanted =
            Signature { checks: 1, explicit: 2, io: 1, offline: 1, ..Signature::default() };
        assert_eq!(seen, wanted);
    }

    #[test]
    fn a_car_does_not_fit() {
        // OBD-II requests and answers, and low identifiers.
        let seen = signature(&[
            (0x7DF, &[2, 1, 0x0C, 0, 0, 0, 0, 0]),
            (0x7E8, &[4, 0x41, 0x0C, 0x1A, 0xF8, 0, 0, 0]),
            (0x0F1, &[0x1C, 5, 2, 0x40]),
            (0x1E5, &[0x46, 0, 0, 0]),
        ]);
        assert_eq!((seen.others, seen.io + seen.explicit), (4, 0));
    }
}
