//! What a frame looks like on the wire, whole or destroyed (CAN 2.0 §3.1, §6).

use super::bits::{Encoded, INTERMISSION, TAIL, encode};
use super::frame::Frame;
use crate::simulate::chance::Chance;
use crate::simulate::level::Low;
use crate::simulate::time::{Clock, Ps};

/// Bits of an error or overload flag.
const FLAG: usize = 6;
/// Bits of the delimiter behind it.
const DELIMITER: usize = 8;
/// Bits that a node waits which is error passive and was the last to send.
const SUSPENSION: usize = 8;

/// What is wrong with an attempt to send a frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Flaw {
    /// A node sees an error of its own and flags it: the others follow.
    Flagged,
    /// A stuff bit is turned over: everybody flags.
    Stuff,
    /// Noise turns a bit over without a stuff error: who saw it flags after the acknowledge.
    Crc,
    /// A bit of the end of frame is dominant.
    Form,
    /// Nobody acknowledges, and the sender flags that.
    Unacknowledged,
    /// The same when the sender is error passive: its flag is recessive, and who only listens sees
    /// a whole frame.
    UnacknowledgedPassive,
    /// The frame is whole, and a node asks for time behind it.
    Overload,
}

impl Flaw {
    /// Whether the frame has to be sent again.
    pub fn destroys(self) -> bool {
        self != Flaw::Overload
    }

    /// Whether who only listens hears a whole frame.
    pub fn leaves_it_whole(self) -> bool {
        matches!(self, Flaw::Overload | Flaw::UnacknowledgedPassive)
    }
}

/// An attempt to send a frame, as levels.
pub struct Course {
    /// From the start of frame on.
    levels: Vec<bool>,
    /// Bits up to the end of the frame, or to the end of the error's delimiter.
    pub end: usize,
    /// Bits up to where the next frame may begin.
    pub free: usize,
}

impl Course {
    /// A frame that everybody takes.
    pub fn whole(frame: &Frame) -> Self {
        let mut levels = encode(frame).levels;
        levels.extend(tail(false));
        Course::rest(levels)
    }

    /// A frame with a flaw; `None` if this frame cannot have it.
    pub fn flawed(frame: &Frame, flaw: Flaw, chance: &mut Chance) -> Option<Self> {
        let encoded = encode(frame);
        let length = encoded.levels.len();
        let mut levels = encoded.levels.clone();
        match flaw {
            Flaw::Flagged => {
                levels.truncate(chance.between(encoded.data as i64, length as i64) as usize);
                flag(&mut levels, FLAG + chance.below(FLAG as u64 + 1) as usize);
            }
            Flaw::Stuff => {
                let later = encoded.stuffed.iter().copied().filter(|at| *at >= encoded.data);
                let at = chance.one_of(&later.collect::<Vec<_>>())?;
                levels.truncate(at + 1);
                levels[at] = !levels[at];
                flag(&mut levels, FLAG);
            }
            Flaw::Crc => {
                let at = chance.one_of(&unnoticed(&encoded))?;
                levels[at] = !levels[at];
                // Who heard it well acknowledges. Who did not flags at once after the delimiter, and
                // the others, to whom that is an error of form, one bit later.
                levels.extend([true, false, true]);
                flag(&mut levels, FLAG + 1);
            }
            Flaw::Form => {
                // Checksum's delimiter, acknowledge slot and delimiter, and not yet the last but
                // one bit, behind which receivers take the frame.
                levels.extend(&tail(false)[..3 + chance.below(5) as usize]);
                levels.push(false);
                flag(&mut levels, FLAG);
            }
            Flaw::Unacknowledged => {
                levels.extend([true, true]);
                flag(&mut levels, FLAG);
            }
            Flaw::UnacknowledgedPassive => {
                levels.extend(tail(true));
                let end = levels.len();
                let free = length + 2 + FLAG + DELIMITER + INTERMISSION + SUSPENSION;
                levels.resize(free, true);
                return Some(Course { levels, end, free });
            }
            Flaw::Overload => {
                levels.extend(tail(false));
                let end = levels.len();
                flag(&mut levels, FLAG + 1);
                let free = levels.len() + INTERMISSION;
                return Some(Course { levels, end, free });
            }
        }
        Some(Course::rest(levels))
    }

    fn rest(levels: Vec<bool>) -> Self {
        let end = levels.len();
        Course { levels, end, free: end + INTERMISSION }
    }

    /// When the line is low, if it begins at this time: CAN_RX shows dominant as low.
    pub fn spans(&self, start: Ps, clock: Clock) -> Vec<Low> {
        let mut spans: Vec<Low> = Vec::new();
        let mut was_low = false;
        for (bit, level) in self.levels.iter().enumerate() {
            let to = start + clock.bits(bit as f64 + 1.0);
            match (level, spans.last_mut()) {
                (false, Some(low)) if was_low => low.to = to,
                (false, _) => spans.push(Low { from: start + clock.bits(bit as f64), to }),
                (true, _) => {}
            }
            was_low = !level;
        }
        spans
    }
}

