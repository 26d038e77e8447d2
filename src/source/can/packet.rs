//! Packets of CAN frames, as Linux hands them out (tcpdump.org/linktypes).
//!
//! Link type 227, `LINKTYPE_CAN_SOCKETCAN`: u32 identifier with flags, big-endian; u8 length, u8
//! flags of CAN FD, u8 reserved, u8 DLC above eight; data, padded to 8 bytes by the kernel. The
//! cooked link types 113 and 276 have a header before the same, and the identifier in the byte
//! order of the host that captured, which is that of the file.

use super::super::buses::Buses;
use super::super::link::Packet;
use super::super::outbox::Outbox;
use dissectors::bus::WireFacts;
use dissectors::can::{Direction, FdFlags, Frame, FrameKind, Identifier, MAX_CLASSIC_DATA};
use dissectors::event::{Loss, LossCause, Moment};
use dissectors::protocol::Medium;
use dissectors::record::BusInfo;
use dissectors::uart::Baud;
use nom::IResult;
use nom::error::{Error, ErrorKind};
use pcap_file::Endianness;

/// Link types that carry CAN frames.
pub const LINK_TYPE: u16 = 227;
const COOKED: u16 = 113;
const COOKED_2: u16 = 276;

/// Protocols of cooked packets (`linux/if_ether.h`).
const ETH_P_CAN: u16 = 0x000C;
const ETH_P_CANFD: u16 = 0x000D;
const ETH_P_CANXL: u16 = 0x000E;

/// The packet type of what the capturing host sent itself (`linux/if_packet.h`).
const PACKET_OUTGOING: u16 = 4;

// Flags of an identifier (`linux/can.h`).
const EXTENDED: u32 = 0x8000_0000;
const REMOTE: u32 = 0x4000_0000;
const ERROR: u32 = 0x2000_0000;

/// What a controller uses of an identifier without EXTENDED.
const STANDARD_BITS: u32 = 0x7FF;
const EXTENDED_BITS: u32 = 0x1FFF_FFFF;

/// The flag of CAN FD frames, and all flags that there are.
const FD: u8 = 0x04;
const FD_FLAGS: u8 = 0x07;

/// The mark of a CAN XL frame, where a classic one has its length.
const XL: u8 = 0x80;

/// Bytes before the data, and those of a whole frame, classic or of CAN FD.
const HEADER: usize = 8;
#[cfg(target_os = "linux")]
const WHOLE_CLASSIC: usize = 16;
const WHOLE_FD: usize = 72;

/// Most data bytes.
const MAX_DATA: usize = 64;

/// How frames stand in the packets of an interface.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Form {
    Plain,
    Cooked,
    Cooked2,
}

/// One CAN interface of a packet capture.
pub struct Tap {
    form: Form,
    order: Endianness,
    info: BusInfo,
    facts: WireFacts,
    uncertainty: u32,
    /// The buses of a cooked capture of several interfaces by their index; else just one.
    buses: Vec<(u32, Option<usize>)>,
    /// Packets that are no frames.
    foreign: u64,
}

/// What a packet says before its frame.
struct Cooking {
    protocol: Option<u16>,
    interface: u32,
    direction: Option<Direction>,
}

impl Tap {
    /// The interface of that link type; `None` for one that carries no CAN frames. Its stamps are
    /// worth `uncertainty` ns, and it is in a file of this byte order.
    pub fn of(
        link_type: u16,
        order: Endianness,
        info: BusInfo,
        facts: WireFacts,
        uncertainty: u32,
    ) -> Option<Tap> {
        let form = match link_type {
            LINK_TYPE => Form::Plain,
            COOKED => Form::Cooked,
            COOKED_2 => Form::Cooked2,
            _ => return None,
        };
        Some(Tap { form, order, info, facts, uncertainty, buses: Vec::new(), foreign: 0 })
    }

