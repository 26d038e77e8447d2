//! The stuffed part of a frame: from the start of frame to the checksum.

use crate::bus::Sampling;
use crate::can::frame::{Frame, FrameKind, Identifier, MAX_CLASSIC_DATA};
use crate::can::length::checksum_of;

/// A bit of the other level is stuffed in behind so many equal ones.
const LONGEST_RUN: u8 = 5;

/// Bits of the checksum.
const CHECKSUM: u8 = 15;

/// Bits up to and with the length code, of a frame with an 11-bit and a 29-bit identifier.
const HEAD: u8 = 19;
const EXTENDED_HEAD: u8 = 39;

/// What is decided by the bits that are awaited.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Awaited {
    /// How long the identifier is, and of a short one whether this is CAN FD: 15 bits.
    Format,
    /// Of a long identifier, whether this is CAN FD: 34 bits.
    ExtendedFormat,
    /// The length.
    Length,
    /// Nothing but the checksum.
    Checksum,
}

/// What came of the bits that were taken.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Taken {
    /// All of them, and there is more to come.
    All,
    /// It is over; so many bits are left.
    Over(u32),
    /// Six equal bits: the last of them is the first of so many that are left.
    Violated(u32),
    /// It is a CAN FD frame; so many bits are left.
    Fd(u32),
}

/// The bits so far, without the stuff bits.
#[derive(Clone, Debug)]
pub(super) struct Body {
    bits: u128,
    count: u8,
    stuffed: u8,
    /// The last bits were so many equal ones.
    run: u8,
    is_recessive: bool,
    awaited: Awaited,
    /// How many bits decide that.
    due: u8,
}

impl Body {
    /// Before the start of frame.
    pub const fn new() -> Self {
        Body {
            bits: 0,
            count: 0,
            stuffed: 0,
            run: 0,
            is_recessive: false,
            awaited: Awaited::Format,
            due: 15,
        }
    }

    /// Whether nothing was taken yet.
    pub const fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Bits on the wire so far.
    pub const fn length(&self) -> u16 {
        self.count as u16 + self.stuffed as u16
    }

    /// Takes what almost all bits are part of: a run after one of the other level, not too long,
    /// that decides nothing. Returns false if they are none, and then has taken nothing.
    #[inline(always)]
    pub fn take_run(&mut self, is_recessive: bool, length: u32) -> bool {
        let stuffed = u8::from(self.run == LONGEST_RUN);
        let is_run = is_recessive != self.is_recessive && length <= u32::from(LONGEST_RUN);
        // Five at most, as the shift is to know.
        let taken = (length as u8).wrapping_sub(stuffed) & 7;
        let count = self.count.wrapping_add(taken);
        if !is_run || length == 0 || self.is_empty() || count >= self.due {
            return false;
        }
        let ones = if is_recessive { (1 << taken) - 1 } else { 0 };
        self.bits = self.bits << taken | ones;
        (self.is_recessive, self.run) = (is_recessive, length as u8);
        self.count = count;
        self.stuffed += stuffed;
        true
    }

    /// Takes so many bits of one level.
    pub fn take(&mut self, is_recessive: bool, mut left: u32) -> Taken {
        while left > 0 {
            let is_same = is_recessive == self.is_recessive;
            if self.run == LONGEST_RUN {
                if is_same {
                    return Taken::Violated(left);
                }
                (self.is_recessive, self.run) = (is_recessive, 1);
                self.stuffed += 1;
                left -= 1;
            } else if self.count < self.due {
                if !is_same {
                    (self.is_recessive, self.run) = (is_recessive, 0);
                }
                let room = (LONGEST_RUN - self.run).min(self.due - self.count);
                let taken = left.min(u32::from(room)) as u8;
                let ones = if is_recessive { (1 << taken) - 1 } else { 0 };
                self.bits = self.bits << taken | ones;
                self.count += taken;
                self.run += taken;
                left -= u32::from(taken);
                if self.count == self.due && self.is_fd() {
                    return Taken::Fd(left);
                }
            } else {
                return Taken::Over(left);
            }
        }
        Taken::All
    }

