//! pcapng: what Wireshark reads, our sentences and findings as comments.

mod blocks;
mod can;
mod serial;

pub use blocks::{BlockWriter, Carries, Extras, Interface, clock_of, runs, unsupported};
pub use serial::marks_for;

use super::Export;
use dissectors::event::{Loss, Moment};
use dissectors::protocol::Medium;
use dissectors::record::{BusInfo, Heard, Record, Sink};
use dissectors::uart::{Character, Parity, ParityMarks};
use serial::check;
use std::collections::{BTreeMap, VecDeque};
use std::io::{self, Write};

/// Comments that may wait for a record on their bus.
const MOST_KEPT: usize = 1024;

/// Writes records as pcapng.
pub struct PcapNg<W: Write> {
    writer: BlockWriter<W>,
    buses: Vec<Bus>,
    /// Comments of others by bus: the time of what they are about, and the text.
    kept: BTreeMap<String, VecDeque<(Moment, String)>>,
    result: io::Result<()>,
}

/// One bus in the file.
struct Bus {
    name: String,
    interface: u32,
    last: Moment,
    /// Comments of events, for the next block.
    pending: Vec<String>,
    /// Frames lost before the next block; `u64::MAX` where nobody counted them.
    dropped: u64,
}

impl<W: Write> PcapNg<W> {
    /// Begins a file.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn new(out: W) -> io::Result<Self> {
        let (buses, kept) = (Vec::new(), BTreeMap::new());
        Ok(PcapNg { writer: BlockWriter::new(out)?, buses, kept, result: Ok(()) })
    }

    fn write(&mut self, record: &Record<'_>) -> io::Result<()> {
        let bus = match self.bus_named(&record.bus.name) {
            Some(bus) => bus,
            None => self.begin_bus(record)?,
        };
        let interface = self.buses[bus].interface;
        let mut comments = comments(record);
        match record.heard {
            // Of words there is not even an interface.
            Heard::Nothing | Heard::Row(_) | Heard::Cycle(_) => {
                self.buses[bus].pending.extend(comments);
            }
            Heard::Characters(characters) => {
                check(characters, record.bus)?;
                for run in runs(characters, record.wire, i64::MAX) {
                    let last = run.last().map_or(Moment::UNKNOWN, |character| character.start);
                    let extras = self.extras(bus, last, std::mem::take(&mut comments));
                    self.writer.characters(interface, run, extras)?;
                }
            }
            Heard::Frame(frame) => {
                let extras = self.extras(bus, frame.start, comments);
                self.writer.frame(interface, frame, extras)?;
            }
            Heard::Break(event) => {
                let extras = self.extras(bus, event.start, comments);
                self.writer.line_break(interface, event, extras)?;
            }
            Heard::Lost(loss) if record.protocol.medium == Medium::Can && loss.cause.is_gap() => {
                // No frame follows at once that could tell of it.
                let at = &mut self.buses[bus];
                let start = if loss.start.is_known() { loss.start } else { at.last };
                comments.append(&mut at.pending);
                self.writer.lost_frames(interface, Loss { start, ..loss }, comments)?;
            }
            Heard::Lost(loss) if record.protocol.medium == Medium::Can => {
                let at = &mut self.buses[bus];
                at.dropped = at.dropped.saturating_add(loss.count.unwrap_or(u64::MAX));
                at.pending.extend(comments);
            }
            Heard::Lost(loss) => {
                let extras = self.extras(bus, loss.start, comments);
                self.writer.lost_characters(interface, loss, extras.comments)?;
            }
        }
        Ok(())
    }

    /// What is told with a block of a bus whose last character or frame began at `last`.
    fn extras(&mut self, bus: usize, last: Moment, mut comments: Vec<String>) -> Extras {
        let at = &mut self.buses[bus];
        at.last = last;
        comments.append(&mut at.pending);
        let kept = self.kept.get_mut(&at.name).into_iter().flat_map(|kept| {
            std::iter::from_fn(|| kept.pop_front_if(|(time, _)| !time.is_after(last)))
        });
        comments.extend(kept.map(|(_, text)| text));
        let lost = Some(std::mem::take(&mut at.dropped)).filter(|count| *count > 0);
        Extras { comments, lost }
    }

    fn bus_named(&self, name: &str) -> Option<usize> {
        self.buses.iter().position(|bus| bus.name == name)
    }

    fn begin_bus(&mut self, record: &Record<'_>) -> io::Result<usize> {
        let (bus, wire, medium) = (record.bus, record.wire, record.protocol.medium);
        let timeless = BusInfo { clock: None, ..bus.clone() };
        let clock = clock_of(if record.start.is_known() { bus } else { &timeless }, medium)?;
        let carries = match medium {
            Medium::Can => Carries::Frames,
            _ => Carries::Characters {
                parity: marks(record),
                format: Some(wire.format()),
                has_all_stamps: false,
            },
        };
        let (uncertainty, baud) = (record.uncertainty, wire.baud());
        let interface =
            self.writer.interface(&Interface { bus, clock, uncertainty, baud, carries })?;
        let (name, last, pending) = (bus.name.clone(), record.start, Vec::new());
        self.buses.push(Bus { name, interface, last, pending, dropped: 0 });
        Ok(self.buses.len() - 1)
    }

    fn write_end(&mut self, bus: usize, end: Moment) -> io::Result<()> {
        let at = &mut self.buses[bus];
        let end = if end.is_known() { end } else { at.last };
        let kept = self.kept.remove(&at.name).into_iter().flatten().map(|(_, text)| text);
        let comments = at.pending.drain(..).chain(kept).collect();
        let lost = Some(at.dropped).filter(|count| (1..u64::MAX).contains(count));
        self.writer.end(at.interface, end, Some(end), Extras { comments, lost })
    }
}

/// What is known of the parity of all characters, as the first ones tell.
fn marks(record: &Record<'_>) -> ParityMarks {
    match record.characters().first().map(Character::parity) {
        Some(Parity::None) => ParityMarks::None,
        _ => record.bus.parity,
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
        if let (Some(bus), Ok(())) = (self.bus_named(&bus.name), &self.result) {
            self.result = self.write_end(bus, end);
        }
    }

    fn status(&mut self) -> io::Result<()> {
        std::mem::replace(&mut self.result, Ok(()))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer.out().flush()
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
