//! What an observer remembers of each address, and what it must tell because of that.

use super::truth::Code;
use std::collections::VecDeque;

/// Requests in a row without an answer that make silence a state.
const SILENT_IN_A_ROW: u32 = 3;

/// How many of a station's last answers look like two senders, before two are there.
const TORN: (usize, usize) = (5, 10);

/// How a silence, or its end, is told.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Silence {
    /// An address that was not heard so far did not answer: told once.
    Never,
    /// A station did not answer, for the first or second time in a row.
    Once,
    /// It is silent for the third time.
    Begin,
    /// It answers again.
    End,
}

/// What is known of one address.
#[derive(Clone, Default, Debug)]
pub struct Memory {
    /// Whether it ever answered.
    pub is_heard: bool,
    /// Whether it was told that it never did.
    pub is_told_unheard: bool,
    /// Requests in a row without an answer.
    pub silent: u32,
    second_answers: u32,
    torn: VecDeque<bool>,
}

impl Memory {
    /// It was asked and did not answer.
    pub fn miss(&mut self) -> Option<Silence> {
        self.silent += 1;
        if !self.is_heard {
            let is_first = !std::mem::replace(&mut self.is_told_unheard, true);
            return is_first.then_some(Silence::Never);
        }
        match self.silent {
            1..SILENT_IN_A_ROW => Some(Silence::Once),
            SILENT_IN_A_ROW => Some(Silence::Begin),
            _ => None,
        }
    }

    /// It answered.
    pub fn hear(&mut self) -> Option<Silence> {
        let silent = std::mem::take(&mut self.silent);
        let is_over = self.is_heard && silent >= SILENT_IN_A_ROW;
        self.is_heard = true;
        is_over.then_some(Silence::End)
    }

    /// It gave two footers to one request. Once may be chance.
    pub fn answer_twice(&mut self) -> Code {
        self.second_answers += 1;
        if self.second_answers < 2 { "slin.stray-data" } else { "slin.duplicate-address" }
    }

    /// Remembers whether an answer had two or more damaged characters. Tells when there are first
    /// so many that two encoders must be there.
    pub fn remember_torn(&mut self, is_torn: bool) -> bool {
        let (many, last) = TORN;
        let count = |torn: &VecDeque<bool>| torn.iter().filter(|torn| **torn).count();
        let before = count(&self.torn);
        self.torn.push_back(is_torn);
        if self.torn.len() > last {
            self.torn.pop_front();
        }
        before < many && count(&self.torn) >= many
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn silence_is_told_twice_then_as_a_state() {
        let mut memory = Memory::default();
        assert_eq!((memory.miss(), memory.miss()), (Some(Silence::Never), None));
        assert_eq!(memory.hear(), None, "it was never known to be there");
        let told: Vec<_> = (0..4).map(|_| memory.miss()).collect();
        assert_eq!(told, [Some(Silence::Once), Some(Silence::Once), Some(Silence::Begin), None]);
        assert_eq!(memory.hear(), Some(Silence::End));
        assert_eq!((memory.miss(), memory.hear()), (Some(Silence::Once), None));
    }

    #[test]
    fn two_encoders_are_told_by_two_footers_or_by_damage() {
        let mut memory = Memory::default();
        assert_eq!(memory.answer_twice(), "slin.stray-data");
        assert_eq!(memory.answer_twice(), "slin.duplicate-address");
        let torn = [true, false, true, false, true, false, true, false, true, true];
        let told: Vec<_> = torn.iter().map(|torn| memory.remember_torn(*torn)).collect();
        assert_eq!(told.iter().position(|told| *told), Some(8), "the fifth of nine");
        assert_eq!(told.iter().filter(|told| **told).count(), 1);
    }
}
