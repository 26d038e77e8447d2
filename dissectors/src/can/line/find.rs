//! Bit rate and polarity of a line, found from its level changes.
//!
//! Every setting that the pulses allow is tried on the same piece of line, and the one under which
//! the most frames have a good checksum wins: chance gives one in 32,768.

use super::receiver::Receiver;
use crate::bus::Sampling;
use crate::can::{FrameKind, codes};
use crate::edges::{Edges, shortest_pulses};
use crate::finding::Finding;
use crate::uart::Baud;
use alloc::{format, string::String, vec::Vec};

/// Rates worth trying: those of DeviceNet, then those that CAN is otherwise run at.
const RATES: [u32; 11] = [
    125_000, 250_000, 500_000, 1_000_000, 800_000, 100_000, 83_333, 50_000, 33_333, 20_000, 10_000,
];

/// Fewest samples of a bit.
const FEWEST_SAMPLES: f64 = 1.9;

/// How far a rate may be off one of the usual ones to be taken for it, in percent.
const SNAP: f64 = 2.5;

/// Good frames that make an opinion against the user's worth having.
const ENOUGH: usize = 4;

/// What the user decided about a line.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Given {
    pub bitrate: Option<Baud>,
    pub inverted: Option<bool>,
}

/// What was found about a line.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Found {
    /// The rate: the usual one, if it is near.
    pub bitrate: Baud,
    /// How long a bit lasts by the clock of the capture, in ticks.
    pub bit: f64,
    pub is_inverted: bool,
    /// Frames with a good checksum, and all frames.
    pub good: usize,
    pub all: usize,
}

impl Found {
    /// Whether the line carries frames and nothing else.
    pub fn is_overwhelming(&self) -> bool {
        self.good * 2 > self.all
    }

    pub fn evidence(&self) -> String {
        format!("{} of the first {} frames have a good checksum", self.good, self.all)
    }

    fn is_better_than(&self, other: &Found) -> bool {
        let bad = |found: &Found| found.all - found.good;
        self.good > other.good || (self.good == other.good && bad(self) < bad(other))
    }

    fn differs_from(&self, bitrate: Baud) -> bool {
        let (set, found) = (f64::from(bitrate.get()), f64::from(self.bitrate.get()));
        (set - found).abs() * 100.0 > found * SNAP
    }
}

/// Finds what the user left open. `None` if no frame has a good checksum.
pub(super) fn find(edges: &Edges, sampling: Sampling, given: Given) -> Option<Found> {
    let polarities = match given.inverted {
        Some(is_inverted) => &[is_inverted][..],
        None => &[false, true],
    };
    let mut best: Option<Found> = None;
    for bit in candidate_bits(edges, sampling, given) {
        for is_inverted in polarities.iter().copied() {
            let Some(mut found) = try_setting(edges, sampling, bit, is_inverted) else { continue };
            found.bitrate = given.bitrate.unwrap_or(found.bitrate);
            if best.as_ref().is_none_or(|best| found.is_better_than(best)) {
                best = Some(found);
            }
        }
    }
    best
}

/// What is wrong with the settings that were given, if under others there are far more good frames
/// than under those that are `used`.
pub(super) fn doubt(
    edges: &Edges,
    sampling: Sampling,
    given: Given,
    used: Option<&Found>,
) -> Option<Finding> {
    let own = find(edges, sampling, Given { bitrate: None, inverted: None })?;
    let good = used.map_or(0, |used| used.good);
    if own.good < ENOUGH || !own.is_overwhelming() || good * 2 > own.good {
        return None;
    }
    let set = given.bitrate.filter(|set| own.differs_from(*set));
    let is_swapped = given.inverted.is_some_and(|set| set != own.is_inverted);
    let [found, set] = [own.bitrate, set.unwrap_or(own.bitrate)].map(|rate| i64::from(rate.get()));
    let finding = Finding::new(&codes::WRONG_BITRATE).expected(found).actual(set);
    (found != set || is_swapped).then_some(finding)
}

/// How long a bit may be, in ticks: at the usual rates, then as the shortest pulses say.
fn candidate_bits(edges: &Edges, sampling: Sampling, given: Given) -> Vec<f64> {
    let bit_of = |rate: u32| sampling.ticks_per_second as f64 / f64::from(rate);
    if let Some(bitrate) = given.bitrate {
        return alloc::vec![bit_of(bitrate.get())];
    }
    let usual = RATES.into_iter().map(bit_of);
    usual.chain(shortest_pulses(&edges.ticks)).filter(|bit| *bit >= FEWEST_SAMPLES).collect()
}

/// Receives with bits of that length, then with the length that they turn out to have: the clocks
/// of capture and senders may differ.
fn try_setting(edges: &Edges, sampling: Sampling, bit: f64, is_inverted: bool) -> Option<Found> {
    let listen = |bit: f64| {
        let mut receiver = Receiver::new(bit, is_inverted, sampling);
        receiver.hear(&edges.levels());
        let is_classic = |frame: &&crate::can::Frame| frame.kind != FrameKind::Fd;
        let frames = receiver.frames.iter().filter(is_classic);
        let good = frames.clone().filter(|frame| frame.crc == Some(true)).count();
        let bitrate = bitrate_of(sampling.ticks_per_second as f64 / bit)?;
        let found = Found { bitrate, bit, is_inverted, good, all: frames.count() };
        Some((found, receiver.measured_bit()?))
    };
    let (first, measured) = listen(bit)?;
    let (again, _) = listen(measured)?;
    Some(if first.is_better_than(&again) { first } else { again })
}

/// The usual rate, if this one is near, or itself.
fn bitrate_of(rate: f64) -> Option<Baud> {
    let is_near = |usual: &u32| {
        let usual = f64::from(*usual);
        (rate - usual).abs() * 100.0 <= usual * SNAP
    };
    Baud::new(RATES.into_iter().find(is_near).unwrap_or((rate + 0.5) as u32))
}
