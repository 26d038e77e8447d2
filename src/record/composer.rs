//! What a source says, as blocks of pcapng: characters and frames as they were heard, undecoded.
//!
//! A block ends where a read ended, and where a start differs from the time that a reader gives it:
//! what is read back is what was heard, to the nanosecond.

use super::steady::Steady;
use crate::export::pcapng::{
    BlockWriter, Carries, Extras, Interface, clock_of, marks_for, runs, unsupported,
};
use crate::source::SourceOptions;
use dissectors::bus::{LineCounts, WireFacts};
use dissectors::can::{Frame, FrameKind};
use dissectors::event::{Break, Event, Loss, LossCause, Moment};
use dissectors::protocol::Medium;
use dissectors::record::BusInfo;
use dissectors::uart::{Baud, Character, Format, ParityMarks, Wire};
use std::io;
use std::ops::Range;

/// Longest time in one chunk, in ns.
const LONGEST_CHUNK: i64 = 100_000_000;

/// Interfaces that a bus gets because the ± of its stamps differs. Beyond that, a ± is rounded up to
/// a power of two.
const EXACT_INTERFACES: usize = 16;

/// Blocks that were composed together.
#[derive(Clone, Debug)]
pub struct Chunk {
    /// When the first began, by a clock that is never set back.
    pub from: Moment,
    /// When the last began, by the same clock.
    pub to: Moment,
    /// When the first began, as the source stamped it.
    pub stamp: Moment,
    /// Where their bytes are among those composed.
    pub bytes: Range<usize>,
}

/// Where what is kept begins or ends.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Edge {
    /// A file ends in which nothing is after this, by a clock that is never set back.
    End(Moment),
    /// What was heard before this was let go, as the source stamps it.
    NotKept(Moment),
}

/// What was composed and is not kept yet.
#[derive(Default)]
pub struct Composed {
    /// The chunks, in order.
    pub chunks: Vec<Chunk>,
    bytes: Vec<u8>,
}

impl Composed {
    /// The bytes of a chunk.
    pub fn bytes(&self, chunk: &Chunk) -> &[u8] {
        &self.bytes[chunk.bytes.clone()]
    }
}

/// One bus that is recorded.
pub struct Bus {
    /// Name and clock.
    pub info: BusInfo,
    /// What was heard on it.
    pub counts: LineCounts,
    /// Characters or frames that were lost, as far as they were counted: in the capture, and at the
    /// receiver.
    pub lost: [u64; 2],
    facts: WireFacts,
    medium: Option<Medium>,
    /// What they can tell, and their numbers.
    interfaces: Vec<(Terms, u32)>,
    /// Frames lost just now: told with the next frame if it is of the same time.
    pending: Option<Loss>,
    comments: Vec<String>,
    /// When the last block began, as the source stamped it.
    last: Moment,
    /// Up to here it was listened to, by a clock that is never set back.
    reach: Moment,
    /// The source said up to when it listened.
    is_reach_told: bool,
}

/// What an interface tells of all that is heard on it.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Terms {
    /// ± of stamps, in ns.
    uncertainty: u32,
    baud: Option<Baud>,
    parity: ParityMarks,
}

/// Composes blocks.
pub struct Composer {
    writer: BlockWriter<Vec<u8>>,
    /// The section's header, and what describes each interface: what a file must have before the
    /// blocks that need it.
    heads: Vec<Vec<u8>>,
    chunks: Vec<Chunk>,
    buses: Vec<Bus>,
    /// The bus of each number of the source.
    numbers: Vec<usize>,
    steady: Steady,
    /// What the user says about serial lines, where the source does not.
    user: (Option<Baud>, Option<Format>),
}

impl Composer {
    /// Nothing was heard yet. What the user says about the source counts where it does not tell.
    ///
    /// # Errors
    /// Never: what is written stays in memory.
    pub fn new(options: &SourceOptions) -> io::Result<Self> {
        let mut writer = BlockWriter::new(Vec::new())?;
        let heads = vec![std::mem::take(writer.out())];
        let user = (options.baud, options.frame);
        let (buses, numbers, chunks) = (Vec::new(), Vec::new(), Vec::new());
        let steady = Steady::default();
        Ok(Composer { writer, heads, chunks, buses, numbers, steady, user })
    }