    /// Lets the bus appear before its first frame, where there is but one.
    ///
    /// # Errors
    /// There are too many buses.
    pub fn announce(&mut self, buses: &mut Buses, out: &mut Outbox) -> Result<(), &'static str> {
        if self.form != Form::Cooked2 {
            self.bus(0, buses, out)?;
        }
        Ok(())
    }

    /// The buses that were heard on it.
    pub fn buses(&self) -> impl Iterator<Item = usize> {
        self.buses.iter().filter_map(|(_, number)| *number)
    }

    /// The bit rate of its frames, if it tells.
    pub fn bitrate(&self) -> Option<Baud> {
        self.facts.baud
    }

    /// Frames that were left out because they are neither classic nor CAN FD.
    pub fn foreign(&self) -> u64 {
        self.foreign
    }

    /// The bus that a packet is of; `None` where it carries no frame that is known, or the user did
    /// not ask for the bus.
    ///
    /// # Errors
    /// There are too many buses.
    pub fn bus_of(
        &mut self,
        packet: &Packet<'_>,
        buses: &mut Buses,
        out: &mut Outbox,
    ) -> Result<Option<usize>, &'static str> {
        let Ok((bytes, cooking)) = cooking(packet.bytes, self.form) else { return Ok(None) };
        let is_xl = bytes.get(4).is_some_and(|length| length & XL != 0);
        match cooking.protocol {
            None | Some(ETH_P_CAN | ETH_P_CANFD) if !is_xl => {
                self.bus(cooking.interface, buses, out)
            }
            None | Some(ETH_P_CAN..=ETH_P_CANXL) => {
                self.foreign += 1;
                Ok(None)
            }
            // What the host speaks on its other interfaces.
            Some(_) => Ok(None),
        }
    }

    /// Puts what a packet of a bus says in the outbox. Returns what is wrong with it, if something
    /// is.
    pub fn hear(&self, bus: usize, packet: &Packet<'_>, out: &mut Outbox) -> Option<String> {
        let lose = |count, cause, out: &mut Outbox| {
            out.lost(bus, Loss { start: packet.at, count, cause });
        };
        match packet.lost_before {
            None | Some(0) => {}
            // More than there can be: lost, and not counted.
            Some(u64::MAX) => lose(None, packet.loss_cause, out),
            count => lose(count, packet.loss_cause, out),
        }
        if packet.bytes.is_empty() && packet.lost_before.is_some_and(|count| count > 0) {
            // Nothing but the loss: no frame followed it.
            return None;
        }
        let (bytes, cooking) = cooking(packet.bytes, self.form).ok()?;
        let Ok((data, header)) = header(bytes, self.id_order()) else {
            lose(Some(1), LossCause::Capture, out);
            let length = packet.bytes.len();
            let is_cut = packet.original_length as usize > length;
            let what = || format!("a packet of {length} bytes, too short for a CAN frame");
            return (!is_cut).then(what);
        };
        let mut frame = header.frame(data, cooking.protocol, packet.at, self.uncertainty);
        frame.direction = packet.direction.or(cooking.direction);
        out.frame(bus, frame);
        None
    }

    fn id_order(&self) -> Endianness {
        match self.form {
            Form::Plain => Endianness::Big,
            Form::Cooked | Form::Cooked2 => self.order,
        }
    }

    fn bus(
        &mut self,
        interface: u32,
        buses: &mut Buses,
        out: &mut Outbox,
    ) -> Result<Option<usize>, &'static str> {
        if let Some((_, number)) = self.buses.iter().find(|(index, _)| *index == interface) {
            return Ok(*number);
        }
        let mut info = self.info.clone();
        if self.form == Form::Cooked2 {
            info.name = format!("{}:{interface}", info.name);
        }
        let number = buses.number(info, Medium::Can, self.facts, out)?;
        self.buses.push((interface, number));
        Ok(number)
    }
}

/// The header of a cooked packet, if it has one.
fn cooking(packet: &[u8], form: Form) -> IResult<&[u8], Cooking> {
    let side = |kind| match kind {
        PACKET_OUTGOING => Some(Direction::Sent),
        _ => Some(Direction::Received),
    };
    match form {
        Form::Plain => Ok((packet, Cooking { protocol: None, interface: 0, direction: None })),
        // u16 packet type, u16 kind of interface, u16 length of an address, its 8 bytes, u16
        // protocol, all big-endian.
        Form::Cooked => match packet.split_first_chunk::<16>() {
            Some(([a, b, .., c, d], frame)) => {
                let (kind, protocol) = (u16::from_be_bytes([*a, *b]), u16::from_be_bytes([*c, *d]));
                let protocol = Some(protocol);
                Ok((frame, Cooking { protocol, interface: 0, direction: side(kind) }))
            }
            None => Err(short(packet)),
        },
        // u16 protocol, u16 reserved, u32 interface, u16 kind of interface, u8 packet type, u8
        // length of an address, its 8 bytes.
        Form::Cooked2 => match packet.split_first_chunk::<20>() {
            Some(([a, b, _, _, i, j, k, l, _, _, kind, ..], frame)) => {
                let protocol = Some(u16::from_be_bytes([*a, *b]));
                let interface = u32::from_be_bytes([*i, *j, *k, *l]);
                let direction = side(u16::from(*kind));
                Ok((frame, Cooking { protocol, interface, direction }))
            }
            None => Err(short(packet)),
        },
    }
}

