//! pcapng: one interface, stamped to the nanosecond.

use super::time::{NS, Ps};
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
use pcap_file::pcapng::blocks::opt_common::CommonOption;
use std::borrow::Cow;
use std::io::Write;
use std::time::Duration;

/// A file of one interface.
pub struct Blocks<W: Write> {
    out: PcapNgWriter<W>,
    /// The date, in s since the Unix epoch.
    start: u64,
}

/// The interface that was captured from.
pub struct Interface<'a> {
    /// What its packets are, by the tcpdump registry.
    pub link: u32,
    /// Its name.
    pub name: &'a str,
    /// Bits a second.
    pub rate: u32,
    /// What its stamps are worth, for readers that know.
    pub comment: Option<String>,
}

impl<W: Write> Blocks<W> {
    /// Begins a file. `start` is when the capture began, in s since the Unix epoch.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn new(out: W, interface: Interface<'_>, start: u64) -> Result<Self> {
        let mut out = PcapNgWriter::new(out).context("cannot write the head")?;
        let mut block = InterfaceDescriptionBlock::new(DataLink::from(interface.link), 0);
        block.options = vec![
            InterfaceDescriptionOption::IfName(Cow::Borrowed(interface.name)),
            InterfaceDescriptionOption::IfSpeed(u64::from(interface.rate)),
            InterfaceDescriptionOption::IfTsResol(InterfaceTsResolution::NANO),
        ];
        if let Some(comment) = interface.comment {
            let comment = CommonOption::Comment(Cow::Owned(comment));
            block.options.push(InterfaceDescriptionOption::Common(comment));
        }
        out.write_pcapng_block(block).context("cannot write the interface")?;
        Ok(Blocks { out, start })
    }

    /// Writes a packet that has these bytes, of so many.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn packet(
        &mut self,
        at: Ps,
        data: &[u8],
        whole: usize,
        options: Vec<EnhancedPacketOption<'static>>,
    ) -> Result<()> {
        let block = EnhancedPacketBlock {
            interface_id: 0,
            timestamp: self.date(at),
            original_len: u32::try_from(whole)?,
            data: Cow::Borrowed(data),
            options,
        };
        self.out.write_pcapng_block(block).context("cannot write a block")?;
        Ok(())
    }

    /// The date of a time of the capture.
    pub fn date(&self, at: Ps) -> Duration {
        Duration::from_secs(self.start) + Duration::from_nanos(u64::try_from(at / NS).unwrap_or(0))
    }

    /// The capture ends here.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn end(mut self, at: Ps) -> Result<()> {
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
