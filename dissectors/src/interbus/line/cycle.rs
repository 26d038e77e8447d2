//! One cycle of a ring, as the line carried it.

use super::super::row::Device;
use super::checksum::Crc;
use super::frames::RawFrame;
use super::ring::{Direction, Ring};
use crate::event::Moment;
use alloc::sync::Arc;

/// Wires of a connector: away from the master, and back.
pub const WIRES: usize = 2;

/// What goes round.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Select {
    /// ID words.
    Identification,
    /// Process data.
    Data,
}

/// What is wrong with a cycle, worst first.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Trouble {
    /// So many characters have no stop bit.
    StopBits(u16),
    /// It ends before its check phase, after so many characters.
    Cut(u16),
    /// One wire carried nothing.
    Missing,
    /// One wire carried more characters than the other.
    Uneven {
        /// Bytes that were sent.
        sent: u16,
        /// Bytes that came back.
        back: u16,
    },
    /// The loopback word came back as another.
    Loopback {
        /// What was sent.
        sent: u16,
        /// What came back.
        back: u16,
    },
    /// The control word is another than in the cycles before.
    Control {
        /// What it was.
        before: u16,
        /// What it is.
        now: u16,
    },
    /// The ring has another length, in bytes: it was reconfigured.
    Length {
        /// What it was.
        before: u16,
        /// What it is.
        now: u16,
    },
}

/// A cycle.
#[derive(Clone, Debug)]
pub struct Cycle {
    /// Its number, from 1.
    pub number: u64,
    /// Its first start edge.
    pub start: Moment,
    /// ± of `start` in ns.
    pub uncertainty: u32,
    /// From there to the end of its last character, in ns.
    pub duration: u64,
    /// From the start of the cycle before to its start, in ns.
    pub cycle_time: Option<u64>,
    /// What goes round.
    pub select: Select,
    /// What the wires carried: DO and DI, or the only one.
    pub wires: [Option<Frame>; WIRES],
    /// The ring, where it is known and this cycle fits it.
    pub ring: Option<Arc<Ring>>,
    /// What is wrong with it.
    pub trouble: Option<Trouble>,
}

/// What one wire carried in a cycle.
#[derive(Clone, Default, Debug)]
pub struct Frame {
    pub(super) raw: RawFrame,
    /// Bytes of checksum and control word.
    pub(super) tail: usize,
    /// Where the loopback word stands, in bytes.
    pub(super) loopback: Option<usize>,
    /// What is known of the checksum.
    pub crc: Crc,
}

impl Frame {
    /// Whether it is whole, and sure to have been read as it was sent.
    pub(super) fn is_sound(&self) -> bool {
        self.raw.is_whole && self.raw.bad == 0 && !self.raw.is_doubtful
    }

    /// Everything, in the order it was sent.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.raw.bytes
    }

    /// Loopback word and registers. Nothing where the frame is cut.
    #[must_use]
    pub fn registers(&self) -> &[u8] {
        let length = self.raw.bytes.len().saturating_sub(self.tail);
        if self.raw.is_whole { &self.raw.bytes[..length] } else { &[] }
    }

    /// The checksum as it was on the wire, high byte first.
    #[must_use]
    pub fn checksum(&self) -> Option<u16> {
        let [high, low] = *self.raw.bytes.get(self.registers().len()..)?.first_chunk()?;
        self.raw.is_whole.then_some(u16::from_be_bytes([high, low]))
    }

    /// The control word.
    #[must_use]
    pub fn control(&self) -> Option<u16> {
        let behind = self.raw.bytes.get(self.registers().len() + 2..)?;
        let word = behind.iter().fold(0, |word: u16, byte| word << 8 | u16::from(*byte));
        (self.raw.is_whole && !behind.is_empty()).then_some(word)
    }

    /// Where the loopback word stands, in bytes from the start, if that is known: the bytes of
    /// registers upstream of the tap.
    #[must_use]
    pub fn loopback_offset(&self) -> Option<usize> {
        self.loopback.filter(|at| at + 2 <= self.registers().len())
    }

    /// The loopback word.
    #[must_use]
    pub fn loopback(&self) -> Option<u16> {
        let word = self.registers().get(self.loopback_offset()?..)?.first_chunk()?;
        Some(u16::from_be_bytes(*word))
    }

    /// What stands before the loopback word: IN data, the device nearest upstream of the tap last.
    #[must_use]
    pub fn before(&self) -> &[u8] {
        self.loopback_offset().map_or(&[], |at| &self.registers()[..at])
    }

    /// What stands behind it: OUT data, the last device first.
    #[must_use]
    pub fn behind(&self) -> &[u8] {
        self.loopback_offset().map_or(&[], |at| &self.registers()[at + 2..])
    }
}

impl Cycle {
    /// The frames that were heard.
    pub fn frames(&self) -> impl Iterator<Item = &Frame> {
        self.wires.iter().flatten()
    }

    /// Whether stop bits, characters or its end are missing, or may be.
    #[must_use]
    pub fn is_damaged(&self) -> bool {
        self.frames().any(|frame| !frame.is_sound()) || self.uneven().is_some()
    }

    /// Bytes on each wire, from the loopback word to the control word, where they differ: all that
    /// is sent comes back, so that a character was lost, or one too many heard.
    pub(super) fn uneven(&self) -> Option<(u16, u16)> {
        let [Some(sent), Some(back)] = &self.wires else { return None };
        let [sent, back] = [sent, back].map(|frame| frame.bytes().len() as u16);
        (sent != back).then_some((sent, back))
    }

    /// The process data of a device, in a data cycle of a ring that is known.
    #[must_use]
    pub fn data(&self, device: Device, direction: Direction) -> Option<&[u8]> {
        let ring = self.ring.as_deref().filter(|_| self.select == Select::Data)?;
        self.frames().find_map(|frame| {
            let place = ring.place(device, direction, frame.loopback_offset()?)?;
            frame.registers().get(place)
        })
    }

    /// The ID word of a device, in an ID cycle.
    #[must_use]
    pub fn id(&self, device: Device) -> Option<&[u8]> {
        if self.select != Select::Identification {
            return None;
        }
        // The last device's comes first; the wire with most of them is the one that comes back.
        let back = self.frames().map(Frame::before).max_by_key(|before| before.len())?;
        let from = back.len().checked_sub(2 * usize::from(device.number()))?;
        back.get(from..from + 2)
    }

    /// How many ID words it has.
    #[must_use]
    pub fn ids(&self) -> usize {
        let is_known = self.select == Select::Identification;
        let longest = self.frames().map(|frame| frame.before().len()).max();
        longest.filter(|_| is_known).map_or(0, |bytes| bytes / 2)
    }

    /// Whether the checksums of all wires fit; `None` while that is not known.
    #[must_use]
    pub fn crc(&self) -> Crc {
        let bad = self.frames().map(|frame| frame.crc).find(|crc| matches!(crc, Crc::Bad { .. }));
        let is_good = self.frames().all(|frame| frame.crc == Crc::Ok);
        match bad {
            Some(bad) => bad,
            None if is_good && self.frames().next().is_some() => Crc::Ok,
            None => Crc::Unverified,
        }
    }
}
