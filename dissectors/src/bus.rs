//! One bus: from what a tap hears to records, whatever is spoken on it.
//!
//! What must be known first and was not given is found out from the first characters, which are
//! held back and then decoded; from there on it is one pass. What a line carries, its rate, format
//! and polarity are found by the line in front, the protocol by the decoder behind it.

use crate::can::Load;
use crate::decoder::Decoder;
use crate::event::{Event, Levels, LossCause, Moment};
use crate::finding::Finding;
use crate::line::{Line, Listener};
use crate::measure::Measurement;
use crate::protocol::{Conclusion, Medium, Protocol, Settings};
use crate::record::{BusInfo, Output};
use crate::setting::Setting;
use crate::uart::{Baud, Format, Wire};
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
    /// What the bus carries, where the source tells it.
    pub medium: Option<Medium>,
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

/// What was on the wire so far, good or bad: characters of a serial line, frames of a CAN bus,
/// rows and cycles of words.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct LineCounts {
    /// CAN frames, error frames included.
    pub frames: u64,
    /// Error frames among them.
    pub error_frames: u64,
    /// Frames that came while the bit rate was not known.
    pub frames_without_rate: u64,
    /// Rows of words.
    pub rows: u64,
    /// Cycles of words.
    pub cycles: u64,
    /// Cycles that are damaged: their stop bits, their end, or their checksum.
    pub bad_cycles: u64,
    /// Characters.
    pub characters: u64,
    /// Characters with a parity or framing error.
    pub damaged: u64,
    /// Characters whose parity is not known.
    pub unknown_parity: u64,
    /// Characters one of which had a parity error, and nobody knows which.
    pub suspect_parity: u64,
    /// Pulses too short for a bit, dropped or outvoted.
    pub glitches: u64,
    /// Breaks.
    pub breaks: u64,
    /// Losses and overruns.
    pub losses: u64,
    /// Those of them in which nobody listened.
    pub deaf: u64,
    /// Times of which nothing was kept. They are no losses.
    pub not_kept: u64,
    /// Times in which its rate was looked for at others. They are no losses either.
    pub sought: u64,
    /// Level changes that are nothing of what the line was said to carry.
    pub strange_edges: u64,
}

impl LineCounts {
    /// Counts a gap for what it is.
    pub const fn lose(&mut self, cause: LossCause) {
        self.losses += cause.is_failure() as u64;
        match cause {
            LossCause::Capture | LossCause::Overrun => {}
            LossCause::Deaf => self.deaf += 1,
            LossCause::NotKept => self.not_kept += 1,
            LossCause::Sought(_) => self.sought += 1,
        }
    }
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
    line: Line,
    decoder: Decoder,
    given: Wire,
}

impl Bus {
    /// A bus on which nothing was heard yet.
    #[must_use]
    pub fn new(info: BusInfo, facts: WireFacts, settings: Settings) -> Self {
        let line = Line::new(facts.sampling, &settings);
        let format = settings.line.format.or(facts.format).unwrap_or(Format::FT12);
        let given = Wire::new(settings.line.baud.or(facts.baud), format);
        let can_find_rate = info.clock.is_some() && !facts.spacing_is_assumed;
        let doubt = facts.baud.zip(settings.line.baud).and_then(|(told, set)| told.doubt(set));
        let mut decoder = Decoder::new(info, settings, can_find_rate, facts.medium);
        doubt.into_iter().for_each(|finding| decoder.note(finding));
        Bus { line, decoder, given }
    }

    /// Name and clock.
    #[must_use]
    pub fn info(&self) -> &BusInfo {
        self.decoder.info()
    }

    /// What was on the wire so far.
    #[must_use]
    pub fn counts(&self) -> LineCounts {
        let (glitches, strange_edges) = (self.line.glitches(), self.line.strange());
        LineCounts { glitches, strange_edges, ..self.decoder.counts() }
    }

