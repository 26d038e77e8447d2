//! Rows and cycles in, records out.

use super::PROTOCOL;
use super::codes;
use super::layer::{Facts, kind};
use super::line::{Crc, Cycle, Direction, Select};
use super::row::{Content, Device, Row};
use crate::event::{Event, Moment, Silence};
use crate::finding::Finding;
use crate::protocol::{self, Conclusion, Dissector};
use crate::record::{BusInfo, Output, Record};
use crate::uart::Wire;
use alloc::vec::Vec;

/// A ring that is being listened to.
pub struct Interbus {
    wire: Wire,
    /// The devices that the user named.
    devices: Vec<Device>,
    at_end: Vec<Finding>,
}

impl Interbus {
    /// A ring of which nothing was heard yet.
    #[must_use]
    pub fn new(wire: Wire, settings: &protocol::Settings) -> Self {
        let named = settings.devices.iter().filter(|(_, profile)| profile.on_interbus().is_some());
        let devices = named.filter_map(|(number, _)| Device::new(*number)).collect();
        Interbus { wire, devices, at_end: Vec::new() }
    }

    /// A row of a log, or what a cycle of that number carried for one device.
    fn row(&mut self, bus: &BusInfo, row: &Row, of_cycle: Option<u64>, out: &mut Output<'_>) {
        let kind = match row.content {
            Content::Process { .. } => kind::NORMAL,
            Content::Identification(_) => kind::ID_WORD,
            Content::Diagnostic { .. } | Content::SlaveDiagnostic(_) | Content::Message => {
                kind::DIAGNOSTIC
            }
        };
        let facts = Facts { row: Some(row), of_cycle, ..Facts::default() };
        let mut record = Record::new(&PROTOCOL, kind, (bus, self.wire), &facts).of_row(row);
        record.station = row.device.map(|device| device.number());
        out.emit(record);
    }

    fn cycle(&mut self, bus: &BusInfo, cycle: &Cycle, out: &mut Output<'_>) {
        let kind = match cycle.select {
            Select::Identification => kind::ID_CYCLE,
            Select::Data => kind::DATA_CYCLE,
        };
        let facts = Facts { cycle: Some(cycle), ..Facts::default() };
        let mut findings = [Finding::new(&codes::LINE); 2];
        let mut count = 0;
        let crc = cycle.crc();
        if let Crc::Bad { expected, actual } = crc {
            let [expected, actual] = [expected, actual].map(i64::from);
            findings[0] = Finding::new(&codes::CRC).expected(expected).actual(actual);
            count = 1;
        }
        count += usize::from(cycle.trouble.is_some());
        let mut record = Record::new(&PROTOCOL, kind, (bus, self.wire), &facts).of_cycle(cycle);
        record.findings = findings.get(..count).unwrap_or_default();
        out.emit(record);
        // What a damaged cycle carried is nobody's process data: the devices drop it too.
        if cycle.is_damaged() || matches!(crc, Crc::Bad { .. }) {
            return;
        }
        for index in 0..self.devices.len() {
            let device = self.devices[index];
            let word = |direction| {
                let data = cycle.data(device, direction)?;
                data.first_chunk().map(|word| u32::from_be_bytes(*word))
            };
            let content =
                Content::Process { out: word(Direction::Out), input: word(Direction::In) };
            if content != (Content::Process { out: None, input: None }) {
                let row = Row::new(Some(device), content).at(cycle.start, cycle.uncertainty);
                self.row(bus, &row, Some(cycle.number), out);
            }
        }
    }

    fn silence(&mut self, bus: &BusInfo, silence: Silence, out: &mut Output<'_>) {
        let nothing = Facts::default();
        let limit = silence.deadline.since(silence.start).unwrap_or(0);
        let findings = [Finding::new(&codes::RESET).limit(limit)];
        let blank = Record::new(&PROTOCOL, kind::DATA_CYCLE, (bus, self.wire), &nothing);
        let mut record = blank.of_event(silence.deadline, &findings);
        record.uncertainty = silence.uncertainty;
        out.emit(record);
    }
}

impl Dissector for Interbus {
    fn hear(&mut self, bus: &BusInfo, event: Event<'_>, out: &mut Output<'_>) {
        match event {
            Event::Rows(rows) => rows.iter().for_each(|row| self.row(bus, row, None, out)),
            Event::Cycle(cycle) => self.cycle(bus, cycle, out),
            Event::Silence(silence) => self.silence(bus, silence, out),
            Event::Lost(loss) => {
                let nothing = Facts::default();
                let blank = Record::new(&PROTOCOL, kind::NORMAL, (bus, self.wire), &nothing);
                out.emit(blank.of_loss(loss));
            }
            Event::Characters(_)
            | Event::Frames(_)
            | Event::Levels(_)
            | Event::Break(_)
            | Event::Advance(_) => {}
        }
    }

    fn finish(&mut self, bus: &BusInfo, end: Moment, out: &mut Output<'_>) {
        let nothing = Facts::default();
        for finding in self.at_end.drain(..) {
            let blank = Record::new(&PROTOCOL, kind::NORMAL, (bus, self.wire), &nothing);
            out.emit(blank.of_event(end, &[finding]));
        }
    }

    fn deadline(&self) -> Moment {
        Moment::UNKNOWN
    }

    fn note(&mut self, finding: Finding) {
        self.at_end.push(finding);
    }

    fn conclusions(&self) -> Vec<Conclusion> {
        Vec::new()
    }
}
