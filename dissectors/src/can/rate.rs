//! The bit rate of a bus, found from how closely its frames follow each other.

use super::Frame;
use crate::uart::Baud;
use alloc::{format, string::String, vec::Vec};

/// Rates worth trying: those of DeviceNet, then those that CAN is otherwise run at.
const RATES: [u32; 8] = [500_000, 250_000, 125_000, 1_000_000, 800_000, 100_000, 50_000, 20_000];

/// How far a spacing may be off a rate's, in percent.
const TOLERANCE: i64 = 3;

/// Frames that follow each other this slowly, in ns, tell no rate.
const LONGEST_NS: i64 = 1_000_000_000;

/// Frames that must follow the one before without a pause.
const ENOUGH: usize = 4;

/// The rate at which frames follow each other without a pause, with the evidence. Stamps are those
/// of the frames' starts or ends, whichever: then the frame before or this one fills the spacing.
/// `None` where too few do, or the clock is too coarse to tell.
pub(crate) fn bitrate_from_spacing(frames: &[Frame]) -> Option<(Baud, String)> {
    let spacings: Vec<(i64, i64)> = frames
        .windows(2)
        .filter_map(|pair| {
            let ns =
                pair[1].start.since(pair[0].start).filter(|ns| (1..LONGEST_NS).contains(ns))?;
            let [before, this] = [&pair[0], &pair[1]].map(|frame| frame.bits().map(i64::from));
            Some((ns, before?.min(this?)))
        })
        .collect();
    let is_near = |ns: i64, target: i64| (ns - target).abs() * 100 <= target * TOLERANCE;
    let fits = |rate: &u32| {
        let baud = Baud::new(*rate)?;
        let target = |bits: i64| baud.bits_ns(bits as u32).cast_signed();
        let near = || spacings.iter().filter(|(ns, bits)| is_near(*ns, target(*bits)));
        let close = near().count();
        // A cycle time may happen to be the length of some frames, but not of long and short ones.
        let lengths = || near().map(|(_, bits)| *bits);
        let (shortest, longest) = (lengths().min()?, lengths().max()?);
        let is_varied = (longest - shortest) * 100 > shortest * 4 * TOLERANCE;
        if !is_varied && close * 2 < spacings.len() {
            return None;
        }
        let impossible =
            spacings.iter().filter(|(ns, bits)| *ns * 100 < target(*bits) * (100 - TOLERANCE));
        (close >= ENOUGH && impossible.count() * 20 <= close).then_some((baud, close))
    };
    let (baud, close) = RATES.iter().filter_map(fits).max_by_key(|(_, close)| *close)?;
    let all = frames.len() - 1;
    Some((baud, format!("{close} of {all} frames follow the one before without a pause")))
}

/// Frames that are looked at together.
const BLOCK: usize = 256;

/// Blocks after which a bus is believed to tell nothing: then its clock is too coarse.
const BLOCKS: usize = 64;

/// Goes on looking for the rate where the beginning did not tell it: nodes that are switched on
/// one after the other send nothing without a pause.
#[derive(Default)]
pub(crate) struct RateSearch {
    frames: Vec<Frame>,
    blocks: usize,
}

impl RateSearch {
    /// Takes the next frames, as many as a block still lacks. Returns how many these were.
    pub fn take(&mut self, frames: &[Frame]) -> usize {
        let lacking = (BLOCK - self.frames.len()).min(frames.len());
        self.frames.extend_from_slice(&frames[..lacking]);
        lacking
    }

    /// The rate that the frames of a full block tell, with the evidence.
    pub fn find(&mut self) -> Option<(Baud, String)> {
        if self.frames.len() < BLOCK {
            return None;
        }
        let found = bitrate_from_spacing(&self.frames);
        self.frames.clear();
        self.blocks += 1;
        found
    }

    /// Whether it is of no use to go on.
    pub fn is_over(&self) -> bool {
        self.blocks >= BLOCKS
    }
}

#[cfg(test)]
mod tests {
    use super::super::Identifier;
    use super::*;
    use crate::event::Moment;

    #[test]
    fn frames_without_a_pause_tell_the_rate() {
        // 42D without data takes 48 bits with the intermission: 384 µs at 125 kbit/s.
        for (bit_ns, rate) in [(8_000, Some(125_000)), (2_000, Some(500_000)), (2_700, None)] {
            let frames: Vec<Frame> = (0..8)
                .map(|n| {
                    let start = Moment::from_ns(n * 48 * bit_ns + i64::from(n == 7) * 1_000_000);
                    Frame::data(start, 1_000, Identifier::Standard(0x42D), &[])
                })
                .collect();
            assert_eq!(bitrate_from_spacing(&frames).map(|(baud, _)| baud.get()), rate);
        }
    }

    /// Frames of 0 to 8 bytes every millisecond: only those of eight bytes, 125 bits, would fill it
    /// at 125 kbit/s.
    #[test]
    fn a_cycle_time_is_no_rate() {
        let frames: Vec<Frame> = (0..90)
            .map(|n| {
                let (start, id) = (Moment::from_ns(n * 1_000_000), Identifier::Standard(0x34A));
                Frame::data(start, 1_000, id, &[0; 8][..n as usize % 9])
            })
            .collect();
        assert_eq!(bitrate_from_spacing(&frames), None);
    }
}
