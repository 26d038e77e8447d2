//! The SLIN bus: characters in, exchanges out of them, records about those.

use super::exchange::{Distance, Exchange, FramedBy, Part};
use super::grammar::{Next, Question};
use super::ledger::{End, Ledger};
use super::outlet::Outlet;
use super::profile::Window;
use super::word::{Footer, Request, is_control};
use crate::event::{Event, LossCause, Moment};
use crate::finding::Finding;
use crate::protocol::{Conclusion, Dissector, Settings};
use crate::record::{BusInfo, Output};
use crate::uart::{Character, Setup, Wire};
use alloc::vec::Vec;

/// Silence of so many response limits is no response.
const PATIENCE: i64 = 10;

/// Duration of a character at the slowest rate of the manuals (9600 Bd), where the rate is not
/// known.
const SLOWEST_CHARACTER_NS: i64 = 1_145_833;

/// The state of one SLIN bus.
pub struct Slin {
    open: Exchange,
    /// Late answers of other stations that came since the open request: one of each at most.
    crossing: Vec<Exchange>,
    ledger: Ledger,
    setup: Setup,
    /// Nothing was heard of the bus's order yet: what comes may be the rest of a telegram.
    is_beginning: bool,
    last: Option<Character>,
    /// How far the undecided character came behind the one before it.
    before: Option<Distance>,
    /// How long the open exchange waits for its next character, in ns.
    patience: i64,
    /// Findings about the bus as a whole, to be told between exchanges, and at the end.
    pending: Vec<Finding>,
    at_end: Vec<Finding>,
}

impl Slin {
    /// A bus that nothing was heard of.
    #[must_use]
    pub fn new(wire: Wire, settings: &Settings) -> Self {
        Slin {
            open: Exchange::empty(),
            crossing: Vec::new(),
            ledger: Ledger::new(wire, settings),
            setup: Setup::with_even_parity(wire.format()),
            is_beginning: true,
            last: None,
            before: None,
            patience: PATIENCE * Window::BAUMER.latest,
            pending: Vec::new(),
            at_end: Vec::new(),
        }
    }

    /// Complete exchanges so far, if the traffic speaks for SLIN.
    pub(super) fn signature(&self) -> &super::signature::Signature {
        &self.ledger.signature
    }

    fn character(&mut self, character: Character, outlet: &mut Outlet<'_, '_>) {
        if let Some(last) = &self.last {
            if self.silence_from(last).is_some_and(|end| character.start.is_after(end)) {
                self.silence(outlet);
            } else if runs_backwards(last, &character) {
                self.cut(outlet);
            }
        }
        // Silence is over before the character is: it may have been told by then.
        self.ledger.signature.hear(character.byte(), character.is_damaged());
        self.pending.extend(self.setup.hear(&character));
        if self.open.undecided().is_some() {
            self.resolve(Next::Character(&character), outlet);
        }
        self.take(character, outlet);
        self.last = Some(character);
    }

    /// A character whose part its byte tells, or that must wait for the next one.
    fn take(&mut self, character: Character, outlet: &mut Outlet<'_, '_>) {
        if self.open.is_empty() {
            self.open.is_beginning = self.is_beginning;
        }
        if character.is_damaged() {
            self.add(character, Part::Undecided, outlet);
        } else if !is_control(character.byte()) {
            self.add(character, Part::Data, outlet);
        } else if Footer::of(character.byte()).bit3 {
            self.open.framed_by = FramedBy::Bit3;
            self.end_with_footer(character, outlet);
        } else if self.may_be_footer(&character) {
            self.add(character, Part::Undecided, outlet);
        } else if self.open.is_empty() && self.ledger.is_second_footer(&character) {
            self.open.framed_by = FramedBy::Time;
            self.end_with_footer(character, outlet);
        } else {
            self.ask(character, outlet);
        }
    }

    /// Whether an intact control word with bit 3 low may end an answer: after data words, and at
    /// the beginning, where it may be all that is left of a telegram.
    fn may_be_footer(&self, character: &Character) -> bool {
        let is_rest = self.open.is_empty()
            && self.is_beginning
            && Request::of(character.byte()).reserved != 0;
        !self.ledger.habits.has_high_bit3_given() && (self.open.words() > 0 || is_rest)
    }

    fn add(&mut self, character: Character, part: Part, outlet: &mut Outlet<'_, '_>) {
        if part == Part::Undecided {
            let wire = self.ledger.wire;
            let last = self.last.as_ref();
            self.before = last.and_then(|last| Distance::between(last, &character, wire));
        }
        if self.open.push(character, part) {
            return;
        }
        if part == Part::Undecided {
            self.resolve(Next::Silence, outlet);
        }
        self.end(End::Silence, outlet);
    }

    fn end_with_footer(&mut self, footer: Character, outlet: &mut Outlet<'_, '_>) {
        self.open.push(footer, Part::Footer);
        self.end_answer(outlet);
    }

    /// An answer ends the exchange, unless it is another station's that comes late: then the
    /// request is still to be answered.
    fn end_answer(&mut self, outlet: &mut Outlet<'_, '_>) {
        let late = self.ledger.late_station(&self.open);
        let came = |address| self.crossing.iter().any(|other| other.named() == Some(address));
        if late.is_some_and(|address| !came(address)) {
            self.crossing.push(self.open.take_answer());
        } else {
            self.end(End::Footer, outlet);
        }
    }

