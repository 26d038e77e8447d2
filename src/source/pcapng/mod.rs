//! pcapng: packets of several interfaces in one or more sections (draft-ietf-opsawg-pcapng).
//!
//! Each interface with serial characters (link type 250) or CAN frames (227, 113, 276) is a bus.
//! Interfaces of the same name in a later section go on with the bus of the first, as the files of
//! a ring do.

mod blocks;
mod fields;
mod interface;
mod packet;
#[cfg(test)]
mod tests;

use super::buses::Buses;
use super::can::packet as can;
use super::link::{self, Packet, Tap};
use super::outbox::{Outbox, Reader};
use super::pcap::LONGEST_PACKET;
use super::rtac;
use super::tap_note;
use super::{Input, Place, SourceError, SourceOptions};
use blocks::{Block, Blocks};
use dissectors::bus::WireFacts;
use dissectors::event::Moment;
use dissectors::protocol::Medium;
use dissectors::record::BusInfo;
use fields::{Order, Stamps};
use interface::{Description, description};
use packet::{PacketFields, Statistics, enhanced, obsolete, statistics};
use pcap_file::pcapng::blocks::{
    ENHANCED_PACKET_BLOCK, INTERFACE_DESCRIPTION_BLOCK, INTERFACE_STATISTIC_BLOCK, PACKET_BLOCK,
    SECTION_HEADER_BLOCK, SIMPLE_PACKET_BLOCK,
};

/// Most interfaces that are believed in a section.
const MOST_INTERFACES: usize = 1024;

/// How comments begin that were made from what was decoded, and will be made anew.
const OWN_COMMENTS: [&[u8]; 5] =
    [b"fieldtap: ", b"[error ", b"[warning ", b"[info ", tap_note::LOSS.as_bytes()];

/// Whether a source begins like a pcapng file.
pub fn is_pcapng(head: &[u8]) -> bool {
    head.starts_with(b"\x0A\x0D\x0D\x0A")
        && matches!(head.get(8..12), Some(b"\x1A\x2B\x3C\x4D" | b"\x4D\x3C\x2B\x1A"))
}

/// A pcapng source.
pub struct PcapNg {
    blocks: Blocks,
    listener: Listener,
}

impl PcapNg {
    /// Reads blocks from this input.
    pub fn new(input: Input, options: &SourceOptions) -> Self {
        let listener = Listener {
            interfaces: Vec::new(),
            buses: Buses::new(options),
            is_of_use: false,
            foreign: None,
            told_oddity: false,
            told_simple: false,
        };
        PcapNg { blocks: Blocks::new(input), listener }
    }
}

impl Reader for PcapNg {
    fn read_on(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
        loop {
            let Some(length) = self.blocks.find()? else {
                self.listener.finish(self.blocks.name(), out)?;
                return Ok(false);
            };
            let block = self.blocks.found(length)?;
            self.listener.hear(&block, &self.blocks, out)?;
            self.blocks.take(length);
            if out.is_full() || !self.blocks.is_next_held() {
                return Ok(true);
            }
        }
    }
}

/// What is known of the interfaces so far.
struct Listener {
    /// The interfaces of this section.
    interfaces: Vec<Interface>,
    /// The buses of the file.
    buses: Buses,
    /// There is an interface with characters or CAN frames.
    is_of_use: bool,
    /// A link type of other interfaces, where there are such.
    foreign: Option<u16>,
    told_oddity: bool,
    told_simple: bool,
}

struct Interface {
    stamps: Stamps,
    role: Role,
}

enum Role {
    /// It is heard.
    Heard(Tap),
    /// The user did not ask for it.
    NotAskedFor,
    /// Its packets are neither characters nor CAN frames.
    Foreign { link_type: u16, is_told: bool },
}

