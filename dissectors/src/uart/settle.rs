//! Where the first whole character of a capture begins.
//!
//! A capture may begin inside a character, and then every falling edge of the rest looks like a
//! start. The first edge is taken unless another one leads to characters without any error where
//! the first leads to errors. Where both ways are without error, the one whose characters join
//! without a gap is right. What still cannot be told apart is left out: no character is invented.

use super::receiver::Edges;
use super::sampler::{Read, Sampler};
use alloc::vec::Vec;
use core::ops::Range;

/// Characters that each way to begin is followed for.
const FRAMES: f64 = 32.0;

/// A way that begins inside a character goes wrong within so many characters, or meets the right
/// one.
const EARLY: usize = 4;

/// The index of the falling edge from which on characters can be trusted. `is_wrong` tells of a
/// character's data and parity bits whether they do not fit.
pub(super) fn settle(
    edges: &Edges,
    first: usize,
    sampler: &Sampler,
    is_wrong: impl Fn(u16) -> bool,
) -> usize {
    let ticks = &edges.ticks;
    let Some(begin) = ticks.get(first).map(|tick| *tick as f64) else { return first };
    if first == 0 && begin - edges.from as f64 >= sampler.certain_idle() {
        return first;
    }
    let end = idle_or(ticks, first, begin + FRAMES * sampler.frame(), sampler);
    let one_frame = begin + 1.1 * sampler.frame();
    let candidates = (first..end).step_by(2).take_while(|i| ticks[*i] as f64 <= one_frame);
    let mut ways: Vec<Way> =
        candidates.map(|start| follow(ticks, start..end, sampler, &is_wrong)).collect();
    if ways.is_empty() {
        return first;
    }
    let straight = ways.remove(0);
    let flawless: Vec<&Way> =
        ways.iter().filter(|way| way.errors_before(way.meets(&straight)) == 0).collect();
    let is_better = |way: &&&Way| straight.errors_before(straight.meets(way)) > 0;
    let mut rivals: Vec<&Way> = flawless.iter().filter(is_better).copied().collect();
    if flawless.is_empty() && straight.stumbles() && end < ticks.len() {
        return end;
    }
    if rivals.is_empty() {
        rivals = flawless;
        rivals.push(&straight);
    }
    let most = rivals.iter().map(|way| way.joints).max().unwrap_or(0);
    rivals.retain(|way| way.joints == most);
    let is_common = |start: &usize| rivals.iter().all(|way| way.goes_through(*start));
    match rivals.as_slice() {
        [] => first,
        [only] => only.start(),
        [one, ..] => match one.steps.iter().map(|step| step.start).find(is_common) {
            Some(meeting) => meeting,
            // They meet in the idle time behind them, unless nothing is there: then the capture
            // is a single character, which begins with its first edge.
            None if end < ticks.len() => end,
            None => first,
        },
    }
}

/// One way to begin, and where it leads.
struct Way {
    steps: Vec<Step>,
    /// Characters that begin right behind the one before.
    joints: usize,
}

#[derive(Clone, Copy)]
struct Step {
    /// The index of its edge.
    start: usize,
    is_wrong: bool,
}

impl Way {
    fn start(&self) -> usize {
        self.steps.first().map_or(0, |step| step.start)
    }

    fn goes_through(&self, start: usize) -> bool {
        self.steps.binary_search_by_key(&start, |step| step.start).is_ok()
    }

    /// The start from which on it is the same as the other way.
    fn meets(&self, other: &Way) -> usize {
        let mut starts = self.steps.iter().map(|step| step.start);
        starts.find(|start| other.goes_through(*start)).unwrap_or(usize::MAX)
    }

    /// Whether it goes wrong early, as a way that begins inside a character does.
    fn stumbles(&self) -> bool {
        self.steps.iter().take(EARLY).any(|step| step.is_wrong)
    }

    fn errors_before(&self, start: usize) -> usize {
        self.steps.iter().filter(|step| step.start < start && step.is_wrong).count()
    }
}

