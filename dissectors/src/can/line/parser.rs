//! From bits to frames, and to what breaks their rules.
//!
//! A tap does not send, so it cannot know who found an error; it sees what every node sees. After
//! an error nothing is believed until the bus was recessive for eleven bits, or for ten and a start
//! of frame: the delimiter of eight and the intermission (CAN 2.0, part A §3.1.3, §3.1.5).

use super::body::{Body, Taken};
use crate::bus::Sampling;
use crate::can::errors::Violation;
use crate::can::frame::Frame;
use alloc::vec::Vec;

/// The bus is idle after so many recessive bits.
const IDLE: u32 = 11;

/// Dominant bits that only a flag has.
const FLAG: u32 = 6;

/// Recessive bits behind a flag, and behind those what delays the next frame.
const OVERLOADED: core::ops::RangeInclusive<u32> = 8..=9;

/// The bits behind the checksum, by number.
const CRC_DELIMITER: u8 = 0;
const ACK_SLOT: u8 = 1;
const ACK_DELIMITER: u8 = 2;
/// A frame is valid for who receives it when this bit is over: the last but one of its end.
const VALID: u8 = 8;
/// In this bit of the intermission a frame may begin.
const LAST: u8 = 12;

/// Bits behind the checksum: delimiters, acknowledge, end of frame, intermission.
const TAIL: u16 = 13;

/// SocketCAN's numbers of the places behind the checksum.
const PLACES: [u8; 13] =
    [0x18, 0x19, 0x1B, 0x1A, 0x1A, 0x1A, 0x1A, 0x1A, 0x1A, 0x1A, 0x12, 0x12, 0x12];

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Stage {
    /// What is on the bus may be anything: so many recessive bits so far, behind so many dominant
    /// ones.
    Deaf { quiet: u32, dominant: u32 },
    /// Nobody sends.
    Idle,
    /// The stuffed part of a frame.
    Body,
    /// The bit of that number behind it is next.
    Tail(u8),
}

/// What an edge to dominant does to the bit clock.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Synchronization {
    /// A bit begins there.
    Hard,
    /// The clock is moved towards it.
    Soft,
}

/// Makes frames of bits.
#[derive(Clone, Debug)]
pub(super) struct Parser {
    sampling: Sampling,
    stage: Stage,
    body: Body,
    /// The tick at which the frame began.
    start: u64,
    is_acknowledged: bool,
    /// Starts that were none.
    pub false_starts: u64,
}

impl Parser {
    /// Of a bus on which anything may be going on.
    pub fn new(sampling: Sampling) -> Self {
        Parser {
            sampling,
            stage: Stage::Deaf { quiet: 0, dominant: 0 },
            body: Body::new(),
            start: 0,
            is_acknowledged: false,
            false_starts: 0,
        }
    }

    /// What follows may begin anywhere.
    pub fn reset(&mut self) {
        self.stage = Stage::Deaf { quiet: 0, dominant: 0 };
    }

    /// Whether it waits for the bus to be idle: then pulses of any length are traffic.
    pub fn is_deaf(&self) -> bool {
        matches!(self.stage, Stage::Deaf { .. })
    }

    /// Whether the bits of the stuffed part are coming.
    pub fn is_in_body(&self) -> bool {
        self.stage == Stage::Body
    }

    /// The level goes to dominant at this tick.
    pub fn fall(&mut self, tick: u64, out: &mut Vec<Frame>) -> Synchronization {
        match self.stage {
            Stage::Deaf { quiet, dominant } if quiet + 1 < IDLE => {
                if dominant >= FLAG && OVERLOADED.contains(&quiet) {
                    out.push(self.report(Violation::Overload, PLACES[usize::from(LAST)], tick));
                }
                self.reset();
            }
            Stage::Idle | Stage::Tail(LAST) | Stage::Deaf { .. } => {
                self.stage = Stage::Body;
                self.start = tick;
                self.body = Body::new();
            }
            Stage::Body | Stage::Tail(_) => return Synchronization::Soft,
        }
        Synchronization::Hard
    }

