//! The levels of a ring in, what was told of them out.

use super::{Plan, Recording};
use fieldtap_dissectors::bus::{Bus, Sampling, WireFacts};
use fieldtap_dissectors::event::{Clock, Event, Levels, Moment};
use fieldtap_dissectors::field::Value;
use fieldtap_dissectors::protocol::{Conclusion, Protocol, Settings};
use fieldtap_dissectors::record::{BusInfo, Output, Record, Sink};
use fieldtap_dissectors::setting::Setting;

/// What came of it.
#[derive(Clone, Default)]
pub struct Heard {
    pub settings: Vec<Setting>,
    pub conclusions: Vec<Conclusion>,
    /// Kind, and verdict on the checksum, of every record.
    pub records: Vec<(&'static str, Option<String>)>,
    pub stations: Vec<(u16, String)>,
    pub findings: Vec<(&'static str, String)>,
    pub protocol: Option<&'static str>,
}

impl Sink for Heard {
    fn record(&mut self, record: &Record<'_>) {
        let crc = match record.named("interbus.crc") {
            Value::Text(text) => Some(text.to_owned()),
            _ => None,
        };
        self.records.push((record.kind, crc));
        if let Some(station) = record.station {
            let hex = |name| match record.named(name) {
                Value::Hex(bytes) => bytes.iter().map(|byte| format!("{byte:02X}")).collect(),
                _ => String::new(),
            };
            self.stations.push((station, hex("interbus.out") + " " + &hex("interbus.in")));
        }
        for finding in record.findings {
            let mut text = String::new();
            finding.say(record, &mut text).expect("a String takes any text");
            self.findings.push((finding.code.name, text));
        }
    }
}

impl Heard {
    pub fn crc(&self, verdict: &str) -> usize {
        self.records.iter().filter(|(_, crc)| crc.as_deref() == Some(verdict)).count()
    }

    pub fn of_kind(&self, kind: &str) -> usize {
        self.records.iter().filter(|(known, _)| *known == kind).count()
    }
}

pub fn settings() -> Settings {
    Settings { protocol: Protocol::named("interbus"), ..Settings::default() }
}

pub fn hear(plan: &Plan, recording: &Recording) -> Heard {
    hear_wires(plan, recording, &[0, 1], settings(), 40_000)
}

/// Hears some of the wires, in blocks of so many samples.
pub fn hear_wires(
    plan: &Plan,
    recording: &Recording,
    wires: &[usize],
    settings: Settings,
    block: u64,
) -> Heard {
    let ticks_per_second = (f64::from(plan.bitrate) * plan.samples) as u64;
    let sampling = Sampling { ticks_per_second, uncertainty: 1, origin: Moment::from_ns(0) };
    let facts = WireFacts { sampling: Some(sampling), ..WireFacts::default() };
    let mut bus = Bus::new(BusInfo::new("DO", Some(Clock::Sample)), facts, settings);
    (1..wires.len()).for_each(|wire| bus.add_wire(wire));
    let (mut heard, mut last) = (Heard::default(), 0);
    let mut from = 0;
    while from < recording.until {
        let until = from.saturating_add(block).min(recording.until);
        for (number, wire) in wires.iter().enumerate() {
            let edges = &recording.edges[*wire];
            let range = edges.partition_point(|e| *e < from)..edges.partition_point(|e| *e < until);
            let level = range.start.is_multiple_of(2) != plan.is_inverted;
            let levels = Levels { edges: &edges[range], level, from, until };
            let mut out = Output::new(&mut last, &mut heard);
            bus.hear_wire(number, Event::Levels(levels), &mut out);
        }
        from = until;
    }
    bus.finish(Moment::UNKNOWN, &mut Output::new(&mut last, &mut heard));
    heard.settings = bus.settings();
    heard.conclusions = bus.conclusions();
    heard.protocol = bus.protocol().map(|protocol| protocol.name);
    heard
}
