//! From the telegrams of one wire to frames: what a cycle is on one wire.

use super::find::{Check, PAUSE};
use super::receiver::{Flags, Telegram};
use alloc::vec::Vec;

/// Bytes of registers that a cycle has at most (512), with loopback word, checksum and a control
/// word of four.
pub const MAX_BYTES: usize = 512 + 8;

/// Bits of a data telegram.
pub const TELEGRAM: u64 = 13;

/// So many characters a doubt lasts: one that was misread may end in the next ones.
const DOUBT: u16 = 16;

/// Frames that are not used are kept, so that their memory is used again: so many.
const SPARE: usize = 8;

/// What one wire carried in a cycle.
#[derive(Clone, Default, PartialEq, Eq, Debug)]
pub struct RawFrame {
    /// The tick of its first start edge.
    pub start: u64,
    /// The tick behind its last character.
    pub end: u64,
    /// The flags of its first character.
    pub flags: Flags,
    /// Loopback word, registers, checksum, control word; bits in the order they were sent.
    pub bytes: Vec<u8>,
    /// Characters without their stop bit.
    pub bad: u16,
    /// What told its characters from status telegrams was no more than likely.
    pub is_doubtful: bool,
    /// It has everything from its first character to its check phase.
    pub is_whole: bool,
}

/// Puts frames together.
#[derive(Clone, Debug)]
pub struct Assembler {
    bit: f64,
    check: Option<Check>,
    /// Characters of the check phase.
    check_length: u16,
    current: Option<RawFrame>,
    checked: u16,
    /// Characters since such a doubt.
    since_doubt: u16,
    /// A status telegram was heard: what comes next begins a frame.
    is_synchronized: bool,
    spare: Vec<RawFrame>,
}

impl Assembler {
    /// For characters whose bits last so many ticks.
    #[must_use]
    pub fn new(bit: f64, check: Option<Check>, check_length: u16) -> Self {
        Assembler {
            bit,
            check,
            check_length,
            current: None,
            checked: 0,
            since_doubt: u16::MAX,
            is_synchronized: false,
            spare: Vec::new(),
        }
    }

    /// When the frame at hand began.
    #[must_use]
    pub fn open(&self) -> Option<u64> {
        self.current.as_ref().map(|frame| frame.start)
    }

    /// Takes a frame back that is not used any more.
    pub fn reuse(&mut self, frame: RawFrame) {
        if self.spare.len() < SPARE {
            self.spare.push(frame);
        }
    }

    /// Takes a telegram.
    pub fn take(&mut self, telegram: Telegram, emit: &mut impl FnMut(RawFrame)) {
        self.since_doubt = match telegram.is_doubtful {
            true => 0,
            false => self.since_doubt.saturating_add(1),
        };
        let Some(byte) = telegram.data else {
            if telegram.is_good {
                self.finish(emit);
                self.is_synchronized = true;
            }
            return;
        };
        self.pass(telegram.start, emit);
        let is_check = self.check.is_some_and(|check| check.is_in(telegram.flags));
        if self.checked > 0 && !is_check {
            self.finish(emit);
        }
        let end = telegram.start.saturating_add((TELEGRAM as f64 * self.bit) as u64);
        let frame = match &mut self.current {
            Some(frame) => frame,
            None if !self.is_synchronized => return,
            current => {
                let mut frame = self.spare.pop().unwrap_or_default();
                frame.bytes.clear();
                (frame.start, frame.flags) = (telegram.start, telegram.flags);
                (frame.bad, frame.is_whole, frame.is_doubtful) = (0, false, false);
                current.insert(frame)
            }
        };
        frame.end = end;
        frame.is_doubtful |= self.since_doubt < DOUBT;
        frame.bad += u16::from(!telegram.is_good);
        frame.bytes.push(byte);
        self.checked += u16::from(is_check);
        let is_over = is_check && self.checked == self.check_length;
        if is_over || frame.bytes.len() >= MAX_BYTES {
            self.finish(emit);
        }
    }

    /// Nothing begins before this tick that was not taken.
    pub fn pass(&mut self, tick: u64, emit: &mut impl FnMut(RawFrame)) {
        let pause = (PAUSE as f64 * self.bit) as u64;
        if self.current.as_ref().is_some_and(|it| tick.saturating_sub(it.end) > pause) {
            self.finish(emit);
        }
    }

    /// The line is not heard any further, or not for a while: what is not whole is none.
    pub fn end(&mut self) {
        self.current = None;
        self.checked = 0;
        self.is_synchronized = false;
    }

    fn finish(&mut self, emit: &mut impl FnMut(RawFrame)) {
        let Some(mut frame) = self.current.take() else { return };
        let length = frame.bytes.len();
        let is_long = length >= usize::from(self.check_length) + 2;
        let has_check = self.check.is_none() || self.checked == self.check_length;
        frame.is_whole = is_long && has_check && length < MAX_BYTES + 1;
        self.checked = 0;
        emit(frame);
    }
}
