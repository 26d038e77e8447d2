//! Rows in, what was told of them out.

use fieldtap_dissectors::bus::{Bus, WireFacts};
use fieldtap_dissectors::device::Profile;
use fieldtap_dissectors::event::{Clock, Event, Moment};
use fieldtap_dissectors::field::Value;
use fieldtap_dissectors::finding::{Severity, State};
use fieldtap_dissectors::interbus::{Content, Device, Row};
use fieldtap_dissectors::protocol::{Conclusion, Medium, Settings};
use fieldtap_dissectors::record::{BusInfo, Output, Record, Sink, Turn};

/// What is compared of a record.
#[derive(Clone, PartialEq, Debug)]
pub struct Told {
    pub n: u64,
    pub kind: &'static str,
    pub station: Option<u16>,
    pub turn: Turn,
    pub about: Option<u64>,
    pub position: Option<i64>,
    pub service: Option<i64>,
    pub data: Option<i64>,
    pub request: Option<i64>,
    pub response_time: Option<i64>,
    pub codes: Vec<&'static str>,
    pub withheld: Vec<&'static str>,
    pub ongoing: usize,
    pub state: Option<State>,
    pub summary: String,
    pub messages: Vec<String>,
    /// Codes that are more than notes.
    pub bad: Vec<&'static str>,
}

#[derive(Default)]
struct Recorder(Vec<Told>);

impl Sink for Recorder {
    fn record(&mut self, record: &Record<'_>) {
        let number = |name| match record.named(name) {
            Value::Int(value) => Some(value),
            _ => None,
        };
        let mut summary = String::new();
        record.summarize(&mut summary).expect("a String takes any text");
        let messages = record.findings.iter().map(|finding| {
            let mut text = String::new();
            finding.say(record, &mut text).expect("a String takes any text");
            text
        });
        let bad = record.findings.iter().filter(|finding| finding.severity() > Severity::Info);
        self.0.push(Told {
            n: record.n,
            kind: record.kind,
            station: record.station,
            turn: record.turn,
            about: record.about,
            position: number("interbus.position"),
            service: number("interbus.service"),
            data: number("interbus.data"),
            request: number("interbus.request"),
            response_time: number("interbus.response_time_ns"),
            codes: record.findings.iter().map(|finding| finding.code.name).collect(),
            withheld: record.withheld.iter().map(|code| code.name).collect(),
            ongoing: record.ongoing.len(),
            state: record.findings.iter().find_map(|finding| finding.state),
            summary,
            messages: messages.collect(),
            bad: bad.map(|finding| finding.code.name).collect(),
        });
    }
}

/// A row: time in µs, OUT, IN.
pub type Words = (i64, u32, u32);

/// Settings for a log with a row for every bus cycle.
pub fn every_cycle() -> Settings {
    let mut settings = Settings::default();
    settings.interbus.every_cycle = true;
    settings
}

/// Settings with device 1 as this.
pub fn device(profile: &str) -> Settings {
    let mut settings = Settings::default();
    settings.devices.insert(1, Profile::parse(profile).expect("a profile"));
    settings
}

/// What is told of rows of device 1, and what was concluded.
pub fn hear(rows: &[Words], settings: Settings) -> (Vec<Told>, Vec<Conclusion>) {
    let rows = rows.iter().map(|(us, out, input)| {
        let content = Content::Process { out: Some(*out), input: Some(*input) };
        Row::new(Some(Device::FIRST), content).at(Moment::from_ns(us * 1_000), 0)
    });
    hear_rows(&rows.collect::<Vec<_>>(), settings)
}

/// What is told of rows.
pub fn hear_rows(rows: &[Row], settings: Settings) -> (Vec<Told>, Vec<Conclusion>) {
    let facts = WireFacts { medium: Some(Medium::Words), ..WireFacts::default() };
    let mut bus = Bus::new(BusInfo::new("ring", Some(Clock::Log)), facts, settings);
    let (mut recorder, mut number) = (Recorder::default(), 0);
    for batch in rows.chunks(7) {
        bus.hear(Event::Rows(batch), &mut Output::new(&mut number, &mut recorder));
    }
    let end = rows.last().map_or(Moment::UNKNOWN, |row| row.start);
    bus.finish(end, &mut Output::new(&mut number, &mut recorder));
    (recorder.0, bus.conclusions())
}

/// Records of rows that are a ms apart.
pub fn told(rows: &[(u32, u32)], settings: Settings) -> Vec<Told> {
    let rows: Vec<Words> =
        (0..).zip(rows).map(|(n, (out, input))| (n * 1_000, *out, *input)).collect();
    hear(&rows, settings).0
}

/// All codes that were told, with the record.
pub fn codes(told: &[Told]) -> Vec<(u64, &'static str)> {
    told.iter().flat_map(|it| it.codes.iter().map(|code| (it.n, *code))).collect()
}
