//! Line levels of the channels of one capture, gathered a few thousand edges at a time.
//!
//! A channel becomes a bus when its first edge comes; one that never moves is none.

use super::outbox::Outbox;
use dissectors::bus::{Sampling, WireFacts};
use dissectors::event::{Clock, Levels, Loss, LossCause, Moment};
use dissectors::record::BusInfo;

/// Edges of one channel that are gathered at most.
const BATCH: usize = 4096;

/// Edges it takes to find out how far samples are apart.
const ENOUGH_EDGES: usize = 16;

/// The channels of a capture. Ticks are ns since `Sampling::origin`.
pub struct Lanes {
    sampling: Sampling,
    is_period_known: bool,
    lanes: Vec<Lane>,
    buses: usize,
    last_edge: u64,
    is_full: bool,
}

struct Lane {
    name: String,
    bus: Option<usize>,
    /// What is known and not handed over; `None` where the channel has no data.
    known: Option<Known>,
    edges: Vec<u64>,
}

#[derive(Clone, Copy)]
struct Known {
    from: u64,
    /// Before the edges.
    level: bool,
}

impl Lane {
    /// The level behind the last edge.
    fn level(&self) -> Option<bool> {
        self.known.map(|known| known.level ^ (self.edges.len() % 2 == 1))
    }
}

impl Lanes {
    /// Channels whose tick 0 is at `origin`. Where the distance of samples is not known, in ns, it
    /// is found from the first edges.
    pub fn new(origin: Moment, period: Option<u32>) -> Self {
        let uncertainty = period.unwrap_or(1).max(1);
        Lanes {
            sampling: Sampling { ticks_per_second: 1_000_000_000, uncertainty, origin },
            is_period_known: period.is_some(),
            lanes: Vec::new(),
            buses: 0,
            last_edge: 0,
            is_full: false,
        }
    }

    /// Adds a channel and returns its number. Nothing is known of it yet.
    pub fn add(&mut self, name: String) -> usize {
        self.lanes.push(Lane { name, bus: None, known: None, edges: Vec::new() });
        self.lanes.len() - 1
    }

    /// The channel has this level from this tick on; `None` where there is no data. Ticks of all
    /// channels together never go back.
    pub fn set(&mut self, number: usize, tick: u64, level: Option<bool>, out: &mut Outbox) {
        let lane = &mut self.lanes[number];
        if lane.level() == level {
            return;
        }
        match (level, lane.known) {
            (None, _) => self.end_of_data(number, tick, out),
            (Some(level), None) => lane.known = Some(Known { from: tick, level }),
            // There and back in no time: nothing happened.
            (Some(_), Some(_)) if lane.edges.last() == Some(&tick) => {
                lane.edges.pop();
            }
            (Some(_), Some(_)) => {
                lane.edges.push(tick);
                self.last_edge = tick;
                self.is_full |= lane.edges.len() >= BATCH;
            }
        }
    }

    /// Nothing happens before this tick that was not said. Hands over what was gathered, if that
    /// is enough.
    pub fn reach(&mut self, tick: u64, out: &mut Outbox) {
        if self.is_full && tick > self.last_edge {
            self.hand_over_all(tick, out);
        }
    }

    /// The capture ends at this tick.
    pub fn finish(&mut self, tick: u64, out: &mut Outbox) {
        self.hand_over_all(tick.max(self.last_edge + 1), out);
        for bus in 0..self.buses {
            out.end(bus, self.moment(tick));
        }
    }

    fn hand_over_all(&mut self, until: u64, out: &mut Outbox) {
        for lane in 0..self.lanes.len() {
            self.hand_over(lane, until, out);
        }
        self.is_full = false;
    }

    /// Hands over what is known of a channel before a tick.
    fn hand_over(&mut self, lane: usize, until: u64, out: &mut Outbox) {
        if self.lanes[lane].bus.is_none() && !self.lanes[lane].edges.is_empty() {
            self.announce(lane, out);
        }
        let lane = &mut self.lanes[lane];
        let (Some(bus), Some(Known { from, level })) = (lane.bus, lane.known) else { return };
        out.levels(bus, Levels { edges: &lane.edges, level, from, until });
        let level = level ^ (lane.edges.len() % 2 == 1);
        lane.edges.clear();
        lane.known = Some(Known { from: until, level });
    }

    fn announce(&mut self, lane: usize, out: &mut Outbox) {
        if !self.is_period_known {
            let period = period(self.lanes.iter().map(|lane| lane.edges.as_slice()));
            self.is_period_known = period.is_some();
            self.sampling.uncertainty = period.unwrap_or(1);
        }
        let lane = &mut self.lanes[lane];
        lane.bus = Some(self.buses);
        self.buses += 1;
        let info = BusInfo::new(lane.name.clone(), Some(Clock::Sample));
        out.bus(info, WireFacts { sampling: Some(self.sampling), ..WireFacts::default() });
    }

    fn end_of_data(&mut self, lane: usize, tick: u64, out: &mut Outbox) {
        let behind_edges = self.lanes[lane].edges.last().map_or(0, |edge| edge + 1);
        self.hand_over(lane, tick.max(behind_edges), out);
        self.lanes[lane].known = None;
        if let Some(bus) = self.lanes[lane].bus {
            let start = self.moment(tick);
            out.lost(bus, Loss { start, count: None, cause: LossCause::Capture });
        }
    }