/// A frame as a socket of this host hands it out (`linux/can.h`): its size tells whether it is one
/// of CAN FD, and its identifier is in this host's byte order. `None` for what is neither.
#[cfg(target_os = "linux")]
pub fn of_socket(bytes: &[u8], at: Moment, uncertainty: u32) -> Option<Frame> {
    let protocol = match bytes.len() {
        WHOLE_CLASSIC => ETH_P_CAN,
        WHOLE_FD => ETH_P_CANFD,
        _ => return None,
    };
    let order = if cfg!(target_endian = "big") { Endianness::Big } else { Endianness::Little };
    let (data, mut header) = header(bytes, order).ok()?;
    if protocol == ETH_P_CAN {
        // Mere padding.
        header.flags = 0;
    }
    Some(header.frame(data, Some(protocol), at, uncertainty))
}

/// What stands before the data of a frame.
struct Header {
    id: u32,
    length: u8,
    flags: u8,
    reserved: [u8; 2],
}

fn header(packet: &[u8], order: Endianness) -> IResult<&[u8], Header> {
    match packet.split_first_chunk::<HEADER>() {
        Some((&[a, b, c, d, length, flags, e, f], data)) => {
            let id = match order {
                Endianness::Big => u32::from_be_bytes([a, b, c, d]),
                Endianness::Little => u32::from_le_bytes([a, b, c, d]),
            };
            Ok((data, Header { id, length, flags, reserved: [e, f] }))
        }
        None => Err(short(packet)),
    }
}

fn short(packet: &[u8]) -> nom::Err<Error<&[u8]>> {
    nom::Err::Error(Error::new(packet, ErrorKind::Eof))
}

impl Header {
    /// The frame with what there is of its data.
    fn frame(&self, data: &[u8], protocol: Option<u16>, at: Moment, uncertainty: u32) -> Frame {
        let (id, length) = (self.id, usize::from(self.length));
        let kind = match id {
            id if id & ERROR != 0 => FrameKind::Error,
            id if id & REMOTE != 0 => FrameKind::Remote,
            _ if self.is_fd(protocol, data.len()) => FrameKind::Fd,
            _ => FrameKind::Data,
        };
        let identifier = if id & (EXTENDED | ERROR) != 0 {
            Identifier::Extended(id & EXTENDED_BITS)
        } else {
            Identifier::Standard((id & STANDARD_BITS) as u16)
        };
        let is_raw = kind != FrameKind::Fd && length == MAX_CLASSIC_DATA && self.flags == 0;
        let dlc = match self.reserved {
            [0, raw @ 9..=15] if is_raw => raw,
            _ => self.length,
        };
        let frame = Frame::new(at, uncertainty, kind, identifier, dlc);
        if kind == FrameKind::Remote {
            return frame;
        }
        let there = data.len().min(length).min(MAX_DATA);
        let mut frame = frame.with(&data[..there]);
        frame.original_length = (there < length).then_some(u32::from(self.length));
        if kind == FrameKind::Fd {
            frame.fd_flags = FdFlags::from_bits(self.flags);
        }
        frame
    }

    /// Captures have garbage where the flags of CAN FD are, and old ones of CAN FD have no flags.
    fn is_fd(&self, protocol: Option<u16>, there: usize) -> bool {
        let is_flagged = self.flags & FD != 0 && self.flags & !FD_FLAGS == 0;
        protocol == Some(ETH_P_CANFD)
            || usize::from(self.length) > MAX_CLASSIC_DATA
            || HEADER + there == WHOLE_FD
            || is_flagged && self.reserved == [0, 0]
    }
}
