//! Rows in, records out.

use super::PROTOCOL;
use super::layer::{Facts, kind};
use super::report::{Master, Report};
use super::row::{Content, Row};
use crate::event::{Event, Moment};
use crate::finding::Finding;
use crate::protocol::{self, Conclusion, Dissector};
use crate::record::{BusInfo, Output, Record};
use crate::uart::Wire;
use alloc::vec::Vec;

/// A ring that is being listened to.
pub struct Interbus {
    wire: Wire,
    master: Master,
    at_end: Vec<Finding>,
}

impl Interbus {
    /// A ring of which nothing was heard yet.
    #[must_use]
    pub fn new(wire: Wire, settings: &protocol::Settings) -> Self {
        Interbus { wire, master: settings.interbus.master, at_end: Vec::new() }
    }

    fn row(&mut self, bus: &BusInfo, row: &Row, out: &mut Output<'_>) {
        let kind = match row.content {
            Content::Process { .. } => kind::NORMAL,
            Content::Identification(_) => kind::ID_WORD,
            Content::Diagnostic { .. } | Content::SlaveDiagnostic(_) | Content::Message => {
                kind::DIAGNOSTIC
            }
        };
        let report = Report::of(row, self.master);
        let facts = Facts { row: Some(row), report };
        let mut record = Record::new(&PROTOCOL, kind, (bus, self.wire), &facts).of_row(row);
        record.station = row.device.map(|device| device.number());
        out.emit(record);
    }
}

impl Dissector for Interbus {
    fn hear(&mut self, bus: &BusInfo, event: Event<'_>, out: &mut Output<'_>) {
        match event {
            Event::Rows(rows) => rows.iter().for_each(|row| self.row(bus, row, out)),
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
