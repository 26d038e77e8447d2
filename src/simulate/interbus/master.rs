//! The PLC's side of the handshake with one encoder (manual §4): it lays out service and data, sets
//! the service bit a scan later, waits for the acknowledgement, withdraws, and waits for the release.

use super::encoder::Slip;
use super::word::SERVICE;
use crate::simulate::chance::Chance;
use crate::simulate::time::{MS, Ps, S};
use std::collections::VecDeque;

/// How long it waits for an acknowledgement or its end before it gives up.
const PATIENCE: Ps = 1_500 * MS;

/// The limit by which a missing acknowledgement is told: that of the analyzer's users, for the
/// manual has none.
const LIMIT: Ps = S;

/// How it asks for a service.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Manner {
    /// As the manual says.
    Usual,
    /// Data and service bit in one go.
    AtOnce,
    /// It changes its mind while it waits.
    Changes,
    /// It gives up while it waits.
    Withdraws,
}

/// What is done with an encoder, one after the other.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Act {
    /// The PLC asks for a service: a word without its service bit.
    Serve(u32, Manner, Option<Slip>),
    /// Nothing happens for a while.
    Wait(Ps),
    /// The magnet leaves the measuring range, or comes back.
    Magnet {
        /// It leaves.
        is_outside: bool,
    },
    /// The position is off by so much from now on.
    Shift(i32),
    /// What the encoder sends is off by so much for one cycle.
    Spike(i32),
    /// What the encoder sends has these bits turned over for a few cycles.
    Garble(u32),
    /// Somebody uses the external preset input.
    ExternalPreset,
}

/// How far the PLC is.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Step {
    Idle(Ps),
    LaidOut(Manner),
    Asked(Manner, Ps),
    Withdrawn(Ps),
}

/// What the PLC does with one encoder.
pub struct Task {
    acts: VecDeque<Act>,
    step: Step,
    /// What it sends.
    pub out: u32,
    /// Whether the act that is going on has a slip of the encoder that is told only after a limit.
    is_late: bool,
    /// From when on what is going on is to be told.
    pub told_from: Option<Ps>,
    chance: Chance,
}

impl Task {
    /// A task that begins with these.
    pub fn new(acts: Vec<Act>, chance: Chance) -> Self {
        let step = Step::Idle(0);
        Task { acts: acts.into(), step, out: 0, is_late: false, told_from: None, chance }
    }

    /// Whether all is done.
    pub fn is_done(&self, now: Ps) -> bool {
        self.acts.is_empty() && matches!(self.step, Step::Idle(until) if now >= until)
    }

    /// More to do.
    pub fn order(&mut self, acts: Vec<Act>) {
        self.told_from = None;
        self.acts.extend(acts);
    }

    /// A scan: it has received this. Returns what happens to the encoder now.
    pub fn scan(&mut self, now: Ps, input: u32) -> Option<Act> {
        let is_acknowledged = input & SERVICE != 0;
        match self.step {
            Step::Idle(until) if now < until => {}
            Step::Idle(_) => return self.begin(now),
            Step::LaidOut(manner) => self.ask(manner, now),
            Step::Asked(_, _) if is_acknowledged => self.withdraw(now),
            Step::Asked(Manner::Changes, since) => {
                // Another value of the same service: nothing else is wrong with it.
                self.out ^= 1 + self.chance.below(15) as u32;
                self.step = Step::Asked(Manner::Usual, since);
            }
            Step::Asked(Manner::Withdraws, _) => self.withdraw(now),
            Step::Asked(_, since) if now - since > PATIENCE => self.withdraw(now),
            Step::Asked(..) => {}
            Step::Withdrawn(since) if !is_acknowledged || now - since > 2 * PATIENCE => {
                self.step = Step::Idle(now);
            }
            Step::Withdrawn(_) => {}
        }
        None
    }

    fn begin(&mut self, now: Ps) -> Option<Act> {
        let act = self.acts.pop_front()?;
        match act {
            Act::Wait(time) => self.step = Step::Idle(now + time),
            Act::Serve(word, manner, slip) => {
                self.is_late = matches!(slip, Some(Slip::Silent | Slip::Holds(_)));
                self.out = word;
                if manner == Manner::AtOnce {
                    self.ask(Manner::Usual, now);
                } else {
                    self.step = Step::LaidOut(manner);
                }
            }
            _ => {}
        }
        Some(act)
    }

    fn ask(&mut self, manner: Manner, now: Ps) {
        self.out |= SERVICE;
        self.step = Step::Asked(manner, now);
        self.told_from = self.is_late.then_some(now + LIMIT);
    }

    /// It takes the service bit back, and often leaves the rest standing.
    fn withdraw(&mut self, now: Ps) {
        self.out = if self.chance.happens(0.5) { self.out & !SERVICE } else { 0 };
        let is_given_up = matches!(self.step, Step::Asked(_, since) if now - since > PATIENCE);
        self.step = Step::Withdrawn(now);
        if self.is_late && !is_given_up {
            self.told_from = Some(now + LIMIT);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::interbus::word::{PRESET, write};

    fn task(manner: Manner) -> Task {
        let act = Act::Serve(write(PRESET, 100), manner, None);
        Task::new(vec![act], Chance::new(1, 1))
    }

    #[test]
    fn data_are_laid_out_a_scan_before_the_service_bit() {
        let mut task = task(Manner::Usual);
        let mut outs = Vec::new();
        for (now, input) in [0, 0, 0, 0xC400_0064, 0xC400_0064, 7, 7].into_iter().enumerate() {
            task.scan(now as Ps * MS, input);
            outs.push(task.out);
        }
        // Withdrawn in the fourth scan: the rest is left standing, or it is not.
        assert_eq!(outs[..3], [0x4400_0064, 0xC400_0064, 0xC400_0064]);
        assert!(outs[3..].iter().all(|out| [0, 0x4400_0064].contains(out)), "{outs:X?}");
        assert!(task.is_done(7 * MS));
    }

    #[test]
    fn manners() {
        let mut at_once = task(Manner::AtOnce);
        at_once.scan(0, 0);
        assert_eq!(at_once.out, 0xC400_0064);
        let mut changes = task(Manner::Changes);
        for now in 0..3 {
            changes.scan(now, 0);
        }
        assert!(changes.out & SERVICE != 0 && changes.out != 0xC400_0064);
        let mut withdraws = task(Manner::Withdraws);
        for now in 0..3 {
            withdraws.scan(now, 0);
        }
        assert!(withdraws.out & SERVICE == 0);
        // Nobody answers: it gives up after 1.5 s.
        let mut patient = task(Manner::Usual);
        for now in 0..2 {
            patient.scan(now, 0);
        }
        patient.scan(PATIENCE, 0);
        assert!(patient.out & SERVICE != 0);
        patient.scan(PATIENCE + 2, 0);
        assert!(patient.out & SERVICE == 0);
    }
}