    /// Takes what almost all bits are part of: a run of the stuffed part that decides nothing.
    /// Returns false if they are none, and then has taken nothing.
    #[inline(always)]
    pub fn take_run(&mut self, is_recessive: bool, count: u32) -> bool {
        self.stage == Stage::Body && self.body.take_run(is_recessive, count)
    }

    /// Takes so many bits of one level, which it has since the tick `edge`.
    pub fn take(&mut self, is_recessive: bool, mut count: u32, edge: u64, out: &mut Vec<Frame>) {
        if self.stage == Stage::Body {
            count = self.take_body(is_recessive, count, edge, out);
        }
        while let Stage::Tail(number) = self.stage {
            if count == 0 {
                return;
            }
            if self.is_violated(number, is_recessive, edge, out) {
                self.stage = Stage::Deaf { quiet: 0, dominant: 0 };
                break;
            }
            self.stage = if number == LAST { Stage::Idle } else { Stage::Tail(number + 1) };
            count -= 1;
        }
        match &mut self.stage {
            Stage::Deaf { quiet, .. } if is_recessive => {
                *quiet = quiet.saturating_add(count);
                if *quiet >= IDLE {
                    self.stage = Stage::Idle;
                }
            }
            Stage::Deaf { dominant, .. } => *dominant = dominant.saturating_add(count),
            Stage::Idle | Stage::Body | Stage::Tail(_) => {}
        }
    }

    /// Takes bits of the stuffed part, and says how many are left.
    fn take_body(
        &mut self,
        is_recessive: bool,
        count: u32,
        edge: u64,
        out: &mut Vec<Frame>,
    ) -> u32 {
        if self.body.is_empty() && is_recessive {
            // The start of frame was over before its sample point.
            self.false_starts += u64::from(count > 0);
            self.stage = if count > 0 { Stage::Idle } else { Stage::Body };
            return 0;
        }
        match self.body.take(is_recessive, count) {
            Taken::All => 0,
            Taken::Over(left) => {
                self.stage = Stage::Tail(CRC_DELIMITER);
                left
            }
            Taken::Violated(left) => {
                out.push(self.report(Violation::Stuff, self.body.place(), edge));
                let dominant = if is_recessive { 0 } else { FLAG - 1 };
                self.stage = Stage::Deaf { quiet: 0, dominant };
                left
            }
            Taken::Fd(left) => {
                out.push(self.body.frame(self.start, &self.sampling));
                self.reset();
                left
            }
        }
    }

    /// Takes one bit behind the checksum, and tells what is wrong with it, or that the frame is
    /// valid.
    fn is_violated(
        &mut self,
        number: u8,
        is_recessive: bool,
        edge: u64,
        out: &mut Vec<Frame>,
    ) -> bool {
        if number == ACK_SLOT {
            self.is_acknowledged = !is_recessive;
            return false;
        }
        if is_recessive {
            if number == VALID {
                out.push(self.frame(TAIL));
            }
            return false;
        }
        let frame = self.frame(u16::from(number));
        let is_bad = frame.crc == Some(false);
        let violation = match number {
            // Who sent it flags at once that nobody acknowledged it, and who found its checksum
            // wrong, behind the delimiter (CAN 2.0, part A §6).
            ACK_DELIMITER if !self.is_acknowledged => Violation::Flag,
            3..=VALID if is_bad => Violation::Flag,
            CRC_DELIMITER..=VALID => Violation::Form,
            _ => Violation::Overload,
        };
        if violation == Violation::Flag {
            out.push(frame);
        }
        out.push(self.report(violation, PLACES[usize::from(number)], edge));
        true
    }

    /// The frame, of which so many bits behind the checksum were sent.
    fn frame(&self, tail: u16) -> Frame {
        let mut frame = self.body.frame(self.start, &self.sampling);
        // What is not understood is rightly not acknowledged.
        frame.is_acknowledged = (frame.crc == Some(true)).then_some(self.is_acknowledged);
        frame.measured_bits = Some(self.body.length() + tail);
        frame
    }

    fn report(&self, violation: Violation, place: u8, tick: u64) -> Frame {
        violation.report(place, self.sampling.moment(tick), self.sampling.uncertainty)
    }
}
