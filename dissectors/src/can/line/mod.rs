//! A CAN line: finds out how it is set up, then receives its frames.

mod body;
mod clock;
mod find;
mod parser;
mod receiver;

use super::Settings;
use crate::bus::Sampling;
use crate::edges::Edges;
use crate::event::{Event, Levels};
use crate::line::Listener;
use crate::protocol::Conclusion;
use crate::uart::{Baud, Format, Wire};
use alloc::{boxed::Box, string::String, string::ToString, vec::Vec};
use find::{Found, Given, doubt, find};
use receiver::Receiver;

/// The rate to go on with where none was found: that of most DeviceNet lines.
const USUAL_RATE: u32 = 125_000;

/// Whether the first edges of a line can be nothing but frames.
pub(crate) fn is_can(edges: &Edges, sampling: Sampling, inverted: Option<bool>) -> bool {
    let given = Given { bitrate: None, inverted };
    let beginning = edges.beginning(sampling.ticks_per_second);
    find(&beginning, sampling, given).is_some_and(|found| found.is_overwhelming())
}

/// One line of a logic capture that carries frames.
#[derive(Debug)]
pub(crate) struct Line {
    sampling: Sampling,
    given: Given,
    stage: Stage,
    conclusions: Vec<Conclusion>,
    is_inverted: bool,
    /// Pulses too short for a bit in captures before this one.
    past_glitches: u64,
}

#[derive(Debug)]
enum Stage {
    Finding(Edges),
    Receiving { receiver: Box<Receiver>, wire: Wire, bit: f64 },
}

impl Line {
    /// A line on which nothing was heard yet. What is given is not found out, but the length of a
    /// bit is always measured.
    #[must_use]
    pub fn new(sampling: Sampling, settings: Settings, inverted: Option<bool>) -> Self {
        Line {
            sampling,
            given: Given { bitrate: settings.bitrate, inverted },
            stage: Stage::Finding(Edges::default()),
            conclusions: Vec::new(),
            is_inverted: inverted.unwrap_or(false),
            past_glitches: 0,
        }
    }

    /// The rate, once it is known.
    #[must_use]
    pub fn wire(&self) -> Option<Wire> {
        match &self.stage {
            Stage::Receiving { wire, .. } => Some(*wire),
            Stage::Finding(_) => None,
        }
    }

    /// Whether the line is dominant when it is high.
    #[must_use]
    pub fn is_inverted(&self) -> bool {
        self.is_inverted
    }

    /// Pulses too short for a bit so far: dropped.
    #[must_use]
    pub fn glitches(&self) -> u64 {
        match &self.stage {
            Stage::Receiving { receiver, .. } => self.past_glitches + receiver.glitches(),
            Stage::Finding(_) => self.past_glitches,
        }
    }

    /// What was found out, with the evidence.
    #[must_use]
    pub fn conclusions(&self) -> &[Conclusion] {
        &self.conclusions
    }

    /// Takes the next piece of line. Doubts about what was given are told before the first frame.
    pub fn hear(&mut self, levels: &Levels<'_>, listener: &mut impl Listener) {
        match &mut self.stage {
            Stage::Receiving { receiver, wire, .. } => {
                receiver.hear(levels);
                pass_on(receiver, *wire, listener);
            }
            Stage::Finding(held) => {
                held.add(levels);
                if held.is_enough(self.sampling.ticks_per_second) {
                    self.find_out(listener);
                }
            }
        }
    }

    /// The line is not heard any further, or not for a while.
    pub fn end(&mut self, listener: &mut impl Listener) {
        if let Stage::Finding(held) = &self.stage
            && !held.ticks.is_empty()
        {
            self.find_out(listener);
        }
        if let Stage::Receiving { receiver, .. } = &mut self.stage {
            receiver.end();
        }
    }

    /// Another capture of the same line begins, after [`Line::end`]: what was found out holds on.
    pub fn go_on(&mut self, sampling: Sampling) {
        self.past_glitches = self.glitches();
        if let Stage::Receiving { receiver, bit, .. } = &mut self.stage {
            *bit *= sampling.ticks_per_second as f64 / self.sampling.ticks_per_second as f64;
            **receiver = Receiver::new(*bit, self.is_inverted, sampling);
        }
        self.sampling = sampling;
    }

    fn find_out(&mut self, listener: &mut impl Listener) {
        let Stage::Finding(held) = &mut self.stage else { return };
        let held = core::mem::take(held);
        let beginning = held.beginning(self.sampling.ticks_per_second);
        let found = find(&beginning, self.sampling, self.given);
        if self.given != (Given { bitrate: None, inverted: None }) {
            let doubt = doubt(&beginning, self.sampling, self.given, found.as_ref());
            doubt.into_iter().for_each(|finding| listener.note(finding));
        }
        self.conclude(found.as_ref());
        let wire = self.given.bitrate.or(found.map(|found| found.bitrate));
        let Some(bitrate) = wire.or(Baud::new(USUAL_RATE)) else { return };
        let nominal = self.sampling.ticks_per_second as f64 / f64::from(bitrate.get());
        let bit = found.map_or(nominal, |found| found.bit);
        let mut receiver = Receiver::new(bit, self.is_inverted, self.sampling);
        let wire = Wire::new(Some(bitrate), Format::FT12);
        receiver.hear(&held.levels());
        pass_on(&mut receiver, wire, listener);
        self.stage = Stage::Receiving { receiver: Box::new(receiver), wire, bit };
    }

    fn conclude(&mut self, found: Option<&Found>) {
        let evidence = match found {
            Some(found) => found.evidence(),
            None => String::from("no setting gives frames with a good checksum"),
        };
        let inverted = self.given.inverted.or(found.map(|found| found.is_inverted));
        self.is_inverted = inverted.unwrap_or(false);
        let word = |inverted| if inverted { "yes" } else { "no" };
        let subjects = [
            ("bitrate", self.given.bitrate.is_none(), found.map(|f| f.bitrate.to_string())),
            ("invert", self.given.inverted.is_none(), inverted.map(|i| String::from(word(i)))),
        ];
        for (subject, is_open, value) in subjects {
            if is_open {
                let evidence = evidence.clone();
                self.conclusions.push(Conclusion { subject, station: None, value, evidence });
            }
        }
    }
}

fn pass_on(receiver: &mut Receiver, wire: Wire, listener: &mut impl Listener) {
    if !receiver.frames.is_empty() {
        listener.hear(wire, Event::Frames(&receiver.frames));
        receiver.frames.clear();
    }
}
