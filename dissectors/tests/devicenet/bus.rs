//! A bus to decode frames on, and what was told of it.

use fieldtap_dissectors::bus::{Bus, WireFacts};
use fieldtap_dissectors::can::{Frame, FrameKind, Identifier};
use fieldtap_dissectors::devicenet::PROTOCOL;
use fieldtap_dissectors::event::{Clock, Event, Loss, LossCause, Moment};
use fieldtap_dissectors::field::Value;
use fieldtap_dissectors::finding::State;
use fieldtap_dissectors::protocol::Settings;
use fieldtap_dissectors::record::{BusInfo, Output, Record, Sink};
use fieldtap_dissectors::uart::Baud;
use std::collections::BTreeMap;

/// What was told of one record.
#[derive(Clone, PartialEq, Debug)]
pub struct Told {
    pub n: u64,
    pub ns: Option<i64>,
    pub kind: &'static str,
    pub station: Option<u16>,
    pub about: Option<u64>,
    pub summary: String,
    /// Codes, with `+` where a state begins and `-` where it ends.
    pub codes: Vec<String>,
    pub withheld: Vec<&'static str>,
    /// The protocol's fields that apply, without `devicenet.`.
    pub fields: BTreeMap<&'static str, String>,
}

impl Told {
    /// A field, or nothing.
    pub fn get(&self, name: &str) -> &str {
        self.fields.get(name).map_or("", String::as_str)
    }

    /// A field as a number.
    pub fn number(&self, name: &str) -> Option<i64> {
        self.get(name).parse().ok()
    }
}

#[derive(Default)]
struct Recorder(Vec<Told>);

impl Sink for Recorder {
    fn record(&mut self, record: &Record<'_>) {
        let mut summary = String::new();
        record.summarize(&mut summary).unwrap();
        let fields = (0..).zip(PROTOCOL.fields).filter_map(|(id, field)| {
            let name = field.name.strip_prefix("devicenet.").unwrap_or(field.name);
            Some((name, shown(record.get(id))?))
        });
        let codes = record.findings.iter().map(|finding| {
            let mut message = String::new();
            finding.say(record, &mut message).unwrap();
            assert!(message.len() >= 8, "{message}");
            let state = match finding.state {
                Some(State::Begin) => "+",
                Some(State::End(_)) => "-",
                None => "",
            };
            let name = finding.code.name;
            format!("{}{state}", name.strip_prefix("devicenet.").unwrap_or(name))
        });
        self.0.push(Told {
            n: record.n,
            ns: record.start.ns(),
            kind: record.kind,
            station: record.station,
            about: record.about,
            summary,
            codes: codes.collect(),
            withheld: record.withheld.iter().map(|code| code.name).collect(),
            fields: fields.collect(),
        });
    }
}

fn shown(value: Value<'_>) -> Option<String> {
    Some(match value {
        Value::Absent => return None,
        Value::Bool(value) => value.to_string(),
        Value::Int(value) => value.to_string(),
        Value::Text(text) => text.to_owned(),
        Value::Hex(bytes) => bytes.iter().map(|byte| format!("{byte:02X}")).collect(),
        Value::List(list) => {
            let items: Vec<String> = (0..list.len()).filter_map(|it| shown(list.get(it))).collect();
            items.join(" ")
        }
        Value::Float(value) => value.to_string(),
        Value::Byte(_) | Value::Rows(_) => unreachable!(),
    })
}

/// One thing that is heard.
#[derive(Clone, Debug)]
pub enum Heard {
    Frame(Frame),
    /// Frames that come at once.
    Batch(Vec<Frame>),
    Lost(i64),
    Advance(i64),
}

/// A frame at so many ns, such as `42C#010E010101`.
pub fn frame_ns(ns: i64, text: &str) -> Frame {
    let (id, data) = text.split_once('#').unwrap();
    let id = Identifier::standard(u32::from_str_radix(id, 16).unwrap()).unwrap();
    let data: Vec<u8> = (0..data.len() / 2)
        .map(|index| u8::from_str_radix(&data[2 * index..2 * index + 2], 16).unwrap())
        .collect();
    Frame::data(Moment::from_ns(ns), 1_000, id, &data)
}

/// Frames at so many ms each; `lost` is a gap, and `overrun` the error frame of a controller that was
/// overrun (`linux/can/error.h`).
pub fn script(lines: &[(f64, &str)]) -> Vec<Heard> {
    let hear = |(ms, text): &(f64, &str)| {
        let ns = (ms * 1e6) as i64;
        match *text {
            "lost" => Heard::Lost(ns),
            "overrun" => {
                let (at, classes) = (Moment::from_ns(ns), Identifier::Extended(0x04));
                let frame = Frame::new(at, 1_000, FrameKind::Error, classes, 8);
                Heard::Frame(frame.with(&[0, 0x01, 0, 0, 0, 0, 0, 0]))
            }
            text => Heard::Frame(frame_ns(ns, text)),
        }
    };
    lines.iter().map(hear).collect()
}

/// Decodes what is heard, at 125 kbit/s, with the capture's end.
pub fn decode(heard: &[Heard], end: Option<i64>) -> Vec<Told> {
    let settings = Settings { protocol: Some(&PROTOCOL), ..Settings::default() };
    let mut recorder = Recorder::default();
    hear(heard, end, settings, &mut recorder);
    recorder.0
}

/// The protocol that is found, where none is given.
pub fn protocol_of(heard: &[Heard]) -> &'static str {
    struct Nobody;
    impl Sink for Nobody {
        fn record(&mut self, _: &Record<'_>) {}
    }
    let bus = hear(heard, None, Settings::default(), &mut Nobody);
    bus.protocol().map_or("", |protocol| protocol.name)
}

fn hear(heard: &[Heard], end: Option<i64>, settings: Settings, sink: &mut dyn Sink) -> Bus {
    let mut number = 0;
    let info = BusInfo::new("can0", Some(Clock::Kernel));
    let facts = WireFacts { baud: Baud::new(125_000), ..WireFacts::default() };
    let mut bus = Bus::new(info, facts, settings);
    let mut out = Output::new(&mut number, sink);
    for heard in heard {
        match heard {
            Heard::Frame(frame) => bus.hear(Event::Frames(&[*frame]), &mut out),
            Heard::Batch(frames) => bus.hear(Event::Frames(frames), &mut out),
            Heard::Lost(ns) => {
                let start = Moment::from_ns(*ns);
                let loss = Loss { start, count: None, cause: LossCause::Capture };
                bus.hear(Event::Lost(loss), &mut out);
            }
            Heard::Advance(ns) => bus.hear(Event::Advance(Moment::from_ns(*ns)), &mut out),
        }
    }
    bus.finish(end.map_or(Moment::UNKNOWN, Moment::from_ns), &mut out);
    bus
}

/// Decodes a script, with the capture's end in ms.
pub fn read(lines: &[(f64, &str)], end_ms: f64) -> Vec<Told> {
    decode(&script(lines), Some((end_ms * 1e6) as i64))
}

/// `n kind codes` of the records that have any finding, for tests to compare.
pub fn findings(told: &[Told]) -> Vec<String> {
    let with = told.iter().filter(|told| !told.codes.is_empty());
    with.map(|told| format!("{} {} {}", told.n, told.kind, told.codes.join(" "))).collect()
}
