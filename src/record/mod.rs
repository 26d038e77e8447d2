//! Recording: what a tap hears goes to disk as it was heard.
//!
//! The tap's own thread stamps and hands over. Here it is composed into blocks of pcapng and written,
//! and nothing else is in the path. With triggers, a thread behind decodes a copy and says what is
//! worth keeping. A third one sees to it that nothing waits for long.

mod composer;
mod failure;
mod files;
mod flight;
mod names;
mod ring;
mod shelf;
mod steady;
mod summary;
#[cfg(test)]
mod tests;
mod trigger;

pub use files::{Files, WriteError};
pub use flight::Surroundings;
pub use names::is_name_of_recording;
pub use ring::{Ring, span};
pub use summary::{Summary, undecoded};
pub use trigger::{Trigger, Watch, Watcher};

use crate::source::{Piece, SourceOptions};
use composer::{Bus, Chunk, Composer, Edge};
use dissectors::event::Event;
use flight::Flight;
use std::io;
use std::path::Path;
use trigger::Told;

/// Why a recording ends before its source does.
#[derive(Debug)]
pub enum RecordError {
    /// A file cannot be written.
    Write(WriteError),
    /// What was heard cannot be recorded.
    Unfit(io::Error),
}

impl From<WriteError> for RecordError {
    fn from(error: WriteError) -> Self {
        RecordError::Write(error)
    }
}

impl From<io::Error> for RecordError {
    fn from(error: io::Error) -> Self {
        RecordError::Unfit(error)
    }
}

/// A recording.
pub struct Recorder {
    composer: Composer,
    files: Files,
    events: Option<Events>,
}

/// What a flight recorder has besides.
struct Events {
    watch: Watch,
    flight: Flight,
    count: u64,
}

impl Recorder {
    /// A recording into these files: of everything, or of what surrounds the events that a watch
    /// finds.
    ///
    /// # Errors
    /// Never: nothing is written yet.
    pub fn new(
        options: &SourceOptions,
        files: Files,
        events: Option<(Watch, Surroundings)>,
    ) -> Result<Self, RecordError> {
        let events =
            events.map(|(watch, kept)| Events { watch, flight: Flight::new(kept), count: 0 });
        Ok(Recorder { composer: Composer::new(options)?, files, events })
    }

    /// Another source begins.
    pub fn begin_source(&mut self) {
        self.composer.begin_source();
        if let Some(events) = &mut self.events {
            events.watch.begin_source();
        }
    }

    /// Takes a piece of the source.
    ///
    /// # Errors
    /// It cannot be recorded, or written.
    pub fn take(&mut self, piece: &Piece<'_>) -> Result<(), RecordError> {
        match piece {
            Piece::Bus(info, facts) => self.composer.bus(info.clone(), *facts),
            Piece::Heard(bus, event) => self.composer.hear(*bus, *event)?,
            Piece::Bitrate(bus, rate) => self.composer.set_bitrate(*bus, *rate)?,
            Piece::Comment(bus, _, text) => self.composer.comment(*bus, text),
            Piece::End(bus, at) => self.composer.end(*bus, *at),
            Piece::Warning(_) | Piece::Note(_) => return Ok(()),
        }
        self.keep()?;
        if let Some(events) = &mut self.events {
            let mut copy = events.watch.outbox();
            match piece {
                Piece::Bus(info, facts) => {
                    events.watch.add_bus();
                    copy.bus(info.clone(), *facts);
                }
                Piece::Heard(bus, event) => copy.hear(*bus, *event),
                Piece::Bitrate(bus, rate) => copy.bitrate(*bus, *rate),
                Piece::End(bus, at) => copy.end(*bus, *at),
                Piece::Comment(..) | Piece::Warning(_) | Piece::Note(_) => return Ok(()),
            }
            events.watch.decode(copy, self.composer.stamp());
        }
        self.heed()?;
        // Silence ends files, too.
        let reach = self.composer.reach();
        if self.events.is_none()
            && matches!(piece, Piece::Heard(_, Event::Advance(_)))
            && self.files.is_full_for(reach, 0)
        {
            self.finish_file()?;
        }
        Ok(())
    }

