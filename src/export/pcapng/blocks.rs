//! The blocks of a pcapng file, whoever has them written: an export of records, or a recording of
//! what a tap hears.

use super::super::forms;
use super::{can, serial};
use crate::source::tap_note;
use dissectors::can::Frame;
use dissectors::event::{Break, Clock, Loss, Moment};
use dissectors::protocol::Medium;
use dissectors::record::BusInfo;
use dissectors::uart::{Baud, Character, Format, ParityMarks, Wire};
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
use std::error::Error;
use std::io::{self, Write};
use std::time::Duration;

/// Longest comment that an option can hold.
const LONGEST_COMMENT: usize = 65_535;

/// What a frame that was lost would have had, at least: a header without data.
const LOST_FRAME: usize = 8;

/// A bus, as the file describes it.
pub struct Interface<'a> {
    /// Its name.
    pub bus: &'a BusInfo,
    /// Who stamped.
    pub clock: Clock,
    /// ± of a stamp in ns.
    pub uncertainty: u32,
    /// The rate, if it is known.
    pub baud: Option<Baud>,
    /// What it carries.
    pub carries: Carries,
}

/// What an interface carries.
pub enum Carries {
    /// Characters.
    Characters {
        /// What is known of their parity.
        parity: ParityMarks,
        /// Their format, where it is known.
        format: Option<Format>,
        /// Each is a block with a stamp of its own, though the rate is not known.
        has_all_stamps: bool,
    },
    /// CAN frames.
    Frames,
}

/// What is told of one block besides its bytes.
#[derive(Default)]
pub struct Extras {
    /// Comments, in order.
    pub comments: Vec<String>,
    /// How many were lost before it; `u64::MAX` where nobody counted them.
    pub lost: Option<u64>,
}

impl Extras {
    /// Comments alone.
    pub fn comments(comments: Vec<String>) -> Self {
        Extras { comments, lost: None }
    }
}

/// Writes blocks.
pub struct BlockWriter<W: Write> {
    writer: PcapNgWriter<W>,
    interfaces: u32,
    data: Vec<u8>,
}