    fn resolve(&mut self, next: Next<'_>, outlet: &mut Outlet<'_, '_>) {
        let expectation = self.ledger.habits.of_asked(self.open.asked());
        let wire = self.ledger.wire;
        let before = self.before;
        let question = Question { exchange: &self.open, expectation, before, next, wire };
        let (part, framed_by) = question.answer();
        match part {
            Part::Footer => {
                self.open.framed_by = framed_by;
                self.open.decide(part);
                self.end_answer(outlet);
            }
            Part::Request => {
                if let Some(request) = self.open.pop() {
                    self.ask(request, outlet);
                }
            }
            Part::Data | Part::Stray | Part::Undecided => self.open.decide(part),
        }
    }

    /// A request begins an exchange.
    fn ask(&mut self, request: Character, outlet: &mut Outlet<'_, '_>) {
        let may_be_answer = self.end(End::Request(&request), outlet);
        self.ledger.forget_last();
        self.is_beginning = false;
        self.open.push(request, Part::Request);
        self.open.may_be_answer = may_be_answer;
        let window = self.ledger.habits.of_asked(self.open.asked()).window;
        self.patience = PATIENCE * window.latest;
    }

    /// Tells the open exchange. Returns whether the request that ended it may be its answer.
    fn end(&mut self, end: End<'_>, outlet: &mut Outlet<'_, '_>) -> bool {
        let mut may_be_answer = false;
        if !self.open.is_empty() {
            may_be_answer = self.ledger.tell(&self.open, &self.crossing, end, outlet);
            self.is_beginning &= self.open.footer().is_none();
            self.open.clear();
            self.crossing.clear();
        }
        for finding in self.pending.drain(..) {
            outlet.event(finding, None, None, self.last);
        }
        may_be_answer
    }

    fn silence(&mut self, outlet: &mut Outlet<'_, '_>) {
        if self.open.undecided().is_some() {
            self.resolve(Next::Silence, outlet);
        }
        self.end(End::Silence, outlet);
        self.ledger.forget_last();
    }

    /// What follows may begin anywhere, and what is open will not be heard to its end.
    fn cut(&mut self, outlet: &mut Outlet<'_, '_>) {
        if self.open.undecided().is_some() {
            self.resolve(Next::Silence, outlet);
        }
        self.end(End::Cut, outlet);
        self.ledger.forget_last();
        self.ledger.interrupt_motion();
        self.is_beginning = true;
        self.last = None;
    }

    /// The silence is judged if it was heard long enough before `end`.
    fn silence_or_cut(&mut self, end: Moment, outlet: &mut Outlet<'_, '_>) {
        if end.is_after(self.deadline()) {
            self.silence(outlet);
        }
        self.cut(outlet);
    }

    /// When the silence after a character is over patience: then nobody answers any more, be it for
    /// the first time or for the second.
    fn silence_from(&self, last: &Character) -> Option<Moment> {
        if self.open.is_empty() && !self.ledger.awaits_second_answer() {
            return None;
        }
        let character = self.ledger.wire.character_ns().unwrap_or(SLOWEST_CHARACTER_NS);
        let stamps = 2 * i64::from(last.uncertainty);
        Some(last.start.plus(character + self.patience + stamps))
    }
}

impl Dissector for Slin {
    fn hear(&mut self, bus: &BusInfo, event: Event<'_>, out: &mut Output<'_>) {
        let outlet = &mut Outlet { bus, wire: self.ledger.wire, out };
        match event {
            Event::Characters(characters) => {
                for character in characters {
                    self.character(*character, outlet);
                }
            }
            Event::Break(event) => {
                let character_ns = self.ledger.wire.character_ns();
                self.silence_or_cut(event.start, outlet);
                outlet.line_break(&event);
                self.pending.extend(self.setup.hear_break(&event, character_ns));
            }
            Event::Lost(loss) => {
                match loss.cause {
                    // It is stamped at its end: what was asked before it may have been answered.
                    LossCause::NotKept | LossCause::Sought(_) => self.cut(outlet),
                    _ => self.silence_or_cut(loss.start, outlet),
                }
                outlet.loss(&loss);
            }
            Event::Advance(now) => {
                if now.is_after(self.deadline()) {
                    self.silence(outlet);
                }
            }
            // Levels are decoded before they come here.
            Event::Levels(_)
            | Event::Frames(_)
            | Event::Rows(_)
            | Event::Cycle(_)
            | Event::Silence(_) => {}
        }
    }

    fn finish(&mut self, bus: &BusInfo, end: Moment, out: &mut Output<'_>) {
        let outlet = &mut Outlet { bus, wire: self.ledger.wire, out };
        let last = self.last;
        let setup = self.setup.finish();
        self.silence_or_cut(end, outlet);
        let verdict = self.ledger.signature.verdict(self.setup.told());
        for finding in setup.into_iter().chain(verdict).chain(self.at_end.drain(..)) {
            outlet.event(finding, None, None, last);
        }
    }

    fn deadline(&self) -> Moment {
        self.last.as_ref().and_then(|last| self.silence_from(last)).unwrap_or(Moment::UNKNOWN)
    }

    fn conclusions(&self) -> Vec<Conclusion> {
        self.ledger.habits.conclusions()
    }

    fn note(&mut self, finding: Finding) {
        if self.setup.is_news(&finding) {
            self.at_end.push(finding);
        }
    }
}

/// Whether a character is earlier than the one before it by more than their stamps' ±.
fn runs_backwards(last: &Character, character: &Character) -> bool {
    let stamps = i64::from(last.uncertainty) + i64::from(character.uncertainty);
    character.start.since(last.start).is_some_and(|ns| ns < -stamps)
}
