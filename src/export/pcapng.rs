//! pcapng with serial characters: what Wireshark reads, our sentences and findings as comments.
//!
//! Characters travel as LINKTYPE_RTAC_SERIAL: a 12-byte header (seconds, microseconds, event, line
//! state, all big-endian) and the bytes. A block is a run of good characters that follow each
//! other; a bad character is a block of its own. The block's stamp, in ns, is the first start bit.

use super::Export;
use dissectors::event::{Break, LossCause, Moment};
use dissectors::record::{BusInfo, Heard, Record, Sink};
use dissectors::uart::{Character, Parity, ParityMarks, Wire};
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
use pcap_file::pcapng::blocks::section_header::{SectionHeaderBlock, SectionHeaderOption};
use std::borrow::Cow;
use std::collections::{BTreeMap, VecDeque};
use std::error::Error;
use std::io::{self, Write};
use std::time::Duration;

/// Events of the RTAC header.
const DATA: u8 = 0x02;
const LOST: u8 = 0x05;
const FRAMING_ERROR: u8 = 0x07;
const PARITY_ERROR: u8 = 0x08;
const BREAK: u8 = 0x09;
const OVERFLOW: u8 = 0x0A;

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
}

impl<W: Write> PcapNg<W> {
    /// Begins a file.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn new(out: W) -> io::Result<Self> {
        let program = concat!("fieldtap ", env!("CARGO_PKG_VERSION"));
        let section = SectionHeaderBlock {
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
        let comments = comments(record);
        match record.heard {
            Heard::Nothing => self.interfaces[interface].pending.extend(comments),
            Heard::Characters(characters) => {
                let facts = (record.wire, record.bus.parity);
                self.write_characters(interface, characters, facts, comments)?;
            }
            Heard::Break(Break { start, .. }) => {
                self.write_block(interface, start, start, BREAK, &[], comments, None)?;
            }
            Heard::Lost(loss) => {
                let event = match loss.cause {
                    LossCause::Capture => LOST,
                    LossCause::Overrun => OVERFLOW,
                };
                let count = Some(loss.count.unwrap_or(0));
                self.write_block(interface, loss.start, loss.start, event, &[], comments, count)?;
            }
        }
        Ok(())
    }

    fn interface_named(&self, name: &str) -> Option<usize> {
        self.interfaces.iter().position(|interface| interface.name == name)
    }

    fn begin_interface(&mut self, record: &Record<'_>) -> io::Result<usize> {
        let (bus, wire) = (record.bus, record.wire);
        if wire.format().data_bits() > 8 {
            let what = format!(
                "{} has {} data bits a character, and serial pcapng holds eight: write CSV or JSON",
                bus.name,
                wire.format().data_bits()
            );
            return Err(io::Error::new(io::ErrorKind::Unsupported, what));
        }
        let Some(clock) = bus.clock.filter(|_| record.start.is_known()) else {
            let what = "the source has no times, and pcapng needs them: write CSV or JSON";
            return Err(io::Error::new(io::ErrorKind::Unsupported, what));
        };
        let parity = match record.characters().first().map(Character::parity) {
            Some(Parity::None) => ParityMarks::None.name(),
            _ => bus.parity.name(),
        };
        let comment = format!(
            "fieldtap-tap: clock={} pm_ns={} parity={parity} format={}",
            clock.name(),
            record.uncertainty,
            wire.format()
        );
        let mut options = vec![
            InterfaceDescriptionOption::IfName(Cow::Borrowed(bus.name.as_str())),
            InterfaceDescriptionOption::IfTsResol(InterfaceTsResolution::NANO),
            InterfaceDescriptionOption::Common(CommonOption::Comment(Cow::Owned(comment))),
        ];
        if let Some(baud) = wire.baud() {
            options.push(InterfaceDescriptionOption::IfSpeed(u64::from(baud.get())));
        }
        let block =
            InterfaceDescriptionBlock { linktype: DataLink::RTAC_SERIAL, snaplen: 0, options };
        self.writer.write_pcapng_block(block).map_err(io_error)?;
        self.interfaces.push(Interface {
            name: bus.name.clone(),
            last: record.start,
            pending: Vec::new(),
        });
        Ok(self.interfaces.len() - 1)
    }

