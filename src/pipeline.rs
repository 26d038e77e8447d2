//! From a source, over the buses it hears, to records.

use crate::source::{Piece, Source, SourceError};
use dissectors::bus::Bus;
use dissectors::event::Moment;
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

/// The buses of a run. Several sources go through it one after the other as one stream.
pub struct Pipeline {
    settings: Settings,
    buses: Vec<Bus>,
    /// Where the capture of each bus ended.
    ends: Vec<Moment>,
    last_number: u64,
}

impl Pipeline {
    /// A run in which nothing was heard yet.
    pub fn new(settings: Settings) -> Self {
        Pipeline { settings, buses: Vec::new(), ends: Vec::new(), last_number: 0 }
    }

    /// The buses that appeared so far.
    pub fn buses(&self) -> &[Bus] {
        &self.buses
    }

    /// How many records there were.
    pub fn records(&self) -> u64 {
        self.last_number
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

    /// Takes a piece of a source whose buses have these numbers here.
    fn take(&mut self, piece: Piece<'_>, numbers: &mut Vec<usize>, consumer: &mut dyn Consumer) {
        match piece {
            Piece::Bus(info, facts) => {
                // Two channels of one source may bear the same name.
                let is_it =
                    |(index, bus): &(usize, &Bus)| *bus.info() == info && !numbers.contains(index);
                let known = self.buses.iter().enumerate().find(is_it).map(|(index, _)| index);
                numbers.push(known.unwrap_or(self.buses.len()));
                if let Some(known) = known {
                    let mut out = Output::new(&mut self.last_number, &mut *consumer);
                    self.buses[known].go_on(facts, &mut out);
                } else {
                    self.buses.push(Bus::new(info, facts, self.settings.clone()));
                    self.ends.push(Moment::UNKNOWN);
                }
            }
            Piece::Heard(bus, event) => {
                let mut out = Output::new(&mut self.last_number, &mut *consumer);
                self.buses[numbers[bus]].hear(event, &mut out);
            }
            Piece::Comment(bus, time, text) => {
                consumer.comment(self.buses[numbers[bus]].info(), time, text);
            }
            Piece::Warning(warning) => consumer.warn(&warning),
            Piece::Note(text) => consumer.note(text),
            Piece::End(bus, end) => self.ends[numbers[bus]] = end,
        }
    }

    /// Tells every bus that nothing more will come.
    pub fn finish(&mut self, consumer: &mut dyn Consumer) {
        for (bus, end) in self.buses.iter_mut().zip(&self.ends) {
            bus.finish(*end, &mut Output::new(&mut self.last_number, &mut *consumer));
            consumer.end(bus.info(), *end);
        }
    }
}
