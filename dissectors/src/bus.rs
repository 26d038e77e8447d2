//! One bus: from what a tap hears to records, whatever is spoken on it.
//!
//! What must be known first and was not given (rate, format, polarity, protocol) is found out from
//! the first characters, which are held back and then decoded; from there on it is one pass.

use crate::event::{Event, Moment};
use crate::finding::Finding;
use crate::protocol::{Conclusion, Dissector, PROTOCOLS, Protocol, Settings, Speaks};
use crate::record::{BusInfo, Output};
use crate::uart::{self, Baud, Character, Format, Parity, Wire};
use alloc::{boxed::Box, string::String, string::ToString, vec::Vec};

/// Characters that are held back at most to find out what is spoken.
const HELD_CHARACTERS: usize = 256;

/// How long characters are held back at most, in ns.
const HELD_NS: i64 = 2_000_000_000;

/// What a source says about the wire of a bus.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct WireFacts {
    /// The rate, where the source tells it.
    pub baud: Option<Baud>,
    /// The format, where the source tells it.
    pub format: Option<Format>,
    /// The source made up the times between characters: no rate can be found from them.
    pub spacing_is_assumed: bool,
    /// How line levels were sampled; `None` where the source has characters.
    pub sampling: Option<Sampling>,
}

/// The sample clock of line levels.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Sampling {
    /// Ticks of [`crate::event::Levels`] a second.
    pub ticks_per_second: u64,
    /// ± of an edge in ns: one sample, which may be longer than a tick.
    pub uncertainty: u32,
    /// The time of tick 0.
    pub origin: Moment,
}

/// What was on the wire so far, good or bad.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct LineCounts {
    /// Characters.
    pub characters: u64,
    /// Characters with a parity or framing error.
    pub damaged: u64,
    /// Characters whose parity is not known.
    pub unknown_parity: u64,
    /// Breaks.
    pub breaks: u64,
    /// Losses and overruns.
    pub losses: u64,
}

/// A bus that is being decoded.
pub struct Bus {
    info: BusInfo,
    settings: Settings,
    facts: WireFacts,
    counts: LineCounts,
    stage: Stage,
    findings: Vec<Conclusion>,
}

enum Stage {
    /// Holding back what was heard.
    Finding { held: Vec<Held>, since: Moment },
    /// Decoding.
    Decoding { wire: Wire, protocol: &'static Protocol, dissector: Box<dyn Dissector> },
}

/// One event that is held back.
enum Held {
    Character(Character),
    Break(crate::event::Break),
    Lost(crate::event::Loss),
}

impl Bus {
    /// A bus on which nothing was heard yet.
    #[must_use]
    pub fn new(info: BusInfo, facts: WireFacts, settings: Settings) -> Self {
        let mut bus = Bus {
            info,
            settings,
            facts,
            counts: LineCounts::default(),
            stage: Stage::Finding { held: Vec::new(), since: Moment::UNKNOWN },
            findings: Vec::new(),
        };
        if let (Some(protocol), true) = (bus.settings.protocol, bus.knows_its_wire()) {
            bus.decode_as(protocol, bus.given_wire(), None);
        }
        bus
    }

    /// Name and clock.
    #[must_use]
    pub fn info(&self) -> &BusInfo {
        &self.info
    }

    /// What was on the wire so far.
    #[must_use]
    pub fn counts(&self) -> LineCounts {
        self.counts
    }

    /// The protocol that is spoken, once it is known.
    #[must_use]
    pub fn protocol(&self) -> Option<&'static Protocol> {
        match &self.stage {
            Stage::Decoding { protocol, .. } => Some(protocol),
            Stage::Finding { .. } => None,
        }
    }

    /// Rate and format, once they are known.
    #[must_use]
    pub fn wire(&self) -> Wire {
        match &self.stage {
            Stage::Decoding { wire, .. } => *wire,
            Stage::Finding { .. } => self.given_wire(),
        }
    }

    /// Everything that was found out instead of being told.
    #[must_use]
    pub fn conclusions(&self) -> Vec<Conclusion> {
        let mut conclusions = self.findings.clone();
        if let Stage::Decoding { dissector, .. } = &self.stage {
            conclusions.extend(dissector.conclusions());
        }
        conclusions
    }

    /// When silence would mean something; see [`Dissector::deadline`].
    #[must_use]
    pub fn deadline(&self) -> Moment {
        match &self.stage {
            Stage::Finding { since, .. } => since.plus(HELD_NS),
            Stage::Decoding { dissector, .. } => dissector.deadline(),
        }
    }

