//! Finds out which protocol is spoken, and lets it be dissected.

use crate::bus::LineCounts;
use crate::can::{self, Frame, FrameKind, Load, RateSearch};
use crate::event::{Break, Event, Loss, Moment};
use crate::finding::Finding;
use crate::interbus::{self, line::Crc};
use crate::measure::Measurement;
use crate::protocol::{
    Beginning, Conclusion, Dissector, Medium, PROTOCOLS, Protocol, Settings, Speaks,
};
use crate::record::{BusInfo, Output};
use crate::uart::{self, Baud, Character, Parity, Wire};
use alloc::{boxed::Box, format, string::String, string::ToString, vec::Vec};

/// Characters or frames that are held back at most to find out what is spoken.
const HELD: usize = 256;

/// How long they are held back at most, in ns.
const HELD_NS: i64 = 2_000_000_000;

/// What a conclusion about the rate of frames is about.
const BITRATE: &str = "bitrate";

/// From characters or frames to records.
pub(crate) struct Decoder {
    info: BusInfo,
    settings: Settings,
    /// What the source says that the bus carries.
    told: Option<Medium>,
    /// Times are real, so that the rate can be found from them.
    can_find_rate: bool,
    counts: LineCounts,
    stage: Stage,
    conclusions: Vec<Conclusion>,
    /// Goes on looking for the bit rate, where the beginning did not tell it.
    search: Option<RateSearch>,
    /// Findings about the bus, for a dissector that is not there yet.
    notes: Vec<Finding>,
}

enum Stage {
    /// Holding back what was heard, since then.
    Finding { held: Vec<Held>, since: Moment },
    /// Decoding.
    Decoding { wire: Wire, protocol: &'static Protocol, dissector: Box<dyn Dissector> },
}

/// One event that is held back.
enum Held {
    Character(Character),
    Frame(Frame),
    Break(Break),
    Lost(Loss),
}

impl Decoder {
    pub fn new(
        info: BusInfo,
        settings: Settings,
        can_find_rate: bool,
        told: Option<Medium>,
    ) -> Self {
        Decoder {
            info,
            settings,
            told,
            can_find_rate,
            counts: LineCounts::default(),
            stage: Stage::Finding { held: Vec::new(), since: Moment::UNKNOWN },
            conclusions: Vec::new(),
            search: None,
            notes: Vec::new(),
        }
    }

    /// Takes a finding about the bus as a whole, to be told at the end.
    pub fn note(&mut self, finding: Finding) {
        match &mut self.stage {
            Stage::Decoding { dissector, .. } => dissector.note(finding),
            Stage::Finding { .. } => self.notes.push(finding),
        }
    }

    pub fn info(&self) -> &BusInfo {
        &self.info
    }

    pub fn counts(&self) -> LineCounts {
        self.counts
    }

    pub fn protocol(&self) -> Option<&'static Protocol> {
        match &self.stage {
            Stage::Decoding { protocol, .. } => Some(protocol),
            Stage::Finding { .. } => None,
        }
    }

    pub fn wire(&self) -> Option<Wire> {
        match &self.stage {
            Stage::Decoding { wire, .. } => Some(*wire),
            Stage::Finding { .. } => None,
        }
    }

    pub fn conclusions(&self) -> Vec<Conclusion> {
        let mut conclusions = self.conclusions.clone();
        if let Stage::Decoding { dissector, .. } = &self.stage {
            conclusions.extend(dissector.conclusions());
        }
        conclusions
    }

    /// How busy the bus was, where frames tell.
    pub fn load(&self) -> Option<Load> {
        match &self.stage {
            Stage::Decoding { dissector, .. } => dissector.load(),
            Stage::Finding { .. } => None,
        }
    }

    /// What was measured of each station besides response times.
    pub fn measurements(&self) -> Vec<Measurement> {
        match &self.stage {
            Stage::Decoding { dissector, .. } => dissector.measurements(),
            Stage::Finding { .. } => Vec::new(),
        }
    }

    pub fn deadline(&self) -> Moment {
        match &self.stage {
            Stage::Finding { since, .. } => since.plus(HELD_NS),
            Stage::Decoding { dissector, .. } => dissector.deadline(),
        }
    }

