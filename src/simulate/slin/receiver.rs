//! What a UART that listens to the line makes of it.
//!
//! The character forms are written from what this receiver hears, not from what was sent: wrong
//! settings, swapped lines, collisions and noise need no rules of their own.

use super::line::Parity;
use crate::simulate::level::Low;
use crate::simulate::time::{Clock, Ps};
use std::collections::VecDeque;

/// How a receiver is set up.
#[derive(Clone, Copy, Debug)]
pub struct Setup {
    /// Its rate in Bd.
    pub baud: u32,
    /// Its parity.
    pub parity: Parity,
    /// Whether its two lines are swapped. Such a receiver does not wait for an edge: as many UARTs
    /// do, it takes a line that stays low for one start bit after the other. (Those that wait
    /// hear one break a pause.)
    pub is_swapped: bool,
}

/// A character as it was heard.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Heard {
    /// The falling edge of its start bit.
    pub start: Ps,
    /// Its data bits.
    pub byte: u8,
    /// How it arrived.
    pub state: State,
}

/// How a character arrived.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum State {
    /// With the parity bit that it should have.
    Good,
    /// Without a parity bit that could tell.
    Unchecked,
    /// With a parity bit that does not fit.
    ParityError,
    /// Without a stop bit.
    FramingError,
    /// The line was low all the time.
    Break,
}

impl Heard {
    /// A line that is still low is no new break.
    fn after_edge(self, is_edge: bool) -> Self {
        match self.state {
            State::Break if !is_edge => Heard { state: State::FramingError, ..self },
            _ => self,
        }
    }
}

impl State {
    /// Whether nothing speaks against the byte.
    pub fn is_good(self) -> bool {
        matches!(self, State::Good | State::Unchecked)
    }
}

/// A receiver that samples every bit once.
pub struct Receiver {
    setup: Setup,
    clock: Clock,
    /// Where in a bit it looks: 0.5 is the middle.
    phase: f64,
    /// Edges that may still matter: when, and the level after it.
    edges: VecDeque<(Ps, bool)>,
    /// The level before the first of them.
    level: bool,
    /// When it is ready for the next start bit.
    ready: Ps,
}

impl Receiver {
    /// A receiver that looks at the middle of each bit.
    pub fn new(setup: Setup) -> Self {
        Receiver::looking_at(setup, 0.5)
    }

    /// A receiver that looks at another place of each bit.
    pub fn looking_at(setup: Setup, phase: f64) -> Self {
        Receiver {
            setup,
            clock: Clock::exact(setup.baud),
            phase,
            edges: VecDeque::new(),
            level: !setup.is_swapped,
            ready: 0,
        }
    }

    /// Listens to the line, which is known until `until`, and adds what it hears.
    pub fn listen(&mut self, spans: &[Low], until: Ps, heard: &mut Vec<Heard>) {
        for low in spans {
            self.edges.push_back((low.from, self.setup.is_swapped));
            self.edges.push_back((low.to, !self.setup.is_swapped));
        }
        while let Some((start, is_edge)) = self.next_start() {
            let last = start + self.clock.bits(f64::from(self.bits() - 1) + self.phase);
            if last > until {
                return;
            }
            let character = self.receive(start);
            heard.extend(character.map(|heard| heard.after_edge(is_edge)));
        }
    }

    /// Bits of a character, start and stop bit included.
    fn bits(&self) -> u32 {
        if self.setup.parity == Parity::None { 10 } else { 11 }
    }

    /// The next start bit, and whether it begins with an edge.
    fn next_start(&mut self) -> Option<(Ps, bool)> {
        while let Some((_, level)) = self.edges.pop_front_if(|(time, _)| *time < self.ready) {
            self.level = level;
        }
        if !self.level && self.setup.is_swapped {
            return Some((self.ready, false));
        }
        let level = self.level;
        let mut before = std::iter::once(level).chain(self.edges.iter().map(|(_, after)| *after));
        self.edges
            .iter()
            .find(|(_, after)| before.next() == Some(true) && !after)
            .map(|(time, _)| (*time, true))
    }

    /// Reads the character that begins here, unless its start bit does not last.
    fn receive(&mut self, start: Ps) -> Option<Heard> {
        let sampled = self.sample(start);
        if sampled & 1 == 1 {
            self.ready = start + self.clock.bits(self.phase);
            return None;
        }
        self.ready = start + self.clock.bits(f64::from(self.bits() - 1) + self.phase);
        let byte = (sampled >> 1 & 0xFF) as u8;
        let has_stop_bit = sampled >> (self.bits() - 1) & 1 == 1;
        let parity_bit = sampled >> 9 & 1 == 1;
        let state = match self.setup.parity.bit(byte) {
            _ if sampled == 0 => State::Break,
            _ if !has_stop_bit => State::FramingError,
            None => State::Unchecked,
            Some(fitting) if fitting == parity_bit => State::Good,
            Some(_) => State::ParityError,
        };
        Some(Heard { start, byte, state })
    }

