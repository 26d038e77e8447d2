//! Between a reader that goes from item to item and those who take piece after piece.
//!
//! One item of a capture (a packet, a row) may have several things to say. The reader of a format
//! puts them in an outbox, which keeps its memory from item to item, and everything found before an
//! error is handed over before the error.

use super::{Piece, Source, SourceError};
use dissectors::bus::WireFacts;
use dissectors::can::Frame;
use dissectors::event::{Break, Event, Levels, Loss, Moment};
use dissectors::interbus::Row;
use dissectors::record::BusInfo;
use dissectors::uart::{Baud, Character};
use std::collections::VecDeque;
use std::ops::Range;

/// Things to say after which a reader that could go on hands over first.
const FULL: usize = 1024;

/// Reads a format, one item after the other.
pub trait Reader {
    /// Reads the next item, or as many as are at hand until the outbox is full, and puts what it says in the outbox. False at the end of the source.
    ///
    /// # Errors
    /// The source cannot go on. What is in the outbox is good.
    fn read_on(&mut self, out: &mut Outbox) -> Result<bool, SourceError>;
}

/// A source that is read item by item.
pub struct Reading<R> {
    reader: R,
    out: Outbox,
    is_over: bool,
}

impl<R: Reader> Reading<R> {
    /// Nothing was read yet.
    pub fn new(reader: R) -> Self {
        Reading { reader, out: Outbox::default(), is_over: false }
    }
}

impl<R: Reader> Source for Reading<R> {
    fn next_piece(&mut self) -> Result<Option<Piece<'_>>, SourceError> {
        while self.out.waiting.is_empty() && !self.is_over {
            self.out.forget();
            match self.reader.read_on(&mut self.out) {
                Ok(has_more) => self.is_over = !has_more,
                Err(error) => {
                    self.is_over = true;
                    self.out.waiting.push_back(Waiting::Error(error));
                }
            }
        }
        self.out.next().transpose()
    }
}

/// What was found and is not yet handed over.
#[derive(Default)]
pub struct Outbox {
    waiting: VecDeque<Waiting>,
    characters: Vec<Character>,
    frames: Vec<Frame>,
    rows: Vec<Row>,
    edges: Vec<u64>,
    text: String,
}

enum Waiting {
    Bus(BusInfo, WireFacts),
    Characters(usize, Range<usize>),
    Frames(usize, Range<usize>),
    Rows(usize, Range<usize>),
    Levels { bus: usize, edges: Range<usize>, level: bool, from: u64, until: u64 },
    Break(usize, Break),
    Lost(usize, Loss),
    Bitrate(usize, Option<Baud>),
    Silence(usize, Moment),
    Comment(usize, Moment, Range<usize>),
    Warning(SourceError),
    Note(Range<usize>),
    End(usize, Moment),
    Error(SourceError),
}

impl Outbox {
    /// A bus appears.
    pub fn bus(&mut self, info: BusInfo, facts: WireFacts) {
        self.waiting.push_back(Waiting::Bus(info, facts));
    }

    /// Characters were heard.
    pub fn characters(&mut self, bus: usize, characters: impl IntoIterator<Item = Character>) {
        let first = self.characters.len();
        self.characters.extend(characters);
        if self.characters.len() > first {
            self.waiting.push_back(Waiting::Characters(bus, first..self.characters.len()));
        }
    }

    /// Characters were heard. They are handed over together with those that wait before them.
    fn more_characters(&mut self, bus: usize, characters: &[Character]) {
        match self.waiting.back_mut() {
            Some(Waiting::Characters(last, range)) if *last == bus && range.len() < FULL => {
                self.characters.extend_from_slice(characters);
                range.end = self.characters.len();
            }
            _ => self.characters(bus, characters.iter().copied()),
        }
    }

    /// A frame was heard. Those that follow each other on a bus are handed over together.
    pub fn frame(&mut self, bus: usize, frame: Frame) {
        let first = self.frames.len();
        self.frames.push(frame);
        match self.waiting.back_mut() {
            Some(Waiting::Frames(last, range)) if *last == bus => range.end = first + 1,
            _ => self.waiting.push_back(Waiting::Frames(bus, first..first + 1)),
        }
    }