    /// Another source begins. Buses of the same name go on.
    pub fn begin_source(&mut self) {
        self.numbers.clear();
    }

    /// The buses that appeared so far.
    pub fn buses(&self) -> &[Bus] {
        &self.buses
    }

    /// A bus appears.
    pub fn bus(&mut self, info: BusInfo, mut facts: WireFacts) {
        if facts.medium != Some(Medium::Can) {
            facts.baud = facts.baud.or(self.user.0);
            facts.format = facts.format.or(self.user.1);
        }
        let is_it =
            |(index, bus): &(usize, &Bus)| bus.info == info && !self.numbers.contains(index);
        let known = self.buses.iter().enumerate().find(is_it).map(|(index, _)| index);
        self.numbers.push(known.unwrap_or(self.buses.len()));
        if known.is_none() {
            self.buses.push(Bus::new(info, facts));
        } else if let (Some(known), true, Some(Medium::Can)) =
            (known, facts.baud.is_some(), facts.medium)
        {
            self.buses[known].facts.baud = facts.baud;
        }
    }

    /// A bus of frames is listened to at this bit rate from here on.
    ///
    /// # Errors
    /// There is no room for it in pcapng.
    pub fn set_bitrate(&mut self, bus: usize, rate: Option<Baud>) -> io::Result<()> {
        let bus = self.numbers[bus];
        self.settle(bus)?;
        self.buses[bus].facts.baud = rate;
        Ok(())
    }

    /// Somebody commented on what is heard next.
    pub fn comment(&mut self, bus: usize, text: &str) {
        self.buses[self.numbers[bus]].comments.push(text.to_owned());
    }

    /// Nothing comes after this time.
    pub fn end(&mut self, bus: usize, at: Moment) {
        self.listened(self.numbers[bus], at);
    }

    /// The source says up to when it listened.
    fn listened(&mut self, index: usize, until: Moment) {
        let bus = &mut self.buses[index];
        bus.reach(self.steady.reach(until, bus.reach));
        bus.is_reach_told |= until.is_known();
    }

    /// Up to here all buses were listened to, at the latest, by a clock that is never set back.
    pub fn reach(&self) -> Moment {
        let latest = self.buses.iter().filter_map(|bus| bus.reach.ns()).max();
        latest.map_or(Moment::UNKNOWN, Moment::from_ns)
    }

    /// The same, as the source stamps it.
    pub fn stamp(&self) -> Moment {
        self.steady.stamp(self.reach())
    }

    /// When it was that the source called `stamp` a while ago, by a clock that is never set back.
    pub fn time_of(&self, stamp: Moment) -> Moment {
        self.steady.of(stamp)
    }

    /// Takes what was heard. Its blocks are among the chunks from then on.
    ///
    /// # Errors
    /// There is no room for it in pcapng.
    pub fn hear(&mut self, bus: usize, event: Event<'_>) -> io::Result<()> {
        let bus = self.numbers[bus];
        match event {
            Event::Characters(characters) => self.characters(bus, characters),
            Event::Frames(frames) => self.frames(bus, frames),
            Event::Break(event) => self.line_break(bus, event),
            Event::Lost(loss) => self.lost(bus, loss),
            Event::Advance(until) => {
                self.settle(bus)?;
                self.listened(bus, until);
                Ok(())
            }
            Event::Levels(_) => Err(unsupported(
                "line levels are not recorded, for only what was decoded could be: let the \
                 analyzer's own program save them (sigrok-cli -o bus.sr)"
                    .to_owned(),
            )),
            // What lines carry is made of levels behind the sources.
            Event::Cycle(_) | Event::Silence(_) => Ok(()),
            Event::Rows(_) => Err(unsupported(
                "rows of words are not recorded: they are in the log already".to_owned(),
            )),
        }
    }

