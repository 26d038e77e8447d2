//! Value change dumps, `.vcd`, also sigrok's with times and values on one line.

use super::{Input, MOST_CHANNELS, Piece, Place, Source, SourceError, SourceOptions, frequency};
use dissectors::bus::{Sampling, WireFacts};
use dissectors::event::{Clock, Event, Levels, Loss, LossCause, Moment};
use dissectors::record::BusInfo;
use std::collections::VecDeque;
use std::io::{self, BufRead, BufReader, Read};
use vcd::{Command, IdCode, Parser, Value};

/// Edges of a channel that are handed over at once.
const BATCH: usize = 4096;

/// Bytes a single command may have: beyond that it has no end.
const LONGEST_COMMAND: u64 = 1 << 20;

/// Whether a source begins as a dump does: with a keyword of its header.
pub fn is_dump(head: &[u8]) -> bool {
    let start = head.trim_ascii_start();
    let keywords = ["$date", "$version", "$timescale", "$comment", "$scope", "$var"];
    keywords.iter().any(|keyword| start.starts_with(keyword.as_bytes()))
}

/// A dump that is being read.
pub struct Vcd {
    name: String,
    parser: Parser<Bounded<BufReader<Input>>>,
    sampling: Sampling,
    wires: Vec<Wire>,
    now: u64,
    announced: usize,
    queue: VecDeque<Todo>,
    /// The wire whose edges were handed over last: they are done with.
    told: Option<usize>,
    /// What ended the dump, once everything before it was told.
    end: Option<Result<(), SourceError>>,
}

/// What is to be told of a wire, before anything more is read.
#[derive(Clone, Copy)]
enum Todo {
    Announce(usize),
    Levels(usize),
    Lost(usize),
    End(usize),
}

/// One line of the dump.
struct Wire {
    id: IdCode,
    name: String,
    bus: Option<usize>,
    /// Unknown before its first value, and while it is `x` or `z`.
    level: Option<bool>,
    /// The level before the first edge that was not told yet.
    level_before: bool,
    /// From where on it is known.
    from: u64,
    edges: Vec<u64>,
}

impl Vcd {
    /// Reads the header of a dump.
    ///
    /// # Errors
    /// The header is damaged, or a channel that is not there was asked for.
    pub fn new(input: Input, options: &SourceOptions) -> Result<Vcd, SourceError> {
        let name = input.name.clone();
        let reader = Bounded { reader: BufReader::with_capacity(256 * 1024, input), left: 0 };
        let mut parser = Parser::new(reader);
        let (mut rate, mut samplerate, mut wires) = (None, None, Vec::new());
        loop {
            parser.reader().left = LONGEST_COMMAND;
            let cut = || Err(io::ErrorKind::UnexpectedEof.into());
            match parser.next().unwrap_or_else(cut) {
                Err(error) => return Err(failed(&name, parser.line(), &error)),
                Ok(Command::Enddefinitions) => break,
                Ok(Command::Timescale(count, unit)) => {
                    rate = unit.divisor().checked_div(u64::from(count));
                }
                Ok(Command::Comment(text)) => samplerate = samplerate.or(acquisition_rate(&text)),
                Ok(Command::VarDef(_, 1, id, name, index)) => {
                    let name = index.map_or(name.clone(), |index| format!("{name}{index}"));
                    // So many that it is refused, and not one more.
                    if wires.len() <= MOST_CHANNELS {
                        wires.push(Wire::new(id, name));
                    }
                }
                Ok(_) => {}
            }
        }
        let place = Place::Line(parser.line());
        let rate = rate.filter(|rate| *rate > 0).ok_or_else(|| {
            let what = "the dump has no usable $timescale, so its times mean nothing";
            SourceError::new(&name, place, what)
        })?;
        let wires = options
            .chosen_lines(wires, |wire: &Wire| &wire.name)
            .map_err(|what| SourceError::new(&name, place, what))?;
        let sample = options.samplerate.or(samplerate).unwrap_or(rate);
        Ok(Vcd {
            name,
            parser,
            sampling: Sampling {
                ticks_per_second: rate,
                uncertainty: u32::try_from(1_000_000_000_u64.div_ceil(sample)).unwrap_or(u32::MAX),
                origin: Moment::from_ns(0),
            },
            wires,
            now: 0,
            announced: 0,
            queue: VecDeque::new(),
            told: None,
            end: None,
        })
    }

    /// Reads until something is to be told, or to the end.
    fn read(&mut self) {
        while self.queue.is_empty() && self.end.is_none() {
            self.parser.reader().left = LONGEST_COMMAND;
            match self.parser.next() {
                None => self.finish(Ok(())),
                Some(Err(error)) => {
                    let error = failed(&self.name, self.parser.line(), &error);
                    self.finish(Err(error));
                }
                Some(Ok(Command::Timestamp(time))) if time < self.now => {
                    let what = "time runs backwards, which a dump does not allow";
                    let place = Place::Line(self.parser.line());
                    self.finish(Err(SourceError::new(&self.name, place, what)));
                }
                Some(Ok(Command::Timestamp(time))) => self.now = time,
                Some(Ok(Command::ChangeScalar(id, value))) => self.change(id, value),
                Some(Ok(Command::ChangeVector(id, values))) => {
                    if let (Some(value), 1) = (values.get(0), values.len()) {
                        self.change(id, value);
                    }
                }
                Some(Ok(_)) => {}
            }
        }
    }

