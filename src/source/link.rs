//! The interfaces of packet captures, whatever their link type.

use super::buses::Buses;
use super::can::packet;
use super::outbox::Outbox;
use super::rtac;
use dissectors::can::Direction;
use dissectors::event::{LossCause, Moment};
use pcap_file::DataLink;

/// A packet as its container has it.
#[derive(Clone, Copy, Debug)]
pub struct Packet<'a> {
    /// The container's stamp.
    pub at: Moment,
    /// What is in the capture.
    pub bytes: &'a [u8],
    /// Bytes the packet had before it was cut.
    pub original_length: u32,
    /// What the container counts as lost before it.
    pub lost_before: Option<u64>,
    /// Why, where the container tells; else the capture has a gap.
    pub loss_cause: LossCause,
    /// Who sent it, if the container tells.
    pub direction: Option<Direction>,
}

/// One interface that is heard.
pub enum Tap {
    /// Characters of a serial line.
    Serial(rtac::Tap),
    /// CAN frames.
    Can(packet::Tap),
}

impl Tap {
    /// The bus that a packet is of, if it is one to be heard.
    ///
    /// # Errors
    /// There are too many buses.
    pub fn bus_of(
        &mut self,
        packet: &Packet<'_>,
        buses: &mut Buses,
        out: &mut Outbox,
    ) -> Result<Option<usize>, &'static str> {
        match self {
            Tap::Serial(tap) => Ok(Some(tap.bus())),
            Tap::Can(tap) => tap.bus_of(packet, buses, out),
        }
    }

    /// Puts what a packet of a bus says in the outbox. Returns what is wrong with it, if something
    /// is.
    pub fn hear(&self, bus: usize, packet: &Packet<'_>, out: &mut Outbox) -> Option<String> {
        match self {
            Tap::Serial(tap) => tap.hear(packet, out),
            Tap::Can(tap) => tap.hear(bus, packet, out),
        }
    }

    /// The capture of its buses ended.
    pub fn end(&self, at: Moment, out: &mut Outbox) {
        self.buses().for_each(|bus| out.end(bus, at));
    }

    /// The buses heard on it.
    pub fn buses(&self) -> impl Iterator<Item = usize> {
        let (serial, can) = match self {
            Tap::Serial(tap) => (Some(tap.bus()), None),
            Tap::Can(tap) => (None, Some(tap.buses())),
        };
        serial.into_iter().chain(can.into_iter().flatten())
    }

    /// What is to be said of packets that were left out, if there were any.
    pub fn oddity(&self) -> Option<String> {
        let Tap::Can(tap) = self else { return None };
        match tap.foreign() {
            0 => None,
            1 => Some("1 frame that is neither CAN nor CAN FD was left out".to_owned()),
            more => Some(format!("{more} frames that are neither CAN nor CAN FD were left out")),
        }
    }
}

/// A link type as messages name it.
pub fn name(link_type: u16) -> String {
    format!("{link_type} ({:?})", DataLink::from(u32::from(link_type)))
}

/// What to do about packets that are neither characters nor CAN frames.
pub fn wrong(link_type: u16) -> String {
    format!(
        "the packets have link type {}: characters of a serial line have {}, frames of a CAN bus \
         {}, or 113 or 276 with a protocol of CAN",
        name(link_type),
        name(rtac::LINK_TYPE),
        name(packet::LINK_TYPE)
    )
}
