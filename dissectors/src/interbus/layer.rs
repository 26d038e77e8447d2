//! What a record of INTERBUS knows.

use super::cycle_fields::{self, CRCS, WORDS, crc_name};
use super::device::Told;
use super::identification::{Direction, IdWord};
use super::line::{Cycle, Select};
use super::report::Report;
use super::row::{Content, Row};
use super::service::Service;
use super::summary::summarize;
use super::word::Word;
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
        "interbus.position" (Kind::Int(0, 16_777_215), "steps", Position) "position, where the words mean one"
            => |t| t.told().and_then(|it| it.position).map(i64::from).into();
        "interbus.position_mm" (Kind::Float, "mm", Plain) "position, where rod and measuring length in steps are known"
            => |t| t.position_mm().map_or(Value::Absent, Value::Float);
        "interbus.service" (Kind::Int(0, 15), "", Plain) "number of the service"
            => |t| t.service().map(|word| i64::from(word.service())).into();
        "interbus.service_name" (Kind::Text, "", Service) "name of the service, where the device has it"
            => |t| t.service().and_then(|it| Service::numbered(it.service())).map(|it| it.name).into();
        "interbus.access" (Kind::OneOf(&["read", "write"]), "", Plain) "which way the service goes"
            => |t| t.service().map(|word| word.access().name()).into();
        "interbus.data" (Kind::Int(0, 16_777_215), "", Plain) "data of the service"
            => |t| t.service().map(|word| i64::from(word.data())).into();
        "interbus.error_bit" (Kind::Bool, "", Plain) "bit 29 of the input data"
            => |t| t.told().and_then(|it| it.has_error).map_or(Value::Absent, Value::Bool);
        "interbus.request" (Kind::Int(1, i64::MAX), "", Request) "number of the record that asked for what is acknowledged"
            => |t| t.told().and_then(|it| it.request).map(|n| n as i64).into();
        "interbus.response_time_ns" (Kind::Int(0, i64::MAX), "ns", ResponseTime) "request to acknowledgement, row to row"
            => |t| t.told().and_then(|it| it.response_time).into();
        "interbus.device" (Kind::Int(1, 512), "", Plain) "place in the ring, from 1"
            => |t| t.row.and_then(|row| row.device).map(|device| i64::from(device.number())).into();
        "interbus.id" (Kind::Hex, "", Plain) "ID word"
            => |t| t.word(|content| matches!(content, Content::Identification(_)), 0);
        "interbus.ident" (Kind::Int(0, 255), "", Plain) "ident code: a class of devices"
            => |t| t.id().map(|id| i64::from(id.ident)).into();
        "interbus.length_bits" (Kind::Int(0, 512), "bit", Plain) "process data, as the ID word says"
            => |t| t.id().and_then(|id| id.length.bits()).map(i64::from).into();
        "interbus.direction" (Kind::OneOf(&Direction::NAMES), "", Plain) "which way process data goes"
            => |t| t.id().map(|id| id.direction().name()).into();
        "interbus.message_bits" (Kind::Int(0, 7), "", Plain) "bits 15 to 13 of the ID word"
            => |t| t.id().map(|id| i64::from(id.messages)).into();
        "interbus.status" (Kind::Hex, "", Plain) "diagnostic status register"
            => |t| t.word(|content| matches!(content, Content::Diagnostic { .. }), 0);
        "interbus.parameter" (Kind::Hex, "", Plain) "diagnostic parameter register"
            => |t| t.word(|content| matches!(content, Content::Diagnostic { .. }), 1);
        "interbus.flags" (Kind::List(&Kind::Text), "", Plain) "bits that are set in a register, by name"
            => |t| t.report.as_ref().map_or(Value::Absent, Report::flags);
        "interbus.segment" (Kind::Int(0, 255), "", Plain) "segment that the parameter register names"
            => |t| t.place().map(|(segment, _)| i64::from(segment)).into();
        "interbus.place" (Kind::Int(0, 127), "", Plain) "device in that segment"
            => |t| t.place().and_then(|(_, device)| device).map(i64::from).into();
        "interbus.message" (Kind::Text, "", Plain) "service of a host message"
            => |t| t.report.as_ref().and_then(Report::message).into();
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
    /// What its process data tells.
    pub process: Option<Told>,
    /// What the row says, where it holds no process words.
    pub report: Option<Report<'a>>,
    /// The cycle it was made from.
    pub cycle: Option<&'a Cycle>,
    /// The number of the cycle that a row was made from.
    pub of_cycle: Option<u64>,
    /// Where the external preset input has set the position to.
    pub preset_to: Option<u32>,
}

impl Facts<'_> {
    fn id(&self) -> Option<IdWord> {
        self.report.as_ref()?.id()
    }

    fn place(&self) -> Option<(u8, Option<u8>)> {
        self.report.as_ref()?.place()
    }

    fn word(&self, is_it: fn(Content) -> bool, index: usize) -> Value<'_> {
        self.report.as_ref().map_or(Value::Absent, |report| report.word(is_it, index))
    }
}

impl<'a> Facts<'a> {
    const fn told(&self) -> Option<&Told> {
        self.process.as_ref()
    }

    fn service(&self) -> Option<Word> {
        self.told()?.service
    }

    fn position_mm(&self) -> Option<f64> {
        let told = self.told()?;
        Some(f64::from(told.position?) * told.step_mm?)
    }

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
        match (&self.report, self.cycle) {
            (Some(report), _) => report.say(out),
            (None, Some(cycle)) => cycle_fields::summarize(cycle, out),
            (None, None) => summarize(self, record, out),
        }
    }
}
