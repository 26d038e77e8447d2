//! The line in front of a bus whose source has levels: what it carries, and from levels to that.

use crate::bus::Sampling;
use crate::can;
use crate::edges::Edges;
use crate::event::{Event, Levels};
use crate::finding::Finding;
use crate::protocol::{Conclusion, Medium, Settings};
use crate::uart::{self, LineSettings, Wire};
use alloc::boxed::Box;

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
    Open { held: Edges, sampling: Sampling, given: LineSettings },
    /// A line that carries characters.
    Serial(Box<uart::Line>),
    /// A line that carries frames.
    Can(can::Line),
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
            // Lines of words are not read yet.
            Some(Medium::Words) => Line::None,
            None if settings.can.bitrate.is_some() => {
                Line::Can(can::Line::new(sampling, settings.can, given.inverted))
            }
            None if is_serial => Line::Serial(Box::new(uart::Line::new(sampling, given))),
            None => Line::Open { held: Edges::default(), sampling, given },
        }
    }

    /// Rate and format, once they are known.
    pub fn wire(&self) -> Option<Wire> {
        match self {
            Line::None | Line::Open { .. } => None,
            Line::Serial(line) => line.wire(),
            Line::Can(line) => line.wire(),
        }
    }

    /// Whether the line is upside down.
    pub fn is_inverted(&self) -> bool {
        match self {
            Line::None | Line::Open { .. } => false,
            Line::Serial(line) => line.is_inverted(),
            Line::Can(line) => line.is_inverted(),
        }
    }

    /// Pulses too short for a bit so far.
    pub fn glitches(&self) -> u64 {
        match self {
            Line::None | Line::Open { .. } => 0,
            Line::Serial(line) => line.glitches(),
            Line::Can(line) => line.glitches(),
        }
    }

    /// What was found out, with the evidence.
    pub fn conclusions(&self) -> &[Conclusion] {
        match self {
            Line::None | Line::Open { .. } => &[],
            Line::Serial(line) => line.conclusions(),
            Line::Can(line) => line.conclusions(),
        }
    }

    /// Takes the next piece of line.
    pub fn hear(&mut self, levels: &Levels<'_>, listener: &mut impl Listener) {
        match self {
            Line::None => {}
            Line::Serial(line) => {
                line.hear(levels, &mut |wire, event| listener.hear(wire, event));
                line.take_doubt().into_iter().for_each(|finding| listener.note(finding));
            }
            Line::Can(line) => line.hear(levels, listener),
            Line::Open { held, sampling, .. } => {
                held.add(levels);
                if held.is_enough(sampling.ticks_per_second) {
                    self.decide(listener);
                }
            }
        }
    }

    /// The line is not heard any further, or not for a while.
    pub fn end(&mut self, listener: &mut impl Listener) {
        if let Line::Open { held, .. } = self
            && !held.ticks.is_empty()
        {
            self.decide(listener);
        }
        match self {
            Line::None | Line::Open { .. } => {}
            Line::Serial(line) => {
                line.end(&mut |wire, event| listener.hear(wire, event));
                line.take_doubt().into_iter().for_each(|finding| listener.note(finding));
            }
            Line::Can(line) => line.end(listener),
        }
    }

    /// Another capture of the same line begins, after [`Line::end`]. Its ticks are counted anew.
    pub fn go_on(&mut self, next: Sampling) {
        match self {
            Line::None => {}
            Line::Open { sampling, .. } => *sampling = next,
            Line::Serial(line) => line.go_on(next),
            Line::Can(line) => line.go_on(next),
        }
    }

    /// Decides what the line carries, and passes on what was held back.
    fn decide(&mut self, listener: &mut impl Listener) {
        let Line::Open { held, sampling, given } = self else { return };
        let (held, sampling, given) = (core::mem::take(held), *sampling, *given);
        *self = if can::line::is_can(&held, sampling, given.inverted) {
            Line::Can(can::Line::new(sampling, can::Settings::default(), given.inverted))
        } else {
            Line::Serial(Box::new(uart::Line::new(sampling, given)))
        };
        self.hear(&held.levels(), listener);
    }
}
