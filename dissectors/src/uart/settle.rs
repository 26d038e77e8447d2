//! Where the first whole character of a capture begins.
//!
//! A capture may begin inside a character, and then every falling edge of the rest looks like a
//! start. Every edge is followed until the ways meet: those that lead to errors are wrong, and of
//! the others the one whose characters join without a gap is right. It begins with the first
//! character that is joined to the next; what stands alone before it may be the rest of one that
//! was cut. No character is invented.

use super::sampler::{Read, Sampler};
use crate::edges::Edges;
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
    // All that comes before the first character is the rest of one that began before the capture:
    // its last rise is that of its stop bit at the latest, and stays up for a bit. If the line is
    // high at first, the start bit of that one was over.
    let gone = if first == 0 { 2.0 } else { 1.0 };
    let last_rise = edges.from as f64 + sampler.frame() - (gone - 0.3) * sampler.bit;
    let may_begin = |start: &usize| match start.checked_sub(1).map(|rise| ticks[rise] as f64) {
        Some(rise) => rise <= last_rise && ticks[*start] as f64 - rise > 0.75 * sampler.bit,
        None => true,
    };
    let candidates = (first..end).step_by(2).filter(may_begin);
    let ways: Vec<Way> =
        candidates.map(|start| follow(ticks, start..end, sampler, &is_wrong)).collect();
    let [straight, ..] = ways.as_slice() else { return first };
    let is_everywhere = |start: &usize| ways.iter().all(|way| way.goes_through(*start));
    let meeting = straight.starts().find(is_everywhere).filter(|_| ways.len() > 1);
    let mut right: Vec<&Way> = ways.iter().filter(|way| way.errors_before(meeting) == 0).collect();
    // A single joint may be chance.
    let most = right.iter().map(|way| way.joints_up_to(meeting)).max().unwrap_or(0);
    right.retain(|way| way.joints_up_to(meeting) + 1 >= most);
    let start = match right.as_slice() {
        [] => {
            // Noise: where the line is idle later on, that is a place to begin.
            let is_hopeless = straight.stumbles() && end < ticks.len();
            return if is_hopeless { end } else { first };
        }
        [only] => only.first_joined(meeting),
        [one, ..] => one.starts().find(|start| right.iter().all(|way| way.goes_through(*start))),
    };
    // Where nothing is sure, the next idle time is; unless there is none, as where the capture is a
    // single character, which begins with its first edge.
    start.or(meeting).unwrap_or(if end < ticks.len() { end } else { first })
}

/// One way to begin, and where it leads.
struct Way(Vec<Step>);

#[derive(Clone, Copy)]
struct Step {
    /// The index of its edge.
    start: usize,
    is_wrong: bool,
    /// The next character begins right behind it.
    is_joined: bool,
}

impl Way {
    fn starts(&self) -> impl Iterator<Item = usize> {
        self.0.iter().map(|step| step.start)
    }

    fn goes_through(&self, start: usize) -> bool {
        self.0.binary_search_by_key(&start, |step| step.start).is_ok()
    }

    /// Whether it goes wrong early, as a way that begins inside a character does.
    fn stumbles(&self) -> bool {
        self.0.iter().take(EARLY).any(|step| step.is_wrong)
    }

    fn before(&self, meeting: Option<usize>) -> impl Iterator<Item = &Step> {
        self.0.iter().take_while(move |step| meeting.is_none_or(|meeting| step.start < meeting))
    }

    fn errors_before(&self, meeting: Option<usize>) -> usize {
        self.before(meeting).filter(|step| step.is_wrong).count()
    }

    fn joints_up_to(&self, meeting: Option<usize>) -> usize {
        self.before(meeting).filter(|step| step.is_joined).count()
    }

    fn first_joined(&self, meeting: Option<usize>) -> Option<usize> {
        self.before(meeting).find(|step| step.is_joined).map(|step| step.start)
    }
}

fn follow(
    ticks: &[u64],
    edges: Range<usize>,
    sampler: &Sampler,
    is_wrong: &impl Fn(u16) -> bool,
) -> Way {
    let mut steps = Vec::new();
    let mut index = edges.start;
    while index < edges.end {
        let reading = sampler.read(ticks, index);
        let is_wrong = match reading.read {
            Read::Character { bits, has_stop } => !has_stop || is_wrong(bits),
            Read::Break | Read::FalseStart => true,
        };
        let length = |next: &u64| (next - ticks[index]) as f64;
        let gap = ticks.get(reading.next).map(length).map(|length| length - sampler.frame());
        let is_joined = gap.is_some_and(|gap| gap.max(-gap) < sampler.bit / 4.0);
        steps.push(Step { start: index, is_wrong, is_joined });
        index = reading.next;
    }
    Way(steps)
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
    fn the_rest_of_a_character_in_front_of_a_pause_is_no_character() {
        // Idle, with a single low bit in it: FEh with the right parity, if it began here.
        let rest = format_line("111 0 0 11111111111111111 ", ANSWER);
        assert_eq!(begins(&line(&rest, 0)), Some(10 * 22));
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
