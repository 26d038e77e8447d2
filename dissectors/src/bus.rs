//! One bus: from what a tap hears to records, whatever is spoken on it.
//!
//! What must be known first and was not given is found out from the first characters, which are
//! held back and then decoded; from there on it is one pass. Rate, format and polarity of a line
//! are found by [`uart::Line`], the protocol by the decoder behind it.

use crate::can::Load;
use crate::decoder::Decoder;
use crate::event::{Event, Moment};
use crate::protocol::{Conclusion, Protocol, Settings};
use crate::record::{BusInfo, Output};
use crate::uart::{Baud, Format, Line, Wire};
use alloc::vec::Vec;

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

/// What was on the wire so far, good or bad: characters of a serial line or frames of a CAN bus.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct LineCounts {
    /// CAN frames, error frames included.
    pub frames: u64,
    /// Error frames among them.
    pub error_frames: u64,
    /// Characters.
    pub characters: u64,
    /// Characters with a parity or framing error.
    pub damaged: u64,
    /// Characters whose parity is not known.
    pub unknown_parity: u64,
    /// Pulses shorter than half a bit, dropped or outvoted.
    pub glitches: u64,
    /// Breaks.
    pub breaks: u64,
    /// Losses and overruns.
    pub losses: u64,
}

impl Sampling {
    /// The time of a tick.
    #[must_use]
    pub fn moment(&self, tick: u64) -> Moment {
        let rate = self.ticks_per_second.max(1);
        let (seconds, rest) = (tick / rate, tick % rate);
        let ns = match rest.checked_mul(1_000_000_000) {
            Some(product) => product / rate,
            // Ticks of picoseconds and less.
            None => rest / (rate / 1_000_000_000).max(1),
        };
        let ns = seconds.saturating_mul(1_000_000_000).saturating_add(ns);
        self.origin.plus(i64::try_from(ns).unwrap_or(i64::MAX))
    }
}

/// A bus that is being decoded.
pub struct Bus {
    /// The line, where levels are heard instead of characters.
    line: Option<Line>,
    decoder: Decoder,
    given: Wire,
}

impl Bus {
    /// A bus on which nothing was heard yet.
    #[must_use]
    pub fn new(info: BusInfo, facts: WireFacts, settings: Settings) -> Self {
        let line = facts.sampling.map(|sampling| Line::new(sampling, settings.line));
        let format = settings.line.format.or(facts.format).unwrap_or(Format::FT12);
        let given = Wire::new(settings.line.baud.or(facts.baud), format);
        let can_find_rate = info.clock.is_some() && !facts.spacing_is_assumed;
        Bus { line, decoder: Decoder::new(info, settings, can_find_rate), given }
    }

    /// Name and clock.
    #[must_use]
    pub fn info(&self) -> &BusInfo {
        self.decoder.info()
    }

    /// What was on the wire so far.
    #[must_use]
    pub fn counts(&self) -> LineCounts {
        let glitches = self.line.as_ref().map_or(0, Line::glitches);
        LineCounts { glitches, ..self.decoder.counts() }
    }

    /// The protocol that is spoken, once it is known.
    #[must_use]
    pub fn protocol(&self) -> Option<&'static Protocol> {
        self.decoder.protocol()
    }

    /// Rate and format, as far as they are known.
    #[must_use]
    pub fn wire(&self) -> Wire {
        let line = self.line.as_ref().and_then(Line::wire);
        line.or(self.decoder.wire()).unwrap_or(self.given)
    }

    /// How busy it was, where frames tell.
    #[must_use]
    pub fn load(&self) -> Option<Load> {
        self.decoder.load()
    }

    /// Whether the line is upside down.
    #[must_use]
    pub fn is_inverted(&self) -> bool {
        self.line.as_ref().is_some_and(Line::is_inverted)
    }

    /// Everything that was found out instead of being told.
    #[must_use]
    pub fn conclusions(&self) -> Vec<Conclusion> {
        let line = self.line.iter().flat_map(Line::conclusions).cloned();
        line.chain(self.decoder.conclusions()).collect()
    }

    /// When silence would mean something: an [`Event::Advance`] to later than this brings records.
    #[must_use]
    pub fn deadline(&self) -> Moment {
        self.decoder.deadline()
    }

    /// Takes the next event.
    pub fn hear(&mut self, event: Event<'_>, out: &mut Output<'_>) {
        let Bus { line, decoder, given } = self;
        match (line, event) {
            (Some(line), Event::Levels(levels)) => {
                line.hear(&levels, &mut |wire, event| decoder.hear(wire, event, out));
                line.take_doubt().into_iter().for_each(|finding| decoder.note(finding));
            }
            (Some(line), Event::Lost(loss)) => {
                line.end(&mut |wire, event| decoder.hear(wire, event, out));
                decoder.hear(line.wire().unwrap_or(*given), Event::Lost(loss), out);
            }
            (line, event) => {
                let wire = line.as_ref().and_then(|line| line.wire()).unwrap_or(*given);
                decoder.hear(wire, event, out);
            }
        }
    }

    /// The capture ended at `end`, if that is known.
    pub fn finish(&mut self, end: Moment, out: &mut Output<'_>) {
        let Bus { line, decoder, given } = self;
        if let Some(line) = line {
            line.end(&mut |wire, event| decoder.hear(wire, event, out));
            line.take_doubt().into_iter().for_each(|finding| decoder.note(finding));
        }
        let wire = line.as_ref().and_then(Line::wire).unwrap_or(*given);
        decoder.finish(wire, end, out);
    }
}