    /// Takes the next event.
    pub fn hear(&mut self, event: Event<'_>, out: &mut Output<'_>) {
        self.count(&event);
        match &mut self.stage {
            Stage::Decoding { dissector, .. } => dissector.hear(&self.info, event, out),
            Stage::Finding { .. } => self.hold(event, out),
        }
    }

    /// The capture ended at `end`, if that is known.
    pub fn finish(&mut self, end: Moment, out: &mut Output<'_>) {
        self.find_out(out);
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

    fn hold(&mut self, event: Event<'_>, out: &mut Output<'_>) {
        let Stage::Finding { held, since } = &mut self.stage else { return };
        let mut rest: &[Character] = &[];
        let now = match event {
            Event::Characters(characters) => {
                let room = HELD_CHARACTERS.saturating_sub(held.len());
                let (fitting, beyond) = characters.split_at(room.min(characters.len()));
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
        if !held.is_empty() && !since.is_known() {
            *since = now;
        }
        let is_enough = held.len() >= HELD_CHARACTERS || now.is_after(since.plus(HELD_NS));
        if is_enough {
            self.find_out(out);
            self.pass_on(Event::Characters(rest), out);
        }
    }

    fn pass_on(&mut self, event: Event<'_>, out: &mut Output<'_>) {
        if let Stage::Decoding { dissector, .. } = &mut self.stage {
            dissector.hear(&self.info, event, out);
        }
    }

    /// Decides what is spoken from what is held, and decodes that.
    fn find_out(&mut self, out: &mut Output<'_>) {
        let Stage::Finding { held, .. } = &mut self.stage else { return };
        let held = core::mem::take(held);
        let characters: Vec<Character> = held
            .iter()
            .filter_map(|event| match event {
                Held::Character(character) => Some(*character),
                _ => None,
            })
            .collect();
        let wire = self.find_wire(&characters);
        let (protocol, note) = self.find_protocol(&characters, wire);
        self.decode_as(protocol, wire, note);
        let mut rest = held.as_slice();
        let mut characters = characters.as_slice();
        while let Some(first) = rest.first() {
            let is_character = |event: &Held| matches!(event, Held::Character(_));
            let run = rest.iter().take_while(|event| is_character(event)).count();
            match first {
                Held::Character(_) => {
                    let (now, later) = characters.split_at(run);
                    self.pass_on(Event::Characters(now), out);
                    characters = later;
                }
                Held::Break(event) => self.pass_on(Event::Break(*event), out),
                Held::Lost(loss) => self.pass_on(Event::Lost(*loss), out),
            }
            rest = &rest[run.max(1)..];
        }
    }

    fn decode_as(&mut self, protocol: &'static Protocol, wire: Wire, note: Option<Finding>) {
        let mut dissector = (protocol.dissector)(wire, &self.settings);
        if let Some(finding) = note {
            dissector.note(finding);
        }
        self.stage = Stage::Decoding { wire, protocol, dissector };
    }

    fn given_wire(&self) -> Wire {
        let line = self.settings.line;
        Wire {
            baud: line.baud.or(self.facts.baud),
            format: line.format.or(self.facts.format).unwrap_or(Format::FT12),
        }
    }

    /// Whether nothing about the wire is left to be found out.
    fn knows_its_wire(&self) -> bool {
        self.given_wire().baud.is_some()
            || self.facts.spacing_is_assumed
            || self.info.clock.is_none()
    }

    fn find_wire(&mut self, characters: &[Character]) -> Wire {
        let mut wire = self.given_wire();
        if !self.knows_its_wire() {
            let found = uart::baud_from_spacing(characters, wire.format);
            wire.baud = found.as_ref().map(|(baud, _)| *baud);
            self.findings.push(Conclusion {
                subject: "baud",
                station: None,
                value: wire.baud.map(|baud| baud.to_string()),
                evidence: found.map_or_else(
                    || String::from("no two characters came without a pause"),
                    |(_, evidence)| evidence,
                ),
            });
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
                    self.findings.push(Conclusion {
                        subject: "protocol",
                        station: None,
                        value: Some(String::from(protocol.name)),
                        evidence,
                    });
                    return (protocol, note);
                }
                Speaks::NoBut(finding) => note = note.or(Some(finding)),
                Speaks::No => {}
            }
        }
        (&uart::PROTOCOL, note)
    }
}
