//! What the fuzz targets do with their bytes. None of it may panic, hang, or grow without bound.

use dissectors::bus::{Bus, Sampling, WireFacts};
use dissectors::can::{Frame, FrameKind, Identifier};
use dissectors::devicenet::{eds, encoder};
use dissectors::event::{Break, Clock, Event, Levels, Loss, LossCause, Moment};
use dissectors::interbus::{Content, Device, Row};
use dissectors::protocol::{Medium, PROTOCOLS, Protocol, Settings};
use dissectors::record::{BusInfo, Output, Record, Sink};
use dissectors::slin::{self, ChecksumChoice, Profile};
use dissectors::uart::{Baud, Character, Format, Parity};
use fieldtap::pipeline::{Consumer, Pipeline};
use fieldtap::source::{self, InputFormat, SourceError, SourceOptions};
use std::io::Cursor;

/// Says everything there is to say of each record, and checks what holds for all of them.
#[derive(Default)]
pub struct Listener {
    text: String,
    last_number: u64,
    events: u64,
}

impl Sink for Listener {
    fn record(&mut self, record: &Record<'_>) {
        assert_eq!(record.n, self.last_number + 1, "numbers are given in order");
        self.last_number = record.n;
        self.text.clear();
        record.summarize(&mut self.text).expect("a String takes any text");
        assert!(!self.text.is_empty());
        for finding in record.findings {
            self.text.clear();
            finding.say(record, &mut self.text).expect("a String takes any text");
            assert!(self.text.len() >= 8);
            let same = record.findings.iter().filter(|other| other.code == finding.code).count();
            assert_eq!(same, 1, "a code stands once in a record");
        }
        assert!(record.protocol.kinds.contains(&record.kind));
        for field in 0..record.protocol.fields.len() {
            let _ = record.get(field);
        }
    }
}

impl Consumer for Listener {
    fn goes_on(&mut self) -> bool {
        self.events += 1;
        self.events < 1 << 20
    }

    fn comment(&mut self, _: &BusInfo, _: Moment, _: &str) {}

    fn end(&mut self, _: &BusInfo, _: Moment) {}

    fn warn(&mut self, _: &SourceError) {}

    fn note(&mut self, _: &str) {}
}

/// Reads bytes as a capture of this format, and decodes it.
pub fn capture(format: InputFormat, bytes: &[u8]) {
    let options = SourceOptions {
        format: Some(format),
        samplerate: Some(4_000_000),
        unitsize: 1,
        ..SourceOptions::default()
    };
    let (mut pipeline, mut listener) = (Pipeline::new(Settings::default()), Listener::default());
    if let Ok(mut source) = source::open_stream(Cursor::new(bytes.to_vec()), &options) {
        // What cannot be read any further was read up to there.
        let _ = pipeline.pass(&mut *source, &mut listener);
    }
    pipeline.finish(&mut listener);
}

/// Settings out of a few bits.
fn settings(choice: u8) -> Settings {
    let protocol = match choice & 3 {
        0 => None,
        other => PROTOCOLS.get(usize::from(other) - 1).copied(),
    };
    let profile = Profile::NAMES[usize::from(choice >> 2 & 3)].1;
    let mut settings = Settings {
        protocol,
        slin: slin::Settings { profile, checksum: ChecksumChoice::OfProfile },
        ..Settings::default()
    };
    if choice & 0x10 != 0 {
        settings.line.baud = Baud::new(115_200);
    }
    if choice & 0x20 != 0 {
        settings.line.format = Some(Format::FT12);
    }
    settings
}

/// Characters, breaks, losses and silences: four bytes each, a byte, what happened, and how much
/// later.
pub fn characters(bytes: &[u8]) {
    let [choice, events @ ..] = bytes else { return };
    let info = BusInfo::new("bus", Some(Clock::Log));
    let mut bus = Bus::new(info, WireFacts::default(), settings(*choice));
    let (mut listener, mut number, mut now) = (Listener::default(), 0, 0_i64);
    for event in events.chunks_exact(4) {
        // From backwards to seconds, finer near a character's duration.
        let step = i64::from(i16::from_le_bytes([event[2], event[3]]));
        now = now.saturating_add(if event[1] & 0x80 == 0 { step * 10_000 } else { step * 100 });
        let start = if event[1] & 0x40 == 0 { Moment::from_ns(now) } else { Moment::UNKNOWN };
        let parity = match event[1] & 7 {
            0..=2 => Parity::Ok,
            3 => Parity::Error,
            4 => Parity::Suspect,
            5 => Parity::Unknown,
            _ => Parity::None,
        };
        let character =
            Character::new(start, u32::from(event[1] >> 3) * 50, event[0].into(), parity);
        let one = [if event[1] & 0x20 == 0 { character } else { character.with_framing_error() }];
        let mut out = Output::new(&mut number, &mut listener);
        bus.hear(
            match event[1] {
                0xFF => Event::Break(Break { start, uncertainty: 1, duration: Some(1_000_000) }),
                0xFE => Event::Lost(Loss { start, count: None, cause: LossCause::Capture }),
                0xFD => Event::Advance(start),
                _ => Event::Characters(&one),
            },
            &mut out,
        );
    }
    bus.finish(Moment::from_ns(now), &mut Output::new(&mut number, &mut listener));
}

