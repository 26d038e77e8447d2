//! pcapng: what Wireshark reads, our sentences and findings as comments.

mod can;
mod serial;

use super::Export;
use dissectors::event::{Break, Moment};
use dissectors::protocol::Medium;
use dissectors::record::{BusInfo, Heard, Record, Sink};
use pcap_file::pcapng::PcapNgWriter;
use pcap_file::pcapng::blocks::enhanced_packet::{EnhancedPacketBlock, EnhancedPacketOption};
use pcap_file::pcapng::blocks::interface_description::{
    InterfaceDescriptionBlock, InterfaceDescriptionOption, InterfaceTsResolution,
};
use pcap_file::pcapng::blocks::interface_statistics::{
    InterfaceStatisticsBlock, InterfaceStatisticsOption,
};
use pcap_file::pcapng::blocks::opt_common::CommonOption;
use pcap_file::pcapng::blocks::section_header::{SectionHeaderBlock, SectionHeaderOption};
use pcap_file::{DataLink, Endianness};
use std::borrow::Cow;
use std::collections::{BTreeMap, VecDeque};
use std::error::Error;
use std::io::{self, Write};
use std::time::Duration;

/// Comments that may wait for a record on their bus.
const MOST_KEPT: usize = 1024;

/// Longest comment that an option can hold.
const LONGEST_COMMENT: usize = 65_535;

/// Writes records as pcapng.
pub struct PcapNg<W: Write> {
    writer: PcapNgWriter<W>,
    interfaces: Vec<Interface>,
    /// Comments of others by bus: the time of what they are about, and the text.
    kept: BTreeMap<String, VecDeque<(Moment, String)>>,
    result: io::Result<()>,
    data: Vec<u8>,
}

/// One bus in the file.
struct Interface {
    name: String,
    last: Moment,
    /// Comments of events, for the next block.
    pending: Vec<String>,
    /// Frames lost before the next block; `u64::MAX` where nobody counted them.
    dropped: u64,
}

/// What is told of one block besides its bytes.
struct Block {
    start: Moment,
    /// When the last of it began.
    last: Moment,
    comments: Vec<String>,
    /// Direction and more, as the format defines them.
    flags: Option<u32>,
    /// Bytes that the capture does not have.
    missing: usize,
}

impl Block {
    fn at(start: Moment, comments: Vec<String>) -> Self {
        Block { start, last: start, comments, flags: None, missing: 0 }
    }
}

