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

/// Which moment of a frame its stamp is: then the frame before fills the spacing, or this one.
#[derive(Clone, Copy)]
enum Stamped {
    Start,
    End,
}

/// Two frames one after the other: what their stamps are apart, and the bits that may fill that.
struct Spacing {
    ns: i64,
    bits: u32,
    /// The ± of both stamps.
    uncertainty: i64,
}

impl Spacing {
    fn between(before: &Frame, this: &Frame, stamped: Stamped) -> Option<Self> {
        let ns = this.start.since(before.start).filter(|ns| (1..LONGEST_NS).contains(ns))?;
        let (before_bits, this_bits) = (before.bits()?, this.bits()?);
        let bits = match stamped {
            Stamped::Start => before_bits,
            Stamped::End => this_bits,
        };
        let uncertainty = i64::from(before.uncertainty) + i64::from(this.uncertainty);
        // A source may say that a frame has no bits.
        (bits > 0).then_some(Spacing { ns, bits: u32::from(bits), uncertainty })
    }

    /// How much longer it is than the frame at a rate, in percent of that; `None` where the stamps
    /// are too coarse to tell.
    fn excess(&self, rate: Baud) -> Option<i64> {
        let frame = rate.bits_ns(self.bits).cast_signed();
        let is_fine = self.uncertainty * 100 <= frame * TOLERANCE;
        is_fine.then_some(((self.ns - frame) * 100).div_euclid(frame))
    }
}

/// The rate at which frames follow each other without a pause, with the evidence. `None` where too
/// few do, or the clock is too coarse to tell: a wrong rate is worse than none.
pub(crate) fn bitrate_from_spacing(frames: &[Frame]) -> Option<(Baud, String)> {
    let fits = [Stamped::Start, Stamped::End].into_iter().flat_map(|stamped| {
        let between = |pair: &[Frame]| Spacing::between(&pair[0], &pair[1], stamped);
        let spacings: Vec<Spacing> = frames.windows(2).filter_map(between).collect();
        let rates = RATES.into_iter().filter_map(Baud::new);
        rates.filter_map(move |rate| Some((rate, fit(&spacings, rate)?)))
    });
    let (baud, close) = fits.max_by_key(|(_, close)| *close)?;
    let all = frames.len() - 1;
    Some((baud, format!("{close} of {all} frames follow the one before without a pause")))
}

/// How many spacings are a frame long at this rate, if that is no chance.
fn fit(spacings: &[Spacing], rate: Baud) -> Option<usize> {
    let (mut lengths, mut rests, mut shorter, mut longer) = (Vec::new(), Vec::new(), 0, 0);
    for spacing in spacings {
        match spacing.excess(rate) {
            Some(excess) if excess < -TOLERANCE => shorter += 1,
            Some(excess) if excess < TOLERANCE => {
                let length = rate.bits_ns(spacing.bits).cast_signed();
                lengths.push(length);
                rests.push(spacing.ns - length);
            }
            Some(excess) if excess < 3 * TOLERANCE => longer += 1,
            _ => {}
        }
    }
    let close = lengths.len();
    // A cycle time or the clock of an adapter may happen to be the length of some frames: but then
    // it stays as it is, be the frame a bit longer or shorter.
    let follows_length = spread(lengths)? > 3 * spread(rests)?;
    // No frame is shorter than it is; and where stamps are smeared, as many are a little longer.
    let is_sharp = shorter * 20 <= close && longer <= close;
    (close >= ENOUGH && follows_length && is_sharp).then_some(close)
}