    /// Keeps what was composed: in the file, or for the event that may come.
    fn keep(&mut self) -> Result<(), RecordError> {
        let composed = self.composer.take_composed();
        let kept = composed
            .chunks
            .iter()
            .try_for_each(|chunk| self.keep_chunk(chunk, composed.bytes(chunk)));
        self.composer.give_back(composed);
        Ok(kept?)
    }

    fn keep_chunk(&mut self, chunk: &Chunk, bytes: &[u8]) -> Result<(), WriteError> {
        let Recorder { composer, files, events } = self;
        let (heads, mut edges) = composer.heads_and_edges();
        if let Some(events) = events {
            events.flight.hold(chunk, bytes);
            return events.flight.write(heads, &mut edges, files);
        }
        if files.is_full_for(chunk.from, bytes.len()) {
            files.finish(&edges(Edge::End(chunk.from)))?;
        }
        files.write(chunk.from, chunk.stamp, bytes, heads)
    }

    /// Heeds what the watch has to say.
    fn heed(&mut self) -> Result<(), RecordError> {
        while let Some(told) = self.events.as_mut().and_then(|events| events.watch.told()) {
            self.heed_one(told)?;
        }
        Ok(())
    }

    fn heed_one(&mut self, told: Told) -> Result<(), RecordError> {
        let Some(events) = &mut self.events else { return Ok(()) };
        let (Told::Event(stamp) | Told::Decoded(stamp)) = told;
        let at = self.composer.time_of(stamp);
        let at = if at.is_known() { at } else { self.composer.reach() };
        let (heads, mut edges) = self.composer.heads_and_edges();
        match told {
            Told::Event(_) => {
                events.count += 1;
                events.flight.event(at, heads, &mut edges, &mut self.files)?;
            }
            Told::Decoded(_) => events.flight.decoded(at, &mut edges, &mut self.files)?,
        }
        Ok(())
    }

    /// Sees to it that nothing waits for long. To be called several times a second.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn attend(&mut self) -> Result<(), RecordError> {
        self.composer.settle_all()?;
        self.keep()?;
        self.heed()?;
        Ok(self.files.attend()?)
    }

    /// Ends the recording, and waits until its files are on the disk. Returns what the watch has
    /// seen, if there was one.
    ///
    /// # Errors
    /// The last file cannot be finished, or one does not get to the disk.
    pub fn finish(&mut self) -> Result<Option<Watcher>, RecordError> {
        let watcher = self.finish_files();
        let settled = self.files.settle();
        let watcher = watcher?;
        settled?;
        Ok(watcher)
    }

    fn finish_files(&mut self) -> Result<Option<Watcher>, RecordError> {
        self.composer.settle_all()?;
        self.keep()?;
        let Some(events) = &mut self.events else {
            if !self.files.is_open() && self.files.finished == 0 {
                // Nothing was heard, and this is what the file says. Where there was no bus to listen
                // to, such as a port that is not there, it has nothing to say.
                self.composer.describe_silent()?;
                let (begin, stamp) = (self.composer.reach(), self.composer.stamp());
                let (heads, _) = self.composer.heads_and_edges();
                if heads.len() > 1 {
                    self.files.write(begin, stamp, &[], heads)?;
                }
            }
            self.finish_file()?;
            return Ok(None);
        };
        let (told, watcher) = events.watch.finish();
        told.into_iter().try_for_each(|told| self.heed_one(told))?;
        if let Some(events) = &mut self.events {
            let (_, mut edges) = self.composer.heads_and_edges();
            events.flight.finish(&mut edges, &mut self.files)?;
        }
        Ok(watcher)
    }

    fn finish_file(&mut self) -> Result<(), RecordError> {
        let ends = self.composer.ends(None);
        Ok(self.files.finish(&ends)?)
    }

    /// The buses that appeared so far.
    pub fn buses(&self) -> &[Bus] {
        self.composer.buses()
    }

    /// The files.
    pub fn files(&self) -> &Files {
        &self.files
    }

    /// How many events there were; `None` where nobody looks for any.
    pub fn events(&self) -> Option<u64> {
        self.events.as_ref().map(|events| events.count)
    }

    /// Whether some of what `--before` asks for had to be let go.
    pub fn is_short(&self) -> bool {
        self.events.as_ref().is_some_and(|events| events.flight.is_short)
    }

    /// Where the files are.
    pub fn directory(&self) -> &Path {
        self.files.directory()
    }
}
