//! The line in front of a bus whose source has levels: what it carries, and from levels to that.
//!
//! A line may have several wires, if the protocol has: these go side by side.

use crate::bus::Sampling;
use crate::can;
use crate::edges::Edges;
use crate::event::{Event, Levels};
use crate::finding::Finding;
use crate::interbus::line::{self as ring, Verdict};
use crate::protocol::{Conclusion, Medium, Settings};
use crate::setting::Setting;
use crate::uart::{self, LineSettings, Wire};
use alloc::{boxed::Box, vec::Vec};

/// Edges that are held back at most while they may be the beginning of a ring's cycles.
const MOST_HELD: usize = 1 << 16;

/// Who listens to what comes off a line.
pub(crate) trait Listener {
    /// Takes what was heard on a wire of that rate and format.
    fn hear(&mut self, wire: Wire, event: Event<'_>);

    /// Takes what is wrong with the settings that were given.
    fn note(&mut self, finding: Finding);
}

/// From levels to characters or frames.
pub(crate) enum Line {
    /// There are no levels: the source has characters or frames.
    None,
    /// Not known yet: levels are held back until frames speak for themselves, or do not.
    Open { held: Edges, sampling: Sampling, given: LineSettings, profile: Box<ring::Profile> },
    /// A line that carries characters.
    Serial(Box<uart::Line>),
    /// A line that carries frames.
    Can(can::Line),
    /// A line that carries cycles of words.
    Words(Box<ring::Line>),
}

impl Line {
    /// A line on which nothing was heard yet. What a protocol or a rate was given for is what it
    /// carries.
    pub fn new(sampling: Option<Sampling>, settings: &Settings) -> Self {
        let Some(sampling) = sampling else { return Line::None };
        let given = settings.line;
        let is_serial = given.baud.is_some() || given.format.is_some();
        match settings.protocol.map(|protocol| protocol.medium) {
            Some(Medium::Serial) => Line::Serial(Box::new(uart::Line::new(sampling, given))),
            Some(Medium::Can) => Line::Can(can::Line::new(sampling, settings.can, given.inverted)),
            Some(Medium::Words) => {
                let mut profile = settings.interbus.line.clone();
                let rate = given.baud.or(settings.can.bitrate).map(uart::Baud::get);
                profile.bitrate = profile.bitrate.or(rate);
                Line::Words(Box::new(ring::Line::new(sampling, profile, given.inverted)))
            }
            None if settings.can.bitrate.is_some() => {
                Line::Can(can::Line::new(sampling, settings.can, given.inverted))
            }
            None if is_serial => Line::Serial(Box::new(uart::Line::new(sampling, given))),
            None => {
                let profile = Box::new(settings.interbus.line.clone());
                Line::Open { held: Edges::default(), sampling, given, profile }
            }
        }
    }

    /// Rate and format, once they are known.
    pub fn wire(&self) -> Option<Wire> {
        match self {
            Line::None | Line::Open { .. } => None,
            Line::Serial(line) => line.wire(),
            Line::Can(line) => line.wire(),
            Line::Words(line) => line.wire(),
        }
    }

    /// Whether the line is upside down.
    pub fn is_inverted(&self) -> bool {
        match self {
            Line::None | Line::Open { .. } => false,
            Line::Serial(line) => line.is_inverted(),
            Line::Can(line) => line.is_inverted(),
            Line::Words(line) => line.is_inverted(),
        }
    }

    /// Pulses too short for a bit so far.
    pub fn glitches(&self) -> u64 {
        match self {
            Line::None | Line::Open { .. } | Line::Words(_) => 0,
            Line::Serial(line) => line.glitches(),
            Line::Can(line) => line.glitches(),
        }
    }

    /// Level changes that nothing could be made of: the line carries something else.
    pub fn strange(&self) -> u64 {
        match self {
            Line::Words(line) => line.strange(),
            Line::None | Line::Open { .. } | Line::Serial(_) | Line::Can(_) => 0,
        }
    }

    /// What was found out, with the evidence.
    pub fn conclusions(&self) -> Vec<Conclusion> {
        match self {
            Line::None | Line::Open { .. } => Vec::new(),
            Line::Serial(line) => line.conclusions().to_vec(),
            Line::Can(line) => line.conclusions().to_vec(),
            Line::Words(line) => line.conclusions(),
        }
    }

    /// What the protocol leaves open about its line, with the answers.
    pub fn settings(&self) -> Vec<Setting> {
        match self {
            Line::Words(line) => line.settings(),
            _ => Vec::new(),
        }
    }

    /// It has another wire of this number.
    pub fn add_wire(&mut self, number: usize) {
        if let Line::Words(line) = self {
            line.add_wire(number);
        }
    }

    /// Takes the next piece of a wire.
    pub fn hear(&mut self, wire: usize, levels: &Levels<'_>, listener: &mut impl Listener) {
        match self {
            Line::None => {}
            Line::Serial(line) => {
                line.hear(levels, &mut |wire, event| listener.hear(wire, event));
                line.take_doubt().into_iter().for_each(|finding| listener.note(finding));
            }
            Line::Can(line) => line.hear(levels, listener),
            Line::Words(line) => line.hear(wire, levels, listener),
            Line::Open { held, sampling, .. } => {
                held.add(levels);
                if held.is_enough(sampling.ticks_per_second) {
                    self.decide(false, listener);
                }
            }
        }
    }

    /// The line is not heard any further, or not for a while.
    pub fn end(&mut self, listener: &mut impl Listener) {
        if let Line::Open { held, .. } = self
            && !held.ticks.is_empty()
        {
            self.decide(true, listener);
        }
        match self {
            Line::None | Line::Open { .. } => {}
            Line::Serial(line) => {
                line.end(&mut |wire, event| listener.hear(wire, event));
                line.take_doubt().into_iter().for_each(|finding| listener.note(finding));
            }
            Line::Can(line) => line.end(listener),
            Line::Words(line) => line.end(listener),
        }
    }

    /// Another capture of the same line begins, after [`Line::end`]. Its ticks are counted anew.
    pub fn go_on(&mut self, next: Sampling) {
        match self {
            Line::None => {}
            Line::Open { sampling, .. } => *sampling = next,
            Line::Serial(line) => line.go_on(next),
            Line::Can(line) => line.go_on(next),
            Line::Words(line) => line.go_on(next),
        }
    }

    /// Decides what the line carries, and passes on what was held back. While a ring is idle there
    /// are no cycles to know it by: more is held, unless this is the end.
    fn decide(&mut self, is_end: bool, listener: &mut impl Listener) {
        let Line::Open { held, sampling, given, profile } = self else { return };
        let (sampling, given) = (*sampling, *given);
        let is_can = can::line::is_can(held, sampling, given.inverted);
        let verdict = match is_can {
            true => Verdict::No,
            false => ring::recognize(held, sampling, given.inverted),
        };
        let is_bounded = held.ticks.len() < MOST_HELD && !held.is_long(sampling.ticks_per_second);
        if verdict == Verdict::Perhaps && is_bounded && !is_end {
            return;
        }
        let held = core::mem::take(held);
        let profile = core::mem::take(&mut **profile);
        *self = match verdict {
            _ if is_can => {
                Line::Can(can::Line::new(sampling, can::Settings::default(), given.inverted))
            }
            Verdict::Yes => {
                Line::Words(Box::new(ring::Line::new(sampling, profile, given.inverted)))
            }
            Verdict::Perhaps | Verdict::No => {
                Line::Serial(Box::new(uart::Line::new(sampling, given)))
            }
        };
        self.hear(0, &held.levels(), listener);
    }
}