impl<W: Write> PcapNg<W> {
    /// Begins a file.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn new(out: W) -> io::Result<Self> {
        let program = concat!("fieldtap ", env!("CARGO_PKG_VERSION"));
        let section = SectionHeaderBlock {
            // Wireshark takes nothing else through a pipe.
            endianness: Endianness::Little,
            options: vec![SectionHeaderOption::UserApplication(Cow::Borrowed(program))],
            ..SectionHeaderBlock::default()
        };
        let writer = PcapNgWriter::with_section_header(out, section).map_err(io_error)?;
        Ok(PcapNg {
            writer,
            interfaces: Vec::new(),
            kept: BTreeMap::new(),
            result: Ok(()),
            data: Vec::new(),
        })
    }

    fn write(&mut self, record: &Record<'_>) -> io::Result<()> {
        let interface = match self.interface_named(&record.bus.name) {
            Some(interface) => interface,
            None => self.begin_interface(record)?,
        };
        let mut comments = comments(record);
        match record.heard {
            // Of words there is not even an interface.
            Heard::Nothing | Heard::Row(_) | Heard::Cycle(_) => {
                self.interfaces[interface].pending.extend(comments);
            }
            Heard::Characters(characters) => {
                serial::check(characters, record.bus)?;
                for run in serial::runs(characters, record.wire) {
                    let last = run.last().map_or(Moment::UNKNOWN, |character| character.start);
                    let comments = std::mem::take(&mut comments);
                    let block = Block { last, ..Block::at(run[0].start, comments) };
                    serial::compose(run, &mut self.data);
                    self.write_block(interface, block)?;
                }
            }
            Heard::Frame(frame) => {
                let (flags, missing) = (can::flags(frame), can::missing(frame));
                let block = Block { flags, missing, ..Block::at(frame.start, comments) };
                can::compose(frame, &mut self.data);
                self.write_block(interface, block)?;
            }
            Heard::Break(Break { start, .. }) => {
                serial::compose_event(start, serial::BREAK, &mut self.data);
                self.write_block(interface, Block::at(start, comments))?;
            }
            Heard::Lost(loss) => {
                if record.protocol.medium == Medium::Can {
                    let at = &mut self.interfaces[interface];
                    at.dropped = at.dropped.saturating_add(loss.count.unwrap_or(u64::MAX));
                    at.pending.extend(comments);
                } else {
                    let start = loss.start;
                    serial::compose_event(start, serial::event_of(loss.cause), &mut self.data);
                    self.write_block(interface, Block::at(start, comments))?;
                }
            }
        }
        Ok(())
    }

    fn interface_named(&self, name: &str) -> Option<usize> {
        self.interfaces.iter().position(|interface| interface.name == name)
    }

    fn begin_interface(&mut self, record: &Record<'_>) -> io::Result<usize> {
        let (bus, wire) = (record.bus, record.wire);
        let Some(clock) = bus.clock.filter(|_| record.start.is_known()) else {
            let what = "the source has no times, and pcapng needs them: write CSV or JSON";
            return Err(io::Error::new(io::ErrorKind::Unsupported, what));
        };
        let (linktype, note) = match record.protocol.medium {
            Medium::Serial => (DataLink::RTAC_SERIAL, serial::note(record)?),
            Medium::Can => (DataLink::CAN_SOCKETCAN, String::new()),
            Medium::Words => {
                let what = format!(
                    "{} is a ring, and pcapng has no link type for its words: write CSV or JSON",
                    bus.name
                );
                return Err(io::Error::new(io::ErrorKind::Unsupported, what));
            }
        };
        let (clock, pm) = (clock.name(), record.uncertainty);
        let comment = format!("fieldtap-tap: clock={clock} pm_ns={pm}{note}");
        let mut options = vec![
            InterfaceDescriptionOption::IfName(Cow::Borrowed(bus.name.as_str())),
            InterfaceDescriptionOption::IfTsResol(InterfaceTsResolution::NANO),
            InterfaceDescriptionOption::Common(CommonOption::Comment(Cow::Owned(comment))),
        ];
        if let Some(baud) = wire.baud() {
            options.push(InterfaceDescriptionOption::IfSpeed(u64::from(baud.get())));
        }
        let block = InterfaceDescriptionBlock { linktype, snaplen: 0, options };
        self.writer.write_pcapng_block(block).map_err(io_error)?;
        self.interfaces.push(Interface {
            name: bus.name.clone(),
            last: record.start,
            pending: Vec::new(),
            dropped: 0,
        });
        Ok(self.interfaces.len() - 1)
    }

    /// Writes a block with the bytes that were composed.
    fn write_block(&mut self, interface: usize, block: Block) -> io::Result<()> {
        let Block { start, last, comments, flags, missing } = block;
        let at = &mut self.interfaces[interface];
        at.last = last;
        if start.ns().is_some_and(|ns| ns < 0) {
            let what =
                "times before the start of 1970, which pcapng does not know: write CSV or JSON";
            return Err(io::Error::new(io::ErrorKind::Unsupported, what));
        }
        let kept = self.kept.get_mut(&at.name).into_iter().flat_map(|kept| {
            std::iter::from_fn(|| kept.pop_front_if(|(time, _)| !time.is_after(last)))
        });
        let kept = kept.map(|(_, text)| text);
        let pending: Vec<String> = at.pending.drain(..).collect();
        let all = comments.into_iter().chain(pending).chain(kept);
        let mut options: Vec<EnhancedPacketOption<'_>> = all
            .map(|text| {
                EnhancedPacketOption::Common(CommonOption::Comment(Cow::Owned(clamped(text))))
            })
            .collect();
        options.extend(flags.map(EnhancedPacketOption::Flags));
        let dropped = std::mem::take(&mut at.dropped);
        options.extend((dropped > 0).then_some(EnhancedPacketOption::DropCount(dropped)));
        let block = EnhancedPacketBlock {
            interface_id: u32::try_from(interface).unwrap_or(u32::MAX),
            timestamp: duration(start),
            original_len: u32::try_from(self.data.len() + missing).unwrap_or(u32::MAX),
            data: Cow::Borrowed(&self.data),
            options,
        };
        self.writer.write_pcapng_block(block).map_err(io_error)?;
        Ok(())
    }

    fn write_end(&mut self, interface: usize, end: Moment) -> io::Result<()> {
        let at = &mut self.interfaces[interface];
        let end = if end.is_known() { end } else { at.last };
        let kept = self.kept.remove(&at.name).into_iter().flatten().map(|(_, text)| text);
        let comments = at.pending.drain(..).chain(kept).map(|text| {
            InterfaceStatisticsOption::Common(CommonOption::Comment(Cow::Owned(clamped(text))))
        });
        let end = duration(end);
        let mut options = vec![InterfaceStatisticsOption::IsbEndTime(end)];
        options.extend(comments);
        // Those lost behind the last frame have no block.
        let dropped = Some(at.dropped).filter(|count| (1..u64::MAX).contains(count));
        options.extend(dropped.map(InterfaceStatisticsOption::IsbIfDrop));
        let interface_id = u32::try_from(interface).unwrap_or(u32::MAX);
        let block = InterfaceStatisticsBlock { interface_id, timestamp: end, options };
        self.writer.write_pcapng_block(block).map_err(io_error)?;
        Ok(())
    }
}

