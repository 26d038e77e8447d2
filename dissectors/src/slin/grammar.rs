//! Which part a character plays, where its byte alone does not tell.
//!
//! Silence cannot frame SLIN: at 9600 and 19200 Bd the response window is shorter than a
//! character. Framing follows from data bit 7 and the order of the words: *a control word before a
//! data word is a request; a control word after data words and not before one is the footer; a
//! control word after a control word is another request.* Two things make that hard. With bit 3
//! low, a footer and a request are the same byte. And a damaged character may have lost its bit 7.
//! Both are settled by the character that follows, and by which characters came without a pause:
//! so that one damaged character costs its own exchange and no other.

use super::checksum::Rules;
use super::exchange::{Distance, Exchange, FramedBy, Part};
use super::profile::Expectation;
use super::word::{Address, Footer, Request, is_control};
use crate::uart::{Character, Wire};

/// Noise is read as this: the start bit was a glitch, and all the bits after it are idle.
pub const NOISE: u8 = 0xFF;

/// What came after the character in question.
#[derive(Clone, Copy, Debug)]
pub enum Next<'a> {
    /// This character.
    Character(&'a Character),
    /// Silence, or the end of what was heard.
    Silence,
}

impl Next<'_> {
    fn is_data(self) -> bool {
        matches!(self, Next::Character(next) if !is_control(next.byte()))
    }

    fn intact_control(self) -> Option<u8> {
        match self {
            Next::Character(next) if !next.is_damaged() => {
                Some(next.byte()).filter(|byte| is_control(*byte))
            }
            _ => None,
        }
    }
}

/// What is known around an undecided character: the last one of the exchange.
pub struct Question<'a> {
    /// The exchange, the character in question being its last.
    pub exchange: &'a Exchange,
    /// What its station is expected to do.
    pub expectation: Expectation,
    /// How far it came behind the character before it.
    pub before: Option<Distance>,
    /// What follows.
    pub next: Next<'a>,
    /// How characters travel on the bus.
    pub wire: Wire,
}