    fn characters(&mut self, index: usize, characters: &[Character]) -> io::Result<()> {
        let wire = self.buses[index].wire();
        // One odd character, or another adapter of the same name, does not end a recording.
        let Bus { info, facts, .. } = &self.buses[index];
        let (told, baud) = (info.parity, facts.baud);
        let terms = |character: &Character| {
            let parity = marks_for(character, told);
            Terms { uncertainty: character.uncertainty, baud, parity }
        };
        for alike in characters.chunk_by(|a, b| terms(a) == terms(b)) {
            let interface = self.interface(index, Medium::Serial, terms(&alike[0]))?;
            for run in runs(alike, wire, 0) {
                let (from, to) = (run[0].start, run[run.len() - 1].start);
                let extras = Extras::comments(self.comments(index));
                let begin = self.writer.out().len();
                self.writer.characters(interface, run, extras)?;
                self.composed(index, begin, from, to);
            }
        }
        let bus = &mut self.buses[index];
        bus.counts.characters += characters.len() as u64;
        let damaged = characters.iter().filter(|character| character.is_damaged());
        bus.counts.damaged += damaged.count() as u64;
        Ok(())
    }

    fn frames(&mut self, index: usize, frames: &[Frame]) -> io::Result<()> {
        for frame in frames {
            let interface = self.usual_interface(index, Medium::Can, frame.uncertainty)?;
            let is_its = |loss: &mut Loss| loss.start == frame.start;
            let lost = self.buses[index].pending.take_if(is_its);
            if lost.is_none() {
                self.settle(index)?;
            }
            let lost = lost.map(|loss| loss.count.unwrap_or(u64::MAX));
            let extras = Extras { comments: self.comments(index), lost };
            let begin = self.writer.out().len();
            self.writer.frame(interface, frame, extras)?;
            self.composed(index, begin, frame.start, frame.start);
            let bus = &mut self.buses[index];
            bus.counts.frames += 1;
            bus.counts.error_frames += u64::from(frame.kind == FrameKind::Error);
        }
        Ok(())
    }

    fn line_break(&mut self, index: usize, event: Break) -> io::Result<()> {
        let interface = self.usual_interface(index, Medium::Serial, event.uncertainty)?;
        let extras = Extras::comments(self.comments(index));
        let begin = self.writer.out().len();
        self.writer.line_break(interface, event, extras)?;
        self.composed(index, begin, event.start, event.start);
        self.buses[index].counts.breaks += 1;
        Ok(())
    }

    fn lost(&mut self, index: usize, loss: Loss) -> io::Result<()> {
        let bus = &mut self.buses[index];
        bus.counts.lose(loss.cause);
        let place = usize::from(loss.cause == LossCause::Overrun);
        bus.lost[place] = bus.lost[place].saturating_add(loss.count.unwrap_or(0));
        // What was lost has no time of its own where the source does not tell.
        let start = if loss.start.is_known() { loss.start } else { bus.last };
        let loss = Loss { start, ..loss };
        if bus.medium == Some(Medium::Can) {
            self.settle(index)?;
            self.buses[index].pending = Some(loss);
            // No frame follows at once, and none could tell why.
            return if loss.cause.is_gap() { self.settle(index) } else { Ok(()) };
        }
        let interface = self.some_interface(index)?;
        let comments = self.comments(index);
        let begin = self.writer.out().len();
        self.writer.lost_characters(interface, loss, comments)?;
        self.composed(index, begin, loss.start, loss.start);
        Ok(())
    }

    /// Describes the buses on which nothing was heard: that, too, is worth knowing.
    ///
    /// # Errors
    /// There is no room for one in pcapng.
    pub fn describe_silent(&mut self) -> io::Result<()> {
        for index in 0..self.buses.len() {
            let bus = &self.buses[index];
            if let (Some(medium), Some(_), []) = (bus.medium, bus.info.clock, &*bus.interfaces) {
                self.usual_interface(index, medium, 0)?;
            }
        }
        Ok(())
    }

