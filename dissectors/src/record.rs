//! Records: what a dissector makes of what it heard, one per telegram, frame or event.

use crate::can::Frame;
use crate::event::{Break, Clock, Loss, LossCause, Moment};
use crate::field::{Field, FieldId, Kind, Role, Value};
use crate::finding::{Code, Finding};
use crate::interbus::{Cycle, Row};
use crate::protocol::Protocol;
use crate::uart::{self, Character, ParityMarks, Wire};
use alloc::string::String;
use core::fmt;

/// What a record was made from.
#[derive(Clone, Copy, Debug)]
pub enum Heard<'a> {
    /// These characters.
    Characters(&'a [Character]),
    /// This frame.
    Frame(&'a Frame),
    /// This row of words.
    Row(&'a Row),
    /// This cycle of words.
    Cycle(&'a Cycle),
    /// A break.
    Break(Break),
    /// A loss.
    Lost(Loss),
    /// Nothing of its own: a conclusion, told where it was drawn.
    Nothing,
}

/// The part a record plays in an exchange between the one who asks and a station.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Turn {
    /// The station is asked.
    Asks,
    /// The station answers.
    Answers,
    /// Neither.
    Neither,
}

/// One line of the trace: what every record has, whatever its protocol.
pub struct Record<'a> {
    /// Its number in the output, from 1.
    pub n: u64,
    /// The bus it was heard on.
    pub bus: &'a BusInfo,
    /// Rate and format of that bus, as far as they are known.
    pub wire: Wire,
    /// Start on the wire.
    pub start: Moment,
    /// ± of `start` against other stamps of the same source, in ns.
    pub uncertainty: u32,
    /// Whether `start` was spread back from one read.
    pub interpolated: bool,
    /// Time on the wire in ns, if known.
    pub duration: Option<u64>,
    /// Whose record it is.
    pub protocol: &'static Protocol,
    /// One of the protocol's kinds.
    pub kind: &'static str,
    /// On an event: the record it concerns.
    pub about: Option<u64>,
    /// SLIN address, MAC ID of the slave, INTERBUS device number.
    pub station: Option<u16>,
    /// The part it plays in an exchange.
    pub turn: Turn,
    /// What it was made from.
    pub heard: Heard<'a>,
    /// What was wrong. A code stands once.
    pub findings: &'a [Finding],
    /// States that were told when they began and that hold here once more: to be counted.
    pub ongoing: &'a [&'static Code],
    /// What could not be judged because of the clock.
    pub withheld: &'a [&'static Code],
    /// What the protocol knows of it.
    pub layer: &'a dyn Layer,
}

/// The protocol's part of a record.
pub trait Layer {
    /// The value of a field of the protocol's table.
    fn get(&self, field: FieldId) -> Value<'_>;

