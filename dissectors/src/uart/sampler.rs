//! Reading one character off a line's level changes.

use super::{Format, Parity};

/// How far from a bit's middle levels still have a say, in bits.
const VOTE: f64 = 0.25;

/// Reads characters of one rate and length. Parity is looked at later: the parity bit is read like
/// a data bit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sampler {
    /// Duration of a bit in ticks.
    pub bit: f64,
    /// Bits between the start bit and the stop bits, parity bit included.
    pub bits: u32,
    /// Stop bits, 1 or 2.
    pub stop_bits: u32,
}

/// What was read at a falling edge.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Read {
    /// A pulse shorter than half a bit.
    FalseStart,
    /// The line stayed low throughout.
    Break,
    /// A character: its data and parity bits, the first in bit 0.
    Character { bits: u16, has_stop: bool },
}

/// A reading, and where the next one may begin.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Reading {
    pub read: Read,
    /// Index of the first falling edge behind it, or of where one will be: the line is high before
    /// it, or will be.
    pub next: usize,
    /// Pulses shorter than half a bit that were outvoted.
    pub glitches: u32,
}

impl Sampler {
    pub fn new(bit: f64, format: Format) -> Self {
        let stop_bits = u32::from(format.stop_bits());
        Sampler { bit, bits: format.bits() - 1 - stop_bits, stop_bits }
    }

    /// Duration of a whole character in ticks.
    pub fn frame(&self) -> f64 {
        f64::from(1 + self.bits + self.stop_bits) * self.bit
    }

    /// How far behind its start edge a character's levels must be known: up to the middle of its
    /// first stop bit, if nothing more will come.
    pub fn reach(&self, is_end: bool) -> f64 {
        if is_end {
            self.frame() - (f64::from(self.stop_bits) - 0.5) * self.bit
        } else {
            self.frame() - VOTE * self.bit
        }
    }

    /// How long a line must be high to be idle for certain: longer than any character makes it.
    pub fn certain_idle(&self) -> f64 {
        self.frame() - 0.7 * self.bit
    }

    /// Reads at the falling edge of that index. Behind the last edge the level stays.
    pub fn read(&self, edges: &[u64], start: usize) -> Reading {
        let mut votes = Votes { edges, start, next: start + 1 };
        let origin = edges[start] as f64;
        let mut vote = |bit: u32| {
            let middle = origin + (f64::from(bit) + 0.5) * self.bit;
            votes.is_high(middle - VOTE * self.bit, middle + VOTE * self.bit)
        };
        if vote(0) {
            return self.reading(Read::FalseStart, edges, start, start + 2);
        }
        let mut bits = 0_u16;
        for bit in 0..self.bits {
            bits |= u16::from(vote(1 + bit)) << bit;
        }
        let has_stop = (0..self.stop_bits).all(|stop| vote(1 + self.bits + stop));
        let after = origin + (f64::from(self.bits + self.stop_bits) + 0.5) * self.bit;
        let next = falling_edge_behind(edges, start, after);
        // Low until the stop bit is over, without a single rise.
        let is_break =
            bits == 0 && !has_stop && edges.get(start + 1).is_none_or(|e| *e as f64 > after);
        let read = if is_break { Read::Break } else { Read::Character { bits, has_stop } };
        self.reading(read, edges, start, next)
    }

    fn reading(&self, read: Read, edges: &[u64], start: usize, next: usize) -> Reading {
        let inside = edges.get(start..next.min(edges.len())).unwrap_or_default();
        let short = inside.windows(2).filter(|pair| ((pair[1] - pair[0]) as f64) < self.bit / 2.0);
        Reading { read, next, glitches: u32::try_from(short.count()).unwrap_or(u32::MAX) }
    }
}

/// The first falling edge after a tick: every second one from `start` on.
fn falling_edge_behind(edges: &[u64], start: usize, tick: f64) -> usize {
    let mut index = start + 2;
    while edges.get(index).is_some_and(|edge| *edge as f64 <= tick) {
        index += 2;
    }
    // The line may be low at that tick: the edge before is then a rise that is still to come.
    index
}

/// Levels between times that only go forward.
struct Votes<'a> {
    edges: &'a [u64],
    start: usize,
    next: usize,
}