    /// Writes what still waits for a frame that does not come.
    fn settle(&mut self, index: usize) -> io::Result<()> {
        let Some(loss) = self.buses[index].pending.take() else { return Ok(()) };
        let interface = self.some_interface(index)?;
        let comments = self.comments(index);
        let begin = self.writer.out().len();
        self.writer.lost_frames(interface, loss, comments)?;
        self.composed(index, begin, loss.start, loss.start);
        Ok(())
    }

    /// The same on every bus.
    ///
    /// # Errors
    /// There is no room for it in pcapng.
    pub fn settle_all(&mut self) -> io::Result<()> {
        (0..self.buses.len()).try_for_each(|bus| self.settle(bus))
    }

    fn comments(&mut self, index: usize) -> Vec<String> {
        std::mem::take(&mut self.buses[index].comments)
    }

    /// An interface of a bus where the ± does not matter.
    fn some_interface(&mut self, index: usize) -> io::Result<u32> {
        let bus = &self.buses[index];
        match bus.some_interface() {
            Some(number) => Ok(number),
            None => self.usual_interface(index, bus.medium.unwrap_or(Medium::Serial), 0),
        }
    }

    /// The interface of a bus for stamps of this ±, where parity is known as its tap told.
    fn usual_interface(&mut self, index: usize, medium: Medium, plus: u32) -> io::Result<u32> {
        let Bus { facts, info, .. } = &self.buses[index];
        let terms = Terms { uncertainty: plus, baud: facts.baud, parity: info.parity };
        self.interface(index, medium, terms)
    }

    /// The interface of a bus for this, which is described if it is new.
    fn interface(&mut self, index: usize, medium: Medium, terms: Terms) -> io::Result<u32> {
        let bus = &mut self.buses[index];
        let uncertainty = match bus.interfaces.len() < EXACT_INTERFACES {
            true => terms.uncertainty,
            false => terms.uncertainty.checked_next_power_of_two().unwrap_or(u32::MAX),
        };
        let terms = Terms { uncertainty, ..terms };
        let known = bus.interfaces.iter().find(|(known, _)| *known == terms);
        if let Some((_, number)) = known {
            return Ok(*number);
        }
        if bus.interfaces.is_empty() && terms.parity != bus.info.parity {
            // Whoever reads it takes the first one for what the bus tells.
            self.usual_interface(index, medium, uncertainty)?;
        }
        let bus = &mut self.buses[index];
        bus.medium = bus.medium.or(Some(medium));
        let clock = clock_of(&bus.info, medium)?;
        let WireFacts { baud, format, spacing_is_assumed, .. } = bus.facts;
        let carries = match medium {
            Medium::Can => Carries::Frames,
            _ => Carries::Characters {
                parity: terms.parity,
                format,
                // Without a rate every character is a block.
                has_all_stamps: baud.is_none() && !spacing_is_assumed,
            },
        };
        let begin = self.writer.out().len();
        let described = Interface { bus: &bus.info, clock, uncertainty, baud, carries };
        let number = self.writer.interface(&described)?;
        bus.interfaces.push((terms, number));
        self.heads.push(self.writer.out().split_off(begin));
        Ok(number)
    }

    /// A block was composed whose bytes begin at `begin`.
    fn composed(&mut self, index: usize, begin: usize, from: Moment, to: Moment) {
        let end = self.writer.out().len();
        let bus = &mut self.buses[index];
        bus.last = to;
        let stamp = from;
        let from = self.steady.reach(stamp, bus.reach);
        let to = to.since(stamp).map_or(from, |span| from.plus(span));
        bus.reach(to);
        match self.chunks.last_mut() {
            Some(chunk)
                if to.since(chunk.from).is_some_and(|span| (0..LONGEST_CHUNK).contains(&span)) =>
            {
                chunk.bytes.end = end;
                chunk.to = if to.is_after(chunk.to) { to } else { chunk.to };
            }
            _ => self.chunks.push(Chunk { from, to, stamp, bytes: begin..end }),
        }
    }

