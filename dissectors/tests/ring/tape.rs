//! The levels of both wires, as they are written.

use super::{Chance, Plan};

/// The edges of both wires, and how many samples there are.
#[derive(Clone, Default)]
pub struct Recording {
    pub edges: [Vec<u64>; 2],
    pub until: u64,
}

/// Writes both wires, in bits.
pub struct Tape<'a> {
    plan: &'a Plan,
    now: [f64; 2],
    /// Changes of level, in bits.
    changes: [Vec<f64>; 2],
    level: [bool; 2],
    /// The next character's stop bit is none.
    pub has_bad_stop: bool,
}

impl<'a> Tape<'a> {
    pub fn new(plan: &'a Plan) -> Self {
        Tape {
            plan,
            now: [10.0, 10.4],
            changes: Default::default(),
            level: [true; 2],
            has_bad_stop: false,
        }
    }

    fn bit(&mut self, wire: usize, level: bool, chance: &mut Chance) {
        if level != self.level[wire] {
            self.level[wire] = level;
            let jitter = self.plan.jitter * (chance.below(2001) as f64 / 1000.0 - 1.0);
            self.changes[wire].push(self.now[wire] + jitter);
        }
        self.now[wire] += 1.0;
    }

    fn character(&mut self, wire: usize, flags: [bool; 3], data: Option<u8>, chance: &mut Chance) {
        self.bit(wire, false, chance);
        flags.into_iter().for_each(|flag| self.bit(wire, flag, chance));
        if let Some(byte) = data {
            let byte = if self.plan.is_lsb { byte.reverse_bits() } else { byte };
            (0..8).rev().for_each(|bit| self.bit(wire, byte >> bit & 1 == 1, chance));
        }
        if std::mem::take(&mut self.has_bad_stop) {
            self.bit(wire, false, chance);
        }
        self.bit(wire, true, chance);
        self.now[wire] += self.plan.pause * chance.below(1001) as f64 / 1000.0;
    }

    fn flags(&self, is_id: bool, is_check: bool, is_status: bool) -> [bool; 3] {
        let plan = self.plan;
        let select =
            if is_status && !plan.status_has_select { false } else { is_id == plan.id_value };
        let control = !is_status && is_check == plan.check_value;
        let mut flags = [false; 3];
        let values = [select, control, is_status == plan.status_value];
        for (place, value) in plan.places.into_iter().zip(values) {
            flags[place] = value;
        }
        flags
    }

    /// Status telegrams.
    pub fn idle(&mut self, count: usize, is_id: bool, chance: &mut Chance) {
        let flags = self.flags(is_id, false, true);
        for _ in 0..count {
            (0..2).for_each(|wire| self.character(wire, flags, None, chance));
        }
        self.join();
    }

    pub fn cycle(&mut self, frames: &[Vec<u8>; 2], is_id: bool, chance: &mut Chance) {
        for (wire, frame) in frames.iter().enumerate() {
            // Frames that are cut have no check phase; those that lost a character have.
            let longest = frames[0].len().max(frames[1].len());
            let whole = if frame.len() + 1 < longest { longest } else { frame.len() };
            for (index, byte) in frame.iter().enumerate() {
                let flags = self.flags(is_id, index + 4 >= whole, false);
                self.character(wire, flags, Some(*byte), chance);
            }
        }
        self.join();
    }

    /// Nothing at all for so many bits.
    pub fn silence(&mut self, bits: f64) {
        self.now.iter_mut().for_each(|now| *now += bits);
    }

    /// The wires stay side by side.
    fn join(&mut self) {
        let latest = self.now[0].max(self.now[1] - 0.4);
        self.now = [latest, latest + 0.4];
    }

    pub fn recording(self) -> Recording {
        let samples = self.plan.samples;
        let edges = self.changes.map(|changes| {
            changes.into_iter().map(|change| (change * samples) as u64 + 1).collect()
        });
        Recording { edges, until: ((self.now[0] + 40.0) * samples) as u64 }
    }
}
