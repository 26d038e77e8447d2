//! Level changes that are held until they can be used.

use crate::event::Levels;
use alloc::vec::Vec;

/// Edges that are held back at most to find out what a line is: those of about 256
/// characters, plus some.
const ENOUGH: usize = 2048;

/// How long they are held back at most, in s.
const ENOUGH_SECONDS: u64 = 2;

/// Level changes that were not used yet.
#[derive(Clone, Default, Debug)]
pub(crate) struct Edges {
    /// Their ticks.
    pub ticks: Vec<u64>,
    /// The level before the first of them.
    pub level: bool,
    /// The line is known from this tick on.
    pub from: u64,
    /// The line is known before this tick.
    pub until: u64,
}

impl Edges {
    /// Adds a piece of line.
    pub fn add(&mut self, levels: &Levels<'_>) {
        if self.ticks.is_empty() {
            self.level = levels.level;
        }
        if self.until == 0 {
            self.from = levels.from;
        }
        self.ticks.extend_from_slice(levels.edges);
        self.until = self.until.max(levels.until);
    }

    /// All of it as one piece of line.
    pub fn levels(&self) -> Levels<'_> {
        Levels { edges: &self.ticks, level: self.level, from: self.from, until: self.until }
    }

    /// As much of it as is needed to find something out, however the line came in pieces.
    pub fn beginning(&self, ticks_per_second: u64) -> Edges {
        let first = self.ticks.first().copied().unwrap_or(self.until);
        let latest = first.saturating_add(ENOUGH_SECONDS.saturating_mul(ticks_per_second));
        let early = self.ticks.partition_point(|tick| *tick < latest).min(ENOUGH);
        let until = match self.ticks.get(early.saturating_sub(1)) {
            Some(last) if early == ENOUGH => last.saturating_add(1),
            _ => self.until.min(latest),
        };
        Edges { ticks: self.ticks[..early].to_vec(), until, ..*self }
    }

    /// The index of the first falling edge, for a line whose idle level is high, or low if
    /// inverted.
    pub fn first_falling(&self, is_inverted: bool) -> usize {
        usize::from(self.level == is_inverted)
    }

    /// Whether these are enough edges to find something out, or have taken long enough.
    pub fn is_enough(&self, ticks_per_second: u64) -> bool {
        self.ticks.len() >= ENOUGH || self.is_long(ticks_per_second)
    }

    /// Whether these took as long as edges are held back at most.
    pub fn is_long(&self, ticks_per_second: u64) -> bool {
        let first = self.ticks.first().copied().unwrap_or(self.until);
        self.until.saturating_sub(first) / ticks_per_second.max(1) >= ENOUGH_SECONDS
    }
}

/// What a bit may last, in ticks, if the shortest pulses are one, two or three bits long.
pub(crate) fn shortest_pulses(ticks: &[u64]) -> Vec<f64> {
    let pulses: Vec<f64> =
        ticks.windows(2).map(|pair| pair[1].saturating_sub(pair[0]) as f64).collect();
    let mut sorted = pulses.clone();
    sorted.sort_by(f64::total_cmp);
    let Some(short) = sorted.get(sorted.len() / 50).copied() else { return Vec::new() };
    let refine = |bits: f64| {
        let mut bit = short / bits;
        for _ in 0..4 {
            let inside = pulses.iter().filter(|pulse| **pulse < 9.5 * bit);
            let (length, count) = inside.fold((0.0, 0.0), |(length, count), pulse| {
                let whole = ((pulse / bit + 0.5) as u32).max(1);
                (length + pulse, count + f64::from(whole))
            });
            if count > 0.0 {
                bit = length / count;
            }
        }
        bit
    };
    [1.0, 2.0, 3.0].into_iter().map(refine).collect()
}