    fn moment(&self, tick: u64) -> Moment {
        self.sampling.origin.plus(i64::try_from(tick).unwrap_or(i64::MAX))
    }
}

/// How far samples are apart, in ns, if edges show it: what all their distances are multiples of.
/// `None` if there are too few edges to tell; 1 where they follow no grid, or only that of what is
/// sent, so that nothing is known but the resolution of the times.
fn period<'a>(lanes: impl Iterator<Item = &'a [u64]>) -> Option<u32> {
    let (mut grid, mut shortest, mut count) = (0, u64::MAX, 0);
    for pair in lanes.flat_map(|edges| edges.windows(2)).take(512) {
        let distance = pair[1] - pair[0];
        grid = greatest_common_divisor(grid, distance);
        shortest = shortest.min(distance);
        count += 1;
    }
    // Sampled signals have a few samples a bit, at least.
    let is_grid = grid.saturating_mul(4) <= shortest;
    (count >= ENOUGH_EDGES).then(|| if is_grid { u32::try_from(grid).unwrap_or(1) } else { 1 })
}

fn greatest_common_divisor(mut a: u64, mut b: u64) -> u64 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}

#[cfg(test)]
mod tests {
    use super::super::SourceError;
    use super::super::outbox::{Reader, Reading};
    use super::super::transcript::of_source;
    use super::*;

    struct Once<F>(F);

    impl<F: FnMut(&mut Lanes, &mut Outbox)> Reader for Once<F> {
        fn read_on(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
            let mut lanes = Lanes::new(Moment::from_ns(1_000_000), None);
            lanes.add("A".to_owned());
            lanes.add("B".to_owned());
            self.0(&mut lanes, out);
            Ok(false)
        }
    }

    fn said(build: impl FnMut(&mut Lanes, &mut Outbox)) -> Vec<String> {
        of_source(&mut Reading::new(Once(build)))
    }

    #[test]
    fn channels_that_never_move_are_no_buses() {
        let said = said(|lanes, out| {
            lanes.set(0, 5, Some(true), out);
            lanes.set(1, 5, Some(true), out);
            lanes.set(1, 100, Some(false), out);
            lanes.set(1, 110, Some(true), out);
            lanes.finish(200, out);
        });
        assert_eq!(
            said,
            [
                "bus B sample 1000000000/s ±1 @1000000",
                "0: high from 5 [100, 110] until 200",
                "0: end @1000200"
            ]
        );
    }

    #[test]
    fn a_gap_is_a_loss_and_the_line_is_known_again_behind_it() {
        let said = said(|lanes, out| {
            for (tick, level) in
                [(0, Some(true)), (10, None), (20, Some(true)), (30, Some(false)), (40, None)]
            {
                lanes.set(0, tick, level, out);
            }
            lanes.set(0, 50, Some(false), out);
            lanes.set(0, 60, Some(true), out);
            lanes.finish(70, out);
        });
        assert_eq!(
            said[1..],
            [
                // The gap before the first edge is not on any bus.
                "0: high from 20 [30] until 40",
                "0: lost Capture @1000040",
                "0: low from 50 [60] until 70",
                "0: end @1000070"
            ]
        );
    }

    #[test]
    fn pulses_of_no_length_are_none() {
        let said = said(|lanes, out| {
            for (tick, level) in [(0, true), (10, false), (20, true), (20, false), (30, true)] {
                lanes.set(0, tick, Some(level), out);
            }
            lanes.finish(40, out);
        });
        assert_eq!(said[1], "0: high from 0 [10, 30] until 40");
    }

    #[test]
    fn edges_are_handed_over_in_pieces_that_join() {
        let said = said(|lanes, out| {
            for n in 0..2 * BATCH as u64 + 1 {
                lanes.reach(10 * n, out);
                lanes.set(1, 10 * n, Some(n % 2 == 1), out);
            }
            lanes.finish(1_000_000, out);
        });
        let size = BATCH as u64;
        let joint = 10 * (size + 1);
        assert_eq!(said.len(), 1 + 2 + 1);
        assert!(said[1].starts_with("0: low from 0 [10, 20, "));
        assert!(said[1].ends_with(&format!(" {}] until {joint}", 10 * size)));
        assert!(said[2].starts_with(&format!("0: low from {joint} [{joint}, ")));
        assert!(said[2].ends_with(&format!(" {}] until 1000000", 20 * size)));
    }

    #[test]
    fn the_distance_of_samples_shows_in_the_edges() {
        let edges = |step: u64, bits: &[u64]| -> Vec<u64> {
            bits.iter()
                .cycle()
                .take(40)
                .scan(0, |at, bits| {
                    *at += bits * step;
                    Some(*at)
                })
                .collect()
        };
        // 115200 Bd at 4 MHz: 34 or 35 samples of 250 ns a bit.
        assert_eq!(period([&edges(250, &[34, 35, 69, 104])[..]].into_iter()), Some(250));
        // Exact multiples of a bit of 100 µs are no samples.
        assert_eq!(period([&edges(100_000, &[1, 2, 5])[..]].into_iter()), Some(1));
        assert_eq!(period([&edges(1, &[8_680, 8_681, 17_361])[..]].into_iter()), Some(1));
        assert_eq!(period([&[250, 500, 1_000][..]].into_iter()), None);
    }
}