    /// The levels of a character's bits, the start bit in bit 0.
    fn sample(&self, start: Ps) -> u32 {
        let mut edges = self.edges.iter();
        let mut next = edges.next();
        let mut level = self.level;
        (0..self.bits()).fold(0, |sampled, bit| {
            let time = start + self.clock.bits(f64::from(bit) + self.phase);
            while let Some((_, after)) = next.filter(|(edge, _)| *edge <= time) {
                level = *after;
                next = edges.next();
            }
            sampled | u32::from(level) << bit
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::slin::line::{Character, Line};

    const FT12: Setup = Setup { baud: 115_200, parity: Parity::Even, is_swapped: false };

    fn hear(setup: Setup, line: Line) -> Vec<(u8, State)> {
        let mut heard = Vec::new();
        Receiver::new(setup).listen(&line.spans(), Ps::MAX, &mut heard);
        heard.iter().map(|character| (character.byte, character.state)).collect()
    }

    fn sent(characters: &[Character], parity: Parity) -> Line {
        let mut line = Line::default();
        let clock = Clock::off_by(115_200, 1.0);
        characters.iter().fold(1_000_000, |at, one| line.send(*one, at, clock, parity));
        line
    }

    #[test]
    fn hears_what_was_sent_by_a_clock_that_is_off() {
        let bytes = [0x80, 0x1A, 0x01, 0x90, 0x00, 0xFF];
        let line = sent(&bytes.map(Character::new), Parity::Even);
        assert_eq!(hear(FT12, line), bytes.map(|byte| (byte, State::Good)));
    }

    #[test]
    fn hears_damage() {
        let flipped = Character { flipped: Some(0), ..Character::new(0x1A) };
        let torn = Character { is_stop_torn: true, ..Character::new(0x1A) };
        let line = sent(&[flipped, torn, Character::new(0x90)], Parity::Even);
        let expected =
            [(0x1B, State::ParityError), (0x1A, State::FramingError), (0x90, State::Good)];
        assert_eq!(hear(FT12, line), expected);
    }

    #[test]
    fn hears_a_glitch_as_ffh_with_a_parity_error() {
        // 0.7 bits low: the start bit holds, every bit after it is idle. FFh has eight ones, so its
        // parity bit should be 0.
        let clock = Clock::exact(115_200);
        let mut line = Line::default();
        line.pull(0, clock.bits(0.7));
        line.pull(100_000_000, 100_000_000 + clock.bits(0.4));
        assert_eq!(hear(FT12, line), [(0xFF, State::ParityError)]);
    }

    #[test]
    fn hears_a_break_once_however_long() {
        let mut line = Line::default();
        line.pull(0, Clock::exact(115_200).characters(4.0));
        assert_eq!(hear(FT12, line), [(0, State::Break)]);
    }

    #[test]
    fn odd_parity_is_wrong_everywhere() {
        let line = sent(&[0x80, 0x1A, 0x90].map(Character::new), Parity::Odd);
        assert!(hear(FT12, line).iter().all(|(_, state)| *state == State::ParityError));
    }

    #[test]
    fn swapped_lines_are_zeros_without_end() {
        // 80h upside down: high for eight bits, low before and after. 10 ms are 104 characters; one
        // that is low all over ends in the middle of its stop bit, so there are a few more.
        let spans = sent(&[Character::new(0x80)], Parity::Even).spans();
        let mut receiver = Receiver::new(Setup { is_swapped: true, ..FT12 });
        let mut heard = Vec::new();
        receiver.listen(&spans, 10_000_000_000, &mut heard);
        let zeros = |state| heard.iter().filter(|one| (one.byte, one.state) == (0, state)).count();
        assert_eq!(zeros(State::Break), 1);
        assert!((100..110).contains(&zeros(State::FramingError)));
    }

    #[test]
    fn a_character_may_come_in_two_pieces() {
        let spans = sent(&[Character::new(0x1A)], Parity::Even).spans();
        let mut receiver = Receiver::new(FT12);
        let mut heard = Vec::new();
        receiver.listen(&spans[..1], spans[1].from - 1, &mut heard);
        assert!(heard.is_empty());
        receiver.listen(&spans[1..], Ps::MAX, &mut heard);
        assert_eq!(heard.len(), 1);
    }
}
