//! What other makers' adapters report of errors, as the error frames of SocketCAN
//! (`linux/can/error.h`), which is the form that dissectors know.

use dissectors::can::{Frame, FrameKind, Identifier};
use dissectors::event::Moment;

// Classes.
const CONTROLLER: u32 = 0x04;
const PROTOCOL: u32 = 0x08;
const NO_ACKNOWLEDGE: u32 = 0x20;
const BUS_OFF: u32 = 0x40;
const BUS_ERROR: u32 = 0x80;
const COUNTERS: u32 = 0x200;

/// Where in the frame: the CRC sequence.
const IN_CRC: u8 = 0x08;

/// A report that is being put together.
#[derive(Clone, Copy, Default, Debug)]
pub struct Report {
    classes: u32,
    data: [u8; 8],
}

/// The state that a controller says it is in.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum State {
    /// All is well again.
    Active,
    /// An error counter has reached 96.
    Warning,
    /// An error counter has reached 128.
    Passive,
    /// It left the bus.
    Off,
}

/// What kind of error was seen on the wire.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Kind {
    /// A bit was not what was sent.
    Bit,
    /// A bit of fixed form.
    Form,
    /// Stuffing.
    Stuff,
    /// The checksum.
    Crc,
    /// Nobody acknowledged.
    Acknowledge,
    /// Some other.
    Other,
}

impl Report {
    /// Of a state. It is not told of which of the two counters it is, and so it is of both.
    pub fn of_state(state: State) -> Self {
        let report = Report::default();
        match state {
            State::Active => report.controller(0x40),
            State::Warning => report.controller(0x0C),
            State::Passive => report.controller(0x30),
            State::Off => Report { classes: BUS_OFF, ..report },
        }
    }

    /// Of an overrun of the receiver: frames are missing.
    pub fn of_overrun() -> Self {
        Report::default().controller(0x01)
    }

    /// Of an error on the wire whose kind is not told.
    pub fn of_error() -> Self {
        Report { classes: BUS_ERROR, ..Report::default() }
    }

    /// Of an overload frame.
    pub fn of_overload() -> Self {
        Report { classes: PROTOCOL, data: [0, 0, 0x20, 0, 0, 0, 0, 0] }
    }

    /// Of the error counters alone.
    pub fn of_counters(sent: u8, received: u8) -> Self {
        Report::default().counting(sent, received)
    }

    /// Of an error of this kind at this place of the frame, which is numbered as the SJA1000
    /// controller and SocketCAN do.
    pub fn of_kind(kind: Kind, place: u8, is_sender: bool) -> Self {
        let kind_bits = match kind {
            Kind::Bit => 0x01,
            Kind::Form => 0x02,
            Kind::Stuff => 0x04,
            Kind::Crc | Kind::Acknowledge | Kind::Other => 0,
        };
        let place = if kind == Kind::Crc { IN_CRC } else { place & 0x1F };
        let sender = if is_sender { 0x80 } else { 0 };
        let unanswered = if kind == Kind::Acknowledge { NO_ACKNOWLEDGE } else { 0 };
        Report {
            classes: PROTOCOL | BUS_ERROR | unanswered,
            data: [0, 0, kind_bits | sender, place, 0, 0, 0, 0],
        }
    }

    /// The error capture code of an SJA1000 controller: two bits of kind, one of direction, five of
    /// place.
    pub fn of_capture_code(code: u8) -> Self {
        let kind = match code >> 6 {
            0 => Kind::Bit,
            1 => Kind::Form,
            2 => Kind::Stuff,
            _ => Kind::Other,
        };
        Report::of_kind(kind, code, code & 0x20 == 0)
    }

    /// The same, with the error counters.
    pub fn counting(mut self, sent: u8, received: u8) -> Self {
        self.classes |= COUNTERS;
        (self.data[6], self.data[7]) = (sent, received);
        self
    }

    /// The error frame.
    pub fn frame(self, at: Moment, uncertainty: u32) -> Frame {
        let id = Identifier::Extended(self.classes);
        Frame::new(at, uncertainty, FrameKind::Error, id, 8).with(&self.data)
    }

    fn controller(mut self, bits: u8) -> Self {
        self.classes |= CONTROLLER;
        self.data[1] = bits;
        self
    }
}