    /// Writes the sentence that tells a person what happened.
    ///
    /// # Errors
    /// Only where `out` fails.
    fn summarize(&self, record: &Record<'_>, out: &mut dyn fmt::Write) -> fmt::Result;

    /// Writes what the record's character of that index is, such as `data word 2`.
    ///
    /// # Errors
    /// Only where `out` fails.
    fn name_character(&self, index: usize, out: &mut dyn fmt::Write) -> fmt::Result {
        write!(out, "character {}", index + 1)
    }
}

static BROKEN: [Finding; 1] = [Finding::new(&uart::BREAK)];
static LOST: [Finding; 1] = [Finding::new(&uart::LOST)];
static DEAF: [Finding; 1] = [Finding::new(&uart::LOST).cured_by(&uart::LISTEN_AGAIN)];
static OVERRUN: [Finding; 1] = [Finding::new(&uart::OVERRUN)];

impl<'a> Record<'a> {
    /// A record that nothing is known of yet but what kind it is.
    #[must_use]
    pub fn new(
        protocol: &'static Protocol,
        kind: &'static str,
        (bus, wire): (&'a BusInfo, Wire),
        layer: &'a dyn Layer,
    ) -> Self {
        Record {
            n: 0,
            bus,
            wire,
            start: Moment::UNKNOWN,
            uncertainty: 0,
            interpolated: false,
            duration: None,
            protocol,
            kind,
            about: None,
            station: None,
            turn: Turn::Neither,
            heard: Heard::Nothing,
            findings: &[],
            ongoing: &[],
            withheld: &[],
            layer,
        }
    }

    /// The same, as told by these characters. The duration is left to the caller, who knows how
    /// long one takes.
    #[must_use]
    pub fn of_characters(mut self, characters: &'a [Character]) -> Self {
        self.heard = Heard::Characters(characters);
        if let [first, ..] = characters {
            self.start = first.start;
            self.uncertainty = first.uncertainty;
            self.interpolated = first.is_interpolated();
        }
        self
    }

    /// The same, as told by this frame. The duration is left to the caller, who knows its bits.
    #[must_use]
    pub fn of_frame(mut self, frame: &'a Frame) -> Self {
        self.heard = Heard::Frame(frame);
        self.start = frame.start;
        self.uncertainty = frame.uncertainty;
        self
    }

    /// The same, as told by this row.
    #[must_use]
    pub fn of_row(mut self, row: &'a Row) -> Self {
        self.heard = Heard::Row(row);
        self.start = row.start;
        self.uncertainty = row.uncertainty;
        self
    }

    /// The same, as told by this cycle.
    #[must_use]
    pub fn of_cycle(mut self, cycle: &'a Cycle) -> Self {
        self.heard = Heard::Cycle(cycle);
        self.start = cycle.start;
        self.uncertainty = cycle.uncertainty;
        self.duration = Some(cycle.duration);
        self
    }

    /// The same, as the record of a break.
    #[must_use]
    pub fn of_break(mut self, event: Break) -> Self {
        self.kind = "break";
        self.start = event.start;
        self.uncertainty = event.uncertainty;
        self.duration = event.duration;
        self.heard = Heard::Break(event);
        self.findings = &BROKEN;
        self
    }

    /// The same, as the record of a loss.
    #[must_use]
    pub fn of_loss(mut self, loss: Loss) -> Self {
        self.kind = "lost";
        self.start = loss.start;
        self.heard = Heard::Lost(loss);
        self.findings = match loss.cause {
            LossCause::Capture => &LOST,
            LossCause::Overrun => &OVERRUN,
            LossCause::Deaf => &DEAF,
            LossCause::NotKept | LossCause::Sought(_) => &[],
        };
        self
    }

    /// The same, as an event: a conclusion that nothing on the wire carries.
    #[must_use]
    pub fn of_event(mut self, start: Moment, findings: &'a [Finding]) -> Self {
        self.kind = "event";
        self.start = start;
        self.findings = findings;
        self
    }

    /// The characters it was made from, if any.
    #[must_use]
    pub fn characters(&self) -> &'a [Character] {
        match self.heard {
            Heard::Characters(characters) => characters,
            _ => &[],
        }
    }

    /// The frame it was made from, if any.
    #[must_use]
    pub fn frame(&self) -> Option<&'a Frame> {
        match self.heard {
            Heard::Frame(frame) => Some(frame),
            _ => None,
        }
    }

    /// Whether it carries bytes of the wire, be it none.
    #[must_use]
    pub fn has_bytes(&self) -> bool {
        matches!(
            self.heard,
            Heard::Characters(_) | Heard::Frame(_) | Heard::Row(_) | Heard::Cycle(_)
        )
    }

    /// The bytes on the wire: those of the characters, the data of the frame, the words of the row,
    /// or all of the cycle, what was sent before what came back.
    pub fn bytes(&self) -> impl Iterator<Item = u8> + use<'a> {
        let (data, cycle) = match self.heard {
            Heard::Frame(frame) => (frame.bytes(), None),
            Heard::Row(row) => (row.bytes(), None),
            Heard::Cycle(cycle) => (&[][..], Some(cycle)),
            _ => (&[][..], None),
        };
        let wires = cycle.into_iter().flat_map(|cycle| cycle.frames());
        let behind = wires.flat_map(|frame| frame.bytes().iter().copied());
        self.characters().iter().map(Character::byte).chain(data.iter().copied()).chain(behind)
    }

    /// How many characters or frames were lost here, if this is a loss and they were counted.
    #[must_use]
    pub fn lost(&self) -> Option<u64> {
        match self.heard {
            Heard::Lost(loss) => loss.count,
            _ => None,
        }
    }

    /// Whether nobody listened here, so that nobody knows what there was.
    #[must_use]
    pub fn is_deaf(&self) -> bool {
        matches!(self.heard, Heard::Lost(Loss { cause: LossCause::Deaf, .. }))
    }

    /// A field of the protocol's table.
    #[must_use]
    pub fn get(&self, field: FieldId) -> Value<'_> {
        self.layer.get(field)
    }

    /// The field of this name, for sentences.
    #[must_use]
    pub fn named(&self, name: &str) -> Value<'_> {
        let field = self.protocol.fields.iter().position(|field| field.name == name);
        field.map_or(Value::Absent, |field| self.layer.get(field))
    }

    /// The first field of the protocol that has this role.
    #[must_use]
    pub fn by_role(&self, role: Role) -> Value<'_> {
        self.protocol.roles.field(role).map_or(Value::Absent, |field| self.layer.get(field))
    }

    /// Writes the sentence that the text view shows.
    ///
    /// # Errors
    /// Only where `out` fails.
    pub fn summarize(&self, out: &mut dyn fmt::Write) -> fmt::Result {
        match self.heard {
            Heard::Lost(loss) if !loss.cause.is_failure() => loss.cause.say(out),
            _ => self.layer.summarize(self, out),
        }
    }
}

