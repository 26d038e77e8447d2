//! `chars`: the plain text form of a character stream.
//!
//! A header `time,byte,parity`, then a line a character: seconds at its start bit, two hex digits,
//! and `ok`, `error`, `unknown`, `framing` or `break`.

use super::lines::Lines;
use super::numbers::{Stamp, hex, seconds};
use super::{Input, Piece, Source, SourceError};
use dissectors::bus::WireFacts;
use dissectors::event::{Break, Clock, Event};
use dissectors::record::BusInfo;
use dissectors::uart::{Character, Parity, ParityMarks};
use nom::branch::alt;
use nom::bytes::complete::tag;
use nom::character::complete::char;
use nom::combinator::{all_consuming, value};
use nom::{IResult, Parser};

const HEADER: &[u8] = b"time,byte,parity";

/// Characters handed over at once.
const BATCH: usize = 1024;

/// Whether a source begins with the header of this format.
pub fn is_header(head: &[u8]) -> bool {
    head.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(head).starts_with(HEADER)
}

/// A `chars` source.
pub struct Chars {
    lines: Lines<Input>,
    is_announced: bool,
    batch: Vec<Character>,
    /// The batch that was handed over.
    given: Vec<Character>,
    /// What ended the batch before it was full.
    pending: Option<Pending>,
}

enum Pending {
    Break(Break),
    Error(SourceError),
}

#[derive(Clone, Copy)]
enum State {
    Character(Parity),
    Framing,
    Break,
}

impl Chars {
    /// Reads characters from this input.
    pub fn new(input: Input) -> Self {
        let name = input.name.clone();
        Chars {
            lines: Lines::new(&name, input),
            is_announced: false,
            batch: Vec::with_capacity(BATCH),
            given: Vec::with_capacity(BATCH),
            pending: None,
        }
    }

    /// What the first characters tell of all: whoever wrote them knew parity, or did not.
    fn parity_marks(&self) -> ParityMarks {
        let first = self.batch.iter().find(|character| !character.has_framing_error());
        match first.map(Character::parity) {
            Some(Parity::Unknown) => ParityMarks::None,
            _ => ParityMarks::Character,
        }
    }

    /// Fills the batch up to the next break, error, or the end, but does not wait with characters
    /// in it.
    fn fill(&mut self) {
        self.batch.clear();
        while self.batch.is_empty() || self.batch.len() < BATCH && !self.lines.may_wait() {
            let parsed = match self.lines.next_line() {
                Ok(None) => return,
                Ok(Some(line)) => parse(line),
                Err(error) => return self.pending = Some(Pending::Error(error)),
            };
            match parsed {
                Parsed::Nothing => {}
                Parsed::Character(character) => self.batch.push(character),
                Parsed::Break(event) => return self.pending = Some(Pending::Break(event)),
                Parsed::Wrong => {
                    let what = "not a character: expected seconds, two hex digits, and ok, error, \
                                unknown, framing or break";
                    return self.pending = Some(Pending::Error(self.lines.error(what)));
                }
            }
        }
    }
}

impl Source for Chars {
    fn next_piece(&mut self) -> Result<Option<Piece<'_>>, SourceError> {
        if !self.is_announced {
            self.is_announced = true;
            self.fill();
            let info = BusInfo::new("serial", Some(Clock::Log)).with_parity(self.parity_marks());
            return Ok(Some(Piece::Bus(info, WireFacts::default())));
        }
        if self.batch.is_empty() && self.pending.is_none() {
            self.fill();
        }
        if !self.batch.is_empty() {
            self.given.clear();
            std::mem::swap(&mut self.batch, &mut self.given);
            return Ok(Some(Piece::Heard(0, Event::Characters(&self.given))));
        }
        match self.pending.take() {
            Some(Pending::Break(event)) => Ok(Some(Piece::Heard(0, Event::Break(event)))),
            Some(Pending::Error(error)) => Err(error),
            None => Ok(None),
        }
    }
}

enum Parsed {
    Nothing,
    Character(Character),
    Break(Break),
    Wrong,
}

fn parse(line: &[u8]) -> Parsed {
    let line = line.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(line);
    if line.is_empty() || line == HEADER {
        return Parsed::Nothing;
    }
    let Ok((_, (stamp, byte, state))) = all_consuming(row).parse(line) else {
        return Parsed::Wrong;
    };
    let character = |parity| Character::new(stamp.time, stamp.resolution, byte, parity);
    match state {
        State::Character(parity) => Parsed::Character(character(parity)),
        State::Framing => Parsed::Character(character(Parity::Unknown).with_framing_error()),
        State::Break => Parsed::Break(Break {
            start: stamp.time,
            uncertainty: stamp.resolution,
            duration: None,
        }),
    }
}

fn row(input: &[u8]) -> IResult<&[u8], (Stamp, u16, State)> {
    let (input, stamp) = seconds(input)?;
    let (input, _) = char(',').parse(input)?;
    let (input, byte) = hex(2)(input)?;
    let (input, _) = char(',').parse(input)?;
    let (input, state) = state(input)?;
    Ok((input, (stamp, byte, state)))
}

fn state(input: &[u8]) -> IResult<&[u8], State> {
    alt((
        value(State::Character(Parity::Ok), tag("ok")),
        value(State::Character(Parity::Error), tag("error")),
        value(State::Character(Parity::Unknown), tag("unknown")),
        value(State::Framing, tag("framing")),
        value(State::Break, tag("break")),
    ))
    .parse(input)
}
