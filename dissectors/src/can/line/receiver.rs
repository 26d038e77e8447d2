//! A receiver: line levels in, frames out. It walks from edge to edge, never over samples.

use super::clock::BitClock;
use super::parser::{Parser, Synchronization};
use crate::bus::Sampling;
use crate::can::Frame;
use crate::event::Levels;
use alloc::vec::Vec;

/// Turns levels into frames, once rate and polarity are known.
#[derive(Clone, Debug)]
pub(super) struct Receiver {
    clock: BitClock,
    parser: Parser,
    is_inverted: bool,
    is_recessive: bool,
    /// Pulses of fewer ticks are dropped.
    shortest: u64,
    /// The last edge, unless it turns out to begin such a pulse.
    pending: Option<u64>,
    /// The edge before that.
    edge: u64,
    is_begun: bool,
    pulses: u64,
    /// From the start of the frame at hand to its last edge, and of all good frames: ticks, bits.
    span: (u64, u64),
    spans: (u64, u64),
    /// What was received and not handed on yet.
    pub frames: Vec<Frame>,
}

impl Receiver {
    /// A receiver of bits that last so many ticks. A recessive line is high, or low if inverted.
    pub fn new(ticks_a_bit: f64, is_inverted: bool, sampling: Sampling) -> Self {
        let clock = BitClock::new(ticks_a_bit);
        Receiver {
            shortest: clock.shortest_pulse(),
            clock,
            parser: Parser::new(sampling),
            is_inverted,
            is_recessive: true,
            pending: None,
            edge: 0,
            is_begun: false,
            pulses: 0,
            span: (0, 0),
            spans: (0, 0),
            frames: Vec::new(),
        }
    }

    /// Pulses that were too short for a bit.
    pub fn glitches(&self) -> u64 {
        self.pulses + self.parser.false_starts
    }

    /// How many ticks a bit of the good frames lasted.
    pub fn measured_bit(&self) -> Option<f64> {
        let (ticks, bits) = self.spans;
        (bits > 0).then_some(ticks as f64 / bits as f64)
    }

    /// Takes the next piece of line.
    pub fn hear(&mut self, levels: &Levels<'_>) {
        if !self.is_begun {
            self.is_begun = true;
            self.is_recessive = levels.level != self.is_inverted;
            self.edge = levels.from;
            self.clock.start(levels.from);
        }
        let mut clock = self.clock;
        let mut pending = self.pending.take();
        for tick in levels.edges.iter().copied() {
            pending = match pending {
                Some(before) if tick.saturating_sub(before) < self.shortest => {
                    self.drop_pulse(&mut clock, before);
                    None
                }
                Some(before) => {
                    self.pass(&mut clock, before);
                    Some(tick)
                }
                None => Some(tick),
            }
        }
        let mut known = levels.until;
        if let Some(tick) = pending {
            if levels.until.saturating_sub(tick) >= self.shortest {
                self.pass(&mut clock, tick);
            } else {
                (self.pending, known) = (pending, tick);
            }
        }
        self.take(clock.advance(known));
        self.clock = clock;
    }

    /// The line is not heard any further, or not for a while. A frame that is not over is none.
    pub fn end(&mut self) {
        self.parser.reset();
        self.pending = None;
        self.is_begun = false;
    }

    #[inline(always)]
    fn drop_pulse(&mut self, clock: &mut BitClock, tick: u64) {
        self.take(clock.advance(tick));
        if self.parser.is_deaf() {
            // The fast bits of a CAN FD frame are as short.
            self.parser.reset();
        } else {
            self.pulses += 1;
        }
    }

    /// Takes the bits before an edge, and the edge.
    #[inline(always)]
    fn pass(&mut self, clock: &mut BitClock, tick: u64) {
        self.take(clock.reach(tick));
        self.edge = tick;
        self.is_recessive = !self.is_recessive;
        if self.is_recessive {
            return;
        }
        match self.parser.fall(tick, &mut self.frames) {
            Synchronization::Hard => clock.synchronize(),
            Synchronization::Soft => {
                if self.parser.is_in_body() {
                    self.span = clock.span();
                }
                clock.resynchronize();
            }
        }
    }

    /// Takes so many bits of the level at hand.
    #[inline(always)]
    fn take(&mut self, count: u32) {
        if !self.parser.take_run(self.is_recessive, count) {
            self.take_any(count);
        }
    }

    /// Not to be inlined: what it needs is not to be set up for every run of bits.
    #[inline(never)]
    fn take_any(&mut self, count: u32) {
        if count == 0 {
            return;
        }
        let before = self.frames.len();
        self.parser.take(self.is_recessive, count, self.edge, &mut self.frames);
        if self.frames.get(before).is_some_and(|frame| frame.crc == Some(true)) {
            self.spans.0 = self.spans.0.saturating_add(self.span.0);
            self.spans.1 = self.spans.1.saturating_add(self.span.1);
        }
    }
}