impl Listener {
    fn hear(
        &mut self,
        block: &Block<'_>,
        blocks: &Blocks,
        out: &mut Outbox,
    ) -> Result<(), SourceError> {
        let short = || blocks.error("is shorter than its fields: the file is damaged");
        let Block { kind, order, body } = *block;
        match kind {
            ENHANCED_PACKET_BLOCK => {
                let (_, packet) = enhanced(body, order).map_err(|_| short())?;
                self.packet(packet, blocks, out)
            }
            PACKET_BLOCK => {
                let (_, packet) = obsolete(body, order).map_err(|_| short())?;
                self.packet(packet, blocks, out)
            }
            INTERFACE_DESCRIPTION_BLOCK => {
                let (_, description) = description(body, order).map_err(|_| short())?;
                self.interface(description, order, blocks, out)
            }
            INTERFACE_STATISTIC_BLOCK => {
                let (_, statistics) = statistics(body, order).map_err(|_| short())?;
                self.statistics(statistics, blocks, out)
            }
            SECTION_HEADER_BLOCK => {
                self.tell_oddities(blocks.name(), out);
                self.interfaces.clear();
                Ok(())
            }
            SIMPLE_PACKET_BLOCK => {
                if !std::mem::replace(&mut self.told_simple, true) {
                    out.warning(blocks.error("packets without a time are left out"));
                }
                Ok(())
            }
            // Name resolution, secrets, and whatever others put into their files.
            _ => Ok(()),
        }
    }

    fn interface(
        &mut self,
        told: Description,
        order: Order,
        blocks: &Blocks,
        out: &mut Outbox,
    ) -> Result<(), SourceError> {
        let number = self.interfaces.len();
        if number >= MOST_INTERFACES {
            return Err(blocks.error("more interfaces than anybody has: the file is damaged"));
        }
        let (link_type, stamps) = (told.link_type, told.stamps);
        let role = match self.tap(told, number, order, out) {
            Some(tap) => {
                self.is_of_use = true;
                tap.map_err(|what| blocks.error(what))?.map_or(Role::NotAskedFor, Role::Heard)
            }
            None => {
                self.foreign = self.foreign.or(Some(link_type));
                Role::Foreign { link_type, is_told: false }
            }
        };
        self.interfaces.push(Interface { stamps, role });
        Ok(())
    }