/// How far values are apart, a few outliers left out.
fn spread(mut values: Vec<i64>) -> Option<i64> {
    values.sort_unstable();
    let left_out = (values.len() / 10).max(1);
    Some(values.iter().nth_back(left_out)? - values.get(left_out)?)
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

    /// Frames of 48 bits and of 125, with the intermission: 42D without data, 34A with eight zeros.
    const SHORT: (u16, &[u8], i64) = (0x42D, &[], 48);
    const LONG: (u16, &[u8], i64) = (0x34A, &[0; 8], 125);

    fn frame(ns: i64, (id, data, _): (u16, &[u8], i64)) -> Frame {
        Frame::data(Moment::from_ns(ns), 1_000, Identifier::Standard(id), data)
    }

    fn found(frames: &[Frame]) -> Option<u32> {
        bitrate_from_spacing(frames).map(|(baud, _)| baud.get())
    }

    #[test]
    fn frames_without_a_pause_tell_the_rate() {
        for (bit_ns, rate) in [(8_000, Some(125_000)), (2_000, Some(500_000)), (2_700, None)] {
            let (mut starts, mut ends, mut now) = (Vec::new(), Vec::new(), 0);
            for n in 0..9 {
                let what = if n % 2 == 0 { SHORT } else { LONG };
                starts.push(frame(now, what));
                now += what.2 * bit_ns;
                ends.push(frame(now, what));
                now += if n == 7 { 1_000_000 } else { 0 };
            }
            assert_eq!([found(&starts), found(&ends)], [rate, rate]);
        }
    }

    #[test]
    fn frames_that_are_said_to_have_no_bits_tell_no_rate() {
        let mut frames: Vec<Frame> = (0..20).map(|n| frame(n * 384_000, SHORT)).collect();
        frames.iter_mut().for_each(|frame| {
            (frame.measured_bits, frame.uncertainty) = (Some(0), 0);
        });
        assert_eq!(found(&frames), None);
    }

    /// Four slaves are polled every 12 ms at 125 kbit/s, and answer at once or somewhat later; what
    /// is asked of them besides waits until the bus is free.
    fn polls(seed: u64) -> Vec<Frame> {
        let (mut now, mut next, mut frames) = (0, Dice(seed), Vec::new());
        for cycle in 0.. {
            now = now.max(cycle * 12_000_000);
            for slave in 0..4 {
                frames.push(frame(now, SHORT));
                now += SHORT.2 * 8_000 + 40_000 + slave * 35_000 + next.below(20_000);
                let position = next.below(1 << 29).to_le_bytes();
                let answer = frame(now, (0x3C1, &position[..4], 0));
                frames.push(answer);
                now += i64::from(answer.bits().unwrap_or_default()) * 8_000;
                now += if next.below(2) == 0 { 0 } else { next.below(900_000) };
                if frames.len() >= 256 {
                    return frames;
                }
            }
        }
        frames
    }

    /// Numbers that are the same at every run: Marsaglia's xorshift.
    struct Dice(u64);

    impl Dice {
        fn below(&mut self, limit: i64) -> i64 {
            self.0 ^= self.0 << 13;
            self.0 ^= self.0 >> 7;
            self.0 ^= self.0 << 17;
            (self.0 % limit.unsigned_abs()) as i64
        }
    }

    /// Adapters hand frames over in bunches, or late by what the computer does besides.
    #[test]
    fn stamps_of_a_computer_tell_no_wrong_rate() {
        for (model, tells) in [
            // The hardware's: a microsecond.
            (0, true),
            // Read every millisecond, every 125 µs of USB, every 16 ms; late by up to 50 µs, by up
            // to 1 ms; in bunches of frames 110 to 120 µs apart.
            (1, false),
            (2, false),
            (3, false),
            (4, false),
            (5, false),
            (6, false),
        ] {
            let mut told = 0;
            for seed in 1..100 {
                let (mut dice, mut last) = (Dice(seed), 0);
                let bunched = |now: i64, every: i64, last: i64, apart: i64| {
                    let read = (now + every - 1) / every * every;
                    if read > last { read } else { last + apart }
                };
                let stamped: Vec<Frame> = polls(seed * 977)
                    .into_iter()
                    .map(|mut frame| {
                        let now = frame.start.ns().unwrap_or_default();
                        last = match model {
                            1 => bunched(now, 1_000_000, last, 3_000),
                            2 => bunched(now, 125_000, last, 3_000) + dice.below(5_000),
                            3 => bunched(now, 16_000_000, last, 3_000 + dice.below(300_000)),
                            4 => last.max(now + dice.below(50_000)) + 1_000,
                            5 => last.max(now + dice.below(1_000_000)) + 1_000,
                            6 => bunched(now, 4_000_000, last, 110_000 + dice.below(10_000)),
                            _ => now,
                        };
                        frame.start = Moment::from_ns(last);
                        frame
                    })
                    .collect();
                let rate = found(&stamped);
                assert!(matches!(rate, None | Some(125_000)), "{model} {seed}: {rate:?}");
                told += usize::from(rate.is_some());
            }
            assert!(!tells || told > 95, "{model}: {told}");
        }
    }

    /// One slave whose answer begins as late as makes the poll a frame of another rate.
    #[test]
    fn an_answer_that_comes_in_time_for_another_rate_tells_none() {
        for late in (0..1_000).step_by(3) {
            let frames: Vec<Frame> = (0..250)
                .map(|n| {
                    let poll = n / 2 * 10_000_000;
                    let answer = poll + SHORT.2 * 2_000 + late * 1_000;
                    if n % 2 == 0 { frame(poll, SHORT) } else { frame(answer, LONG) }
                })
                .collect();
            assert_eq!(found(&frames).filter(|rate| *rate != 500_000), None, "{late} µs");
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