impl Votes<'_> {
    /// Whether the line is high for more than half of the time between two ticks.
    fn is_high(&mut self, from: f64, to: f64) -> bool {
        while self.edges.get(self.next).is_some_and(|edge| *edge as f64 <= from) {
            self.next += 1;
        }
        let (mut high, mut at, mut next) = (0.0, from, self.next);
        loop {
            // The level is low behind the falling edge at `start`, and toggles from there.
            let is_high = (next - self.start).is_multiple_of(2);
            let until = match self.edges.get(next) {
                Some(edge) if (*edge as f64) < to => *edge as f64,
                _ => to,
            };
            high += if is_high { until - at } else { at - until };
            if until >= to {
                return high > 0.0;
            }
            (at, next) = (until, next + 1);
        }
    }
}

/// Divides data bits and parity bit, and says whether they fit.
pub(super) fn with_parity(bits: u16, format: Format) -> (u16, Parity) {
    let value = bits & ((1 << format.data_bits()) - 1);
    let received = bits >> format.data_bits() & 1 == 1;
    match format.parity().bit(value) {
        None => (value, Parity::None),
        Some(expected) if expected == received => (value, Parity::Ok),
        Some(_) => (value, Parity::Error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    const SAMPLER: Sampler = Sampler { bit: 10.0, bits: 9, stop_bits: 1 };

    /// Edges of a wire of 10 ticks a bit, given as its levels, idle before.
    fn edges(levels: &str) -> Vec<u64> {
        let mut level = '1';
        let mut edges = Vec::new();
        for (n, bit) in (0..).zip(levels.chars()) {
            if bit != level {
                edges.push(1_000 + 10 * n);
                level = bit;
            }
        }
        edges
    }

    fn character(reading: Reading) -> (u16, bool) {
        match reading.read {
            Read::Character { bits, has_stop } => (bits, has_stop),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn the_worked_characters_of_the_tr_manual() {
        // 80h and 1Ah as TR SLIN §6 describes them: start, LSB first, even parity, stop.
        let wire = edges("0 00000001 1 1 0 01011000 1 1".replace(' ', "").as_str());
        let first = SAMPLER.read(&wire, 0);
        assert_eq!(character(first), (0x180, true));
        assert_eq!(with_parity(0x180, Format::FT12), (0x80, Parity::Ok));
        assert_eq!(wire[first.next], 1_110);
        assert_eq!(character(SAMPLER.read(&wire, first.next)), (0x11A, true));
    }

    #[test]
    fn a_pulse_shorter_than_half_a_bit_is_no_start() {
        for (ticks, is_start) in [(4, false), (5, true), (6, true)] {
            let read = SAMPLER.read(&[100, 100 + ticks], 0).read;
            assert_eq!(read != Read::FalseStart, is_start, "{ticks}");
        }
        assert_eq!(SAMPLER.read(&[100, 104, 300], 0).next, 2);
    }

    #[test]
    fn a_glitch_around_the_middle_of_a_bit_is_outvoted_and_counted() {
        // FFh with parity bit 0: high from tick 1010 to 1090. A low pulse of 2 ticks in the middle.
        let wire = [1_000, 1_010, 1_044, 1_046, 1_090, 1_100];
        let reading = SAMPLER.read(&wire, 0);
        assert_eq!((character(reading), reading.glitches), ((0x0FF, true), 1));
        // Three ticks of the five around the middle win.
        let wire = [1_000, 1_010, 1_043, 1_047, 1_090, 1_100];
        assert_eq!(character(SAMPLER.read(&wire, 0)), (0x0F7, true));
    }

    #[test]
    fn a_missing_stop_bit_is_seen_and_a_break_told_from_it() {
        let framing = SAMPLER.read(&edges("0 11111111 0 0 1".replace(' ', "").as_str()), 0);
        assert_eq!(character(framing), (0x0FF, false));
        assert_eq!(SAMPLER.read(&[1_000, 1_200, 1_300], 0).read, Read::Break);
        assert_eq!(SAMPLER.read(&[1_000, 1_200, 1_300], 0).next, 2);
        assert_eq!(SAMPLER.read(&[1_000], 0), Reading { read: Read::Break, next: 2, glitches: 0 });
    }
}
