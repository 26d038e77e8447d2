//! What error frames say: the classes and details of SocketCAN (`linux/can/error.h`).

use super::{Frame, FrameKind, Identifier};
use crate::event::Moment;
use crate::field::{List, Value};

/// The classes that an error frame reports, one bit each in its identifier.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct ErrorClasses(u32);

/// Names by bit number, as `linux/can/error.h` has them.
pub static NAMES: [&str; 10] = [
    "tx-timeout",
    "lost-arbitration",
    "controller",
    "protocol",
    "transceiver",
    "no-acknowledge",
    "bus-off",
    "bus-error",
    "restarted",
    "counters",
];

const CONTROLLER: u32 = 0x04;
const PROTOCOL: u32 = 0x08;
const NO_ACKNOWLEDGE: u32 = 0x20;
const BUS_OFF: u32 = 0x40;
const RESTARTED: u32 = 0x100;
const COUNTERS: u32 = 0x200;

impl ErrorClasses {
    /// The classes of an error frame; none for any other frame.
    #[must_use]
    pub fn of(frame: &Frame) -> Self {
        ErrorClasses(if frame.kind == FrameKind::Error { frame.id.value() } else { 0 })
    }

    const fn has(self, class: u32) -> bool {
        self.0 & class != 0
    }

    /// The tap's controller has left the bus.
    #[must_use]
    pub const fn is_bus_off(self) -> bool {
        self.has(BUS_OFF)
    }

    /// Nobody acknowledged what the tap's own host sent.
    #[must_use]
    pub const fn is_not_acknowledged(self) -> bool {
        self.has(NO_ACKNOWLEDGE)
    }
}

/// What breaks the rules of a frame on the line (CAN 2.0, part A §6): the type of a protocol error.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Violation {
    /// A bit of fixed form has the other level.
    Form = 0x02,
    /// Six equal bits where stuffing forbids them.
    Stuff = 0x04,
    /// A dominant bit in the intermission: a node asks for more time.
    Overload = 0x20,
    /// An error flag, the cause of which is told already.
    Flag = 0x40,
}

impl Violation {
    /// The error frame that a controller would report of it, at one of SocketCAN's places.
    #[must_use]
    pub fn report(self, place: u8, start: Moment, uncertainty: u32) -> Frame {
        let classes = Identifier::Extended(PROTOCOL);
        Frame::new(start, uncertainty, FrameKind::Error, classes, 8)
            .with(&[0, 0, self as u8, place, 0, 0, 0, 0])
    }
}

impl List for ErrorClasses {
    fn len(&self) -> usize {
        (self.0 & 0x3FF).count_ones() as usize
    }

    fn get(&self, index: usize) -> Value<'_> {
        let mut names = NAMES.iter().enumerate().filter(|(bit, _)| self.0 >> bit & 1 == 1);
        names.nth(index).map_or(Value::Absent, |(_, name)| Value::Text(name))
    }
}

/// What the data of an error frame adds to its classes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ErrorDetail {
    classes: ErrorClasses,
    data: [u8; 8],
}

impl ErrorDetail {
    /// The detail of an error frame.
    #[must_use]
    pub fn of(frame: &Frame) -> Option<Self> {
        let data = *frame.bytes().first_chunk()?;
        (frame.kind == FrameKind::Error)
            .then_some(ErrorDetail { classes: ErrorClasses::of(frame), data })
    }

    /// Nothing is wrong: the controller is active again, or merely tells its counters.
    #[must_use]
    pub const fn is_recovery(&self) -> bool {
        let is_active = !self.classes.has(CONTROLLER) || self.data[1] == 0x40;
        is_active && self.classes.0 & !(CONTROLLER | RESTARTED | COUNTERS) == 0
    }

    /// The controller or its driver was overrun: frames are missing.
    #[must_use]
    pub const fn is_overrun(&self) -> bool {
        self.classes.has(CONTROLLER) && self.data[1] & 0x03 != 0
    }

    /// Frames are missing: the tap's controller was overrun, or was off the bus and is back.
    #[must_use]
    pub const fn is_gap(&self) -> bool {
        self.is_overrun() || self.classes.has(BUS_OFF | RESTARTED)
    }

    /// A node asked for more time between frames.
    #[must_use]
    pub const fn is_overload(&self) -> bool {
        self.classes.has(PROTOCOL) && self.data[2] & 0x20 != 0
    }

    /// Nothing was destroyed: this is no error frame, though controllers report it as one.
    #[must_use]
    pub const fn is_overload_alone(&self) -> bool {
        self.classes.0 == PROTOCOL && self.data[2] == 0x20
    }

    /// A bit was stuffed wrongly.
    #[must_use]
    pub const fn is_stuff(&self) -> bool {
        self.classes.has(PROTOCOL) && self.data[2] & 0x04 != 0
    }

    /// A bit of fixed form had the other level.
    #[must_use]
    pub const fn is_form(&self) -> bool {
        self.classes.has(PROTOCOL) && self.data[2] & 0x02 != 0
    }

    /// The checksum was found wrong: the place is the CRC sequence or its delimiter, and it is not
    /// their stuffing or form that was.
    #[must_use]
    pub const fn is_crc(&self) -> bool {
        let is_other = self.is_stuff() || self.is_form();
        self.classes.has(PROTOCOL) && matches!(self.data[3], 0x08 | 0x18) && !is_other
    }

    /// The error counters of the tap's controller: sent, received. Old drivers fill them in without
    /// saying so.
    #[must_use]
    pub const fn counters(&self) -> Option<(u8, u8)> {
        let [.., tx, rx] = self.data;
        if self.classes.has(COUNTERS) || tx != 0 || rx != 0 { Some((tx, rx)) } else { None }
    }
}
