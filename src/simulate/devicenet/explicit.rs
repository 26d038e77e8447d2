//! Explicit messages: header, body, and what is done where a body does not fit one frame
//! (CIP Vol. 3; acknowledged fragmentation).

use super::frame::Frame;
use crate::simulate::time::{Ps, S};

/// Get_Attribute_Single.
pub const GET: u8 = 0x0E;
/// Set_Attribute_Single.
pub const SET: u8 = 0x10;
/// Reset.
pub const RESET: u8 = 0x05;
/// Restore.
pub const RESTORE: u8 = 0x15;
/// Save.
pub const SAVE: u8 = 0x16;
/// Allocate of the DeviceNet object, and Open of the message manager.
pub const ALLOCATE: u8 = 0x4B;
/// Release.
pub const RELEASE: u8 = 0x4C;
/// Device heartbeat, always with the R/R bit.
pub const HEARTBEAT: u8 = 0xCD;
/// Device shutdown, always with the R/R bit.
pub const SHUTDOWN: u8 = 0xCE;
/// Error response.
pub const ERROR: u8 = 0x94;
/// The R/R bit of a response.
pub const RESPONSE: u8 = 0x80;

/// FRAG of the message header.
const FRAGMENTED: u8 = 0x80;
/// Fragment types.
const MIDDLE: u8 = 0x40;
const LAST: u8 = 0x80;
const ACKNOWLEDGE: u8 = 0xC0;
/// Bytes of the body in a frame, and in a fragment.
const WHOLE: usize = 7;
const PIECE: usize = 6;
/// How long a sender waits for an acknowledge before it sends the fragment again, and then before
/// it gives up.
pub const PATIENCE: Ps = S;

/// Status of an acknowledge: too much data.
pub const TOO_MUCH: u8 = 1;

/// What a fragment is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Piece {
    /// The message is not fragmented.
    Whole,
    /// The first, one in the middle, the last.
    First,
    /// Neither.
    Middle,
    /// The last.
    Last,
    /// None: it acknowledges one.
    Acknowledge,
}

impl Piece {
    /// Its name, if the message is fragmented.
    pub fn name(self) -> Option<&'static str> {
        match self {
            Piece::Whole => None,
            Piece::First => Some("first"),
            Piece::Middle => Some("middle"),
            Piece::Last => Some("last"),
            Piece::Acknowledge => Some("ack"),
        }
    }
}

/// A message on its way out.
#[derive(Clone, Debug)]
pub struct Outgoing {
    id: u16,
    /// The other end.
    header: u8,
    body: Vec<u8>,
    /// Bytes that are acknowledged.
    sent: usize,
    count: u8,
    /// Whether the current fragment was sent again.
    pub is_second: bool,
    /// What is added to the count by mistake.
    pub slip: u8,
}

impl Outgoing {
    /// A message to this MAC ID, whose body begins with the service.
    pub fn new(id: u16, other: u8, body: Vec<u8>) -> Self {
        Outgoing { id, header: other, body, sent: 0, count: 0, is_second: false, slip: 0 }
    }

    /// Whether it takes more than one frame.
    pub fn is_fragmented(&self) -> bool {
        self.body.len() > WHOLE
    }

    /// What the current frame is.
    pub fn piece(&self) -> Piece {
        match (self.is_fragmented(), self.sent) {
            (false, _) => Piece::Whole,
            (true, 0) => Piece::First,
            (true, sent) if sent + PIECE >= self.body.len() => Piece::Last,
            (true, _) => Piece::Middle,
        }
    }

    /// The current frame.
    pub fn frame(&self) -> Frame {
        let kind = match self.piece() {
            Piece::Middle => MIDDLE,
            Piece::Last => LAST,
            _ => 0,
        };
        if self.piece() == Piece::Whole {
            return Frame::new(self.id, &[&[self.header], &self.body[..]].concat());
        }
        let end = self.body.len().min(self.sent + PIECE);
        let count = kind | (self.count + self.slip) & 0x3F;
        let head = [self.header | FRAGMENTED, count];
        Frame::new(self.id, &[&head, &self.body[self.sent..end]].concat())
    }

    /// The fragment with this count was taken. Returns whether there is another.
    pub fn advance(&mut self, count: u8) -> Option<bool> {
        if !self.is_fragmented() || count != self.count & 0x3F {
            return None;
        }
        self.sent = self.body.len().min(self.sent + PIECE);
        self.count += 1;
        self.is_second = false;
        Some(self.sent < self.body.len())
    }

    /// The body.
    pub fn body(&self) -> &[u8] {
        &self.body
    }
}

/// The acknowledge of a fragment.
pub fn acknowledge(id: u16, other: u8, count: u8, status: u8) -> Frame {
    Frame::new(id, &[other | FRAGMENTED, ACKNOWLEDGE | count & 0x3F, status])
}

/// What a frame of a connection brought.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Arrival {
    /// A message: its header without FRAG, and its body.
    Message(u8, Vec<u8>),
    /// A fragment that is to be acknowledged: count, and the message if it is the last.
    Fragment(u8, Option<Vec<u8>>),
    /// An acknowledge: count and status.
    Acknowledge(u8, u8),
    /// Nothing that could be used.
    Nothing,
}