/// What follows the checksum of a frame: only the acknowledge slot can be dominant.
fn tail(is_slot_empty: bool) -> [bool; TAIL] {
    std::array::from_fn(|bit| bit != 1 || is_slot_empty)
}

/// An error or overload flag with the flags of those who see it, and the delimiter.
fn flag(levels: &mut Vec<bool>, dominant: usize) {
    levels.resize(levels.len() + dominant, false);
    levels.resize(levels.len() + DELIMITER, true);
}

/// Bits of the data that can be turned over so that only the checksum tells: the stuff bits stay
/// where they are.
fn unnoticed(encoded: &Encoded) -> Vec<usize> {
    (encoded.data..encoded.levels.len())
        .filter(|at| {
            let mut levels = encoded.levels.clone();
            levels[*at] = !levels[*at];
            !encoded.stuffed.contains(at) && stuff_bits(&levels) == Some(encoded.stuffed.clone())
        })
        .collect()
}

/// Where a receiver finds stuff bits; `None` if one has the wrong level.
fn stuff_bits(levels: &[bool]) -> Option<Vec<usize>> {
    let (mut found, mut run, mut last) = (Vec::new(), 0, true);
    for (at, level) in levels.iter().enumerate() {
        if run == 5 {
            if *level == last {
                return None;
            }
            found.push(at);
            run = 0;
        }
        run = if at > 0 && *level == last { run + 1 } else { 1 };
        last = *level;
    }
    // A run of five that ends with the checksum has its stuff bit behind it.
    (run < 5).then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dominant_run(course: &Course) -> usize {
        let runs = course.levels.split(|level| *level).map(<[bool]>::len);
        runs.max().unwrap_or(0)
    }

    fn flawed(flaw: Flaw) -> Course {
        let frame = Frame::new(0x3D7, &[0x00, 0x00, 0x04, 0x00]);
        Course::flawed(&frame, flaw, &mut Chance::new(1, 1)).unwrap()
    }

    #[test]
    fn a_whole_frame_ends_with_eleven_recessive_bits() {
        // 42D without data: 48 bits with the intermission.
        let course = Course::whole(&Frame::new(0x42D, &[]));
        assert_eq!((course.end, course.free), (45, 48));
        assert!(course.levels[45 - 8..].iter().all(|level| *level));
        assert!(!course.levels[45 - 9], "the acknowledge");
    }

    #[test]
    fn a_destroyed_frame_has_a_flag_and_a_delimiter() {
        for flaw in [Flaw::Flagged, Flaw::Stuff, Flaw::Crc, Flaw::Form, Flaw::Unacknowledged] {
            let course = flawed(flaw);
            let end = course.levels.len();
            assert!(dominant_run(&course) >= FLAG, "{flaw:?}");
            assert!(course.levels[end - DELIMITER..].iter().all(|level| *level), "{flaw:?}");
            assert!(!course.levels[end - DELIMITER - 1], "{flaw:?}");
            assert_eq!(course.free, course.end + INTERMISSION);
        }
    }

    #[test]
    fn a_checksum_error_is_not_a_stuff_error() {
        for seed in 0..50 {
            let frame = Frame::new(0x357, &[0x12, 0x34, 0x56, 0x00]);
            let clean = encode(&frame).levels;
            let course = Course::flawed(&frame, Flaw::Crc, &mut Chance::new(seed, 1)).unwrap();
            let levels = &course.levels[..clean.len()];
            assert_eq!(levels.iter().zip(&clean).filter(|(one, other)| one != other).count(), 1);
            assert_eq!(
                stuff_bits(levels).map(|bits| bits.len()),
                Some(encode(&frame).stuffed.len())
            );
        }
    }

    #[test]
    fn a_passive_sender_that_nobody_hears_repeats_after_25_bits() {
        let frame = Frame::new(0x4BF, &[0, 1, 0, 2, 3, 4, 5]);
        let course =
            Course::flawed(&frame, Flaw::UnacknowledgedPassive, &mut Chance::new(1, 1)).unwrap();
        // Flag 6, delimiter 8, intermission 3, suspension 8, from the bit behind the empty slot on.
        assert_eq!(course.free, encode(&frame).levels.len() + 2 + 25);
    }

    #[test]
    fn levels_become_spans() {
        let clock = Clock::exact(500_000);
        let course = Course { levels: vec![false, true, false, false, true], end: 5, free: 8 };
        let low = |from: Ps, to: Ps| Low { from: from * 2_000_000, to: to * 2_000_000 };
        assert_eq!(course.spans(0, clock), [low(0, 1), low(2, 4)]);
    }
}
