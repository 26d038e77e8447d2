//! Rate, format and polarity of a line, found from its level changes.
//!
//! Every setting that the pulses allow is tried on the same piece of line, and the one under which
//! the most characters have their stop bit wins. The length of a character is the shortest that
//! leaves stop bits in place; what its last bit is follows from whether it fits the others.

use super::rate::RATES;
use super::sampler::{Read, Sampler};
use super::settle::settle;
use super::{Baud, Format, LineSettings, ParityRule};
use crate::edges::{Edges, shortest_pulses};
use alloc::{format, string::String, vec::Vec};

/// Share of pulses that must be whole multiples of a bit, in percent.
const FITTING_PULSES: usize = 85;

/// Rates that are tried at most.
const MOST_RATES: usize = 6;

/// Longer than any character, in bits.
const IDLE_BITS: u64 = 13;

/// How far a rate may be off one of the usual ones to be taken for it, in percent.
const SNAP: f64 = 2.5;

/// What was found about a line.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Found {
    pub baud: Baud,
    pub format: Format,
    pub is_inverted: bool,
    /// Characters with all their stop bits, and all characters.
    pub good: usize,
    pub all: usize,
}

impl Found {
    /// Whether the line looks like characters at all.
    pub fn is_convincing(&self) -> bool {
        self.good > 0 && self.good * 2 >= self.all
    }

    /// Fewer errors are better; where two are alike, the one that was tried first stays.
    fn is_better_than(&self, other: &Found) -> bool {
        const ALIKE: usize = 20;
        let per_mille = |found: &Found| (found.all - found.good) * 1000 / found.all.max(1);
        per_mille(self) + ALIKE < per_mille(other)
    }

    /// A line is taken to be upside down only if that explains it and nothing else does.
    fn is_much_better_than(&self, other: &Found) -> bool {
        let percent = |found: &Found| (found.all - found.good) * 100 / found.all.max(1);
        percent(other) >= 30 && percent(self) + 20 <= percent(other)
    }

    pub fn evidence(&self) -> String {
        format!("{} of the first {} characters have their stop bits", self.good, self.all)
    }
}

/// Finds what the user left open. `None` if the line has no pulses to learn from.
pub(super) fn find(edges: &Edges, ticks_per_second: u64, given: LineSettings) -> Option<Found> {
    let rates = candidate_rates(edges, ticks_per_second, given);
    let best = |is_inverted: bool| {
        let mut best: Option<Found> = None;
        for baud in &rates {
            let bit = ticks_per_second as f64 / f64::from(baud.get());
            let Some(found) = try_setting(edges, *baud, bit, is_inverted, given) else { continue };
            if best.as_ref().is_none_or(|other| found.is_better_than(other)) {
                best = Some(found);
            }
        }
        best
    };
    if let Some(is_inverted) = given.inverted {
        return best(is_inverted);
    }
    let upright = best(false);
    let slowest = rates.iter().map(|baud| ticks_per_second / u64::from(baud.get())).max()?;
    if !is_ever_idle_low(edges, IDLE_BITS * slowest) {
        return upright;
    }
    match (upright, best(true)) {
        (Some(upright), Some(inverted)) if !inverted.is_much_better_than(&upright) => Some(upright),
        (upright, inverted) => inverted.or(upright),
    }
}

/// Whether the line is low for longer than a character somewhere: a line that is not upside down
/// never is, but for breaks.
fn is_ever_idle_low(edges: &Edges, ticks: u64) -> bool {
    let begin = core::iter::once(edges.from);
    let end = core::iter::once(edges.until);
    let times: Vec<u64> = begin.chain(edges.ticks.iter().copied()).chain(end).collect();
    let mut level = edges.level;
    times.windows(2).any(|pair| {
        let is_low = !level;
        level = !level;
        is_low && pair[1].saturating_sub(pair[0]) > ticks
    })
}

