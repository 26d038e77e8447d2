//! One exchange as it is heard: a request and what follows it, with the part that each character
//! plays.

use super::word::{self, Address, Response};
use crate::event::Moment;
use crate::uart::{Character, Parity, Wire};

/// Most characters an exchange can hold. The longest answer has six; beyond this the rest is told
/// as stray characters.
pub const CAPACITY: usize = 32;

/// The part a character plays.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Part {
    /// The master's request.
    Request,
    /// A data word.
    Data,
    /// The word that ends the answer.
    Footer,
    /// Nobody's: noise, or outside any exchange.
    Stray,
    /// To be decided by what follows.
    Undecided,
}

impl Part {
    /// The word that records carry.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Part::Request => "request",
            Part::Data => "data",
            Part::Footer => "footer",
            Part::Stray | Part::Undecided => "stray",
        }
    }
}

/// Why characters were taken for a response.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum FramedBy {
    /// Bit 3 of the footer.
    Bit3,
    /// The order of control and data words.
    Grammar,
    /// The order left it open; which characters came without a pause decided.
    Time,
}

impl FramedBy {
    /// The word that records carry.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            FramedBy::Bit3 => "bit3",
            FramedBy::Grammar => "grammar",
            FramedBy::Time => "time",
        }
    }
}

/// The characters of an exchange so far.
#[derive(Clone, Debug)]
pub struct Exchange {
    characters: [Character; CAPACITY],
    parts: [Part; CAPACITY],
    len: usize,
    words: usize,
    /// Data words with bit 7 cleared, and the footer with bit 7 set, as a parser wants them: a
    /// damaged bit 7 has been seen through by then.
    answer: [u8; CAPACITY],
    footer: Option<usize>,
    /// Why it is framed as it is.
    pub framed_by: FramedBy,
    /// It may have begun before it was heard: after the capture's start, a loss or a break.
    pub is_beginning: bool,
    /// The request may be the empty answer to the one before it.
    pub may_be_answer: bool,
}

impl Exchange {
    /// Nothing heard.
    #[must_use]
    pub const fn empty() -> Self {
        const NOBODY: Character = Character::new(Moment::UNKNOWN, 0, 0, Parity::Unknown);
        Exchange {
            characters: [NOBODY; CAPACITY],
            parts: [Part::Stray; CAPACITY],
            len: 0,
            words: 0,
            answer: [0; CAPACITY],
            footer: None,
            framed_by: FramedBy::Grammar,
            is_beginning: false,
            may_be_answer: false,
        }
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.len = 0;
        self.words = 0;
        self.footer = None;
        self.framed_by = FramedBy::Grammar;
        self.is_beginning = false;
        self.may_be_answer = false;
    }

    /// Adds a character.
    ///
    /// Returns whether there is room for another one.
    pub fn push(&mut self, character: Character, part: Part) -> bool {
        let Some(slot) = self.characters.get_mut(self.len) else { return false };
        *slot = character;
        self.len += 1;
        self.decide(part);
        self.len < CAPACITY
    }

    /// Settles which part the last character plays.
    pub fn decide(&mut self, part: Part) {
        let last = self.len - 1;
        self.parts[last] = part;
        match part {
            Part::Data => {
                self.answer[self.words] = self.characters[last].byte() & 0x7F;
                self.words += 1;
            }
            Part::Footer => {
                self.answer[self.words] = self.characters[last].byte() | 0x80;
                self.footer = Some(last);
            }
            Part::Request | Part::Stray | Part::Undecided => {}
        }
    }

    /// Takes the last character back.
    pub fn pop(&mut self) -> Option<Character> {
        self.len = self.len.checked_sub(1)?;
        Some(self.characters[self.len])
    }

    /// Takes the answer out. What is left is the request, to be answered yet.
    pub fn take_answer(&mut self) -> Exchange {
        let mut answer = Exchange { framed_by: self.framed_by, ..Exchange::empty() };
        let from = self.answer_begins();
        for (character, part) in self.characters[from..self.len].iter().zip(&self.parts[from..]) {
            answer.push(*character, *part);
        }
        self.len = from;
        self.words = 0;
        self.footer = None;
        self.framed_by = FramedBy::Grammar;
        answer
    }