/// What is known of a bus before anything is decoded.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct BusInfo {
    /// Interface or channel name of the source.
    pub name: String,
    /// Who stamps its times; `None` where there are none.
    pub clock: Option<Clock>,
    /// What its tap tells about parity.
    pub parity: ParityMarks,
    /// Its times are bare numbers, in a unit that the source does not tell.
    pub is_unit_guessed: bool,
    /// Its words may be hex or decimal: nothing tells which.
    pub is_radix_guessed: bool,
}

impl BusInfo {
    /// A bus whose tap tells the parity of every character.
    #[must_use]
    pub fn new(name: impl Into<String>, clock: Option<Clock>) -> Self {
        BusInfo {
            name: name.into(),
            clock,
            parity: ParityMarks::Character,
            is_unit_guessed: false,
            is_radix_guessed: false,
        }
    }

    /// The same with times that are bare numbers.
    #[must_use]
    pub fn with_guessed_unit(mut self, is_guessed: bool) -> Self {
        self.is_unit_guessed = is_guessed;
        self
    }

    /// The same with a tap that tells this about parity.
    #[must_use]
    pub fn with_parity(mut self, parity: ParityMarks) -> Self {
        self.parity = parity;
        self
    }
}

/// Takes records, in output order.
pub trait Sink {
    /// Takes the next record. It borrows from the dissector: what must stay is to be copied.
    fn record(&mut self, record: &Record<'_>);
}

/// Where a dissector hands its records: numbers them and passes them on.
pub struct Output<'a> {
    last_number: &'a mut u64,
    sink: &'a mut dyn Sink,
}

impl<'a> Output<'a> {
    /// An output that goes on counting from `last_number`.
    pub fn new(last_number: &'a mut u64, sink: &'a mut dyn Sink) -> Self {
        Output { last_number, sink }
    }

    /// The number that the next record will get.
    #[must_use]
    pub fn next_number(&self) -> u64 {
        *self.last_number + 1
    }

    /// Numbers a record, hands it on, and returns its number.
    pub fn emit(&mut self, mut record: Record<'_>) -> u64 {
        *self.last_number += 1;
        record.n = *self.last_number;
        self.sink.record(&record);
        record.n
    }
}

/// The fields that records of every protocol have, in the order they are written.
pub static COMMON: [Field; 17] = [
    field("n", Kind::Int(1, i64::MAX), "", "record number, in output order, from 1"),
    field(
        "time_ns",
        Kind::Int(i64::MIN, i64::MAX),
        "ns",
        "start on the wire, since the Unix epoch or the capture's start",
    ),
    field("duration_ns", Kind::Int(0, i64::MAX), "ns", "time on the wire, if known"),
    field(
        "uncertainty_ns",
        Kind::Int(0, i64::MAX),
        "ns",
        "± of the time against other stamps of the same source",
    ),
    field(
        "clock",
        Kind::OneOf(&["hardware", "sample", "kernel", "read", "log"]),
        "",
        "who stamped the time",
    ),
    field("interpolated", Kind::Bool, "", "true where the time was spread back from one read"),
    field("bus", Kind::Text, "", "interface or channel name of the source"),
    field("protocol", Kind::Text, "", "whose record it is"),
    field("kind", Kind::Text, "", "what kind of record"),
    field("about", Kind::Int(1, i64::MAX), "", "on an event: the record it concerns"),
    field("station", Kind::Int(0, 65_535), "", "SLIN address, MAC ID, INTERBUS device number"),
    field("lost", Kind::Int(0, i64::MAX), "", "how many were lost here, if they were counted"),
    field("summary", Kind::Text, "", "the sentence that the text view shows"),
    field("raw", Kind::Hex, "", "the bytes on the wire"),
    field("findings", Kind::Text, "", "what was wrong, with the evidence"),
    field("withheld", Kind::Text, "", "codes that could not be judged here because of the clock"),
    field(
        "delta_ns",
        Kind::Int(i64::MIN, i64::MAX),
        "ns",
        "time since the record before it (text and CSV)",
    ),
];

const fn field(name: &'static str, kind: Kind, unit: &'static str, meaning: &'static str) -> Field {
    Field { name, kind, unit, meaning, role: Role::Plain }
}
