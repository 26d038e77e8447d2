//! A receiver: line levels in, characters and breaks out.

use super::sampler::{Read, Sampler, with_parity};
use super::settle::settle;
use super::{Character, Format, Parity};
use crate::bus::Sampling;
use crate::edges::Edges;
use crate::event::{Break, Event, Levels};
use alloc::vec::Vec;

/// Characters that are looked at to find where the first one begins.
const SETTLE_FRAMES: f64 = 34.0;

/// Edges that are held at most while a character is not over: a line that toggles faster carries
/// no characters.
const MOST_EDGES: usize = 1 << 16;

/// Turns levels into characters, once rate, format and polarity are known.
#[derive(Clone, Debug)]
pub(super) struct Receiver {
    sampler: Sampler,
    format: Format,
    is_inverted: bool,
    sampling: Sampling,
    edges: Edges,
    is_settled: bool,
    /// Characters of the piece at hand.
    batch: Vec<Character>,
    /// Pulses shorter than half a bit so far.
    pub glitches: u64,
}

impl Receiver {
    pub fn new(sampler: Sampler, format: Format, is_inverted: bool, sampling: Sampling) -> Self {
        Receiver {
            sampler,
            format,
            is_inverted,
            sampling,
            edges: Edges::default(),
            is_settled: false,
            batch: Vec::new(),
            glitches: 0,
        }
    }

    /// Takes edges that were held back.
    pub fn take(&mut self, edges: Edges) {
        self.edges = edges;
    }

    /// Takes the next piece of line.
    pub fn hear(&mut self, levels: &Levels<'_>, emit: &mut impl FnMut(Event<'_>)) {
        self.edges.add(levels);
        self.receive(false, emit);
    }

    /// The line is not heard any further: what is open is decided by what is known. What follows,
    /// if anything, may begin anywhere.
    pub fn end(&mut self, emit: &mut impl FnMut(Event<'_>)) {
        self.receive(true, emit);
        self.edges = Edges::default();
        self.is_settled = false;
    }

    /// Reads all characters that are known to their end.
    pub fn receive(&mut self, is_end: bool, emit: &mut impl FnMut(Event<'_>)) {
        let first = self.edges.first_falling(self.is_inverted);
        let Some(mut start) = self.settled(first, is_end) else { return };
        while let Some(&tick) = self.edges.ticks.get(start) {
            let is_open = tick as f64 + self.sampler.reach(is_end) > self.edges.until as f64;
            if is_open && self.edges.ticks.len() - start < MOST_EDGES {
                break;
            }
            let reading = self.sampler.read(&self.edges.ticks, start);
            let begins = self.sampling.moment(tick);
            match reading.read {
                Read::FalseStart => {}
                Read::Character { bits, has_stop } => {
                    let (value, parity) = with_parity(bits, self.format);
                    let mut character =
                        Character::new(begins, self.sampling.uncertainty, value, parity);
                    if !has_stop {
                        character = character.with_framing_error();
                    }
                    self.batch.push(character);
                }
                Read::Break => {
                    let rise = self.edges.ticks.get(reading.next - 1).copied();
                    let Some(rise) = rise.or(is_end.then_some(self.edges.until)) else { break };
                    self.flush(emit);
                    let lasted = self.sampling.moment(rise).since(begins).unwrap_or_default();
                    emit(Event::Break(Break {
                        start: begins,
                        uncertainty: self.sampling.uncertainty,
                        duration: u64::try_from(lasted).ok(),
                    }));
                }
            }
            self.glitches += u64::from(reading.glitches);
            start = reading.next;
        }
        self.flush(emit);
        self.drop_used(start);
    }

    /// Where to look for the next character; `None` while the beginning is not settled.
    fn settled(&mut self, first: usize, is_end: bool) -> Option<usize> {
        if self.is_settled {
            return Some(first);
        }
        let tick = *self.edges.ticks.get(first)?;
        let horizon = tick as f64 + SETTLE_FRAMES * self.sampler.frame();
        let is_open = (self.edges.until as f64) < horizon;
        if !is_end && is_open && self.edges.ticks.len() < MOST_EDGES {
            return None;
        }
        self.is_settled = true;
        let is_wrong = |bits| with_parity(bits, self.format).1 == Parity::Error;
        Some(settle(&self.edges, first, &self.sampler, is_wrong))
    }

    fn flush(&mut self, emit: &mut impl FnMut(Event<'_>)) {
        if !self.batch.is_empty() {
            emit(Event::Characters(&self.batch));
            self.batch.clear();
        }
    }

    /// Forgets the edges before `start`, which is falling or will be.
    fn drop_used(&mut self, start: usize) {
        let used = start.min(self.edges.ticks.len());
        if used % 2 == 1 {
            self.edges.level = !self.edges.level;
        }
        self.edges.ticks.drain(..used);
    }
}
