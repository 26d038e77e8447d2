//! pcapng with LINKTYPE_CAN_SOCKETCAN: a frame a block, stamped to the nanosecond.

use super::frame::{Frame, Id};
use super::tap::{ErrorFrame, Heard, Tap, What};
use crate::simulate::time::{NS, Ps};
use anyhow::{Context, Result};
use pcap_file::DataLink;
use pcap_file::pcapng::PcapNgWriter;
use pcap_file::pcapng::blocks::enhanced_packet::{EnhancedPacketBlock, EnhancedPacketOption};
use pcap_file::pcapng::blocks::interface_description::{
    InterfaceDescriptionBlock, InterfaceDescriptionOption, InterfaceTsResolution,
};
use pcap_file::pcapng::blocks::interface_statistics::{
    InterfaceStatisticsBlock, InterfaceStatisticsOption,
};
use std::borrow::Cow;
use std::io::Write;
use std::time::Duration;

/// LINKTYPE_CAN_SOCKETCAN of the tcpdump registry.
const CAN_SOCKETCAN: u32 = 227;

/// Bits of the identifier's word.
const EXTENDED: u32 = 0x8000_0000;
const REMOTE: u32 = 0x4000_0000;
const ERROR: u32 = 0x2000_0000;

/// A capture of this form.
pub struct Pcapng<W: Write> {
    out: PcapNgWriter<W>,
    /// The date, in s since the Unix epoch.
    start: u64,
    /// Frames that were missed before the next.
    missed: u64,
}

impl<W: Write> Pcapng<W> {
    /// Begins a capture of this interface.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn new(out: W, interface: &str, bitrate: u32, start: u32) -> Result<Self> {
        let mut out = PcapNgWriter::new(out).context("cannot write the head")?;
        let mut block = InterfaceDescriptionBlock::new(DataLink::from(CAN_SOCKETCAN), 0);
        block.options = vec![
            InterfaceDescriptionOption::IfName(Cow::Borrowed(interface)),
            InterfaceDescriptionOption::IfSpeed(u64::from(bitrate)),
            InterfaceDescriptionOption::IfTsResol(InterfaceTsResolution::NANO),
        ];
        out.write_pcapng_block(block).context("cannot write the interface")?;
        Ok(Pcapng { out, start: u64::from(start), missed: 0 })
    }

    /// Identifier big-endian, length, three bytes of zeros, data.
    fn write(&mut self, at: Ps, id: u32, length: u8, data: &[u8], kept: usize) -> Result<()> {
        let head = [&id.to_be_bytes()[..], &[length, 0, 0, 0]].concat();
        let original_len = u32::try_from(head.len() + data.len())?;
        let kept = kept.min(data.len());
        let missed = std::mem::take(&mut self.missed);
        let block = EnhancedPacketBlock {
            interface_id: 0,
            timestamp: self.date(at),
            original_len,
            data: Cow::Owned([&head, &data[..kept]].concat()),
            options: match missed {
                0 => Vec::new(),
                missed => vec![EnhancedPacketOption::DropCount(missed)],
            },
        };
        self.out.write_pcapng_block(block).context("cannot write a frame")?;
        Ok(())
    }

    fn date(&self, at: Ps) -> Duration {
        Duration::from_secs(self.start) + Duration::from_nanos(u64::try_from(at / NS).unwrap_or(0))
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

    fn end(mut self: Box<Self>, at: Ps) -> Result<()> {
        let end = self.date(at);
        let statistics = InterfaceStatisticsBlock {
            interface_id: 0,
            timestamp: end,
            options: vec![
                InterfaceStatisticsOption::IsbStartTime(self.date(0)),
                InterfaceStatisticsOption::IsbEndTime(end),
            ],
        };
        self.out.write_pcapng_block(statistics).context("cannot write the end")?;
        self.out.into_inner().flush()?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pcap_file::pcapng::{Block, PcapNgReader};

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