/// CAN frames of DeviceNet: identifier, length and flags, milliseconds to the next, and the data.
pub fn frames(bytes: &[u8]) {
    let info = BusInfo::new("bus", Some(Clock::Log));
    let settings = Settings {
        protocol: Protocol::named("devicenet"),
        devices: [(23, dissectors::device::Profile::DeviceNet(encoder::Profile::BaumerEncoder))]
            .into(),
        ..Settings::default()
    };
    let baud = Baud::new(125_000);
    let facts = WireFacts { baud, medium: Some(Medium::Can), ..WireFacts::default() };
    let mut bus = Bus::new(info, facts, settings);
    let (mut listener, mut number, mut now) = (Listener::default(), 0, 0_i64);
    let mut rest = bytes;
    while let [low, high, length, step, behind @ ..] = rest {
        let (data, behind) = behind.split_at(behind.len().min(usize::from(length & 0xF)));
        rest = behind;
        now = now.saturating_add(i64::from(step.cast_signed()) * 1_000_000);
        let (start, id) = (Moment::from_ns(now), u16::from_le_bytes([*low, *high]) & 0x7FF);
        let mut out = Output::new(&mut number, &mut listener);
        if length & 0xC0 == 0xC0 {
            bus.hear(Event::Lost(Loss { start, count: None, cause: LossCause::Capture }), &mut out);
            continue;
        }
        let kind = match length >> 4 & 0x3 {
            0..=1 => FrameKind::Data,
            2 => FrameKind::Remote,
            _ => FrameKind::Error,
        };
        let id = Identifier::Standard(id);
        let frame = Frame::new(start, 1_000, kind, id, data.len() as u8).with(data);
        bus.hear(Event::Frames(&[frame]), &mut out);
    }
    bus.finish(Moment::from_ns(now), &mut Output::new(&mut number, &mut listener));
}

/// A maker's description of a device, and everything that can be asked of it.
pub fn eds(bytes: &[u8]) {
    let (eds, warnings) = eds::parse(bytes);
    assert!(warnings.iter().all(|warning| !warning.to_string().is_empty()));
    for class in 0..=255 {
        for attribute in 0..=32 {
            let _ = eds.parameter(class, 1, attribute);
        }
        if let Some(assembly) = eds.assembly(class) {
            assert!(eds.cells(assembly).all(|cell| cell.bits <= u32::MAX as _));
        }
    }
}

/// Line levels: two bytes a pulse, its length in ticks.
pub fn levels(bytes: &[u8]) {
    let [choice, rate, pulses @ ..] = bytes else { return };
    let sampling = Sampling {
        ticks_per_second: 1 << (rate % 40),
        uncertainty: 250,
        origin: Moment::from_ns(0),
    };
    let facts = WireFacts { sampling: Some(sampling), ..WireFacts::default() };
    let info = BusInfo::new("bus", Some(Clock::Sample));
    let mut bus = Bus::new(info, facts, settings(*choice));
    let (mut listener, mut number, mut from, mut level) = (Listener::default(), 0, 0, true);
    for block in pulses.chunks(64) {
        let mut tick = from;
        let edges: Vec<u64> = block
            .chunks_exact(2)
            .map(|pulse| {
                tick += 1 + u64::from(u16::from_le_bytes([pulse[0], pulse[1]]));
                tick
            })
            .collect();
        let until = tick + 1;
        let levels = Levels { edges: &edges, level, from, until };
        bus.hear(Event::Levels(levels), &mut Output::new(&mut number, &mut listener));
        level ^= edges.len() % 2 == 1;
        from = until;
    }
    bus.finish(Moment::UNKNOWN, &mut Output::new(&mut number, &mut listener));
}

/// Settings for a ring whose first device is a linear encoder.
fn ring_settings() -> Settings {
    let profile = dissectors::device::Profile::parse("la66:500mm");
    Settings {
        protocol: Protocol::named("interbus"),
        devices: profile.into_iter().map(|profile| (1, profile)).collect(),
        ..Settings::default()
    }
}