    /// A row was logged. Those that follow each other on a bus are handed over together.
    pub fn row(&mut self, bus: usize, row: Row) {
        let first = self.rows.len();
        self.rows.push(row);
        match self.waiting.back_mut() {
            Some(Waiting::Rows(last, range)) if *last == bus => range.end = first + 1,
            _ => self.waiting.push_back(Waiting::Rows(bus, first..first + 1)),
        }
    }

    /// Whether there is so much in it that it is to be handed over first.
    pub fn is_full(&self) -> bool {
        let items = [self.frames.len(), self.rows.len(), self.characters.len(), self.edges.len()];
        items.into_iter().chain([self.waiting.len()]).any(|count| count >= FULL)
    }

    /// Line levels were heard.
    pub fn levels(&mut self, bus: usize, levels: Levels<'_>) {
        let Levels { edges, level, from, until } = levels;
        let first = self.edges.len();
        self.edges.extend_from_slice(edges);
        let edges = first..self.edges.len();
        self.waiting.push_back(Waiting::Levels { bus, edges, level, from, until });
    }

    /// Nothing more was heard until this time. Who is told of a silence that goes on is told of its
    /// end.
    pub fn silence(&mut self, bus: usize, until: Moment) {
        match self.waiting.back_mut() {
            Some(Waiting::Silence(last, before)) if *last == bus => *before = until,
            _ => self.waiting.push_back(Waiting::Silence(bus, until)),
        }
    }

    /// The source cannot go on.
    pub fn error(&mut self, error: SourceError) {
        self.waiting.push_back(Waiting::Error(error));
    }

    /// Whether everything was handed over.
    pub fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    /// A break was heard.
    pub fn line_break(&mut self, bus: usize, event: Break) {
        self.waiting.push_back(Waiting::Break(bus, event));
    }

    /// Something was lost.
    pub fn lost(&mut self, bus: usize, loss: Loss) {
        self.waiting.push_back(Waiting::Lost(bus, loss));
    }

    /// The frames of a bus come at another bit rate from here on, or at one that is not known.
    pub fn bitrate(&mut self, bus: usize, rate: Option<Baud>) {
        self.waiting.push_back(Waiting::Bitrate(bus, rate));
    }

    /// Somebody commented on what was heard at this time.
    pub fn comment(&mut self, bus: usize, at: Moment, text: &str) {
        let text = self.keep(text);
        self.waiting.push_back(Waiting::Comment(bus, at, text));
    }

    /// Something about the source that the user may want to know.
    pub fn note(&mut self, text: &str) {
        let text = self.keep(text);
        self.waiting.push_back(Waiting::Note(text));
    }

    fn keep(&mut self, text: &str) -> Range<usize> {
        let first = self.text.len();
        self.text.push_str(text);
        first..self.text.len()
    }

    /// Something about the source that the user should know.
    pub fn warning(&mut self, warning: SourceError) {
        self.waiting.push_back(Waiting::Warning(warning));
    }

    /// The capture of a bus ends.
    pub fn end(&mut self, bus: usize, at: Moment) {
        self.waiting.push_back(Waiting::End(bus, at));
    }

    /// The characters that were put in and not forgotten.
    pub fn heard(&self) -> &[Character] {
        &self.characters
    }

    /// Whether a bus appears in it.
    pub fn has_bus(&self) -> bool {
        self.waiting.iter().any(|waiting| matches!(waiting, Waiting::Bus(..)))
    }

    /// Breaks that wait to be handed over.
    pub fn breaks(&self) -> usize {
        self.waiting.iter().filter(|waiting| matches!(waiting, Waiting::Break(..))).count()
    }

    /// What another source said.
    pub fn pass_on(&mut self, piece: Piece<'_>) {
        match piece {
            Piece::Bus(info, facts) => self.bus(info, facts),
            Piece::Heard(bus, event) => self.hear(bus, event),
            Piece::Bitrate(bus, rate) => self.bitrate(bus, rate),
            Piece::Comment(bus, at, text) => self.comment(bus, at, text),
            Piece::End(bus, at) => self.end(bus, at),
            Piece::Warning(warning) => self.warning(warning),
            Piece::Note(line) => self.note(line),
        }
    }

    /// Everything that another outbox holds. It takes no more room than what was heard.
    pub fn absorb(&mut self, mut other: Outbox) {
        while let Some(said) = other.next() {
            match said {
                Ok(Piece::Heard(bus, Event::Characters(characters))) => {
                    self.more_characters(bus, characters);
                }
                Ok(piece) => self.pass_on(piece),
                Err(error) => self.error(error),
            }
        }
    }