/// Rates under which most pulses are whole bits: the usual ones, the slowest first, then what the
/// shortest pulses say. Under twice the right rate every pulse is whole as well: such rates are
/// left out.
fn candidate_rates(edges: &Edges, ticks_per_second: u64, given: LineSettings) -> Vec<Baud> {
    if let Some(baud) = given.baud {
        return alloc::vec![baud];
    }
    let bit_of = |rate: u32| ticks_per_second as f64 / f64::from(rate);
    let mut usual: Vec<u32> =
        RATES.into_iter().filter(|r| fits(&edges.ticks, bit_of(*r))).collect();
    usual.sort_unstable();
    let mut rates: Vec<u32> = Vec::new();
    for rate in usual {
        let is_multiple = |slower: &u32| {
            let times = f64::from(rate) / f64::from(*slower);
            (times - f64::from((times + 0.5) as u32)).abs() * 100.0 <= times * SNAP
        };
        if !rates.iter().any(is_multiple) {
            rates.push(rate);
        }
    }
    for bit in shortest_pulses(&edges.ticks) {
        let rate = ticks_per_second as f64 / bit;
        let is_usual = |usual: &u32| {
            let usual = f64::from(*usual);
            (rate - usual).abs() * 100.0 <= usual * SNAP
        };
        if !RATES.iter().any(is_usual) && fits(&edges.ticks, bit) {
            rates.push((rate + 0.5) as u32);
        }
    }
    rates.truncate(MOST_RATES);
    rates.into_iter().filter_map(Baud::new).collect()
}

/// Whether most pulses that can be inside characters are whole multiples of a bit. Pulses shorter
/// than half a bit are glitches, if there are few of them.
pub(super) fn fits(ticks: &[u64], bit: f64) -> bool {
    // Below two samples a bit nothing can be told.
    if bit < 2.0 {
        return false;
    }
    let (kept, glitches) = without_glitches(ticks, bit);
    let (mut inside, mut fitting) = (0, 0);
    for pulse in kept.windows(2).map(|pair| pair[1].saturating_sub(pair[0]) as f64) {
        let bits = pulse / bit;
        if bits >= 12.0 {
            continue;
        }
        let off = (bits - f64::from((bits + 0.5) as u32)).abs();
        inside += 1;
        fitting += usize::from(off <= 0.3 + 1.0 / bit);
    }
    inside >= 2 && fitting * 100 >= inside * FITTING_PULSES && glitches * 4 <= inside
}

/// The edges without pulses shorter than half a bit, the shortest left out first, and how many
/// such pulses there were.
fn without_glitches(ticks: &[u64], bit: f64) -> (Vec<u64>, usize) {
    let mut kept = ticks.to_vec();
    for share in [16.0, 8.0, 4.0, 2.0] {
        let mut passed: Vec<u64> = Vec::with_capacity(kept.len());
        for tick in kept {
            match passed.last() {
                Some(before) if (tick.saturating_sub(*before) as f64) < bit / share => {
                    passed.pop();
                }
                _ => passed.push(tick),
            }
        }
        kept = passed;
    }
    let glitches = (ticks.len() - kept.len()) / 2;
    (kept, glitches)
}

fn try_setting(
    edges: &Edges,
    baud: Baud,
    bit: f64,
    is_inverted: bool,
    given: LineSettings,
) -> Option<Found> {
    let lengths: &[u32] = &[7, 8, 9, 10];
    let tries = lengths.iter().map(|bits| Try::new(edges, bit, *bits, is_inverted));
    let chosen = match given.format {
        Some(format) => {
            let bits = Sampler::new(bit, format).bits;
            Try::new(edges, bit, bits, is_inverted)
        }
        None => shortest_without_errors(tries.collect()),
    }?;
    let format = given.format.or_else(|| chosen.format())?;
    let good = chosen.characters.len();
    Some(Found { baud, format, is_inverted, good, all: good + chosen.errors })
}

/// The characters of a line, read with one length.
struct Try {
    bits: u32,
    bit: f64,
    /// Data and parity bits of the characters that have their stop bit, and where they begin.
    characters: Vec<(u64, u16)>,
    errors: usize,
}

