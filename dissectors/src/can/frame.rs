//! One CAN frame as a tap heard it.

use super::length;
use crate::event::Moment;

/// Most data bytes of a frame: those of CAN FD.
const MAX_DATA: usize = 64;

/// Most data bytes of a classic frame.
pub const MAX_CLASSIC_DATA: usize = 8;

/// A CAN identifier, which is also the priority: low wins.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Identifier {
    /// 11 bits.
    Standard(u16),
    /// 29 bits.
    Extended(u32),
}

impl Identifier {
    /// An 11-bit identifier; `None` where the value has more bits.
    #[must_use]
    pub const fn standard(value: u32) -> Option<Self> {
        if value <= 0x7FF { Some(Identifier::Standard(value as u16)) } else { None }
    }

    /// A 29-bit identifier; `None` where the value has more bits.
    #[must_use]
    pub const fn extended(value: u32) -> Option<Self> {
        if value <= 0x1FFF_FFFF { Some(Identifier::Extended(value)) } else { None }
    }

    /// Its value.
    #[must_use]
    pub const fn value(self) -> u32 {
        match self {
            Identifier::Standard(id) => id as u32,
            Identifier::Extended(id) => id,
        }
    }

    /// Whether it has 29 bits.
    #[must_use]
    pub const fn is_extended(self) -> bool {
        matches!(self, Identifier::Extended(_))
    }
}

/// What kind of frame it is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum FrameKind {
    /// A classic data frame.
    Data,
    /// A remote frame: no data, whatever its DLC says.
    Remote,
    /// What a controller reports instead of a frame. The identifier holds the error classes of
    /// SocketCAN (`linux/can/error.h`), the eight data bytes say more.
    Error,
    /// A CAN FD frame.
    Fd,
}

/// What a CAN FD frame says of itself besides its data.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct FdFlags {
    /// Its data was sent at a higher rate (BRS).
    pub has_rate_switch: bool,
    /// Its sender was error passive (ESI).
    pub is_error_passive: bool,
}

impl FdFlags {
    /// As SocketCAN and its logs have them: 1 is BRS, 2 is ESI (`linux/can.h`).
    #[must_use]
    pub const fn from_bits(bits: u8) -> Self {
        FdFlags { has_rate_switch: bits & 1 != 0, is_error_passive: bits & 2 != 0 }
    }

    /// The same bits.
    #[must_use]
    pub const fn bits(self) -> u8 {
        self.has_rate_switch as u8 | (self.is_error_passive as u8) << 1
    }
}

/// Whether the tap's own host sent a frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Direction {
    /// It came from the bus.
    Received,
    /// The host that captured sent it.
    Sent,
}

impl Direction {
    /// The name that records carry.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Direction::Received => "rx",
            Direction::Sent => "tx",
        }
    }
}

/// A frame, or a controller's report of an error.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Frame {
    /// The source's stamp.
    pub start: Moment,
    /// ± of the stamp against others of the same source, in ns.
    pub uncertainty: u32,
    /// What kind.
    pub kind: FrameKind,
    /// The identifier; the error classes of an error frame.
    pub id: Identifier,
    /// The data length code as sent: 0 to 15, or the length of a CAN FD frame.
    pub dlc: u8,
    /// What a CAN FD frame says of itself; nothing for any other frame.
    pub fd_flags: FdFlags,
    /// Who sent it, if the source tells.
    pub direction: Option<Direction>,
    /// Whether its checksum fits, if the source has the bits.
    pub crc: Option<bool>,
    /// Whether somebody acknowledged it, if the source has the bits.
    pub is_acknowledged: Option<bool>,
    /// The bits it took on the wire, where the source saw them: SOF to the end of the intermission.
    pub measured_bits: Option<u16>,
    /// How many data bytes it had, where the capture has fewer.
    pub original_length: Option<u32>,
    length: u8,
    data: [u8; MAX_DATA],
}

impl Frame {
    /// A data frame with these bytes: eight at most, more are left out.
    #[must_use]
    pub fn data(start: Moment, uncertainty: u32, id: Identifier, data: &[u8]) -> Self {
        let data = &data[..data.len().min(MAX_CLASSIC_DATA)];
        Frame::new(start, uncertainty, FrameKind::Data, id, data.len() as u8).with(data)
    }

    /// A frame without data.
    #[must_use]
    pub const fn new(
        start: Moment,
        uncertainty: u32,
        kind: FrameKind,
        id: Identifier,
        dlc: u8,
    ) -> Self {
        Frame {
            start,
            uncertainty,
            kind,
            id,
            dlc,
            fd_flags: FdFlags::from_bits(0),
            direction: None,
            crc: None,
            is_acknowledged: None,
            measured_bits: None,
            original_length: None,
            length: 0,
            data: [0; MAX_DATA],
        }
    }

    /// The same with these data bytes: 64 at most, more are left out.
    #[must_use]
    pub fn with(mut self, data: &[u8]) -> Self {
        let length = data.len().min(MAX_DATA);
        self.data[..length].copy_from_slice(&data[..length]);
        self.length = length as u8;
        self
    }

    /// The data bytes that the capture has.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.data[..usize::from(self.length)]
    }

    /// Whether the capture has fewer data bytes than the frame had, or fewer than its length says.
    #[must_use]
    pub fn is_cut(&self) -> bool {
        let due = match self.kind {
            FrameKind::Data => usize::from(self.dlc).min(MAX_CLASSIC_DATA),
            FrameKind::Remote | FrameKind::Error | FrameKind::Fd => 0,
        };
        self.original_length.is_some() || usize::from(self.length) < due
    }

    /// Bits on the wire, stuff bits and the three of the intermission included: as seen, else
    /// computed. `None` for what is no whole classic frame.
    #[must_use]
    pub fn bits(&self) -> Option<u16> {
        match self.kind {
            _ if self.measured_bits.is_some() => self.measured_bits,
            FrameKind::Data | FrameKind::Remote if !self.is_cut() => Some(length::of(self)),
            _ => None,
        }
    }
}