impl Question<'_> {
    /// The part that the undecided character plays, and what it was decided by.
    #[must_use]
    pub fn answer(&self) -> (Part, FramedBy) {
        match self.exchange.undecided() {
            Some(character) if character.is_damaged() => (self.damaged(character), FramedBy::Time),
            Some(character) => self.footer_or_request(character),
            None => (Part::Stray, FramedBy::Grammar),
        }
    }

    /// An intact control word with bit 3 low.
    fn footer_or_request(&self, character: &Character) -> (Part, FramedBy) {
        let control = character.byte();
        let has_reserved_bits = Request::of(control).reserved != 0;
        let fits = self.exchange.words() > 0 && self.fits_as_footer(control, self.exchange.data());
        let close = self.before.map(Distance::is_close);
        let part = |is_footer| if is_footer { Part::Footer } else { Part::Request };
        if self.expectation.bit3 == Some(true) {
            // This station's footers have bit 3 high: only one that fits in every way is one.
            let is_footer = fits && (has_reserved_bits || close == Some(true));
            return (part(is_footer), FramedBy::Time);
        }
        if self.next.is_data() {
            // By the order of the words a request, unless everything else speaks for a footer and
            // a stray character behind it.
            let is_footer =
                fits && (close == Some(true) || has_reserved_bits && close != Some(false));
            return (part(is_footer), FramedBy::Time);
        }
        // By the order of the words the footer, unless it came long after the words, does not fit
        // them, and is a perfect request.
        let is_far = self.before.is_some_and(Distance::is_far);
        if self.exchange.words() > 0 && is_far && !fits && !has_reserved_bits {
            return (Part::Request, FramedBy::Time);
        }
        (Part::Footer, FramedBy::Grammar)
    }

    fn damaged(&self, character: &Character) -> Part {
        let exchange = self.exchange;
        if character.byte() == NOISE && exchange.words() == 0 && self.follows() != Some(true) {
            return Part::Stray;
        }
        match (exchange.request().is_some(), exchange.words() > 0) {
            (false, false) => self.damaged_outside(character),
            (true, false) => self.damaged_first_word(character),
            (_, true) => self.damaged_in_answer(character),
        }
    }

    fn damaged_outside(&self, character: &Character) -> Part {
        // Right behind a telegram, what looks like a data word is rather the rest of something.
        let is_rest = !is_control(character.byte()) && self.came_close();
        if bits_from_request(character) <= 1 && !is_rest { Part::Request } else { Part::Stray }
    }

    /// Right after a request: the first data word, an empty answer's footer, or another request.
    fn damaged_first_word(&self, character: &Character) -> Part {
        let may_be_request = bits_from_request(character) <= 1;
        if !is_control(character.byte()) {
            let stands_alone = self.follows() == Some(false) && !self.came_close();
            let has_no_footer = self.next.is_data() || self.is_last();
            let is_request = may_be_request && stands_alone && has_no_footer;
            return if is_request { Part::Request } else { Part::Data };
        }
        // Long after the request nothing is its first data word.
        let is_late =
            self.before.is_some_and(|before| before.gap > 2 * self.expectation.window.latest);
        if self.follows() == Some(true) && !(is_late && may_be_request) {
            return Part::Data;
        }
        if self.follows().is_none() {
            // Without times a damaged data word is likelier than a damaged second request, unless
            // a request stands behind it.
            let Some(control) = self.next.intact_control() else { return Part::Data };
            let is_request = self.is_request(control);
            return if is_request && may_be_request { Part::Request } else { Part::Data };
        }
        let bits_from_footer = wrong_bits(character, self.empty_footer(), 0xFF);
        if self.expectation.bit3 == Some(true) && bits_from_footer < bits_from_request(character) {
            Part::Footer
        } else if may_be_request {
            Part::Request
        } else {
            Part::Data
        }
    }

    /// After data words: another one, the footer, or the next request.
    fn damaged_in_answer(&self, character: &Character) -> Part {
        let is_request = bits_from_request(character) <= 1
            && !self.came_close()
            && self.follows() == Some(false)
            && self.next.is_data();
        if is_control(character.byte()) {
            match self.next.intact_control() {
                Some(control) if !self.is_request(control) => Part::Data,
                Some(control) if self.ends_the_answer_with(character, control) => Part::Data,
                Some(_) => Part::Footer,
                None if is_request => Part::Request,
                None if self.follows() == Some(false) => Part::Footer,
                None => Part::Data,
            }
        } else {
            let is_footer = self.is_perfect_footer(character.byte() | 0x80);
            let is_before_footer =
                self.next.intact_control().is_some_and(|control| !self.is_request(control));
            if is_footer && self.is_apart() && !self.next.is_data() {
                Part::Footer
            } else if self.follows() == Some(true) || is_before_footer && self.follows().is_none() {
                Part::Data
            } else if is_footer {
                Part::Footer
            } else if is_request {
                Part::Request
            } else {
                Part::Data
            }
        }
    }

    /// Whether a control word can only be meant as a request.
    fn is_request(&self, control: u8) -> bool {
        let footer = Footer::of(control);
        !footer.bit3 && (footer.checksum == 0 || self.expectation.bit3 == Some(true))
    }

    /// Whether, with the damaged character as a data word whose bit 7 flipped, the control word
    /// joined to it is the footer.
    fn ends_the_answer_with(&self, damaged: &Character, control: u8) -> bool {
        let bit3 = Footer::of(control).bit3;
        if self.expectation.bit3.is_some_and(|expected| expected != bit3) || self.is_apart() {
            return false;
        }
        let mut data = [0; super::exchange::CAPACITY];
        let words = self.exchange.words();
        data[..words].copy_from_slice(self.exchange.data());
        data[words] = damaged.byte() & 0x7F;
        self.fits_as_footer(control, &data[..=words])
    }

    /// Whether a control word fits the words so far as their footer, and its station's habits.
    fn is_perfect_footer(&self, control: u8) -> bool {
        let bit3 = Footer::of(control).bit3;
        self.expectation.bit3.is_none_or(|expected| expected == bit3)
            && self.fits_as_footer(control, self.exchange.data())
    }

    fn fits_as_footer(&self, control: u8, data: &[u8]) -> bool {
        let footer = Footer::of(control);
        let names_the_asked = self.exchange.asked().is_none_or(|asked| asked == footer.address);
        let fitting = Rules::fitting(data, footer.checksum);
        names_the_asked && !fitting.and(self.expectation.rules).is_empty()
    }

    fn empty_footer(&self) -> u8 {
        0x88 | self.exchange.asked().map_or(0, Address::get)
    }

    fn came_close(&self) -> bool {
        self.before.is_some_and(Distance::is_close)
    }

    /// Whether what follows came without a pause; `None` where the clock cannot tell.
    fn follows(&self) -> Option<bool> {
        match self.next {
            Next::Silence => Some(false),
            Next::Character(_) => self.behind().map(Distance::is_close),
        }
    }

    /// Whether what follows is not joined to it, as words that one encoder sends are.
    fn is_apart(&self) -> bool {
        self.behind().is_some_and(|behind| !behind.is_joined())
    }

    /// Whether no other word of the same answer can follow: there is silence, or room for more
    /// than a lost one.
    fn is_last(&self) -> bool {
        matches!(self.next, Next::Silence) || self.behind().is_some_and(Distance::is_far)
    }

    /// How far behind it the next one came.
    fn behind(&self) -> Option<Distance> {
        match (self.next, self.exchange.last()) {
            (Next::Character(next), Some(last)) => Distance::between(last, next, self.wire),
            _ => None,
        }
    }
}

/// How many bits of a character must be wrong if it was sent as a request: of the bits that are
/// the same in every request.
fn bits_from_request(character: &Character) -> u32 {
    wrong_bits(character, 0x80, 0xF8)
}

/// How many bits of a character, the stop bit among them, must be wrong if these data bits were
/// sent; of the data bits those in the mask are compared.
fn wrong_bits(character: &Character, sent: u8, mask: u8) -> u32 {
    ((character.byte() ^ sent) & mask).count_ones() + u32::from(character.has_framing_error())
}
