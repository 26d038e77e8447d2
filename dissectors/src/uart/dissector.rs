//! Plain characters: what `uart` shows, and `auto` where nothing speaks for another protocol.

use super::{Character, FRAMING, Parity, Setup, Wire};
use crate::event::{Event, Moment};
use crate::field::{FieldId, Kind, Roles, Value, fields};
use crate::finding::Finding;
use crate::protocol::{Conclusion, Dissector, Medium, Protocol, Speaks};
use crate::record::{BusInfo, Layer, Output, Record};
use alloc::{boxed::Box, string::String, vec::Vec};
use core::fmt;

/// Plain characters in the list of protocols.
pub static PROTOCOL: Protocol = Protocol {
    name: "uart",
    title: "serial characters",
    kinds: &[CHARACTER, "break", "lost", "event"],
    fields: FIELDS,
    roles: Roles::of(FIELDS),
    codes: &super::CODES,
    limits: &[],
    medium: Medium::Serial,
    wires: &[],
    speaks: |_| Speaks::Yes(String::from("nothing speaks for another protocol")),
    dissector: |wire, _| Box::new(Uart::new(wire)),
};

const CHARACTER: &str = "character";

fields! {
    /// The fields of plain characters.
    pub static FIELDS of Plain {
        "uart.byte" (Kind::Byte, "", Plain)
            "the data bits"
            => |t| t.character.map_or(Value::Absent, |character| Value::Byte(character.value()));
        "uart.parity" (Kind::OneOf(&["ok", "error", "none", "unknown"]), "", Plain)
            "whether the parity bit fits"
            => |t| t.character.map(|character| match character.parity() {
                // One of a packet was bad: of this one nothing is known.
                Parity::Suspect => "unknown",
                parity => parity.name(),
            }).into();
        "uart.framing" (Kind::OneOf(&["error"]), "", Plain)
            "only if the stop bit was missing"
            => |t| t.character
                .filter(|character| character.has_framing_error())
                .map(|_| "error")
                .into();
    }
}

/// A character, or nothing.
struct Plain<'a> {
    character: Option<&'a Character>,
}

impl Layer for Plain<'_> {
    fn get(&self, field: FieldId) -> Value<'_> {
        self.value(field)
    }

    fn summarize(&self, record: &Record<'_>, out: &mut dyn fmt::Write) -> fmt::Result {
        let Some(character) = self.character else {
            return match record.findings.first() {
                Some(finding) => finding.say(record, out),
                None => write!(out, "nothing"),
            };
        };
        write!(out, "{:02X}", character.value())?;
        if let Ok(byte @ 0x20..=0x7E) = u8::try_from(character.value()) {
            write!(out, " '{}'", char::from(byte))?;
        }
        match character.parity() {
            Parity::Error => write!(out, ", parity error"),
            Parity::Suspect => write!(out, ", parity suspect"),
            _ => Ok(()),
        }
    }

    fn name_character(&self, _: usize, out: &mut dyn fmt::Write) -> fmt::Result {
        write!(out, "the character")
    }
}

/// A serial line without a protocol.
struct Uart {
    wire: Wire,
    setup: Setup,
    at_end: Vec<Finding>,
}

impl Uart {
    fn new(wire: Wire) -> Self {
        Uart { wire, setup: Setup::default(), at_end: Vec::new() }
    }

    fn character(&mut self, bus: &BusInfo, character: &Character, out: &mut Output<'_>) {
        let plain = Plain { character: Some(character) };
        let framing = [Finding::new(&FRAMING).on_characters(1)];
        let mut record = Record::new(&PROTOCOL, CHARACTER, (bus, self.wire), &plain)
            .of_characters(core::slice::from_ref(character));
        record.duration = self.wire.character_ns().map(i64::unsigned_abs);
        if character.has_framing_error() {
            record.findings = &framing;
        }
        out.emit(record);
        if let Some(finding) = self.setup.hear(character) {
            event((bus, self.wire), finding, character.start, out);
        }
    }
}

impl Dissector for Uart {
    fn hear(&mut self, bus: &BusInfo, heard: Event<'_>, out: &mut Output<'_>) {
        let nothing = Plain { character: None };
        let blank = Record::new(&PROTOCOL, CHARACTER, (bus, self.wire), &nothing);
        match heard {
            Event::Characters(characters) => {
                characters.iter().for_each(|character| self.character(bus, character, out));
            }
            Event::Break(line_break) => {
                out.emit(blank.of_break(line_break));
                let told = self.setup.hear_break(&line_break, self.wire.character_ns());
                if let Some(finding) = told {
                    event((bus, self.wire), finding, line_break.start, out);
                }
            }
            Event::Lost(loss) => {
                out.emit(blank.of_loss(loss));
            }
            Event::Advance(_)
            | Event::Levels(_)
            | Event::Frames(_)
            | Event::Rows(_)
            | Event::Cycle(_)
            | Event::Silence(_) => {}
        }
    }

    fn finish(&mut self, bus: &BusInfo, end: Moment, out: &mut Output<'_>) {
        let setup = self.setup.finish();
        for finding in setup.into_iter().chain(self.at_end.drain(..)) {
            event((bus, self.wire), finding, end, out);
        }
    }

    fn deadline(&self) -> Moment {
        Moment::UNKNOWN
    }

    fn note(&mut self, finding: Finding) {
        if self.setup.is_news(&finding) {
            self.at_end.push(finding);
        }
    }

    fn conclusions(&self) -> Vec<Conclusion> {
        Vec::new()
    }
}

fn event(at: (&BusInfo, Wire), finding: Finding, start: Moment, out: &mut Output<'_>) {
    let (nothing, findings) = (Plain { character: None }, [finding]);
    out.emit(Record::new(&PROTOCOL, CHARACTER, at, &nothing).of_event(start, &findings));
}