/// Rows of a ring's log: what it holds, ms to the next, and for OUT and IN bits 31 to 24 and the
/// low byte.
pub fn rows(bytes: &[u8]) {
    let [choice, rows @ ..] = bytes else { return };
    let info = BusInfo::new("ring", Some(Clock::Log));
    let facts = WireFacts { medium: Some(Medium::Words), ..WireFacts::default() };
    let mut settings = ring_settings();
    settings.interbus.every_cycle = choice & 1 != 0;
    let mut bus = Bus::new(info, facts, settings);
    let (mut listener, mut number, mut now) = (Listener::default(), 0, 0_i64);
    for row in rows.chunks_exact(6) {
        now = now.saturating_add(i64::from(row[1].cast_signed()) * 1_000_000);
        let start = if row[0] & 0x80 == 0 { Moment::from_ns(now) } else { Moment::UNKNOWN };
        let word = |code: u8, data: u8| (u32::from(code) << 24) | (u32::from(data) * 257);
        let (out, input) = (word(row[2], row[3]), word(row[4], row[5]));
        let content = match row[0] & 7 {
            0..=3 => Content::Process { out: Some(out), input: Some(input) },
            4 => Content::Process { out: Some(out), input: None },
            5 => Content::Process { out: None, input: Some(input) },
            6 => Content::Diagnostic { status: (out >> 16) as u16, parameter: None },
            _ => Content::SlaveDiagnostic(row[2]),
        };
        let device = Device::new(u16::from(row[0] >> 3 & 3));
        let row = Row::new(device, content).at(start, u32::from(row[0] >> 5 & 3) * 500_000);
        bus.hear(Event::Rows(&[row]), &mut Output::new(&mut number, &mut listener));
    }
    bus.finish(Moment::from_ns(now), &mut Output::new(&mut number, &mut listener));
}

/// Ticks of a bit at 500 kbit/s.
const BIT: u64 = 8;

/// One wire, as it is written.
struct Tape {
    edges: Vec<u64>,
    now: u64,
    level: bool,
}

impl Tape {
    fn bit(&mut self, level: bool) {
        if level != self.level {
            self.edges.push(self.now);
            self.level = level;
        }
        self.now += BIT;
    }

    /// A telegram with these flags, in bits 2 to 4; bit 5 of them: it has data, 6: no stop bit.
    fn telegram(&mut self, flags: u8, data: u8) {
        self.bit(false);
        (2..5).for_each(|bit| self.bit(flags >> bit & 1 == 1));
        if flags & 0x20 != 0 {
            (0..8).rev().for_each(|bit| self.bit(data >> bit & 1 == 1));
        }
        self.bit(flags & 0x40 == 0);
    }
}

/// The two wires of a ring: two bytes a telegram, what it is and what it holds. Bits 0 and 1 say on
/// which wires it is; where on none, the line stands still.
pub fn ring_lines(bytes: &[u8]) {
    let blank = || Tape { edges: Vec::new(), now: 20 * BIT, level: true };
    let mut tapes = [blank(), blank()];
    for telegram in bytes.chunks_exact(2) {
        let [what, data] = [telegram[0], telegram[1]];
        for (wire, tape) in tapes.iter_mut().enumerate() {
            if what & 3 == 0 {
                // Up to 25 ms and more, or a part of a bit.
                let bits = u64::from(data) * if what & 4 == 0 { 60 * BIT } else { 1 };
                tape.now += bits;
            } else if what >> wire & 1 == 1 {
                tape.telegram(what, data);
            }
        }
    }
    let sampling =
        Sampling { ticks_per_second: 500_000 * BIT, uncertainty: 250, origin: Moment::from_ns(0) };
    let facts = WireFacts { sampling: Some(sampling), ..WireFacts::default() };
    let mut bus = Bus::new(BusInfo::new("DO", Some(Clock::Sample)), facts, ring_settings());
    bus.add_wire(1);
    let (mut listener, mut number, mut from) = (Listener::default(), 0, 0);
    let end = tapes.iter().map(|tape| tape.now).max().unwrap_or(0) + 20 * BIT;
    while from < end {
        let until = (from + 100_000).min(end);
        for (wire, tape) in tapes.iter().enumerate() {
            let place = |tick| tape.edges.partition_point(|edge| *edge < tick);
            let (first, behind) = (place(from), place(until));
            let level = first % 2 == 0;
            let levels = Levels { edges: &tape.edges[first..behind], level, from, until };
            bus.hear_wire(
                wire,
                Event::Levels(levels),
                &mut Output::new(&mut number, &mut listener),
            );
        }
        from = until;
    }
    bus.finish(Moment::UNKNOWN, &mut Output::new(&mut number, &mut listener));
}