    /// How much waits in it.
    pub fn len(&self) -> usize {
        self.characters.len() + self.frames.len() + self.rows.len() + self.waiting.len()
    }

    /// What was heard, whatever it is.
    pub fn hear(&mut self, bus: usize, event: Event<'_>) {
        match event {
            Event::Characters(characters) => self.characters(bus, characters.iter().copied()),
            Event::Frames(frames) => frames.iter().for_each(|frame| self.frame(bus, *frame)),
            Event::Rows(rows) => rows.iter().for_each(|row| self.row(bus, *row)),
            Event::Levels(levels) => self.levels(bus, levels),
            Event::Break(event) => self.line_break(bus, event),
            Event::Lost(loss) => self.lost(bus, loss),
            Event::Advance(until) => self.silence(bus, until),
            // What lines carry is made of levels behind the sources.
            Event::Cycle(_) | Event::Silence(_) => {}
        }
    }

    /// Empties it for what is heard next. What was not handed over is gone.
    pub fn forget(&mut self) {
        self.waiting.clear();
        self.characters.clear();
        self.frames.clear();
        self.rows.clear();
        self.edges.clear();
        self.text.clear();
    }

    /// The next piece, or the error that ended the source.
    pub fn next(&mut self) -> Option<Result<Piece<'_>, SourceError>> {
        Some(Ok(match self.waiting.pop_front()? {
            Waiting::Bus(info, facts) => Piece::Bus(info, facts),
            Waiting::Characters(bus, range) => {
                Piece::Heard(bus, Event::Characters(&self.characters[range]))
            }
            Waiting::Rows(bus, range) => Piece::Heard(bus, Event::Rows(&self.rows[range])),
            Waiting::Frames(bus, range) => Piece::Heard(bus, Event::Frames(&self.frames[range])),
            Waiting::Levels { bus, edges, level, from, until } => {
                let edges = &self.edges[edges];
                Piece::Heard(bus, Event::Levels(Levels { edges, level, from, until }))
            }
            Waiting::Break(bus, event) => Piece::Heard(bus, Event::Break(event)),
            Waiting::Lost(bus, loss) => Piece::Heard(bus, Event::Lost(loss)),
            Waiting::Bitrate(bus, rate) => Piece::Bitrate(bus, rate),
            Waiting::Silence(bus, until) => Piece::Heard(bus, Event::Advance(until)),
            Waiting::Comment(bus, at, range) => Piece::Comment(bus, at, &self.text[range]),
            Waiting::Warning(warning) => Piece::Warning(warning),
            Waiting::Note(range) => Piece::Note(&self.text[range]),
            Waiting::End(bus, at) => Piece::End(bus, at),
            Waiting::Error(error) => return Some(Err(error)),
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dissectors::uart::Parity;

    #[test]
    fn an_idle_bus_fills_nothing_and_characters_count_once() {
        let mut behind = Outbox::default();
        let turn = |hear: &dyn Fn(&mut Outbox)| {
            let mut heard = Outbox::default();
            hear(&mut heard);
            heard
        };
        for n in 0..1_000_000 {
            behind.absorb(turn(&|out| out.silence(0, Moment::from_ns(n))));
        }
        assert_eq!(behind.len(), 1);
        for n in 0..1000 {
            let character = Character::new(Moment::from_ns(n), 0, 0x55, Parity::Ok);
            behind.absorb(turn(&|out| out.characters(0, [character])));
        }
        // What was heard, and the two things to be said of it.
        assert_eq!(behind.len(), 1000 + 2);
        let Some(Ok(Piece::Heard(0, Event::Advance(until)))) = behind.next() else {
            panic!("the silence comes first")
        };
        assert_eq!(until.ns(), Some(999_999));
    }

    #[test]
    fn what_is_heard_on_one_bus_is_not_put_together_with_another() {
        let mut out = Outbox::default();
        for bus in [0, 1] {
            out.silence(bus, Moment::from_ns(1));
        }
        for bus in [0, 1] {
            out.characters(bus, [Character::new(Moment::from_ns(2), 0, 0x55, Parity::Ok)]);
        }
        let mut said = Vec::new();
        while let Some(Ok(Piece::Heard(bus, event))) = out.next() {
            said.push((bus, matches!(event, Event::Characters([_]))));
        }
        assert_eq!(said, [(0, false), (1, false), (0, true), (1, true)]);
    }
}