    fn change(&mut self, id: IdCode, value: Value) {
        let now = self.now;
        let level = match value {
            Value::V0 => Some(false),
            Value::V1 => Some(true),
            Value::X | Value::Z => None,
        };
        let mut is_full = false;
        for (index, wire) in self.wires.iter_mut().enumerate().filter(|(_, wire)| wire.id == id) {
            match (wire.level, level) {
                (Some(before), Some(after)) if before != after => {
                    wire.edges.push(now);
                    is_full |= wire.edges.len() >= BATCH;
                }
                (Some(_), None) if wire.bus.is_some() || !wire.edges.is_empty() => {
                    if wire.bus.is_none() {
                        self.queue.push_back(Todo::Announce(index));
                    }
                    self.queue.extend([Todo::Levels(index), Todo::Lost(index)]);
                }
                (None, Some(after)) => {
                    wire.level_before = after;
                    wire.from = now;
                }
                _ => {}
            }
            wire.level = level;
        }
        if is_full {
            self.tell_all();
        }
    }

    /// Has the levels of every wire told that has any.
    fn tell_all(&mut self) {
        for (index, wire) in self.wires.iter().enumerate() {
            if wire.bus.is_none() && !wire.edges.is_empty() {
                self.queue.push_back(Todo::Announce(index));
            }
            if wire.bus.is_some() || !wire.edges.is_empty() {
                self.queue.push_back(Todo::Levels(index));
            }
        }
    }

    fn finish(&mut self, result: Result<(), SourceError>) {
        self.tell_all();
        if result.is_ok() {
            let heard = |wire: &Wire| wire.bus.is_some() || !wire.edges.is_empty();
            let ends = self.wires.iter().enumerate().filter(|(_, wire)| heard(wire));
            self.queue.extend(ends.map(|(index, _)| Todo::End(index)));
        }
        self.end = Some(result);
    }

    /// Forgets the edges that were handed over.
    fn drop_told(&mut self) {
        if let Some(wire) = self.told.take().and_then(|told| self.wires.get_mut(told)) {
            if wire.edges.len() % 2 == 1 {
                wire.level_before = !wire.level_before;
            }
            wire.edges.clear();
            wire.from = self.now;
        }
    }
}

impl Source for Vcd {
    fn next_piece(&mut self) -> Result<Option<Piece<'_>>, SourceError> {
        self.drop_told();
        self.read();
        let Some(todo) = self.queue.pop_front() else {
            return self.end.take().unwrap_or(Ok(())).map(|()| None);
        };
        let now = self.sampling.moment(self.now);
        let bus_of = |wire: &Wire| wire.bus.unwrap_or_default();
        Ok(Some(match todo {
            Todo::Announce(index) => {
                self.wires[index].bus = Some(self.announced);
                self.announced += 1;
                let name = self.wires[index].name.clone();
                let info = BusInfo::new(name, Some(Clock::Sample));
                let facts = WireFacts { sampling: Some(self.sampling), ..WireFacts::default() };
                Piece::Bus(info, facts)
            }
            Todo::Levels(index) => {
                self.told = Some(index);
                let wire = &self.wires[index];
                let (edges, level, from) = (&wire.edges[..], wire.level_before, wire.from);
                let levels = Levels { edges, level, from, until: self.now };
                Piece::Heard(bus_of(wire), Event::Levels(levels))
            }
            Todo::Lost(index) => {
                let loss = Loss { start: now, count: None, cause: LossCause::Capture };
                Piece::Heard(bus_of(&self.wires[index]), Event::Lost(loss))
            }
            Todo::End(index) => Piece::End(bus_of(&self.wires[index]), now),
        }))
    }
}

impl Wire {
    fn new(id: IdCode, name: String) -> Wire {
        Wire { id, name, bus: None, level: None, level_before: true, from: 0, edges: Vec::new() }
    }
}

/// The sample rate in sigrok's comment: `Acquisition with 1/8 channels at 4 MHz`.
fn acquisition_rate(comment: &str) -> Option<u64> {
    frequency(comment.rsplit_once(" at ")?.1)
}

fn failed(name: &str, line: u64, error: &io::Error) -> SourceError {
    let what = match error.kind() {
        io::ErrorKind::UnexpectedEof => "the dump is cut here".to_owned(),
        _ => error.to_string(),
    };
    SourceError::new(name, Place::Line(line), what)
}

/// A reader that gives up when a single command takes more than it is allowed to.
struct Bounded<R> {
    reader: R,
    left: u64,
}

impl<R: Read> Read for Bounded<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.left == 0 {
            return Err(io::Error::other("a command has no end: this is not a value change dump"));
        }
        let allowed = usize::try_from(self.left).unwrap_or(usize::MAX).min(buffer.len());
        let count = self.reader.read(&mut buffer[..allowed])?;
        self.left -= count as u64;
        Ok(count)
    }
}

impl<R: BufRead> BufRead for Bounded<R> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        self.reader.fill_buf()
    }

    fn consume(&mut self, count: usize) {
        self.left = self.left.saturating_sub(count as u64);
        self.reader.consume(count);
    }
}