    /// Characters in runs, the comments on the first.
    fn write_characters(
        &mut self,
        interface: usize,
        characters: &[Character],
        (wire, parity): (Wire, ParityMarks),
        mut comments: Vec<String>,
    ) -> io::Result<()> {
        if let Some(what) = contradicts(characters, parity) {
            return Err(io::Error::new(io::ErrorKind::Unsupported, what));
        }
        let mut rest = characters;
        while let Some(first) = rest.first() {
            let (run, behind) = rest.split_at(length_of_run(rest, wire));
            let event = match (first.has_framing_error(), first.parity()) {
                (true, _) => FRAMING_ERROR,
                (false, Parity::Error | Parity::Suspect) => PARITY_ERROR,
                (false, _) => DATA,
            };
            let bytes: Vec<u8> = run.iter().map(Character::byte).collect();
            let last = run.last().unwrap_or(first).start;
            let comments = std::mem::take(&mut comments);
            self.write_block(interface, first.start, last, event, &bytes, comments, None)?;
            rest = behind;
        }
        Ok(())
    }

    #[expect(clippy::too_many_arguments, reason = "they are the parts of a block")]
    fn write_block(
        &mut self,
        interface: usize,
        start: Moment,
        last: Moment,
        event: u8,
        bytes: &[u8],
        comments: Vec<String>,
        dropped: Option<u64>,
    ) -> io::Result<()> {
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
        options.extend(dropped.filter(|count| *count > 0).map(EnhancedPacketOption::DropCount));
        let stamp = duration(start);
        self.data.clear();
        let seconds = u32::try_from(stamp.as_secs()).unwrap_or(u32::MAX);
        self.data.extend_from_slice(&seconds.to_be_bytes());
        self.data.extend_from_slice(&stamp.subsec_micros().to_be_bytes());
        self.data.extend_from_slice(&[event, 0, 0, 0]);
        self.data.extend_from_slice(bytes);
        let block = EnhancedPacketBlock {
            interface_id: u32::try_from(interface).unwrap_or(u32::MAX),
            timestamp: stamp,
            original_len: u32::try_from(self.data.len()).unwrap_or(u32::MAX),
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

/// What characters say that an interface cannot, once it told what is known of parity.
fn contradicts(characters: &[Character], parity: ParityMarks) -> Option<&'static str> {
    let mut whole = characters.iter().filter(|character| !character.has_framing_error());
    let contradicts = whole.any(|character| match character.parity() {
        Parity::Unknown => parity != ParityMarks::None,
        Parity::Ok | Parity::Error => parity == ParityMarks::None,
        Parity::None | Parity::Suspect => false,
    });
    contradicts.then_some(
        "parity is known of some characters and not of others, which serial pcapng cannot hold: \
         write chars, CSV or JSON",
    )
}

/// How many characters from the first on can be told by one stamp: good ones that follow each
/// other at the frame's length, within the stamp's ± and half a bit.
fn length_of_run(characters: &[Character], wire: Wire) -> usize {
    let [first, others @ ..] = characters else { return 0 };
    let is_plain =
        |character: &Character| !character.is_damaged() && character.parity() != Parity::Suspect;
    let (Some(baud), true) = (wire.baud(), is_plain(first)) else { return 1 };
    let half_bit = baud.bits_ns(1).cast_signed() / 2;
    let off_by = i64::from(first.uncertainty).min(half_bit);
    let follows = |(index, character): &(u32, &Character)| {
        let rebuilt = baud.bits_ns(wire.format().bits() * (index + 1)).cast_signed();
        let start = character.start.since(first.start);
        is_plain(character) && start.is_some_and(|start| (start - rebuilt).abs() <= off_by)
    };
    1 + (0..).zip(others).take_while(follows).count()
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
