//! What a SLIN record knows: its fields and its sentence.

use super::checksum::Rules;
use super::exchange::{FramedBy, Part};
use super::word::{Address, Footer};
use crate::field::{Field, FieldId, Kind, Role, Rows, Value, fields};
use crate::finding::Span;
use crate::record::{Heard, Layer, Record};
use crate::station::Station;
use crate::uart::Character;
use core::fmt;

/// The kinds of SLIN records.
pub static KINDS: [&str; 7] = [REQUEST, RESPONSE, PARTIAL, STRAY, BREAK, LOST, EVENT];

pub(super) const REQUEST: &str = "request";
pub(super) const RESPONSE: &str = "response";
pub(super) const PARTIAL: &str = "partial";
pub(super) const STRAY: &str = "stray";
pub(super) const BREAK: &str = "break";
pub(super) const LOST: &str = "lost";
pub(super) const EVENT: &str = "event";

/// The protocol's part of a SLIN record. What does not apply is `None`.
#[derive(Clone, Copy, Default)]
pub(super) struct Telegram<'a> {
    pub address: Option<Address>,
    /// Number and address of the request that is answered.
    pub request: Option<(u64, Address)>,
    pub position: Option<u32>,
    pub data_words: Option<usize>,
    pub footer: Option<Footer>,
    pub checksum_expected: Option<u8>,
    pub fitting: Option<Rules>,
    pub response_time: Option<i64>,
    pub framed_by: Option<FramedBy>,
    pub parts: &'a [Part],
    pub characters: &'a [Character],
    pub station: Option<&'a Station>,
}

fields! {
    /// The fields of SLIN records.
    pub static FIELDS of Telegram {
        "slin.address" (Kind::Int(0, 7), "", Plain)
            "address of the encoder; in an answer as its footer says"
            => |t| t.address.map(|address| i64::from(address.get())).into();
        "slin.request" (Kind::Int(1, i64::MAX), "", Request)
            "number of the request that was answered"
            => |t| t.request.map(|(n, _)| n.cast_signed()).into();
        "slin.request_address" (Kind::Int(0, 7), "", Plain)
            "address that was asked"
            => |t| t.request.map(|(_, address)| i64::from(address.get())).into();
        "slin.position" (Kind::Int(0, 268_435_455), "steps", Position)
            "position: the data words, low word first"
            => |t| t.position.map(i64::from).into();
        "slin.turns" (Kind::Int(0, 268_435_455), "turns", Plain)
            "whole turns, clockwise (with --stations)"
            => |t| t.turns().map(i64::from).into();
        "slin.angle" (Kind::Float, "degrees", Plain)
            "angle within the turn, clockwise (with --stations)"
            => |t| t.angle().map_or(Value::Absent, Value::Float);
        "slin.name" (Kind::Text, "", Plain)
            "name of the station (with --stations)"
            => |t| t.name().into();
        "slin.data_words" (Kind::Int(0, 32), "", Plain)
            "number of data words"
            => |t| t.data_words.and_then(|words| i64::try_from(words).ok()).into();
        "slin.checksum" (Kind::Int(0, 7), "", Plain)
            "checksum in the footer"
            => |t| t.footer.map(|footer| i64::from(footer.checksum)).into();
        "slin.checksum_expected" (Kind::Int(0, 7), "", Plain)
            "checksum of the data words"
            => |t| t.checksum_expected.map(i64::from).into();
        "slin.checksum_rule" (Kind::AnyOf(&["add", "addc", "addc-sent"]), "", Plain)
            "readings of the manuals under which the checksum fits"
            => |t| t.fitting.map(Rules::names).into();
        "slin.footer_bit3" (Kind::Int(0, 1), "", Plain)
            "bit 3 of the footer"
            => |t| t.footer.map(|footer| i64::from(footer.bit3)).into();
        "slin.response_time_ns" (Kind::Int(i64::MIN, i64::MAX), "ns", ResponseTime)
            "end of the request's stop bit to the first start bit of the answer"
            => |t| t.response_time.into();
        "slin.framed_by" (Kind::OneOf(&["bit3", "grammar", "time"]), "", Plain)
            "why it was taken for a response"
            => |t| t.framed_by.map(FramedBy::name).into();
        "slin.characters" (Kind::Rows(&CHARACTER_FIELDS), "", Plain)
            "the characters it was made from"
            => |t| if t.characters.is_empty() { Value::Absent } else { Value::Rows(t) };
    }
}

static CHARACTER_FIELDS: [Field; 5] = [
    character_field("time_ns", Kind::Int(i64::MIN, i64::MAX), "ns", "start of the start bit"),
    character_field("byte", Kind::Byte, "", "the data bits"),
    character_field(
        "parity",
        Kind::OneOf(&["ok", "error", "suspect", "unknown"]),
        "",
        "whether the parity bit fits; suspect: the adapter marks whole packets",
    ),
    character_field(
        "role",
        Kind::OneOf(&["request", "data", "footer", "stray"]),
        "",
        "the part it plays",
    ),
    character_field("framing", Kind::OneOf(&["error"]), "", "only if the stop bit was missing"),
];

