//! What the tap hears of the bus: a controller that may miss frames, cut them, or leave the bus.

use super::bus::Attempt;
use super::fate::Fate;
use super::fault::Fault;
use super::plan::Plan;
use super::tap::{ErrorFrame, What};
use super::truth::Fortune;
use super::wire::Flaw;
use crate::simulate::chance::Chance;
use crate::simulate::order::Orderable;
use crate::simulate::time::{MS, Ps};

/// The stream of the seed.
const TAP: u64 = 4;

/// How long a controller is off the bus before it is restarted.
const OFF: Ps = 120 * MS;

/// The tap's controller.
pub struct Listener {
    chance: Chance,
    has_wrong_rate: bool,
    /// Errors that it counts: less one with every good frame.
    errors: u8,
    /// Frames heard whole.
    pub frames: u64,
    /// Frames that it is missing now, and those that it still will.
    missed: u64,
    misses: u64,
    /// When it heard the last frame.
    heard_at: Ps,
    /// It is off the bus until then.
    off_until: Option<Ps>,
}

impl Listener {
    /// A controller that heard nothing yet.
    pub fn new(plan: &Plan) -> Self {
        Listener {
            chance: Chance::new(plan.seed, TAP),
            has_wrong_rate: plan.has(Fault::WrongBitrate),
            errors: 0,
            frames: 0,
            missed: 0,
            misses: 0,
            heard_at: 0,
            off_until: None,
        }
    }

    /// What it hears of an attempt, and what became of that.
    pub fn hear<'a>(&mut self, attempt: &'a Attempt, fate: &mut Fate) -> (Vec<What<'a>>, Fortune) {
        let mut what = Vec::new();
        if self.has_wrong_rate {
            return self.hear_garbage(attempt);
        }
        if self.is_off(attempt, fate, &mut what) || self.is_missing(attempt, fate) {
            return (what, Fortune::Missed);
        }
        if self.missed > 0 {
            what.push(What::Missed(std::mem::take(&mut self.missed)));
        }
        let is_whole = attempt.flaw.is_none_or(Flaw::leaves_it_whole);
        if is_whole {
            let kept = self.kept(attempt, fate);
            what.push(What::Frame(&attempt.sending.frame, kept));
            self.frames += 1;
            self.heard_at = attempt.end;
            self.errors = self.errors.saturating_sub(1);
        }
        if let Some(flaw) = attempt.flaw.filter(|flaw| *flaw != Flaw::UnacknowledgedPassive) {
            self.errors = self.errors.saturating_add(1);
            what.push(What::Error(ErrorFrame::of(flaw, self.errors)));
        }
        let fortune = if is_whole {
            Fortune::Whole(self.frames)
        } else {
            Fortune::Destroyed(attempt.fault.map(Orderable::name).unwrap_or_default())
        };
        (what, fortune)
    }

    /// Another bit rate than the bus has: what looks like a frame breaks the rules sooner or later.
    fn hear_garbage<'a>(&mut self, _: &'a Attempt) -> (Vec<What<'a>>, Fortune) {
        let flaw = self.chance.one_of(&[Flaw::Stuff, Flaw::Stuff, Flaw::Form, Flaw::Flagged]);
        // Who only listens is passive, and counts no further.
        self.errors = self.errors.saturating_add(8).min(135);
        let error = flaw.map(|flaw| What::Error(ErrorFrame::of(flaw, self.errors)));
        (error.into_iter().collect(), Fortune::Missed)
    }

    /// Whether it left the bus.
    fn is_off<'a>(
        &mut self,
        attempt: &'a Attempt,
        fate: &mut Fate,
        what: &mut Vec<What<'a>>,
    ) -> bool {
        if let Some(until) = self.off_until {
            if attempt.end < until {
                return true;
            }
            self.off_until = None;
            what.push(What::Error(ErrorFrame::restarted()));
        }
        let station = attempt.sending.note.station.unwrap_or(attempt.sending.note.source);
        let leaves = fate.strikes(Fault::BusOff, station, attempt.end);
        if leaves {
            self.off_until = Some(attempt.end + OFF);
            what.extend(ErrorFrame::leaving().map(What::Error));
        }
        leaves
    }

    /// Whether it is too slow for this frame.
    fn is_missing(&mut self, attempt: &Attempt, fate: &mut Fate) -> bool {
        let station = attempt.sending.note.station.unwrap_or(attempt.sending.note.source);
        if self.misses == 0 && fate.strikes(Fault::Dropped, station, attempt.end) {
            self.misses = 1 + self.chance.below(5);
            // A log may tell of it right behind the frame before.
            fate.since(self.heard_at);
        }
        let is_missing = self.misses > 0;
        if is_missing {
            self.misses -= 1;
            self.missed += 1;
        }
        is_missing
    }

    /// Bytes that it keeps.
    fn kept(&mut self, attempt: &Attempt, fate: &mut Fate) -> usize {
        let note = &attempt.sending.note;
        let length = attempt.sending.frame.bytes().len();
        let is_cut = length > 0
            && fate.strikes(Fault::Truncated, note.station.unwrap_or(note.source), attempt.end);
        if is_cut { self.chance.below(length as u64) as usize } else { length }
    }
}