    /// What the awaited bits decide: how many more there are, or that this is CAN FD. There, what
    /// is reserved and dominant in a classic frame is recessive (ISO 11898-1:2015).
    fn is_fd(&mut self) -> bool {
        let is_recessive = |bit: u8| self.bits >> bit & 1 == 1;
        (self.awaited, self.due) = match self.awaited {
            Awaited::Format if is_recessive(1) => (Awaited::ExtendedFormat, 34),
            Awaited::Format | Awaited::ExtendedFormat if is_recessive(0) => return true,
            Awaited::Format => (Awaited::Length, HEAD),
            Awaited::ExtendedFormat => (Awaited::Length, EXTENDED_HEAD),
            Awaited::Length => {
                let data = 8 * self.data_bytes() as u8;
                (Awaited::Checksum, self.count + data + CHECKSUM)
            }
            Awaited::Checksum => (Awaited::Checksum, self.due),
        };
        false
    }

    const fn is_extended(&self) -> bool {
        !matches!(self.awaited, Awaited::Format) && self.bit(13)
    }

    /// The bit of that number, from the start of frame on, which is 0.
    const fn bit(&self, number: u8) -> bool {
        self.bits >> (self.count - 1 - number) & 1 == 1
    }

    const fn head(&self) -> u8 {
        if self.is_extended() { EXTENDED_HEAD } else { HEAD }
    }

    fn length_code(&self) -> u8 {
        (self.bits >> (self.count - self.head()) & 0xF) as u8
    }

    fn is_remote(&self) -> bool {
        self.bit(if self.is_extended() { 32 } else { 12 })
    }

    fn data_bytes(&self) -> usize {
        if self.is_remote() { 0 } else { usize::from(self.length_code()).min(MAX_CLASSIC_DATA) }
    }

    fn identifier(&self) -> Identifier {
        if self.is_extended() {
            let high = self.bits >> (self.count - 12) & 0x7FF;
            let low = self.bits >> (self.count - 32) & 0x3_FFFF;
            Identifier::Extended((high << 18 | low) as u32)
        } else {
            Identifier::Standard((self.bits >> (self.count - 12) & 0x7FF) as u16)
        }
    }

    /// The frame, if that is over; of a CAN FD frame its identifier.
    pub fn frame(&self, start: u64, sampling: &Sampling) -> Frame {
        let (moment, uncertainty) = (sampling.moment(start), sampling.uncertainty);
        let blank = |kind, dlc| Frame::new(moment, uncertainty, kind, self.identifier(), dlc);
        if self.awaited != Awaited::Checksum {
            return blank(FrameKind::Fd, 0);
        }
        let kind = if self.is_remote() { FrameKind::Remote } else { FrameKind::Data };
        let length = self.data_bytes();
        let data = (self.bits >> CHECKSUM) as u64;
        let mut frame = blank(kind, self.length_code()).with(&data.to_be_bytes()[8 - length..]);
        let sent = (self.bits & 0x7FFF) as u16;
        frame.crc = Some(checksum_of(self.bits >> CHECKSUM) == sent);
        frame
    }

    /// What the next bit belongs to, as SocketCAN numbers the places of an error.
    pub fn place(&self) -> u8 {
        let is_checksum = self.awaited == Awaited::Checksum && self.count + CHECKSUM >= self.due;
        match self.count {
            _ if is_checksum => 0x08,
            0 => 0x03,
            1..=8 => 0x02,
            9..=11 => 0x06,
            12 => 0x04,
            13 => 0x05,
            14..=18 if self.is_extended() => 0x07,
            19..=26 if self.is_extended() => 0x0F,
            27..=31 if self.is_extended() => 0x0E,
            32 if self.is_extended() => 0x0C,
            33 if self.is_extended() => 0x0D,
            34 if self.is_extended() => 0x09,
            35..=38 if self.is_extended() => 0x0B,
            14 => 0x09,
            15..=18 => 0x0B,
            _ => 0x0A,
        }
    }
}