const fn character_field(
    name: &'static str,
    kind: Kind,
    unit: &'static str,
    meaning: &'static str,
) -> Field {
    Field { name, kind, unit, meaning, role: Role::Plain }
}

impl Rows for Telegram<'_> {
    fn len(&self) -> usize {
        self.characters.len()
    }

    fn get(&self, row: usize, field: FieldId) -> Value<'_> {
        let (Some(character), Some(part)) = (self.characters.get(row), self.parts.get(row)) else {
            return Value::Absent;
        };
        match field {
            0 => character.start.ns().into(),
            1 => Value::Byte(character.value()),
            2 => Value::Text(match character.parity() {
                // SLIN has parity: a source that shows none does not tell.
                crate::uart::Parity::None => "unknown",
                parity => parity.name(),
            }),
            3 => Value::Text(part.name()),
            4 => character.has_framing_error().then_some("error").into(),
            _ => Value::Absent,
        }
    }
}

impl Telegram<'_> {
    fn turns(&self) -> Option<u32> {
        self.station?.resolution?.turns(self.position?)
    }

    fn angle(&self) -> Option<f64> {
        self.station?.resolution?.angle(self.position?)
    }

    fn name(&self) -> Option<&str> {
        self.station?.name.as_deref()
    }

    fn who(&self, out: &mut dyn fmt::Write) -> fmt::Result {
        match self.address {
            Some(address) => write!(out, "{}", address.get())?,
            None => write!(out, "somebody")?,
        }
        match self.name() {
            Some(name) => write!(out, " ({name})"),
            None => Ok(()),
        }
    }

    fn summarize_response(&self, uncertainty: u32, out: &mut dyn fmt::Write) -> fmt::Result {
        self.who(out)?;
        match (self.position, self.data_words) {
            (Some(position), _) => write!(out, " answers {position}")?,
            (None, Some(1)) => write!(out, " answers 1 word, no position")?,
            (None, words) => write!(out, " answers {} words, no position", words.unwrap_or(0))?,
        }
        let resolution = self.station.and_then(|station| station.resolution);
        if let Some((position, resolution)) = self.position.zip(resolution) {
            write!(out, " {}", resolution.place(position))?;
        }
        match self.response_time {
            Some(ns) => match 2 * i64::from(uncertainty) {
                // What both stamps together cannot tell from none is told by what it is at most.
                both if both >= ns.saturating_abs() && both > 0 => {
                    write!(out, " in under {}", Span(ns.saturating_add(both)))
                }
                _ => write!(out, " in {}", Span(ns)),
            },
            None => Ok(()),
        }
    }

    fn summarize_characters(&self, what: &str, out: &mut dyn fmt::Write) -> fmt::Result {
        let count = self.characters.len();
        write!(out, "{count} {what}{}", if count == 1 { "" } else { "s" })
    }
}

impl Telegram<'_> {
    /// Whose record it is: a footer that was damaged names nobody.
    pub fn whose(&self) -> Option<Address> {
        let is_damaged = |(part, character): (&Part, &Character)| {
            *part == Part::Footer && character.is_damaged()
        };
        let asked = self.request.map(|(_, address)| address);
        let is_torn = self.parts.iter().zip(self.characters).any(is_damaged);
        asked.filter(|_| is_torn).or(self.address)
    }
}

impl Layer for Telegram<'_> {
    fn get(&self, field: FieldId) -> Value<'_> {
        self.value(field)
    }

    fn summarize(&self, record: &Record<'_>, out: &mut dyn fmt::Write) -> fmt::Result {
        match record.heard {
            Heard::Break(_) | Heard::Lost(_) => {
                record.findings.iter().try_for_each(|finding| finding.say(record, out))
            }
            Heard::Nothing | Heard::Frame(_) | Heard::Row(_) | Heard::Cycle(_) => {
                match record.findings.first() {
                    Some(finding) => finding.say(record, out),
                    None => write!(out, "nothing"),
                }
            }
            Heard::Characters(_) if record.kind == REQUEST => {
                write!(out, "master asks ")?;
                self.who(out)
            }
            Heard::Characters(_) if record.kind == RESPONSE => {
                self.summarize_response(record.uncertainty, out)
            }
            Heard::Characters(_) if record.kind == PARTIAL => {
                self.summarize_characters("character", out)?;
                write!(out, ", cut off by the edge of the capture")
            }
            Heard::Characters(_) => self.summarize_characters("stray character", out),
        }
    }

    fn name_character(&self, index: usize, out: &mut dyn fmt::Write) -> fmt::Result {
        match self.parts.get(index) {
            Some(Part::Request) => write!(out, "the request"),
            Some(Part::Footer) => write!(out, "the footer"),
            Some(Part::Data) => {
                let words = self.parts[..=index].iter().filter(|part| **part == Part::Data).count();
                write!(out, "data word {words}")
            }
            _ => write!(out, "a stray character"),
        }
    }
}