impl<W: Write> BlockWriter<W> {
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
        Ok(BlockWriter { writer, interfaces: 0, data: Vec::new() })
    }

    /// Where the blocks go.
    pub fn out(&mut self) -> &mut W {
        self.writer.get_mut()
    }

    /// Describes a bus, and returns the number of its interface.
    ///
    /// # Errors
    /// The format has no room for it, or the file cannot be written.
    pub fn interface(&mut self, interface: &Interface<'_>) -> io::Result<u32> {
        let Interface { bus, clock, uncertainty, baud, ref carries } = *interface;
        let (linktype, note) = match carries {
            Carries::Characters { parity, format, has_all_stamps } => {
                let mut note = serial::note(bus, *parity, *format)?;
                note.push_str(if *has_all_stamps { " stamps=all" } else { "" });
                (DataLink::RTAC_SERIAL, note)
            }
            Carries::Frames => (DataLink::CAN_SOCKETCAN, String::new()),
        };
        let comment = format!("fieldtap-tap: clock={} pm_ns={uncertainty}{note}", clock.name());
        let mut options = vec![
            InterfaceDescriptionOption::IfName(Cow::Borrowed(bus.name.as_str())),
            InterfaceDescriptionOption::IfTsResol(InterfaceTsResolution::NANO),
            InterfaceDescriptionOption::Common(CommonOption::Comment(Cow::Owned(comment))),
        ];
        if let Some(baud) = baud {
            options.push(InterfaceDescriptionOption::IfSpeed(u64::from(baud.get())));
        }
        let block = InterfaceDescriptionBlock { linktype, snaplen: 0, options };
        self.writer.write_pcapng_block(block).map_err(io_error)?;
        self.interfaces += 1;
        Ok(self.interfaces - 1)
    }

    /// Writes one run of characters that a block can hold.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn characters(
        &mut self,
        interface: u32,
        run: &[Character],
        extras: Extras,
    ) -> io::Result<()> {
        let start = run.first().map_or(Moment::UNKNOWN, |character| character.start);
        serial::compose(run, &mut self.data)?;
        self.packet(interface, start, None, 0, extras)
    }

    /// Writes a frame.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn frame(&mut self, interface: u32, frame: &Frame, extras: Extras) -> io::Result<()> {
        can::compose(frame, &mut self.data);
        self.packet(interface, frame.start, can::flags(frame), can::missing(frame), extras)
    }

    /// Writes a break.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn line_break(&mut self, interface: u32, at: Break, extras: Extras) -> io::Result<()> {
        serial::compose_event(at.start, serial::BREAK, &mut self.data)?;
        self.packet(interface, at.start, None, 0, extras)
    }

    /// Writes that characters were lost.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn lost_characters(
        &mut self,
        interface: u32,
        loss: Loss,
        mut comments: Vec<String>,
    ) -> io::Result<()> {
        comments.extend(tap_note::of_loss(loss.cause));
        serial::compose_event(loss.start, serial::event_of(loss.cause), &mut self.data)?;
        self.packet(interface, loss.start, None, 0, Extras { comments, lost: loss.count })
    }

    /// Writes that frames were lost where no frame follows at that time: a packet of which nothing
    /// is there.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn lost_frames(
        &mut self,
        interface: u32,
        loss: Loss,
        mut comments: Vec<String>,
    ) -> io::Result<()> {
        comments.extend(tap_note::of_loss(loss.cause));
        self.data.clear();
        let lost = Some(loss.count.unwrap_or(u64::MAX));
        self.packet(interface, loss.start, None, LOST_FRAME, Extras { comments, lost })
    }

    /// Writes a block with the bytes that were composed, of which `missing` more are not there.
    fn packet(
        &mut self,
        interface_id: u32,
        start: Moment,
        flags: Option<u32>,
        missing: usize,
        extras: Extras,
    ) -> io::Result<()> {
        let timestamp = duration(start)?;
        let mut options: Vec<EnhancedPacketOption<'_>> = extras
            .comments
            .into_iter()
            .map(|text| {
                EnhancedPacketOption::Common(CommonOption::Comment(Cow::Owned(clamped(text))))
            })
            .collect();
        options.extend(flags.map(EnhancedPacketOption::Flags));
        options.extend(extras.lost.map(EnhancedPacketOption::DropCount));
        let block = EnhancedPacketBlock {
            interface_id,
            timestamp,
            original_len: u32::try_from(self.data.len() + missing).unwrap_or(u32::MAX),
            data: Cow::Borrowed(&self.data),
            options,
        };
        self.writer.write_pcapng_block(block).map_err(io_error)?;
        Ok(())
    }

    /// Writes when the capture of an interface ended, if that is known, and what is left to say, at a
    /// time at which there was something. Those lost behind the last frame have no block.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn end(
        &mut self,
        interface_id: u32,
        at: Moment,
        end: Option<Moment>,
        extras: Extras,
    ) -> io::Result<()> {
        let comments = extras.comments.into_iter().map(|text| {
            InterfaceStatisticsOption::Common(CommonOption::Comment(Cow::Owned(clamped(text))))
        });
        let end = end.map(duration).transpose()?;
        let mut options: Vec<InterfaceStatisticsOption<'_>> =
            end.map(InterfaceStatisticsOption::IsbEndTime).into_iter().collect();
        options.extend(comments);
        options.extend(extras.lost.map(InterfaceStatisticsOption::IsbIfDrop));
        let block = InterfaceStatisticsBlock { interface_id, timestamp: duration(at)?, options };
        self.writer.write_pcapng_block(block).map_err(io_error)?;
        Ok(())
    }
}

/// Characters divided into the runs that a block each can hold, where starts may be off by so many
/// ns at most from the time a reader gives them.
pub fn runs(
    characters: &[Character],
    wire: Wire,
    off_by: i64,
) -> impl Iterator<Item = &[Character]> {
    serial::runs(characters, wire, off_by)
}

/// Who stamped on a bus of this medium.
///
/// # Errors
/// There are no times, or the bus carries words: there is no room for such a bus.
pub fn clock_of(bus: &BusInfo, medium: Medium) -> io::Result<Clock> {
    let Some(clock) = bus.clock else {
        return Err(unsupported(
            "the source has no times, and pcapng needs them: write CSV or JSON".to_owned(),
        ));
    };
    match medium {
        Medium::Serial | Medium::Can => Ok(clock),
        Medium::Words => Err(unsupported(format!(
            "{} is a ring, and pcapng has no link type for its words: {}",
            bus.name,
            forms(medium)
        ))),
    }
}

/// Time since the epoch.
///
/// # Errors
/// The time lies before it.
pub fn duration(time: Moment) -> io::Result<Duration> {
    u64::try_from(time.ns().unwrap_or(0)).map(Duration::from_nanos).map_err(|_| {
        unsupported(
            "times before the start of 1970, which pcapng does not know: write CSV or JSON"
                .to_owned(),
        )
    })
}

fn clamped(mut text: String) -> String {
    text.truncate(text.floor_char_boundary(LONGEST_COMMENT));
    text
}

/// What this form has no room for.
pub fn unsupported(what: String) -> io::Error {
    io::Error::new(io::ErrorKind::Unsupported, what)
}

/// The system's error behind one of the library.
fn io_error(error: impl Error + Send + Sync + 'static) -> io::Error {
    let system = error.source().and_then(|source| source.downcast_ref::<io::Error>());
    match system.map(io::Error::kind) {
        Some(kind) => io::Error::new(kind, error),
        None => io::Error::other(error),
    }
}
