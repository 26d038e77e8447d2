//! From a source, over the buses it hears, to records.

use crate::source::{Piece, Source, SourceError};
use dissectors::bus::{Bus, WireFacts};
use dissectors::event::{Event, Moment};
use dissectors::protocol::Settings;
use dissectors::record::{BusInfo, Output, Sink};

/// Takes records for as long as it wants more.
pub trait Consumer: Sink {
    /// Whether it wants more. Asked between pieces of the source.
    fn goes_on(&mut self) -> bool;

    /// Takes somebody's comment on what was heard on a bus at this time.
    fn comment(&mut self, bus: &BusInfo, time: Moment, text: &str);

    /// Takes what the user should know about a source that goes on.
    fn warn(&mut self, warning: &SourceError);

    /// Takes what the user may want to know about a source.
    fn note(&mut self, _: &str) {}

    /// The capture of a bus ended here, if the source told.
    fn end(&mut self, bus: &BusInfo, end: Moment);
}

/// What a source names: a bus, or one wire of a bus that has several.
struct Channel {
    info: BusInfo,
    bus: usize,
    wire: usize,
    /// Only the first of characters that come together has a stamp.
    is_spaced: bool,
    /// The last stamp.
    last: Moment,
}

impl Channel {
    /// How often time runs backwards in what is heard. Ticks of levels cannot; times that were
    /// spread over what one read or one packet brought are no stamps.
    fn steps_back(&mut self, event: &Event<'_>) -> u64 {
        match event {
            Event::Characters(heard) => {
                let most = if self.is_spaced { 1 } else { heard.len() };
                let stamped = heard.iter().take(most).filter(|heard| !heard.is_interpolated());
                self.count_steps_back(stamped.map(|heard| (heard.start, heard.uncertainty)))
            }
            Event::Frames(frames) => {
                self.count_steps_back(frames.iter().map(|frame| (frame.start, frame.uncertainty)))
            }
            Event::Rows(rows) => {
                self.count_steps_back(rows.iter().map(|row| (row.start, row.uncertainty)))
            }
            _ => 0,
        }
    }

    /// Counts steps back by more than what stamps are off anyway: their ± is what their last digit
    /// is worth, or more.
    fn count_steps_back(&mut self, stamps: impl Iterator<Item = (Moment, u32)>) -> u64 {
        let mut count = 0;
        for (time, uncertainty) in stamps.filter(|(time, _)| time.is_known()) {
            let back = self.last.since(time).unwrap_or(0);
            count += u64::from(back > 0 && back >= i64::from(uncertainty));
            self.last = time;
        }
        count
    }
}

/// The buses of a run. Several sources go through it one after the other as one stream.
pub struct Pipeline {
    settings: Settings,
    buses: Vec<Bus>,
    channels: Vec<Channel>,
    /// Where the capture of each bus ended.
    ends: Vec<Moment>,
    last_number: u64,
    steps_back: u64,
}

impl Pipeline {
    /// A run in which nothing was heard yet.
    pub fn new(settings: Settings) -> Self {
        Pipeline {
            settings,
            buses: Vec::new(),
            channels: Vec::new(),
            ends: Vec::new(),
            last_number: 0,
            steps_back: 0,
        }
    }

    /// What the user decided.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The buses that appeared so far.
    pub fn buses(&self) -> &[Bus] {
        &self.buses
    }

    /// How many records there were.
    pub fn records(&self) -> u64 {
        self.last_number
    }

    /// How often something was heard on a channel that bears an earlier time than what was heard
    /// there before.
    pub fn steps_back(&self) -> u64 {
        self.steps_back
    }

    /// Passes everything of a source on, for as long as the consumer wants more. Buses of the same
    /// name go on where an earlier source left them.
    ///
    /// # Errors
    /// The source could not go on. What came before was passed on.
    pub fn pass(
        &mut self,
        source: &mut dyn Source,
        consumer: &mut dyn Consumer,
    ) -> Result<(), SourceError> {
        let mut numbers = Vec::new();
        while consumer.goes_on() {
            match source.next_piece()? {
                None => break,
                Some(piece) => self.take(piece, &mut numbers, consumer),
            }
        }
        if source.stop() {
            while let Some(piece) = source.next_piece()? {
                self.take(piece, &mut numbers, consumer);
            }
        }
        Ok(())
    }