fn follow(
    ticks: &[u64],
    edges: Range<usize>,
    sampler: &Sampler,
    is_wrong: &impl Fn(u16) -> bool,
) -> Way {
    let mut way = Way { steps: Vec::new(), joints: 0 };
    let (mut index, mut last) = (edges.start, None);
    while index < edges.end {
        let reading = sampler.read(ticks, index);
        let tick = ticks[index] as f64;
        let is_wrong = match reading.read {
            Read::Character { bits, has_stop } => !has_stop || is_wrong(bits),
            Read::Break | Read::FalseStart => true,
        };
        let gap = last.map(|last: f64| tick - last - sampler.frame());
        way.joints += usize::from(gap.is_some_and(|gap| gap.max(-gap) < sampler.bit / 4.0));
        way.steps.push(Step { start: index, is_wrong });
        last = Some(tick);
        index = reading.next;
    }
    way
}

/// The first falling edge behind a certain idle time, or behind the horizon, or the end.
fn idle_or(ticks: &[u64], first: usize, horizon: f64, sampler: &Sampler) -> usize {
    let ends = |index: &usize| {
        let tick = ticks[*index] as f64;
        let rise = index.checked_sub(1).and_then(|before| ticks.get(before));
        let high = rise.map_or(0.0, |rise| tick - *rise as f64);
        *index > first && (high >= sampler.certain_idle() || tick > horizon)
    };
    (first..ticks.len()).step_by(2).find(ends).unwrap_or(ticks.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    const SAMPLER: Sampler = Sampler { bit: 10.0, bits: 9, stop_bits: 1 };

    /// Level changes of a line at 10 ticks a bit, cut off before `from` and beginning at tick 0.
    fn line(levels: &str, from: usize) -> Edges {
        let levels: Vec<u8> = levels.bytes().filter(|b| *b != b' ').skip(from).collect();
        let changes = (1..).zip(levels.windows(2)).filter(|(_, pair)| pair[0] != pair[1]);
        Edges {
            ticks: changes.map(|(n, _)| 10 * n).collect(),
            level: levels[0] == b'1',
            from: 0,
            until: 10 * levels.len() as u64,
        }
    }

    fn begins(edges: &Edges) -> Option<u64> {
        let is_wrong = |bits: u16| bits.count_ones() % 2 == 1;
        let start = settle(edges, edges.first_falling(false), &SAMPLER, is_wrong);
        edges.ticks.get(start).copied()
    }

    /// The answer 1A 01 90h of TR SLIN §6 without pauses, a pause of two characters, and the
    /// request 81h.
    const ANSWER: &str = "0 01011000 1 1 0 10000000 1 1 0 00001001 0 1 1111111111111111111111 \
                          0 10000001 0 1 11111111";

    #[test]
    fn wherever_the_capture_begins_the_first_start_is_a_real_one() {
        let starts = [0, 11, 22, 55];
        for from in 1..55 {
            let tick = begins(&line(ANSWER, from));
            let bit = tick.map(|tick| tick / 10 + from as u64);
            assert!(bit.is_some_and(|bit| starts.contains(&bit)), "cut at {from}: {bit:?}");
        }
    }

    #[test]
    fn a_capture_that_begins_idle_begins_with_its_first_edge() {
        let long = format_line("11111111111 ", ANSWER);
        assert_eq!(begins(&line(&long, 0)), Some(110));
        // One bit of idle is no proof, but the characters join.
        let short = format_line("1 ", ANSWER);
        assert_eq!(begins(&line(&short, 0)), Some(10));
    }

    #[test]
    fn a_single_character_begins_with_its_first_edge() {
        assert_eq!(begins(&line("1 0 01011000 1 1 11", 0)), Some(10));
    }

    fn format_line(before: &str, after: &str) -> alloc::string::String {
        alloc::format!("{before}{after}")
    }
}
