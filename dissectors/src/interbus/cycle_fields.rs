//! What a record of a cycle can be asked for.

use super::line::{Crc, Cycle, Direction, Frame, Select};
use super::row::Device;
use crate::field::{Field, FieldId, Kind, List, Role, Rows, Value};
use core::fmt;

/// What is said of checksums.
pub static CRCS: [&str; 3] = ["ok", "bad", "unverified"];

/// The fields of a device in a cycle.
pub static WORDS: [Field; 3] = [
    field("device", Kind::Int(1, 512), "place in the ring; absent while the ring is not known"),
    field("out", Kind::Hex, "what the wire carried away from the master"),
    field("in", Kind::Hex, "what the wire carried to the master"),
];

const fn field(name: &'static str, kind: Kind, meaning: &'static str) -> Field {
    Field { name, kind, unit: "", meaning, role: Role::Plain }
}

/// Whether the checksums fit.
pub fn crc_name(cycle: &Cycle) -> &'static str {
    match cycle.crc() {
        Crc::Ok => CRCS[0],
        Crc::Bad { .. } => CRCS[1],
        Crc::Unverified => CRCS[2],
    }
}

/// By device where the ring is known; otherwise one row: what the wires carried, without the
/// loopback word where that is known.
impl Rows for Cycle {
    fn len(&self) -> usize {
        self.ring.as_ref().map_or(1, |ring| ring.len())
    }

    fn get(&self, row: usize, field: FieldId) -> Value<'_> {
        let of = |bytes: &[u8]| !bytes.is_empty();
        if self.ring.is_none() {
            let bytes = match field {
                1 => self.wires[0].as_ref().map(registers),
                2 => self.wires[1].as_ref().map(registers),
                _ => None,
            };
            return bytes.filter(|bytes| of(bytes)).map_or(Value::Absent, Value::Hex);
        }
        let device = u16::try_from(row + 1).ok().and_then(Device::new);
        let Some(device) = device else { return Value::Absent };
        let data = |direction| self.data(device, direction).filter(|bytes| of(bytes));
        match field {
            0 => Value::Int(i64::from(device.number())),
            1 => data(Direction::Out).map_or(Value::Absent, Value::Hex),
            2 => data(Direction::In).map_or(Value::Absent, Value::Hex),
            _ => Value::Absent,
        }
    }
}

/// All registers of a wire, if the loopback word stands at one of its ends; else with it.
fn registers(frame: &Frame) -> &[u8] {
    match (frame.before(), frame.behind()) {
        ([], []) => frame.registers(),
        ([], behind) => behind,
        (before, []) => before,
        _ => frame.registers(),
    }
}

/// The ID words, the first device first.
impl List for Cycle {
    fn len(&self) -> usize {
        self.ids()
    }

    fn get(&self, index: usize) -> Value<'_> {
        let device = u16::try_from(index + 1).ok().and_then(Device::new);
        device.and_then(|device| self.id(device)).map_or(Value::Absent, Value::Hex)
    }
}

/// The sentence of a cycle.
pub fn summarize(cycle: &Cycle, out: &mut dyn fmt::Write) -> fmt::Result {
    match cycle.select {
        Select::Identification => {
            write!(out, "ID cycle {}", cycle.number)?;
            match cycle.ids() {
                0 => {}
                1 => write!(out, ", 1 device")?,
                count => write!(out, ", {count} devices")?,
            }
        }
        Select::Data => write!(out, "data cycle {}", cycle.number)?,
    }
    match cycle.crc() {
        Crc::Ok | Crc::Bad { .. } => Ok(()),
        Crc::Unverified => write!(out, ", CRC unverified"),
    }
}