    /// Takes the next event of a wire that is known so far.
    pub fn hear(&mut self, wire: Wire, event: Event<'_>, out: &mut Output<'_>) {
        self.count(&event);
        match self.stage {
            Stage::Finding { .. } => self.hold(wire, event, out),
            Stage::Decoding { .. } => self.go_on(event, out),
        }
    }

    pub fn finish(&mut self, wire: Wire, end: Moment, out: &mut Output<'_>) {
        self.find_out(wire, out);
        if let Stage::Decoding { dissector, .. } = &mut self.stage {
            dissector.finish(&self.info, end, out);
        }
    }

    fn count(&mut self, event: &Event<'_>) {
        let counts = &mut self.counts;
        match event {
            Event::Characters(characters) => {
                counts.characters += characters.len() as u64;
                for character in *characters {
                    counts.damaged += u64::from(character.is_damaged());
                    counts.unknown_parity += u64::from(character.parity() == Parity::Unknown);
                    counts.suspect_parity += u64::from(character.parity() == Parity::Suspect);
                }
            }
            Event::Frames(frames) => {
                counts.frames += frames.len() as u64;
                let is_error = |frame: &&Frame| frame.kind == FrameKind::Error;
                counts.error_frames += frames.iter().filter(is_error).count() as u64;
            }
            Event::Rows(rows) => counts.rows += rows.len() as u64,
            Event::Cycle(cycle) => {
                counts.cycles += 1;
                let is_bad = matches!(cycle.crc(), Crc::Bad { .. }) || cycle.is_damaged();
                counts.bad_cycles += u64::from(is_bad);
            }
            Event::Break(_) => counts.breaks += 1,
            Event::Lost(loss) => {
                counts.lose(loss.cause);
            }
            Event::Levels(_) | Event::Advance(_) | Event::Silence(_) => {}
        }
    }

    fn hold(&mut self, mut wire: Wire, event: Event<'_>, out: &mut Output<'_>) {
        if let (Event::Frames(_), Some(rate)) = (event, self.settings.can.bitrate) {
            wire = Wire::new(Some(rate), wire.format());
        }
        if let Event::Rows(_) | Event::Cycle(_) | Event::Silence(_) = event {
            // Words are of one protocol alone: there is nothing to find out.
            self.told = Some(Medium::Words);
            self.find_out(wire, out);
            return self.pass_on(event, out);
        }
        let Stage::Finding { held, since } = &mut self.stage else { return };
        let mut rest = None;
        let now = match event {
            Event::Characters(characters) => {
                begin(since, characters.first().map(|first| first.start));
                let starts = characters.iter().map(|character| character.start);
                let (fitting, beyond) = characters.split_at(in_time(starts, held.len(), *since));
                held.extend(fitting.iter().copied().map(Held::Character));
                rest = Some(Event::Characters(beyond));
                characters.last().map_or(Moment::UNKNOWN, |last| last.start)
            }
            Event::Frames(frames) => {
                begin(since, frames.first().map(|first| first.start));
                let starts = frames.iter().map(|frame| frame.start);
                let (fitting, beyond) = frames.split_at(in_time(starts, held.len(), *since));
                held.extend(fitting.iter().copied().map(Held::Frame));
                rest = Some(Event::Frames(beyond));
                frames.last().map_or(Moment::UNKNOWN, |last| last.start)
            }
            Event::Break(event) => {
                held.push(Held::Break(event));
                event.start
            }
            Event::Lost(loss) => {
                held.push(Held::Lost(loss));
                loss.start
            }
            Event::Advance(now) => now,
            Event::Levels(_) | Event::Rows(_) | Event::Cycle(_) | Event::Silence(_) => return,
        };
        let is_long = since.is_known() && now.is_after(since.plus(HELD_NS));
        let is_full = held.len() >= HELD;
        let is_told = self.settings.protocol.is_some() && !self.must_find_rate(wire);
        // What does not fit ends the holding, even where time then runs backwards.
        let has_rest = match rest {
            Some(Event::Characters(rest)) => !rest.is_empty(),
            Some(Event::Frames(rest)) => !rest.is_empty(),
            _ => false,
        };
        if is_full || is_long || has_rest || (is_told && rest.is_some()) {
            self.find_out(wire, out);
            if let Some(rest) = rest {
                self.go_on(rest, out);
            }
        }
    }