    /// The tap of an interface: `None` for a link type that is not known, and none where the user
    /// did not ask for it.
    fn tap(
        &mut self,
        told: Description,
        number: usize,
        order: Order,
        out: &mut Outbox,
    ) -> Option<Result<Option<Tap>, &'static str>> {
        let Description { link_type, name, baud, stamps, note } = told;
        let note = note.unwrap_or_default();
        let name = name.unwrap_or_else(|| format!("if{number}"));
        let info = BusInfo::new(name, Some(note.clock)).with_parity(note.parity);
        if link_type == rtac::LINK_TYPE {
            if note.format.is_some_and(|format| format.data_bits() > 8) {
                return Some(Err("characters of nine data bits do not fit into bytes"));
            }
            let tap = rtac::Tap::new(&note, stamps.resolution(), baud, self.buses.options());
            let number = self.buses.number(info, Medium::Serial, tap.facts(), out);
            return Some(number.map(|bus| Some(Tap::Serial(tap.on(bus?)))));
        }
        let facts = WireFacts { baud, ..WireFacts::default() };
        let uncertainty = stamps.resolution().max(note.uncertainty);
        let mut tap = can::Tap::of(link_type, order.0, info, facts, uncertainty)?;
        let announced = tap.announce(&mut self.buses, out);
        Some(announced.map(|()| Some(Tap::Can(tap))))
    }

    fn packet(
        &mut self,
        fields: PacketFields<'_>,
        blocks: &Blocks,
        out: &mut Outbox,
    ) -> Result<(), SourceError> {
        let interface = interface_of(&mut self.interfaces, fields.interface, blocks)?;
        let tap = match &mut interface.role {
            Role::Heard(tap) => tap,
            Role::NotAskedFor => return Ok(()),
            Role::Foreign { link_type, .. } if !self.is_of_use => {
                return Err(blocks.error(link::wrong(*link_type)));
            }
            Role::Foreign { link_type, is_told } => {
                if !std::mem::replace(is_told, true) {
                    out.warning(blocks.error(format!(
                        "interface {} has link type {}: its packets are left out",
                        fields.interface,
                        link::name(*link_type)
                    )));
                }
                return Ok(());
            }
        };
        let Some(at) = interface.stamps.moment(fields.ticks) else {
            return Err(blocks.error("its stamp lies after the year 2262: if_tsresol is not right"));
        };
        if fields.bytes.len() > LONGEST_PACKET as usize {
            let length = fields.bytes.len();
            let what = format!("a packet of {length} bytes, longer than any: the file is damaged");
            return Err(blocks.error(what));
        }
        let packet = Packet {
            at,
            bytes: fields.bytes,
            original_length: fields.original_length,
            lost_before: fields.dropped,
            loss_cause: fields.loss_cause,
            direction: fields.direction,
        };
        let bus = tap.bus_of(&packet, &mut self.buses, out).map_err(|what| blocks.error(what))?;
        let Some(bus) = bus else { return Ok(()) };
        if let Tap::Can(tap) = tap {
            self.buses.hear_at(bus, tap.bitrate(), out);
        }
        comments(bus, at, fields.comments(), out);
        if let (Some(oddity), false) = (tap.hear(bus, &packet, out), self.told_oddity) {
            self.told_oddity = true;
            out.warning(blocks.error(oddity));
        }
        Ok(())
    }

    fn statistics(
        &mut self,
        fields: Statistics<'_>,
        blocks: &Blocks,
        out: &mut Outbox,
    ) -> Result<(), SourceError> {
        let interface = interface_of(&mut self.interfaces, fields.interface, blocks)?;
        let Role::Heard(tap) = &interface.role else { return Ok(()) };
        let end = fields.end.and_then(|ticks| interface.stamps.moment(ticks));
        if fields.dropped > 0 {
            out.warning(blocks.error(format!(
                "{} packets of interface {} were lost in the capture, nobody knows where",
                fields.dropped, fields.interface
            )));
        }
        if let Some(bus) = tap.buses().next() {
            comments(bus, end.unwrap_or(Moment::UNKNOWN), fields.comments(), out);
        }
        if let Some(end) = end {
            tap.end(end, out);
        }
        Ok(())
    }

    fn finish(&self, name: &str, out: &mut Outbox) -> Result<(), SourceError> {
        self.tell_oddities(name, out);
        match self.foreign {
            Some(link_type) if !self.is_of_use => {
                Err(SourceError::new(name, Place::Whole, link::wrong(link_type)))
            }
            _ => self.buses.check(name),
        }
    }

    /// Tells what was left out of the interfaces of a section.
    fn tell_oddities(&self, name: &str, out: &mut Outbox) {
        for interface in &self.interfaces {
            let Role::Heard(tap) = &interface.role else { continue };
            if let Some(oddity) = tap.oddity() {
                out.warning(SourceError::new(name, Place::Whole, oddity));
            }
        }
    }
}

fn interface_of<'a>(
    interfaces: &'a mut [Interface],
    number: u32,
    blocks: &Blocks,
) -> Result<&'a mut Interface, SourceError> {
    let there = interfaces.len();
    interfaces.get_mut(number as usize).ok_or_else(|| {
        blocks.error(format!(
            "is of interface {number}, and its section has {there}: the file is damaged"
        ))
    })
}

/// Passes on what somebody else wrote.
fn comments<'a>(
    bus: usize,
    at: Moment,
    comments: impl Iterator<Item = &'a [u8]>,
    out: &mut Outbox,
) {
    for comment in comments {
        if !OWN_COMMENTS.iter().any(|beginning| comment.starts_with(beginning)) {
            out.comment(bus, at, &String::from_utf8_lossy(comment));
        }
    }
}
