//! Where a capture is taken: what the tap hears of each attempt to send a frame.

use super::frame::Frame;
use super::wire::Flaw;
use crate::simulate::level::Low;
use crate::simulate::samples::Sampler;
use crate::simulate::time::Ps;
use anyhow::Result;

/// An attempt to send a frame, as the tap hears it. Times are counted from the capture's start.
pub struct Heard<'a> {
    /// When the line was low, in order.
    pub spans: &'a [Low],
    /// Up to where the line is known.
    pub until: Ps,
    /// When a controller hears of it: at the end of the frame, or of the error's delimiter.
    pub at: Ps,
    /// What a controller hears, in order.
    pub what: Vec<What<'a>>,
}

/// What a controller hears.
#[derive(Clone, Copy, Debug)]
pub enum What<'a> {
    /// A frame, and how many bytes of its data are kept.
    Frame(&'a Frame, usize),
    /// An error, as SocketCAN tells it.
    Error(ErrorFrame),
    /// So many frames were missed.
    Missed(u64),
}

/// An error frame of SocketCAN (`linux/can/error.h`).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ErrorFrame {
    /// Error classes.
    pub classes: u32,
    /// What they mean.
    pub data: [u8; 8],
}

/// Classes of errors.
const CONTROLLER: u32 = 0x04;
const PROTOCOL: u32 = 0x08;
const BUS_OFF: u32 = 0x40;
const BUS_ERROR: u32 = 0x80;
const RESTARTED: u32 = 0x100;
const COUNTERS: u32 = 0x200;

impl ErrorFrame {
    /// A protocol violation, as a controller sees it that counted so many errors.
    pub fn of(flaw: Flaw, errors: u8) -> Self {
        // Kind of the error, and where: data, checksum, end of frame, acknowledge delimiter,
        // intermission.
        let (kind, place) = match flaw {
            Flaw::Flagged => (0x01, 0x0A),
            Flaw::Stuff => (0x04, 0x0A),
            Flaw::Crc => (0x00, 0x08),
            Flaw::Form => (0x02, 0x1A),
            Flaw::Unacknowledged | Flaw::UnacknowledgedPassive => (0x02, 0x1B),
            Flaw::Overload => (0x20, 0x12),
        };
        let data = [0, 0, kind, place, 0, 0, 0, errors];
        ErrorFrame { classes: PROTOCOL | BUS_ERROR | COUNTERS, data }
    }

    /// What a controller tells that sends at the wrong time, until it is off the bus.
    pub fn leaving() -> [Self; 3] {
        let sent = |classes, status, count| ErrorFrame {
            classes,
            data: [0, status, 0, 0, 0, 0, count, 0],
        };
        [
            // Warning, passive, off.
            sent(CONTROLLER | COUNTERS, 0x08, 96),
            sent(CONTROLLER | COUNTERS, 0x20, 128),
            sent(BUS_OFF, 0, 248),
        ]
    }

    /// It is back.
    pub fn restarted() -> Self {
        ErrorFrame { classes: RESTARTED, data: [0; 8] }
    }
}

/// Something that listens to the bus and writes a capture.
pub trait Tap {
    /// Hears an attempt.
    ///
    /// # Errors
    /// The capture cannot be written.
    fn hear(&mut self, heard: &Heard<'_>) -> Result<()>;

    /// The capture ends here.
    ///
    /// # Errors
    /// The capture cannot be written.
    fn end(self: Box<Self>, at: Ps) -> Result<()>;
}

/// A tap that looks at the line's level: that of CAN_RX.
impl Tap for Sampler {
    fn hear(&mut self, heard: &Heard<'_>) -> Result<()> {
        // A capture that begins in the middle of a frame.
        let within = |low: &Low| Low { from: low.from.max(0), to: low.to.max(0) };
        let spans: Vec<Low> = heard.spans.iter().map(within).filter(|low| low.to > 0).collect();
        self.watch(&spans, heard.until.max(0))
    }

    fn end(self: Box<Self>, at: Ps) -> Result<()> {
        self.finish(at)
    }
}