    /// All characters.
    #[must_use]
    pub fn characters(&self) -> &[Character] {
        &self.characters[..self.len]
    }

    /// The part of each character.
    #[must_use]
    pub fn parts(&self) -> &[Part] {
        &self.parts[..self.len]
    }

    /// Whether nothing was heard.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The last character.
    #[must_use]
    pub fn last(&self) -> Option<&Character> {
        self.characters().last()
    }

    /// The last character, if what it is depends on what follows.
    #[must_use]
    pub fn undecided(&self) -> Option<&Character> {
        (self.parts().last() == Some(&Part::Undecided)).then(|| &self.characters[self.len - 1])
    }

    /// The request, if it began with one.
    #[must_use]
    pub fn request(&self) -> Option<&Character> {
        (self.parts().first() == Some(&Part::Request)).then(|| &self.characters[0])
    }

    /// The address that was asked.
    #[must_use]
    pub fn asked(&self) -> Option<Address> {
        self.request().map(|request| Address::of(request.byte()))
    }

    /// Number of characters that are not the answer: one if there is a request.
    #[must_use]
    pub fn answer_begins(&self) -> usize {
        usize::from(self.request().is_some())
    }

    /// Number of data words.
    #[must_use]
    pub const fn words(&self) -> usize {
        self.words
    }

    /// The data words, bit 7 cleared.
    #[must_use]
    pub fn data(&self) -> &[u8] {
        &self.answer[..self.words]
    }

    /// The footer's character.
    #[must_use]
    pub fn footer(&self) -> Option<&Character> {
        self.footer.map(|index| &self.characters[index])
    }

    /// The address that an undamaged footer names.
    #[must_use]
    pub fn named(&self) -> Option<Address> {
        self.footer().filter(|footer| !footer.is_damaged()).map(|footer| Address::of(footer.byte()))
    }

    /// Whether anybody answered: a data word or a footer came.
    #[must_use]
    pub const fn has_answer(&self) -> bool {
        self.words > 0 || self.footer.is_some()
    }

    /// The answer, parsed.
    #[must_use]
    pub fn response(&self) -> Response<'_> {
        let end = self.words + usize::from(self.footer.is_some());
        match word::response(&self.answer[..end]) {
            Ok((_, response)) => response,
            Err(_) => Response { data: self.data(), footer: None },
        }
    }

    /// The first character of the answer that is not noise.
    #[must_use]
    pub fn first_word(&self) -> Option<&Character> {
        let parts = self.parts().iter();
        let is_word = |part: &Part| matches!(part, Part::Data | Part::Footer);
        let index = parts.clone().position(is_word)?;
        Some(&self.characters[index])
    }
}

/// How close two characters of a bus are, where the clock can tell.
#[derive(Clone, Copy, Debug)]
pub struct Distance {
    /// From the end of the one to the start of the other, in ns.
    pub gap: i64,
    /// ± of it.
    uncertainty: i64,
    /// Duration of a character in ns.
    character: i64,
}

impl Distance {
    /// The distance, if times and rate are known and precise enough to see half a character.
    #[must_use]
    pub fn between(earlier: &Character, later: &Character, wire: Wire) -> Option<Distance> {
        let character = wire.character_ns()?;
        let gap = later.start.since(earlier.start)? - character;
        let uncertainty = i64::from(earlier.uncertainty) + i64::from(later.uncertainty);
        (uncertainty <= character / 2).then_some(Distance { gap, uncertainty, character })
    }

    /// Whether the later one follows within half a character: what one station sends in one go.
    #[must_use]
    pub const fn is_close(self) -> bool {
        self.gap < self.character / 2
    }

    /// Whether the later one may follow within two bits, as words that one encoder sends do.
    #[must_use]
    pub const fn is_joined(self) -> bool {
        self.gap - self.uncertainty < self.character * 2 / 11
    }

    /// Whether more than one lost character fits between them.
    #[must_use]
    pub const fn is_far(self) -> bool {
        self.gap > self.character + self.character / 2
    }
}