impl<W: Write> Sink for PcapNg<W> {
    fn record(&mut self, record: &Record<'_>) {
        if self.result.is_ok() {
            self.result = self.write(record);
        }
    }
}

impl<W: Write> Export for PcapNg<W> {
    fn comment(&mut self, bus: &BusInfo, time: Moment, text: &str) {
        let kept = match self.kept.get_mut(&bus.name) {
            Some(kept) => kept,
            None => self.kept.entry(bus.name.clone()).or_default(),
        };
        // They wait for records that held characters back, which is not long.
        if kept.len() < MOST_KEPT {
            kept.push_back((time, text.to_owned()));
        }
    }

    fn end(&mut self, bus: &BusInfo, end: Moment) {
        if let (Some(interface), Ok(())) = (self.interface_named(&bus.name), &self.result) {
            self.result = self.write_end(interface, end);
        }
    }

    fn status(&mut self) -> io::Result<()> {
        std::mem::replace(&mut self.result, Ok(()))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer.get_mut().flush()
    }
}

/// The record's sentence and findings. A String takes any text.
fn comments(record: &Record<'_>) -> Vec<String> {
    let mut comments = Vec::with_capacity(1 + record.findings.len());
    if !matches!(record.heard, Heard::Nothing) {
        let mut sentence = "fieldtap: ".to_owned();
        let _ = record.summarize(&mut sentence);
        comments.push(sentence);
    }
    for finding in record.findings {
        let mut text = format!("[{} {}] ", finding.severity().name(), finding.code.name);
        let _ = finding.say(record, &mut text);
        comments.push(text);
    }
    comments
}

fn clamped(mut text: String) -> String {
    text.truncate(text.floor_char_boundary(LONGEST_COMMENT));
    text
}

/// The file knows no times before its epoch.
fn duration(time: Moment) -> Duration {
    Duration::from_nanos(u64::try_from(time.ns().unwrap_or(0)).unwrap_or(0))
}

/// The system's error behind one of the library.
fn io_error(error: impl Error + Send + Sync + 'static) -> io::Error {
    let system = error.source().and_then(|source| source.downcast_ref::<io::Error>());
    match system.map(io::Error::kind) {
        Some(kind) => io::Error::new(kind, error),
        None => io::Error::other(error),
    }
}
