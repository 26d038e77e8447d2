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

/// Words that a sentence has of a direction at most, and bytes of each.
const MOST_WORDS: usize = 4;
const MOST_BYTES: usize = 8;

/// The first few words of a direction, if there are any; `-` for a device without.
fn say_some<'a>(
    heading: &str,
    words: impl Iterator<Item = Value<'a>> + Clone,
    out: &mut dyn fmt::Write,
) -> fmt::Result {
    if !words.clone().any(|word| matches!(word, Value::Hex(_))) {
        return Ok(());
    }
    out.write_str(heading)?;
    for (index, word) in words.clone().take(MOST_WORDS).enumerate() {
        out.write_str(if index == 0 { "" } else { " " })?;
        let Value::Hex(bytes) = word else {
            out.write_char('-')?;
            continue;
        };
        bytes.iter().take(MOST_BYTES).try_for_each(|byte| write!(out, "{byte:02X}"))?;
        out.write_str(if bytes.len() > MOST_BYTES { "…" } else { "" })?;
    }
    out.write_str(if words.count() > MOST_WORDS { " …" } else { "" })
}

/// The sentence of a cycle: what went round, by device where the ring is known.
pub fn summarize(cycle: &Cycle, out: &mut dyn fmt::Write) -> fmt::Result {
    match cycle.select {
        Select::Identification => {
            write!(out, "ID cycle {}", cycle.number)?;
            match cycle.ids() {
                0 => {}
                1 => write!(out, ", 1 device")?,
                count => write!(out, ", {count} devices")?,
            }
            let ids = (0..cycle.ids()).map(|index| List::get(cycle, index));
            say_some(": ", ids, out)?;
        }
        Select::Data => {
            write!(out, "data cycle {}", cycle.number)?;
            let rows = Rows::len(cycle);
            say_some(", OUT ", (0..rows).map(|row| Rows::get(cycle, row, 1)), out)?;
            say_some(", IN ", (0..rows).map(|row| Rows::get(cycle, row, 2)), out)?;
        }
    }
    match cycle.crc() {
        Crc::Ok | Crc::Bad { .. } => Ok(()),
        Crc::Unverified => write!(out, ", CRC unverified"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::String;

    #[test]
    fn words_are_told_by_device_and_shortly() {
        let said = |words: &[Value<'static>]| {
            let mut text = String::new();
            say_some(", OUT ", words.iter().copied(), &mut text).unwrap();
            text
        };
        let word = Value::Hex(&[0xC2, 0x00, 0x13, 0x88]);
        assert_eq!(said(&[word]), ", OUT C2001388");
        assert_eq!(said(&[word, Value::Absent]), ", OUT C2001388 -");
        assert_eq!(said(&[Value::Hex(&[0xAB; 9])]), ", OUT ABABABABABABABAB…");
        assert_eq!(said(&[Value::Hex(&[1]); 5]), ", OUT 01 01 01 01 …");
        assert_eq!(said(&[Value::Absent; 3]), "");
    }
}
