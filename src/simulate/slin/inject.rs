//! Faults as changes to the script of a healthy exchange.

use super::encoder::Encoder;
use super::exchange::{After, Disturbance, Extra, Script, Senders};
use super::fault::Fault;
use super::line::{Character, Line, PARITY_BIT};
use super::plan::Plan;
use super::receiver::{Heard, Receiver, Setup, State};
use super::tap::Loss;
use super::truth::{Code, May};
use super::word::{self, Checksum, MAX_DATA_WORDS};
use crate::simulate::chance::Chance;
use crate::simulate::time::{MS, Ps};

/// A healthy exchange with one encoder, and what may be used to spoil it.
pub struct Scene<'a> {
    /// What is to happen.
    pub script: &'a mut Script,
    /// Who answers.
    pub encoder: &'a mut Encoder,
    /// What it measures now.
    pub position: u32,
    /// When it is.
    pub now: Ps,
    /// Who sends.
    pub senders: Senders,
    /// An address that another encoder could take for its own.
    pub other_address: Option<u8>,
    /// The bus.
    pub plan: &'a Plan,
    /// How it falls.
    pub chance: &'a mut Chance,
}

/// What a fault makes of the exchange besides its own finding.
#[derive(Default, Debug)]
pub struct Effect {
    /// Findings that it may cause.
    pub may: May,
    /// Whether the answer's words cannot be told.
    pub is_unreadable: bool,
}

/// How often a collision is tried until it is one beyond doubt.
const TRIES: u32 = 200;