    /// What was composed. To be given back.
    pub fn take_composed(&mut self) -> Composed {
        Composed {
            chunks: std::mem::take(&mut self.chunks),
            bytes: std::mem::take(self.writer.out()),
        }
    }

    /// Takes back what was composed, for its memory.
    pub fn give_back(&mut self, mut composed: Composed) {
        composed.chunks.clear();
        composed.bytes.clear();
        self.chunks = composed.chunks;
        *self.writer.out() = composed.bytes;
    }

    /// The blocks that a file ends with, in which nothing is after `limit`, by a clock that is never
    /// set back: when each bus was last listened to. To be asked for where nothing is composed.
    pub fn ends(&mut self, limit: Option<Moment>) -> Vec<u8> {
        self.heads_and_edges().1(Edge::End(limit.unwrap_or(Moment::from_ns(i64::MAX))))
    }

    /// What a file must begin with (the section's header, then the interfaces in order), and what
    /// makes the blocks at the edges of what is kept. To be asked for where nothing is composed.
    pub fn heads_and_edges(&mut self) -> (&[Vec<u8>], impl FnMut(Edge) -> Vec<u8>) {
        let Composer { heads, buses, writer, steady, .. } = self;
        let edges = |edge: Edge| {
            for bus in buses.iter_mut() {
                // Times that have no room were refused when their blocks were composed.
                let _ = match edge {
                    Edge::End(limit) => bus.end(limit, steady, writer),
                    Edge::NotKept(stamp) => bus.keep_nothing_before(stamp, writer),
                };
            }
            std::mem::take(writer.out())
        };
        (heads, edges)
    }
}

impl Bus {
    fn new(info: BusInfo, facts: WireFacts) -> Self {
        Bus {
            info,
            counts: LineCounts::default(),
            lost: [0; 2],
            medium: facts.medium,
            facts,
            interfaces: Vec::new(),
            pending: None,
            comments: Vec::new(),
            last: Moment::UNKNOWN,
            reach: Moment::UNKNOWN,
            is_reach_told: false,
        }
    }

    /// Rate and format, as far as the source or the user tell.
    pub fn wire(&self) -> Wire {
        Wire::new(self.facts.baud, self.facts.format.unwrap_or(Format::FT12))
    }

    /// Whether it carries frames.
    pub fn is_can(&self) -> bool {
        self.medium == Some(Medium::Can)
    }

    /// The interface that told of it last, at the rate that it has now.
    fn some_interface(&self) -> Option<u32> {
        let is_it = |(terms, _): &&(Terms, u32)| terms.baud == self.facts.baud;
        self.interfaces.iter().rfind(is_it).map(|(_, number)| *number)
    }

    /// Writes when it was last listened to, which is not after `limit`.
    fn end(
        &mut self,
        limit: Moment,
        steady: &Steady,
        out: &mut BlockWriter<Vec<u8>>,
    ) -> io::Result<()> {
        let Some((_, number)) = self.interfaces.first() else { return Ok(()) };
        let is_limited = self.reach.is_after(limit);
        let end = steady.stamp(if is_limited { limit } else { self.reach });
        // What the source does not tell is not known to whoever reads the file either.
        let told = (is_limited || self.is_reach_told).then_some(end);
        let comments = std::mem::take(&mut self.comments);
        out.end(*number, end, told, Extras::comments(comments))
    }

    /// Writes that nothing was kept before this stamp.
    fn keep_nothing_before(&self, stamp: Moment, out: &mut BlockWriter<Vec<u8>>) -> io::Result<()> {
        let first = self.interfaces.first().map(|(_, number)| *number);
        let Some(number) = self.some_interface().or(first) else { return Ok(()) };
        let gap = Loss { start: stamp, count: None, cause: LossCause::NotKept };
        match self.is_can() {
            true => out.lost_frames(number, gap, Vec::new()),
            false => out.lost_characters(number, gap, Vec::new()),
        }
    }

    fn reach(&mut self, to: Moment) {
        if to.is_known() && !self.reach.is_after(to) {
            self.reach = to;
        }
    }
}
