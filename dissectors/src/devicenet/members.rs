//! I/O data as its maker's description lays it out: members with names, values and units.

use super::cip;
use super::connection::{Direction, Instance};
use super::eds::{Assembly, Cell, Eds, Format, Mode, format_of_size};
use super::identifier::MacId;
use super::layer::{Facts, Link, kind};
use crate::field::{Field, FieldId, Kind, Role, Rows, Value};
use core::fmt;

/// Members that a sentence shows at most.
const SHOWN: usize = 8;

/// The fields of a member.
pub(super) static MEMBER_FIELDS: [Field; 4] = [
    member_field("name", Kind::Text, "what the member is called"),
    member_field("value", Kind::Any, "its value, scaled where the EDS says how"),
    member_field("unit", Kind::Text, "the unit of its value, if it has one"),
    member_field("word", Kind::Text, "what its value is called, if it has a name"),
];

const fn member_field(name: &'static str, kind: Kind, meaning: &'static str) -> Field {
    Field { name, kind, unit: "", meaning, role: Role::Plain }
}

/// Which data of which connection a frame carries, as its slave sees it.
pub(super) fn carried(facts: &Facts) -> Option<(MacId, Instance, Direction, Mode)> {
    let slave = facts.station?;
    let is_produced = facts.source == Some(slave);
    let direction = if is_produced { Direction::Produced } else { Direction::Consumed };
    let (instance, mode) = match (facts.link?, is_produced) {
        (Link::Poll, _) => (Instance::Poll, Mode::Poll),
        (Link::Strobe, true) => (Instance::Strobe, Mode::Strobe),
        // What a master sends by change of state or cyclically travels on the poll connection.
        (Link::Cos, true) => (Instance::Production, Mode::Cos),
        (Link::Cos, false) => (Instance::Poll, Mode::Cos),
        (Link::Cyclic, true) => (Instance::Production, Mode::Cyclic),
        (Link::Cyclic, false) => (Instance::Poll, Mode::Cyclic),
        _ => return None,
    };
    let is_data = facts.kind != kind::IO_ACK;
    is_data.then_some((slave, instance, direction, mode))
}

/// One message of I/O data, as the maker's description lays it out.
#[derive(Clone, Copy)]
pub(super) struct LaidOut<'a> {
    /// What the data is called, or nothing.
    pub name: &'a str,
    /// What stands in it, where the description tells.
    pub members: Option<Members<'a>>,
}

impl<'a> LaidOut<'a> {
    /// The data of a mode. `assembly` is the one that the connection's path names; where the capture
    /// did not show that, the size of the data tells.
    pub fn of(
        eds: &'a Eds,
        (direction, mode): (Direction, Mode),
        assembly: Option<u16>,
        data: &'a [u8],
    ) -> Option<Self> {
        let formats = formats(eds, direction);
        let format = match assembly {
            Some(_) => { formats }.find(|format| format.assembly() == assembly),
            None => format_of_size(formats, default(eds, direction, mode), data.len()),
        };
        let number = assembly.or_else(|| format?.assembly());
        let assembly = number.and_then(|number| eds.assembly(number));
        let names = [assembly.map(|it| it.name.as_str()), format.map(|it| it.name.as_str())];
        let name = names.into_iter().flatten().find(|name| !name.is_empty());
        let members = assembly.map(|assembly| Members { eds, assembly, data });
        let members = members.filter(|members| members.named().next().is_some());
        (name.is_some() || members.is_some())
            .then_some(LaidOut { name: name.unwrap_or_default(), members })
    }
}

/// What the description lists in a direction.
pub(super) fn formats(eds: &Eds, direction: Direction) -> impl Iterator<Item = &Format> {
    let (produced, consumed) = match direction {
        Direction::Produced => (Some(eds.io.produced()), None),
        Direction::Consumed => (None, Some(eds.io.consumed())),
    };
    produced.into_iter().flatten().chain(consumed.into_iter().flatten())
}

/// What a mode carries by default.
pub(super) fn default(eds: &Eds, direction: Direction, mode: Mode) -> Option<&Format> {
    let (produced, consumed) = eds.io.defaults(mode);
    match direction {
        Direction::Produced => produced,
        Direction::Consumed => consumed,
    }
}

/// The members of one message of I/O data.
#[derive(Clone, Copy)]
pub(super) struct Members<'a> {
    eds: &'a Eds,
    assembly: &'a Assembly,
    data: &'a [u8],
}

impl<'a> Members<'a> {
    /// The members that have names, with their values.
    fn named(self) -> impl Iterator<Item = (Cell<'a>, cip::Value<'a>)> {
        let cells = self.eds.cells(self.assembly).filter(|cell| cell.name().is_some());
        // What comes behind the end of the data has no value.
        cells.map_while(move |cell| Some((cell, cell.value(self.data)?)))
    }
}

impl Rows for Members<'_> {
    fn len(&self) -> usize {
        self.named().count()
    }

    fn get(&self, row: usize, field: FieldId) -> Value<'_> {
        let Some((cell, value)) = self.named().nth(row) else { return Value::Absent };
        let Some(parameter) = cell.parameter else { return Value::Absent };
        match field {
            0 => Value::Text(&parameter.name),
            1 => match (parameter.scaling, value, value.number()) {
                (Some(scaling), _, Some(number)) => Value::Float(scaling.apply(number)),
                (_, cip::Value::Bool(truth), _) => Value::Bool(truth),
                (_, cip::Value::Real(number), _) if number.is_finite() => Value::Float(number),
                (_, cip::Value::Text(text), _) => text.as_str().into(),
                (_, _, number) => number.into(),
            },
            2 => Some(parameter.unit.as_str()).filter(|unit| !unit.is_empty()).into(),
            3 => value.number().and_then(|number| parameter.word(number)).into(),
            _ => Value::Absent,
        }
    }
}

impl fmt::Display for Members<'_> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, (cell, value)) in self.named().enumerate() {
            let Some(parameter) = cell.parameter else { continue };
            match index {
                0 => {}
                SHOWN => return write!(out, " …"),
                _ => write!(out, ", ")?,
            }
            write!(out, "{} {}", parameter.name, parameter.in_words(value))?;
        }
        Ok(())
    }
}
