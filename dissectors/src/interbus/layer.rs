//! What a record of INTERBUS knows.

use super::cycle_fields::{CRCS, WORDS, crc_name, summarize};
use super::line::{Cycle, Select};
use super::row::{Content, Row};
use crate::field::{FieldId, Kind, Value, fields};
use crate::record::{Layer, Record};
use core::fmt;

/// The kinds of records, as the contract names them.
pub static KINDS: [&str; 11] = [
    kind::NORMAL,
    kind::PREPARED,
    kind::SERVICE_REQUEST,
    kind::SERVICE_ACKNOWLEDGE,
    kind::RELEASE,
    kind::ID_WORD,
    kind::DIAGNOSTIC,
    kind::ID_CYCLE,
    kind::DATA_CYCLE,
    "lost",
    "event",
];

/// The names of the kinds.
pub mod kind {
    /// Both service bits are 0.
    pub const NORMAL: &str = "normal";
    /// The master has laid out a service, and has not asked for it.
    pub const PREPARED: &str = "prepared";
    /// The master asks for a service.
    pub const SERVICE_REQUEST: &str = "service-request";
    /// The device has done it.
    pub const SERVICE_ACKNOWLEDGE: &str = "service-acknowledge";
    /// The master has withdrawn its request, and the device has not answered that.
    pub const RELEASE: &str = "release";
    /// The ID word of a device.
    pub const ID_WORD: &str = "id-word";
    /// Diagnostic registers, and messages of the host interface.
    pub const DIAGNOSTIC: &str = "diagnostic";
    /// A cycle in which devices tell their ID words.
    pub const ID_CYCLE: &str = "id-cycle";
    /// A cycle in which process data goes round.
    pub const DATA_CYCLE: &str = "data-cycle";
}

fields! {
    /// The fields of INTERBUS.
    pub static FIELDS of Facts {
        "interbus.out" (Kind::Hex, "", Plain) "process data from the master to the device"
            => |t| t.process().0.map_or(Value::Absent, Value::Hex);
        "interbus.in" (Kind::Hex, "", Plain) "process data from the device to the master"
            => |t| t.process().1.map_or(Value::Absent, Value::Hex);
        "interbus.device" (Kind::Int(1, 512), "", Plain) "place in the ring, from 1"
            => |t| t.row.and_then(|row| row.device).map(|device| i64::from(device.number())).into();
        "interbus.cycle" (Kind::Int(1, i64::MAX), "", Plain) "number of the cycle on the line"
            => |t| t.cycle_number().map(u64::cast_signed).into();
        "interbus.cycle_time_ns" (Kind::Int(0, i64::MAX), "ns", Plain) "from the start of the cycle before to its start"
            => |t| t.cycle.and_then(|cycle| cycle.cycle_time).map(u64::cast_signed).into();
        "interbus.crc" (Kind::OneOf(&CRCS), "", Plain) "whether the checksums of a cycle fit: unverified until it is known how they are made"
            => |t| t.cycle.map(crc_name).into();
        "interbus.words" (Kind::Rows(&WORDS), "", Plain) "process data of a cycle, by device where the ring is known"
            => |t| t.cycle.filter(|it| it.select == Select::Data).map_or(Value::Absent, |cycle| Value::Rows(cycle));
        "interbus.ids" (Kind::List(&Kind::Hex), "", Plain) "ID words of a cycle, the first device first"
            => |t| t.cycle.filter(|it| it.ids() > 0).map_or(Value::Absent, |cycle| Value::List(cycle));
    }
}

/// What is known of a record.
#[derive(Default)]
pub struct Facts<'a> {
    /// The row it was made from.
    pub row: Option<&'a Row>,
    /// The cycle it was made from.
    pub cycle: Option<&'a Cycle>,
    /// The number of the cycle that a row was made from.
    pub of_cycle: Option<u64>,
}

impl<'a> Facts<'a> {
    fn cycle_number(&self) -> Option<u64> {
        self.cycle.map(|cycle| cycle.number).or(self.of_cycle)
    }

    /// The words of a row of process data, as bytes.
    fn process(&self) -> (Option<&'a [u8]>, Option<&'a [u8]>) {
        let Some(row) = self.row else { return (None, None) };
        let Content::Process { out, input } = row.content else { return (None, None) };
        match (out, input) {
            (Some(_), Some(_)) => (row.bytes().get(..4), row.bytes().get(4..)),
            (Some(_), None) => (Some(row.bytes()), None),
            _ => (None, Some(row.bytes())),
        }
    }
}

impl Layer for Facts<'_> {
    fn get(&self, field: FieldId) -> Value<'_> {
        self.value(field)
    }

    fn summarize(&self, record: &Record<'_>, out: &mut dyn fmt::Write) -> fmt::Result {
        if let Some(cycle) = self.cycle {
            return summarize(cycle, out);
        }
        match record.findings.first() {
            Some(finding) if record.kind == "event" => finding.say(record, out),
            _ => write!(out, "{}", record.kind),
        }
    }
}