    /// Takes what comes after the beginning.
    fn go_on(&mut self, event: Event<'_>, out: &mut Output<'_>) {
        match event {
            Event::Frames(frames) if self.search.is_some() => self.search_rate(frames, out),
            event => self.pass_on(event, out),
        }
    }

    /// Looks for the bit rate in every so many frames, however they come.
    fn search_rate(&mut self, mut frames: &[Frame], out: &mut Output<'_>) {
        while let Some(search) = self.search.as_mut().filter(|_| !frames.is_empty()) {
            let (block, rest) = frames.split_at(search.take(frames));
            let found = search.find();
            self.search.take_if(|search| search.is_over());
            self.pass_on(Event::Frames(block), out);
            if let Some((baud, evidence)) = found {
                self.learn_rate(baud, evidence);
            }
            frames = rest;
        }
        if !frames.is_empty() {
            self.pass_on(Event::Frames(frames), out);
        }
    }

    /// The tap was set to another bit rate.
    pub fn set_bitrate(&mut self, before: Wire, rate: Option<Baud>, out: &mut Output<'_>) {
        if self.settings.can.bitrate.is_some() {
            return;
        }
        if let Stage::Finding { held, .. } = &self.stage {
            if held.is_empty() {
                return;
            }
            self.find_out(before, out);
        }
        let Stage::Decoding { wire, dissector, .. } = &mut self.stage else { return };
        let old = core::mem::replace(wire, Wire::new(rate, wire.format()));
        dissector.learn_rate(*wire);
        let wire = *wire;
        self.search = self.must_find_rate(wire).then(RateSearch::default);
        self.conclusions.retain(|conclusion| conclusion.subject != BITRATE);
        let evidence = match old.baud() {
            Some(old) => format!("the tap was set to another one on the way; {old} before"),
            None => String::from("the tap was set to it on the way"),
        };
        let value = rate.map(|rate| rate.to_string());
        self.conclusions.push(Conclusion { subject: BITRATE, station: None, value, evidence });
    }

    fn learn_rate(&mut self, baud: Baud, evidence: String) {
        self.search = None;
        let Stage::Decoding { wire, dissector, .. } = &mut self.stage else { return };
        *wire = Wire::new(Some(baud), wire.format());
        dissector.learn_rate(*wire);
        self.conclusions.retain(|conclusion| conclusion.subject != BITRATE);
        let before = self.counts.frames_without_rate;
        let evidence = format!("{evidence}, among the {before} so far");
        let value = Some(baud.to_string());
        self.conclusions.push(Conclusion { subject: BITRATE, station: None, value, evidence });
    }

    fn pass_on(&mut self, event: Event<'_>, out: &mut Output<'_>) {
        if let Stage::Decoding { wire, dissector, .. } = &mut self.stage {
            if let Event::Frames(frames) = event
                && wire.baud().is_none()
            {
                self.counts.frames_without_rate += frames.len() as u64;
            }
            dissector.hear(&self.info, event, out);
        }
    }

    /// Decides what is spoken from what is held, and decodes that.
    fn find_out(&mut self, wire: Wire, out: &mut Output<'_>) {
        let Stage::Finding { held, .. } = &mut self.stage else { return };
        let held = core::mem::take(held);
        let characters: Vec<Character> = held.iter().filter_map(Held::character).collect();
        let frames: Vec<Frame> = held.iter().filter_map(Held::frame).collect();
        let wire = self.find_rate(wire, &characters, &frames);
        let (protocol, note) = self.find_protocol(&characters, &frames, wire);
        let mut dissector = (protocol.dissector)(wire, &self.settings);
        for finding in self.notes.drain(..).chain(note) {
            dissector.note(finding);
        }
        self.stage = Stage::Decoding { wire, protocol, dissector };
        let is_open = protocol.medium == Medium::Can && self.must_find_rate(wire);
        self.search = is_open.then(RateSearch::default);
        for held in &held {
            self.pass_on(held.event(), out);
        }
    }