impl Try {
    fn new(edges: &Edges, bit: f64, bits: u32, is_inverted: bool) -> Option<Try> {
        let sampler = Sampler { bit, bits, stop_bits: 1 };
        let mut index = settle(edges, edges.first_falling(is_inverted), &sampler, |_| false);
        let mut tried = Try { bits, bit, characters: Vec::new(), errors: 0 };
        while let Some(tick) = edges.ticks.get(index) {
            if *tick as f64 + sampler.reach(true) > edges.until as f64 {
                break;
            }
            let reading = sampler.read(&edges.ticks, index);
            match reading.read {
                Read::Character { bits, has_stop: true } => tried.characters.push((*tick, bits)),
                Read::Character { .. } | Read::Break | Read::FalseStart => tried.errors += 1,
            }
            index = reading.next;
        }
        (!tried.characters.is_empty()).then_some(tried)
    }

    fn error_share(&self) -> usize {
        self.errors * 1000 / (self.errors + self.characters.len()).max(1)
    }

    /// What the last bit is: a parity bit if it fits the others.
    fn format(&self) -> Option<Format> {
        let data = self.bits - 1;
        let count = self.characters.len();
        let fitting = |rule: ParityRule| {
            let fits =
                |bits: u16| rule.bit(bits & ((1 << data) - 1)) == Some(bits >> data & 1 == 1);
            self.characters.iter().filter(|(_, bits)| fits(*bits)).count()
        };
        // Seven data bits with parity look like eight without in a short text.
        let varies = (1..count).contains(&fitting(ParityRule::Mark));
        let (share, is_plausible) = match data {
            7 => (95, varies && count >= 12),
            _ => (75, data >= 8),
        };
        let is = |rule| is_plausible && fitting(rule) * 100 >= count * share;
        let stop_bits = if self.has_two_stop_bits() { 2 } else { 1 };
        let data_bits = u8::try_from(data).ok()?;
        if is(ParityRule::Even) {
            Format::new(data_bits, ParityRule::Even, stop_bits)
        } else if is(ParityRule::Odd) {
            Format::new(data_bits, ParityRule::Odd, stop_bits)
        } else if data == 8 && count > 0 && fitting(ParityRule::Space) == count {
            Format::new(data_bits, ParityRule::Space, stop_bits)
        } else {
            Format::new(data_bits + 1, ParityRule::None, stop_bits)
        }
    }

    /// Whether characters that follow each other closely all leave room for a second stop bit.
    fn has_two_stop_bits(&self) -> bool {
        let frame = f64::from(self.bits + 2);
        let spacing = |pair: &[(u64, u16)]| (pair[1].0 - pair[0].0) as f64 / self.bit;
        let close = self.characters.windows(2).map(spacing).filter(|bits| *bits < frame + 1.5);
        let (mut with_two, mut all) = (0, 0);
        for bits in close {
            all += 1;
            with_two += usize::from((bits - frame - 1.0).abs() < 0.25);
        }
        all >= 3 && with_two * 10 >= all * 9
    }
}

/// The shortest length under which stop bits are where they should be; but eight bits and a
/// parity bit that always fits are preferred to eight bits and an idle line.
fn shortest_without_errors(tries: Vec<Option<Try>>) -> Option<Try> {
    let tries: Vec<Try> = tries.into_iter().flatten().collect();
    let fewest = tries.iter().map(Try::error_share).min()?;
    let is_even = |tried: &Try| {
        let even = |bits: &(u64, u16)| bits.1.count_ones().is_multiple_of(2);
        tried.bits == 9
            && tried.errors == 0
            && tried.characters.len() >= 3
            && tried.characters.iter().all(even)
    };
    let preferred = tries.iter().position(is_even);
    let shortest = tries.iter().position(|tried| tried.error_share() <= fewest + 20);
    let chosen = preferred.or(shortest)?;
    tries.into_iter().nth(chosen)
}