/// Puts fragments together.
#[derive(Default, Debug)]
pub struct Incoming {
    body: Vec<u8>,
    is_open: bool,
    /// The count that comes next.
    next: u8,
    /// The fragment that was taken last.
    last: Option<u8>,
}

impl Incoming {
    /// Takes the data of a frame.
    pub fn take(&mut self, data: &[u8]) -> Arrival {
        let [header, rest @ ..] = data else { return Arrival::Nothing };
        if header & FRAGMENTED == 0 {
            *self = Incoming::default();
            return Arrival::Message(*header, rest.to_vec());
        }
        let [kind, piece @ ..] = rest else { return Arrival::Nothing };
        let (count, status) = (kind & 0x3F, piece.first().copied().unwrap_or(0));
        match kind & 0xC0 {
            ACKNOWLEDGE => Arrival::Acknowledge(count, status),
            // A fragment that came before: its acknowledge was lost.
            _ if self.last == Some(*kind) && *kind != 0 => Arrival::Fragment(count, None),
            0 if count == 0 => {
                *self =
                    Incoming { body: piece.to_vec(), is_open: true, next: 1, last: Some(*kind) };
                Arrival::Fragment(count, None)
            }
            0 => Arrival::Nothing,
            kind_of if self.is_open && count == self.next => {
                self.body.extend(piece);
                (self.next, self.last) = ((count + 1) & 0x3F, Some(*kind));
                if kind_of == LAST {
                    let body = std::mem::take(&mut self.body);
                    self.is_open = false;
                    return Arrival::Fragment(count, Some(body));
                }
                Arrival::Fragment(count, None)
            }
            _ => {
                *self = Incoming::default();
                Arrival::Nothing
            }
        }
    }

    /// Forgets what came so far.
    pub fn reset(&mut self) {
        *self = Incoming::default();
    }
}

/// The body of an error response.
pub fn error(general: u8, additional: u8) -> Vec<u8> {
    vec![ERROR, general, additional]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sent(mut message: Outgoing) -> Vec<String> {
        let mut frames = Vec::new();
        loop {
            let frame = message.frame();
            frames.push(frame.bytes().iter().map(|byte| format!("{byte:02X}")).collect());
            let count = frame.bytes()[1] & 0x3F;
            if message.advance(count) != Some(true) {
                return frames;
            }
        }
    }

    #[test]
    fn a_body_of_seven_bytes_is_one_frame() {
        let get = Outgoing::new(0x4BC, 0, vec![GET, 0x2F, 1, 12]);
        assert_eq!(sent(get), ["000E2F010C"]);
    }

    #[test]
    fn a_preset_takes_two_fragments() {
        // Preset 74565 = 12345h, attribute 10.
        let set = Outgoing::new(0x4BC, 0, vec![SET, 0x2F, 1, 10, 0x45, 0x23, 0x01, 0x00]);
        assert_eq!(sent(set), ["8000102F010A4523", "80810100"]);
        assert_eq!(acknowledge(0x4BB, 0, 0, 0).bytes(), [0x80, 0xC0, 0]);
        assert_eq!(acknowledge(0x4BB, 0, 1, 0).bytes(), [0x80, 0xC1, 0]);
    }

    #[test]
    fn fragments_are_put_together_and_repeats_are_acknowledged_again() {
        let mut incoming = Incoming::default();
        let first = [0x80, 0x00, SET, 0x2F, 1, 10, 0x45, 0x23];
        assert_eq!(incoming.take(&first), Arrival::Fragment(0, None));
        assert_eq!(incoming.take(&first), Arrival::Fragment(0, None));
        let body = vec![SET, 0x2F, 1, 10, 0x45, 0x23, 0x01, 0x00];
        assert_eq!(incoming.take(&[0x80, 0x81, 0x01, 0x00]), Arrival::Fragment(1, Some(body)));
        assert_eq!(incoming.take(&[0x80, 0x81, 0x01, 0x00]), Arrival::Fragment(1, None));
        assert_eq!(incoming.take(&[0x80, 0x43, 0x01, 0x00]), Arrival::Nothing);
        assert_eq!(incoming.take(&[0x80, 0xC1, 0x01]), Arrival::Acknowledge(1, 1));
        assert_eq!(incoming.take(&[0x00, 0x90]), Arrival::Message(0, vec![0x90]));
    }

    #[test]
    fn counts_wrap_after_64_fragments() {
        let body: Vec<u8> = (0..=255).chain(0..=255).collect();
        let mut incoming = Incoming::default();
        let mut message = Outgoing::new(0x4BB, 0, body.clone());
        loop {
            let Arrival::Fragment(count, whole) = incoming.take(message.frame().bytes()) else {
                panic!("a fragment");
            };
            if let Some(whole) = whole {
                assert_eq!(whole, body);
                break;
            }
            message.advance(count).unwrap();
        }
    }
}