    /// Takes a piece of a source whose channels have these numbers here.
    fn take(&mut self, piece: Piece<'_>, numbers: &mut Vec<usize>, consumer: &mut dyn Consumer) {
        match piece {
            Piece::Bus(info, facts) => {
                let number = self.channel(info, facts, numbers, consumer);
                numbers.push(number);
            }
            Piece::Heard(number, event) => {
                let channel = &mut self.channels[numbers[number]];
                self.steps_back += channel.steps_back(&event);
                let Channel { bus, wire, .. } = *channel;
                let mut out = Output::new(&mut self.last_number, &mut *consumer);
                self.buses[bus].hear_wire(wire, event, &mut out);
            }
            Piece::Bitrate(number, rate) => {
                let bus = self.channels[numbers[number]].bus;
                let mut out = Output::new(&mut self.last_number, &mut *consumer);
                self.buses[bus].set_bitrate(rate, &mut out);
            }
            Piece::Comment(number, time, text) => {
                let bus = self.channels[numbers[number]].bus;
                consumer.comment(self.buses[bus].info(), time, text);
            }
            Piece::Warning(warning) => consumer.warn(&warning),
            Piece::Note(line) => consumer.note(line),
            Piece::End(number, end) => self.ends[self.channels[numbers[number]].bus] = end,
        }
    }

    /// The number of a channel that appears in a source which has these already.
    fn channel(
        &mut self,
        info: BusInfo,
        facts: WireFacts,
        heard: &[usize],
        consumer: &mut dyn Consumer,
    ) -> usize {
        // Two channels of one source may bear the same name.
        let is_it =
            |(number, channel): &(usize, &Channel)| channel.info == info && !heard.contains(number);
        let known = self.channels.iter().enumerate().find(is_it).map(|(number, _)| number);
        if let Some(known) = known {
            let bus = self.channels[known].bus;
            if !heard.iter().any(|number| self.channels[*number].bus == bus) {
                let mut out = Output::new(&mut self.last_number, &mut *consumer);
                self.buses[bus].go_on(facts, &mut out);
            }
            return known;
        }
        let (bus, wire) = self.join(&info, facts, heard).unwrap_or_else(|| {
            self.buses.push(Bus::new(info.clone(), facts, self.settings.clone()));
            self.ends.push(Moment::UNKNOWN);
            (self.buses.len() - 1, 0)
        });
        self.channels.push(Channel {
            info,
            bus,
            wire,
            is_spaced: facts.spacing_is_assumed,
            last: Moment::UNKNOWN,
        });
        self.channels.len() - 1
    }

    /// The bus of the same source that a channel is one more wire of, and which. Where the protocol
    /// has several wires, they are known by their names, or else by their order.
    fn join(
        &mut self,
        info: &BusInfo,
        facts: WireFacts,
        heard: &[usize],
    ) -> Option<(usize, usize)> {
        let names = self.settings.protocol?.wires;
        facts.sampling?;
        let last = &self.channels[*heard.last()?];
        let (bus, before) = (last.bus, &last.info.name);
        let wires = self.channels.iter().filter(|channel| channel.bus == bus).count();
        if wires >= names.len() {
            return None;
        }
        let place = |name: &str| names.iter().position(|known| known.eq_ignore_ascii_case(name));
        let is_before = place(&info.name).zip(place(before)).is_some_and(|(own, it)| own < it);
        let wire = if is_before { wires - 1 } else { wires };
        self.buses[bus].add_wire(wire);
        let moved = self.channels.iter_mut().filter(|it| it.bus == bus && it.wire >= wire);
        moved.for_each(|channel| channel.wire += 1);
        Some((bus, wire))
    }

    /// Tells every bus that nothing more will come.
    pub fn finish(&mut self, consumer: &mut dyn Consumer) {
        for (bus, end) in self.buses.iter_mut().zip(&self.ends) {
            bus.finish(*end, &mut Output::new(&mut self.last_number, &mut *consumer));
            consumer.end(bus.info(), *end);
        }
    }
}