    /// The protocol that is spoken, once it is known.
    #[must_use]
    pub fn protocol(&self) -> Option<&'static Protocol> {
        self.decoder.protocol()
    }

    /// Rate and format, as far as they are known.
    #[must_use]
    pub fn wire(&self) -> Wire {
        self.line.wire().or(self.decoder.wire()).unwrap_or(self.given)
    }

    /// How busy it was, where frames tell.
    #[must_use]
    pub fn load(&self) -> Option<Load> {
        self.decoder.load()
    }

    /// What was measured of each station besides response times.
    #[must_use]
    pub fn measurements(&self) -> Vec<Measurement> {
        self.decoder.measurements()
    }

    /// Whether the line is upside down.
    #[must_use]
    pub fn is_inverted(&self) -> bool {
        self.line.is_inverted()
    }

    /// Everything that was found out instead of being told.
    #[must_use]
    pub fn conclusions(&self) -> Vec<Conclusion> {
        self.line.conclusions().into_iter().chain(self.decoder.conclusions()).collect()
    }

    /// What the protocol leaves open about its line: the answers that are used, and from what.
    #[must_use]
    pub fn settings(&self) -> Vec<Setting> {
        self.line.settings()
    }

    /// Another wire of the line is heard from now on, by this number in [`Bus::hear_wire`]. Wires
    /// that had this number, or a higher one, have the next.
    pub fn add_wire(&mut self, number: usize) {
        self.line.add_wire(number);
    }

    /// When silence would mean something: an [`Event::Advance`] to later than this brings records.
    #[must_use]
    pub fn deadline(&self) -> Moment {
        self.decoder.deadline()
    }

    /// Takes the next event.
    pub fn hear(&mut self, event: Event<'_>, out: &mut Output<'_>) {
        self.hear_wire(0, event, out);
    }

    /// Takes the next event of one of its wires.
    pub fn hear_wire(&mut self, wire: usize, event: Event<'_>, out: &mut Output<'_>) {
        match event {
            Event::Levels(levels) => self.hear_levels(Some((wire, &levels)), out),
            Event::Lost(loss) => {
                self.hear_levels(None, out);
                self.decoder.hear(self.wire(), Event::Lost(loss), out);
            }
            event => self.decoder.hear(self.wire(), event, out),
        }
    }

    /// Another capture of the same bus begins. Its line levels are counted from another tick on.
    pub fn go_on(&mut self, facts: WireFacts, out: &mut Output<'_>) {
        if let Some(sampling) = facts.sampling {
            self.hear_levels(None, out);
            self.line.go_on(sampling);
        }
        if facts.medium == Some(Medium::Can) && facts.baud.is_some() {
            self.set_bitrate(facts.baud, out);
        }
    }

    /// Frames come at this bit rate from here on, or at one that is not known, unless the user
    /// decided. What was heard before keeps its own.
    pub fn set_bitrate(&mut self, rate: Option<Baud>, out: &mut Output<'_>) {
        if self.wire().baud() != rate {
            self.decoder.set_bitrate(self.wire(), rate, out);
            self.given = Wire::new(rate, self.given.format());
        }
    }

    /// The capture ended at `end`, if that is known.
    pub fn finish(&mut self, end: Moment, out: &mut Output<'_>) {
        self.hear_levels(None, out);
        self.decoder.finish(self.wire(), end, out);
    }

    /// Takes the next levels, or that none follow.
    fn hear_levels(&mut self, levels: Option<(usize, &Levels<'_>)>, out: &mut Output<'_>) {
        let mut behind = Behind { decoder: &mut self.decoder, out };
        match levels {
            Some((wire, levels)) => self.line.hear(wire, levels, &mut behind),
            None => self.line.end(&mut behind),
        }
    }
}

/// What is behind a line.
struct Behind<'a, 'b> {
    decoder: &'a mut Decoder,
    out: &'a mut Output<'b>,
}

impl Listener for Behind<'_, '_> {
    fn hear(&mut self, wire: Wire, event: Event<'_>) {
        self.decoder.hear(wire, event, self.out);
    }

    fn note(&mut self, finding: Finding) {
        self.decoder.note(finding);
    }
}