impl Scene<'_> {
    /// Lets the fault strike. `None` if it cannot strike here; the script is then as it was.
    pub fn inject(&mut self, fault: Fault) -> Option<Effect> {
        let mut effect = Effect::default();
        match fault {
            Fault::Parity => return self.flip_a_bit(),
            Fault::Framing => self.tear_a_stop_bit()?,
            Fault::Checksum => self.miscalculate()?,
            Fault::AddressMismatch => self.answer_as_another()?,
            Fault::NoResponse | Fault::LateAnswerCrossing => self.script.answer.clear(),
            Fault::MissingFooter => self.drop_the_footer()?,
            Fault::TooManyWords => {
                self.add_words();
                effect.may = May::Codes(vec!["slin.checksum"]);
                effect.is_unreadable = true;
            }
            Fault::DuplicateAddress => self.answer_twice()?,
            Fault::Collision => {
                self.collide()?;
                effect = Effect { may: May::ANY, is_unreadable: true };
            }
            Fault::LateResponse => self.be_late()?,
            Fault::EarlyResponse => self.be_early()?,
            Fault::ReservedBits => self.set_reserved_bits(),
            Fault::StrayData => self.leave_stray_data(),
            Fault::LateAnswer => self.script.delay = self.chance.between(12 * MS, 18 * MS),
            Fault::Glitch => self.pull_for_a_moment(),
            Fault::NoDataWords => self.leave_out_the_data(true)?,
            Fault::Ambiguous => self.leave_out_the_data(false)?,
            Fault::Break => self.hold_the_line(),
            Fault::Overrun | Fault::Lost => {
                self.miss(if fault == Fault::Lost { Loss::Lost } else { Loss::Overrun });
                effect.is_unreadable = true;
            }
            // These are in the position, or in the bus as a whole.
            Fault::PositionJump
            | Fault::NeverAnswered
            | Fault::SwappedLines
            | Fault::WrongRate
            | Fault::WrongParity
            | Fault::NotSlin => return None,
        }
        Some(effect)
    }

    fn characters(&self, characters: f64) -> Ps {
        self.plan.clock().characters(characters)
    }

    fn some_characters(&mut self, least: f64, most: f64) -> Ps {
        let characters = self.chance.within(least, most);
        self.characters(characters)
    }

    /// What follows is not to be taken for a part of this.
    fn keep_apart(&mut self) {
        self.script.rest = self.script.rest.max(self.characters(3.0));
    }

    /// Request and answer as one sequence.
    fn word(&mut self, number: usize) -> Option<&mut Character> {
        match number.checked_sub(1) {
            None => Some(&mut self.script.request),
            Some(number) => self.script.answer.get_mut(number),
        }
    }

    fn words(&self) -> usize {
        1 + self.script.answer.len()
    }

    fn flip_a_bit(&mut self) -> Option<Effect> {
        let number = self.chance.below(self.words() as u64) as usize;
        let bit = self.chance.below(u64::from(PARITY_BIT) + 1) as u8;
        let is_footer = number + 1 == self.words();
        self.word(number)?.flipped = Some(bit);
        let codes: &[Code] = match bit {
            PARITY_BIT => &[],
            7 => return Some(Effect { may: May::ANY, is_unreadable: true }),
            0..=2 if number == 0 => &["slin.address-mismatch", "slin.late-answer"],
            4..=6 if number == 0 => &["slin.reserved-bits"],
            0..=2 if is_footer => &["slin.address-mismatch", "slin.late-answer"],
            4..=6 if is_footer => &["slin.checksum"],
            _ if number == 0 || is_footer => &[],
            _ => &["slin.checksum"],
        };
        Some(Effect { may: May::Codes(codes.to_vec()), is_unreadable: false })
    }

    /// Not in a character of zeros, which would be a break.
    fn tear_a_stop_bit(&mut self) -> Option<()> {
        let last = self.script.answer.len();
        let bytes = (0..=last).filter(|number| match number.checked_sub(1) {
            None => true,
            Some(number) => self.script.answer[number].byte != 0,
        });
        let number = self.chance.one_of(&bytes.collect::<Vec<_>>())?;
        self.word(number)?.is_stop_torn = true;
        Some(())
    }

    fn data(&self) -> Vec<u8> {
        let bytes = self.script.answer.iter().map(|word| word.byte);
        bytes.filter(|byte| byte & 0x80 == 0).collect()
    }

    fn miscalculate(&mut self) -> Option<()> {
        let data = self.data();
        let right = Checksum::ALL.map(|rule| rule.of(&data));
        let wrong: Vec<u8> = (0..8).filter(|checksum| !right.contains(checksum)).collect();
        let checksum = self.chance.one_of(&wrong)?;
        let footer = self.script.answer.last_mut()?;
        footer.byte = footer.byte & !0x70 | checksum << 4;
        Some(())
    }

    fn answer_as_another(&mut self) -> Option<()> {
        let footer = self.script.answer.last_mut()?;
        footer.byte = footer.byte & !0x07 | self.other_address?;
        Some(())
    }

    fn drop_the_footer(&mut self) -> Option<()> {
        if self.data().is_empty() {
            return None;
        }
        self.script.answer.pop();
        Some(())
    }

    fn add_words(&mut self) {
        let mut data = self.data();
        let words = MAX_DATA_WORDS + 1 + self.chance.below(2) as usize;
        while data.len() < words {
            data.push(self.chance.below(128) as u8);
        }
        data.push(self.encoder.footer(&data));
        self.script.answer = data.into_iter().map(Character::new).collect();
    }

    /// What the second encoder would send, and its clock.
    fn twin(&mut self) -> Option<Disturbance> {
        let twin = self.encoder.twin.as_mut()?;
        let position = twin.shaft.position_at(self.now);
        let answer = twin.answer(position).into_iter().map(Character::new).collect();
        Some(Disturbance::Sender(answer, twin.clock))
    }

    fn answer_twice(&mut self) -> Option<()> {
        let what = self.twin()?;
        let delay = self.some_characters(1.0, 3.0);
        self.script.extra = Some(Extra { after: After::Answer, delay, what });
        self.keep_apart();
        Some(())
    }

    /// Two answers at once, such that every receiver hears damage in two characters at least, and
    /// no control word or request that nobody sent.
    fn collide(&mut self) -> Option<()> {
        let what = self.twin()?;
        for _ in 0..TRIES {
            let bits = self.chance.between(1, 16) as f64 + self.chance.within(0.3, 0.7);
            let delay = self.script.delay + self.plan.clock().bits(bits);
            let what = what.clone();
            self.script.extra = Some(Extra { after: After::Request, delay, what });
            if [0.4, 0.5, 0.6].iter().all(|phase| self.is_torn_at(*phase)) {
                self.keep_apart();
                return Some(());
            }
        }
        self.script.extra = None;
        None
    }

    /// What a receiver makes of two answers, if it looks at this place of each bit: whether it
    /// is a torn answer of this station and nothing else.
    fn is_torn_at(&self, phase: f64) -> bool {
        let mut line = Line::default();
        self.script.play(&mut line, 0, self.senders);
        let setup = Setup { baud: self.plan.baud, parity: self.senders.parity, is_swapped: false };
        let mut heard = Vec::new();
        Receiver::looking_at(setup, phase).listen(&line.spans(), Ps::MAX, &mut heard);
        let Some(([_, words @ ..], last)) = heard.split_last().map(|(last, rest)| (rest, last))
        else {
            return false;
        };
        let is_damaged = |heard: &Heard| !heard.state.is_good();
        let answer = || words.iter().chain([last]);
        // FFh is what a receiver makes of a glitch: it does not tell a second sender.
        let damaged = answer().filter(|heard| is_damaged(heard) && heard.byte != 0xFF).count();
        let is_break = |heard: &Heard| heard.state == State::Break;
        let is_control = |heard: &Heard| !is_damaged(heard) && heard.byte & 0x80 != 0;
        let is_request =
            |heard: &Heard| is_damaged(heard) && ((heard.byte ^ 0x80) & 0xF8).count_ones() <= 1;
        let footer = self.encoder.footer(&[]) & !0x70;
        // A receiver that is out of step misses bits: that must not look like the end of an answer.
        let longest = self.plan.clock().characters(1.4);
        let is_torn_apart = heard[1..].windows(2).any(|two| two[1].start - two[0].start > longest);
        damaged >= 2
            && !is_torn_apart
            && !answer().any(|heard| is_break(heard) || is_request(heard))
            && !words.iter().any(is_control)
            && (is_damaged(last) || last.byte & !0x70 == footer)
    }

    fn be_late(&mut self) -> Option<()> {
        let (least, most) = self.plan.late_fault(self.encoder.profile)?;
        self.script.delay = self.chance.between(least, most);
        Some(())
    }

    fn be_early(&mut self) -> Option<()> {
        let latest = self.plan.earliest_fault(self.encoder.profile)?;
        self.script.delay = self.chance.between(latest / 3, latest);
        Some(())
    }

    fn set_reserved_bits(&mut self) {
        self.script.request.byte |= (1 + self.chance.below(7) as u8) << 4;
        // Right behind the last footer it would look like a second one.
        self.script.pause = self.characters(3.0);
    }

    fn leave_stray_data(&mut self) {
        let count = 1 + self.chance.below(3);
        let words = (0..count).map(|_| Character::new(self.chance.below(128) as u8)).collect();
        let what = Disturbance::Sender(words, self.senders.encoder);
        let delay = self.some_characters(2.0, 5.0);
        self.script.extra = Some(Extra { after: After::Answer, delay, what });
        self.keep_apart();
    }

    /// Between request and answer, if the eleven bits that a receiver then hears and a pause fit
    /// in.
    fn pull_for_a_moment(&mut self) {
        let clock = self.plan.clock();
        let what = Disturbance::Low(clock.bits(self.chance.within(0.6, 0.9)));
        let room = clock.bits(19.0);
        let (earliest, latest) = self.encoder.profile.healthy();
        let (after, delay) = if room < latest {
            self.script.delay = self.chance.between(room.max(earliest), latest);
            (After::Request, clock.bits(self.chance.within(0.3, 0.8)))
        } else {
            self.keep_apart();
            (After::Answer, self.some_characters(1.0, 2.0))
        };
        self.script.extra = Some(Extra { after, delay, what });
    }

    fn leave_out_the_data(&mut self, bit3: bool) -> Option<()> {
        if self.position != 0 || self.encoder.profile.bit3() != bit3 {
            return None;
        }
        let footer = word::footer(self.encoder.address, bit3, 0);
        self.script.answer = vec![Character::new(footer)];
        Some(())
    }

    fn hold_the_line(&mut self) {
        let what = Disturbance::Low(self.some_characters(2.0, 5.0));
        let delay = self.some_characters(2.0, 4.0);
        self.script.extra = Some(Extra { after: After::Answer, delay, what });
        self.keep_apart();
    }

    /// The end of the exchange, all of it, or its beginning up to one data word and the footer:
    /// a footer alone could be taken for a request.
    fn miss(&mut self, loss: Loss) {
        let words = self.words();
        let range = if words > 2 && self.chance.happens(0.3) {
            0..1 + self.chance.below(words as u64 - 2) as usize
        } else {
            self.chance.below(words as u64) as usize..words
        };
        self.script.missed = Some((range, loss));
    }
}