    fn must_find_rate(&self, wire: Wire) -> bool {
        let has_rate = self.told != Some(Medium::Words);
        has_rate && wire.baud().is_none() && self.can_find_rate
    }

    fn find_rate(&mut self, mut wire: Wire, characters: &[Character], frames: &[Frame]) -> Wire {
        if !frames.is_empty() {
            wire = Wire::new(self.settings.can.bitrate.or(wire.baud()), wire.format());
        }
        if self.must_find_rate(wire) {
            let found = if frames.is_empty() {
                uart::baud_from_spacing(characters, wire.format())
            } else {
                can::bitrate_from_spacing(frames)
            };
            wire = Wire::new(found.as_ref().map(|(baud, _)| *baud), wire.format());
            let evidence = match found {
                Some((_, evidence)) => evidence,
                None => String::from("nothing came without a pause"),
            };
            let value = wire.baud().map(|baud| baud.to_string());
            let subject = if frames.is_empty() { "baud" } else { BITRATE };
            self.conclusions.push(Conclusion { subject, station: None, value, evidence });
        }
        wire
    }

    fn find_protocol(
        &mut self,
        characters: &[Character],
        frames: &[Frame],
        wire: Wire,
    ) -> (&'static Protocol, Option<Finding>) {
        let given = self.settings.protocol.map(|protocol| protocol.medium);
        let given = self.told.or(given).unwrap_or(Medium::Serial);
        let medium = match (frames, characters) {
            _ if self.told == Some(Medium::Words) => Medium::Words,
            ([], []) => given,
            ([], _) => Medium::Serial,
            _ => Medium::Can,
        };
        if let Some(protocol) = self.settings.protocol.filter(|given| given.medium == medium) {
            return (protocol, None);
        }
        let beginning =
            Beginning { bus: &self.info, wire, characters, frames, settings: &self.settings };
        let mut note = None;
        for protocol in PROTOCOLS.into_iter().filter(|protocol| protocol.medium == medium) {
            match (protocol.speaks)(&beginning) {
                Speaks::Yes(evidence) => {
                    let value = Some(String::from(protocol.name));
                    let subject = "protocol";
                    // Silence speaks for nothing. Words are not held.
                    if medium == Medium::Words || !characters.is_empty() || !frames.is_empty() {
                        let station = None;
                        self.conclusions.push(Conclusion { subject, station, value, evidence });
                    }
                    return (protocol, note);
                }
                Speaks::NoBut(finding) => note = note.or(Some(finding)),
                Speaks::No => {}
            }
        }
        match medium {
            Medium::Serial => (&uart::PROTOCOL, note),
            Medium::Can => (&can::PROTOCOL, note),
            Medium::Words => (&interbus::PROTOCOL, note),
        }
    }
}

fn begin(since: &mut Moment, first: Option<Moment>) {
    if !since.is_known() {
        *since = first.unwrap_or(Moment::UNKNOWN);
    }
}

/// How many of what starts then are held: what comes later tells nothing, be it in the same batch
/// or not.
fn in_time(starts: impl Iterator<Item = Moment>, held: usize, since: Moment) -> usize {
    let limit = since.plus(HELD_NS);
    starts.take(HELD.saturating_sub(held)).take_while(|start| !start.is_after(limit)).count()
}

impl Held {
    fn character(&self) -> Option<Character> {
        if let Held::Character(character) = self { Some(*character) } else { None }
    }

    fn frame(&self) -> Option<Frame> {
        if let Held::Frame(frame) = self { Some(*frame) } else { None }
    }

    fn event(&self) -> Event<'_> {
        match self {
            Held::Character(character) => Event::Characters(core::slice::from_ref(character)),
            Held::Frame(frame) => Event::Frames(core::slice::from_ref(frame)),
            Held::Break(event) => Event::Break(*event),
            Held::Lost(loss) => Event::Lost(*loss),
        }
    }
}
