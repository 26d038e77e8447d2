//! Finds out which protocol is spoken, and lets it be dissected.

use crate::bus::LineCounts;
use crate::event::{Break, Event, Loss, Moment};
use crate::finding::Finding;
use crate::protocol::{Conclusion, Dissector, PROTOCOLS, Protocol, Settings, Speaks};
use crate::record::{BusInfo, Output};
use crate::uart::{self, Character, Parity, Wire};
use alloc::{boxed::Box, string::String, string::ToString, vec::Vec};

/// Characters that are held back at most to find out what is spoken.
const HELD_CHARACTERS: usize = 256;

/// How long characters are held back at most, in ns.
const HELD_NS: i64 = 2_000_000_000;

/// From characters to records.
pub(crate) struct Decoder {
    info: BusInfo,
    settings: Settings,
    /// Times are real, so that the rate can be found from them.
    can_find_rate: bool,
    counts: LineCounts,
    stage: Stage,
    conclusions: Vec<Conclusion>,
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
    Break(Break),
    Lost(Loss),
}

impl Decoder {
    pub fn new(info: BusInfo, settings: Settings, can_find_rate: bool) -> Self {
        Decoder {
            info,
            settings,
            can_find_rate,
            counts: LineCounts::default(),
            stage: Stage::Finding { held: Vec::new(), since: Moment::UNKNOWN },
            conclusions: Vec::new(),
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

    pub fn deadline(&self) -> Moment {
        match &self.stage {
            Stage::Finding { since, .. } => since.plus(HELD_NS),
            Stage::Decoding { dissector, .. } => dissector.deadline(),
        }
    }

    /// Takes the next event of a wire that is known so far.
    pub fn hear(&mut self, wire: Wire, event: Event<'_>, out: &mut Output<'_>) {
        self.count(&event);
        if let Stage::Decoding { dissector, .. } = &mut self.stage {
            dissector.hear(&self.info, event, out);
        } else if self.settings.protocol.is_some() && !self.must_find_rate(wire) {
            self.find_out(wire, out);
            self.pass_on(event, out);
        } else {
            self.hold(wire, event, out);
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
                }
            }
            Event::Break(_) => counts.breaks += 1,
            Event::Lost(_) => counts.losses += 1,
            Event::Levels(_) | Event::Advance(_) => {}
        }
    }

    fn hold(&mut self, wire: Wire, event: Event<'_>, out: &mut Output<'_>) {
        let Stage::Finding { held, since } = &mut self.stage else { return };
        let mut rest: &[Character] = &[];
        let now = match event {
            Event::Characters(characters) => {
                if !since.is_known() {
                    *since = characters.first().map_or(Moment::UNKNOWN, |first| first.start);
                }
                // What comes later tells nothing, be it in the same batch or not.
                let limit = since.plus(HELD_NS);
                let is_in_time = |character: &&Character| !character.start.is_after(limit);
                let room = HELD_CHARACTERS.saturating_sub(held.len());
                let fitting = characters.iter().take(room).take_while(is_in_time).count();
                let (fitting, beyond) = characters.split_at(fitting);
                held.extend(fitting.iter().copied().map(Held::Character));
                rest = beyond;
                characters.last().map_or(Moment::UNKNOWN, |last| last.start)
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
            Event::Levels(_) => return,
        };
        let is_long = since.is_known() && now.is_after(since.plus(HELD_NS));
        if held.len() >= HELD_CHARACTERS || is_long {
            self.find_out(wire, out);
            self.pass_on(Event::Characters(rest), out);
        }
    }

    fn pass_on(&mut self, event: Event<'_>, out: &mut Output<'_>) {
        if let Stage::Decoding { dissector, .. } = &mut self.stage {
            dissector.hear(&self.info, event, out);
        }
    }

    /// Decides what is spoken from what is held, and decodes that.
    fn find_out(&mut self, wire: Wire, out: &mut Output<'_>) {
        let Stage::Finding { held, .. } = &mut self.stage else { return };
        let held = core::mem::take(held);
        let characters: Vec<Character> = held
            .iter()
            .filter_map(|event| match event {
                Held::Character(character) => Some(*character),
                _ => None,
            })
            .collect();
        let wire = self.find_rate(wire, &characters);
        let (protocol, note) = self.find_protocol(&characters, wire);
        let mut dissector = (protocol.dissector)(wire, &self.settings);
        for finding in self.notes.drain(..).chain(note) {
            dissector.note(finding);
        }
        self.stage = Stage::Decoding { wire, protocol, dissector };
        self.replay(&held, &characters, out);
    }

    fn replay(&mut self, held: &[Held], mut characters: &[Character], out: &mut Output<'_>) {
        for run in held.chunk_by(|a, b| matches!((a, b), (Held::Character(_), Held::Character(_))))
        {
            match run[0] {
                Held::Character(_) => {
                    let (now, later) = characters.split_at(run.len());
                    self.pass_on(Event::Characters(now), out);
                    characters = later;
                }
                Held::Break(event) => self.pass_on(Event::Break(event), out),
                Held::Lost(loss) => self.pass_on(Event::Lost(loss), out),
            }
        }
    }

    fn must_find_rate(&self, wire: Wire) -> bool {
        wire.baud().is_none() && self.can_find_rate
    }

    fn find_rate(&mut self, mut wire: Wire, characters: &[Character]) -> Wire {
        if self.must_find_rate(wire) {
            let found = uart::baud_from_spacing(characters, wire.format());
            wire = Wire::new(found.as_ref().map(|(baud, _)| *baud), wire.format());
            let evidence = match found {
                Some((_, evidence)) => evidence,
                None => String::from("no two characters came without a pause"),
            };
            let value = wire.baud().map(|baud| baud.to_string());
            self.conclusions.push(Conclusion { subject: "baud", station: None, value, evidence });
        }
        wire
    }

    fn find_protocol(
        &mut self,
        characters: &[Character],
        wire: Wire,
    ) -> (&'static Protocol, Option<Finding>) {
        if let Some(protocol) = self.settings.protocol {
            return (protocol, None);
        }
        let mut note = None;
        for protocol in PROTOCOLS {
            match (protocol.speaks)(&self.info, characters, wire, &self.settings) {
                Speaks::Yes(evidence) => {
                    let value = Some(String::from(protocol.name));
                    let subject = "protocol";
                    self.conclusions.push(Conclusion { subject, station: None, value, evidence });
                    return (protocol, note);
                }
                Speaks::NoBut(finding) => note = note.or(Some(finding)),
                Speaks::No => {}
            }
        }
        (&uart::PROTOCOL, note)
    }
}
