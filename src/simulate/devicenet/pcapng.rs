//! pcapng with LINKTYPE_CAN_SOCKETCAN: a frame a block, stamped to the nanosecond.

use super::frame::{Frame, Id};
use super::tap::{ErrorFrame, Heard, Tap, What};
use crate::simulate::pcapng::{Blocks, Interface};
use crate::simulate::time::Ps;
use anyhow::Result;
use pcap_file::pcapng::blocks::enhanced_packet::EnhancedPacketOption;
use std::io::Write;

/// LINKTYPE_CAN_SOCKETCAN of the tcpdump registry.
const CAN_SOCKETCAN: u32 = 227;

/// Bits of the identifier's word.
const EXTENDED: u32 = 0x8000_0000;
const REMOTE: u32 = 0x4000_0000;
const ERROR: u32 = 0x2000_0000;

/// A capture of this form.
pub struct Pcapng<W: Write> {
    out: Blocks<W>,
    /// Frames that were missed before the next.
    missed: u64,
}

impl<W: Write> Pcapng<W> {
    /// Begins a capture of this interface.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn new(out: W, name: &str, bitrate: u32, start: u32) -> Result<Self> {
        let interface = Interface { link: CAN_SOCKETCAN, name, rate: bitrate, comment: None };
        Ok(Pcapng { out: Blocks::new(out, interface, u64::from(start))?, missed: 0 })
    }

    /// Identifier big-endian, length, three bytes of zeros, data.
    fn write(&mut self, at: Ps, id: u32, length: u8, data: &[u8], kept: usize) -> Result<()> {
        let head = [&id.to_be_bytes()[..], &[length, 0, 0, 0]].concat();
        let whole = head.len() + data.len();
        let kept = kept.min(data.len());
        let options = match std::mem::take(&mut self.missed) {
            0 => Vec::new(),
            missed => vec![EnhancedPacketOption::DropCount(missed)],
        };
        self.out.packet(at, &[&head, &data[..kept]].concat(), whole, options)
    }
}

fn word(frame: &Frame) -> u32 {
    let remote = if frame.is_remote { REMOTE } else { 0 };
    remote
        | match frame.id {
            Id::Standard(id) => u32::from(id),
            Id::Extended(id) => EXTENDED | id,
        }
}

impl<W: Write> Tap for Pcapng<W> {
    fn hear(&mut self, heard: &Heard<'_>) -> Result<()> {
        for what in &heard.what {
            match what {
                What::Frame(frame, kept) => {
                    self.write(heard.at, word(frame), frame.length(), frame.bytes(), *kept)?;
                }
                What::Error(ErrorFrame { classes, data }) => {
                    self.write(heard.at, ERROR | classes, 8, data, 8)?;
                }
                What::Missed(frames) => self.missed += frames,
            }
        }
        Ok(())
    }

    fn end(self: Box<Self>, at: Ps) -> Result<()> {
        self.out.end(at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::time::NS;
    use pcap_file::pcapng::{Block, PcapNgReader};
    use std::time::Duration;

    #[test]
    fn a_frame_is_a_block_with_the_identifier_big_endian() {
        let mut file = Vec::new();
        let mut tap = Box::new(Pcapng::new(&mut file, "can0", 125_000, 1_000).unwrap());
        let frame = Frame::new(0x3D7, &[0x45, 0x23, 0x01, 0x00]);
        let what = vec![What::Missed(2), What::Frame(&frame, 3)];
        tap.hear(&Heard { spans: &[], until: 0, at: 2_000 * NS, what }).unwrap();
        tap.end(3_000 * NS).unwrap();
        let mut reader = PcapNgReader::new(&file[..]).unwrap();
        let mut blocks = Vec::new();
        while let Some(block) = reader.next_block() {
            if let Block::EnhancedPacket(packet) = block.unwrap().0 {
                blocks.push(packet.into_owned());
            }
        }
        let [packet] = &blocks[..] else { panic!("one block") };
        assert_eq!(packet.timestamp, Duration::new(1_000, 2_000));
        assert_eq!(packet.data[..], [0, 0, 0x03, 0xD7, 4, 0, 0, 0, 0x45, 0x23, 0x01]);
        assert_eq!(packet.original_len, 12);
        assert_eq!(packet.options, [EnhancedPacketOption::DropCount(2)]);
    }
}
