//! A serial line: finds out how it is set up, then receives its characters.

use super::doubt::doubt;
use super::find::find;
use super::receiver::Receiver;
use super::sampler::Sampler;
use super::{Baud, Format, LineSettings, Wire};
use crate::bus::Sampling;
use crate::edges::Edges;
use crate::event::{Event, Levels};
use crate::finding::Finding;
use crate::protocol::Conclusion;
use alloc::{string::String, string::ToString, vec::Vec};

/// The rate to go on with where none was found.
const USUAL_RATE: u32 = 115_200;

/// One line of a logic capture.
#[derive(Debug)]
pub struct Line {
    sampling: Sampling,
    given: LineSettings,
    stage: Stage,
    conclusions: Vec<Conclusion>,
    is_inverted: bool,
    /// The first edges, kept to see whether they bear out what was given.
    to_check: Option<Edges>,
    doubt: Option<Finding>,
}

#[derive(Debug)]
enum Stage {
    Finding(Edges),
    Receiving { receiver: Receiver, wire: Wire },
}

impl Line {
    /// A line on which nothing was heard yet.
    #[must_use]
    pub fn new(sampling: Sampling, given: LineSettings) -> Self {
        let mut line = Line {
            sampling,
            given,
            stage: Stage::Finding(Edges::default()),
            conclusions: Vec::new(),
            is_inverted: given.inverted.unwrap_or(false),
            to_check: (given != LineSettings::default()).then(Edges::default),
            doubt: None,
        };
        if let LineSettings { baud: Some(baud), format: Some(format), inverted: Some(_) } = given {
            line.receive_as(baud, format, 0);
        }
        line
    }

    /// Rate and format, once they are known.
    #[must_use]
    pub fn wire(&self) -> Option<Wire> {
        match &self.stage {
            Stage::Receiving { wire, .. } => Some(*wire),
            Stage::Finding(_) => None,
        }
    }

    /// Whether the line is upside down.
    #[must_use]
    pub fn is_inverted(&self) -> bool {
        self.is_inverted
    }

    /// Pulses shorter than half a bit so far: dropped or outvoted.
    #[must_use]
    pub fn glitches(&self) -> u64 {
        match &self.stage {
            Stage::Receiving { receiver, .. } => receiver.glitches,
            Stage::Finding(_) => 0,
        }
    }

    /// What was found out, with the evidence.
    #[must_use]
    pub fn conclusions(&self) -> &[Conclusion] {
        &self.conclusions
    }

    /// What is wrong with the settings that were given, once it is seen. It is handed out once.
    pub fn take_doubt(&mut self) -> Option<Finding> {
        self.doubt.take()
    }

    /// Takes the next piece of line.
    pub fn hear(&mut self, levels: &Levels<'_>, emit: &mut impl FnMut(Wire, Event<'_>)) {
        if let Some(first) = &mut self.to_check {
            first.add(levels);
        }
        match &mut self.stage {
            Stage::Receiving { receiver, wire } => {
                receiver.hear(levels, &mut |event| emit(*wire, event));
            }
            Stage::Finding(held) => held.add(levels),
        }
        if let Stage::Finding(held) = &self.stage
            && held.is_enough(self.sampling.ticks_per_second)
        {
            self.find_out(false, emit);
        }
        let rate = self.sampling.ticks_per_second;
        if self.to_check.as_ref().is_some_and(|first| first.is_enough(rate)) {
            self.check();
        }
    }

    /// Holds the settings against what the line says itself.
    fn check(&mut self) {
        let (Some(wire), Some(edges)) = (self.wire(), self.to_check.take()) else { return };
        let used = LineSettings {
            baud: wire.baud(),
            format: Some(wire.format()),
            inverted: Some(self.is_inverted),
        };
        self.doubt = doubt(&edges, self.sampling.ticks_per_second, self.given, used);
    }

    /// The line is not heard any further, or not for a while.
    pub fn end(&mut self, emit: &mut impl FnMut(Wire, Event<'_>)) {
        if let Stage::Finding(held) = &self.stage {
            if held.ticks.is_empty() {
                return;
            }
            self.find_out(true, emit);
        }
        self.check();
        if let Stage::Receiving { receiver, wire } = &mut self.stage {
            receiver.end(&mut |event| emit(*wire, event));
        }
    }

    /// Another capture of the same line begins, after [`Line::end`]: what was found out holds on.
    pub fn go_on(&mut self, sampling: Sampling) {
        self.sampling = sampling;
        let glitches = self.glitches();
        if let Some((baud, format)) =
            self.wire().and_then(|wire| Some((wire.baud()?, wire.format())))
        {
            self.receive_as(baud, format, glitches);
        }
    }

    fn find_out(&mut self, is_end: bool, emit: &mut impl FnMut(Wire, Event<'_>)) {
        let Stage::Finding(held) = &mut self.stage else { return };
        let held = core::mem::take(held);
        let found = find(&held, self.sampling.ticks_per_second, self.given)
            .filter(super::find::Found::is_convincing);
        let usual = Baud::new(USUAL_RATE);
        let baud = self.given.baud.or(found.as_ref().map(|found| found.baud)).or(usual);
        let format = self.given.format.or(found.as_ref().map(|found| found.format));
        let inverted = self.given.inverted.or(found.as_ref().map(|found| found.is_inverted));
        self.is_inverted = inverted.unwrap_or(false);
        let evidence = match &found {
            Some(found) => found.evidence(),
            None => String::from("no setting gives characters with their stop bits"),
        };
        let word = |inverted| if inverted { "yes" } else { "no" };
        let subjects = [
            ("baud", self.given.baud.is_none(), found.as_ref().map(|f| f.baud.to_string())),
            ("frame", self.given.format.is_none(), found.as_ref().map(|f| f.format.to_string())),
            ("invert", self.given.inverted.is_none(), inverted.map(|i| String::from(word(i)))),
        ];
        for (subject, is_open, value) in subjects {
            if is_open {
                let evidence = evidence.clone();
                self.conclusions.push(Conclusion { subject, station: None, value, evidence });
            }
        }
        if let Some(baud) = baud {
            self.receive_as(baud, format.unwrap_or(Format::FT12), 0);
        }
        if let Stage::Receiving { receiver, wire } = &mut self.stage {
            receiver.take(held);
            receiver.receive(is_end, &mut |event| emit(*wire, event));
        }
    }

    fn receive_as(&mut self, baud: Baud, format: Format, glitches: u64) {
        let bit = self.sampling.ticks_per_second as f64 / f64::from(baud.get());
        let sampler = Sampler::new(bit, format);
        let mut receiver = Receiver::new(sampler, format, self.is_inverted, self.sampling);
        receiver.glitches = glitches;
        self.stage = Stage::Receiving { receiver, wire: Wire::new(Some(baud), format) };
    }
}
