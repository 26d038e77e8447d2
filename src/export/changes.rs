//! Only what is new: findings, and positions that differ from the one before.

use super::Export;
use dissectors::event::Moment;
use dissectors::field::{Role, Value};
use dissectors::record::{BusInfo, Record, Sink};
use std::io;

/// Wants records with findings and records that tell a new position.
pub struct Changes<'a> {
    export: Box<dyn Export + 'a>,
    /// The last position of each station.
    positions: Vec<(String, u16, i64)>,
}

impl<'a> Changes<'a> {
    /// Passes on to `export`.
    pub fn new(export: Box<dyn Export + 'a>) -> Self {
        Changes { export, positions: Vec::new() }
    }

    fn has_moved(&mut self, record: &Record<'_>) -> bool {
        let (Some(station), Value::Int(position)) =
            (record.station, record.by_role(Role::Position))
        else {
            return false;
        };
        let bus = &record.bus.name;
        let known = self.positions.iter_mut().find(|(on, who, _)| *who == station && on == bus);
        match known {
            Some((_, _, last)) => std::mem::replace(last, position) != position,
            None => {
                self.positions.push((bus.clone(), station, position));
                true
            }
        }
    }
}

impl Sink for Changes<'_> {
    fn record(&mut self, record: &Record<'_>) {
        self.export.record(record);
    }
}

impl Export for Changes<'_> {
    fn begin(&mut self, time: Moment) {
        self.export.begin(time);
    }

    fn wants(&mut self, record: &Record<'_>) -> bool {
        self.has_moved(record) || !record.findings.is_empty()
    }

    fn comment(&mut self, bus: &BusInfo, time: Moment, text: &str) {
        self.export.comment(bus, time, text);
    }

    fn end(&mut self, bus: &BusInfo, end: Moment) {
        self.export.end(bus, end);
    }

    fn status(&mut self) -> io::Result<()> {
        self.export.status()
    }

    fn flush(&mut self) -> io::Result<()> {
        self.export.flush()
    }
}
