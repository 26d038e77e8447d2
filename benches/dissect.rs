//! How fast characters become telegrams, line levels characters, and rows of words records.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use dissectors::bus::{Bus, Sampling, WireFacts};
use dissectors::event::{Clock, Event, Levels, Moment};
use dissectors::interbus::{Content, Device, Row};
use dissectors::protocol::{Medium, Settings};
use dissectors::record::{BusInfo, Output, Record, Sink};
use dissectors::uart::{Character, Parity};
use std::hint::black_box;

/// Exchanges of the busy bus that is decoded: three encoders in turn, their positions moving.
const EXCHANGES: u32 = 200_000;

/// Counts records and looks at nothing else.
#[derive(Default)]
struct Counter(u64);

impl Sink for Counter {
    fn record(&mut self, record: &Record<'_>) {
        self.0 += 1 + record.findings.len() as u64;
    }
}

/// The bytes of one exchange with a Baumer encoder (Baumer SLIN §3).
fn exchange(address: u8, position: u32) -> Vec<u8> {
    let mut bytes = vec![0x80 | address];
    let mut left = position;
    while left > 0 {
        bytes.push((left & 0x7F) as u8);
        left >>= 7;
    }
    let sum = bytes[1..].iter().fold(0_u8, |sum, word| sum.wrapping_add(*word));
    bytes.push(0x88 | sum & 0x70 | address);
    bytes
}

/// A full bus at 115200 Bd: characters of 95.486 µs, answers after 200 µs, pauses of 100 µs.
fn characters() -> Vec<Character> {
    let mut characters = Vec::new();
    let mut ns = 0.0;
    for n in 0..EXCHANGES {
        let bytes = exchange((n % 3) as u8, 1_000_000 + 37 * n);
        for (index, byte) in bytes.iter().enumerate() {
            let start = Moment::from_ns(ns as i64);
            characters.push(Character::new(start, 250, u16::from(*byte), Parity::Ok));
            ns += 11e9 / 115_200.0 + if index == 0 { 200_000.0 } else { 0.0 };
        }
        ns += 100_000.0;
    }
    characters
}

fn bus(facts: WireFacts) -> Bus {
    let info = BusInfo::new("bus", Some(Clock::Sample));
    Bus::new(info, facts, Settings::default())
}

fn characters_to_telegrams(criterion: &mut Criterion) {
    let characters = characters();
    let mut group = criterion.benchmark_group("characters to telegrams");
    group.throughput(Throughput::Elements(characters.len() as u64));
    group.bench_function("auto", |bencher| {
        bencher.iter(|| {
            let (mut bus, mut counter, mut number) = (bus(WireFacts::default()), Counter(0), 0);
            for batch in characters.chunks(1024) {
                let mut out = Output::new(&mut number, &mut counter);
                bus.hear(Event::Characters(black_box(batch)), &mut out);
            }
            bus.finish(Moment::UNKNOWN, &mut Output::new(&mut number, &mut counter));
            assert_eq!(counter.0, 2 * u64::from(EXCHANGES));
        });
    });
    group.finish();
}

/// Level changes of the same bus, in samples of 4 MHz.
fn edges(characters: &[Character]) -> Vec<u64> {
    let mut edges = Vec::new();
    for character in characters {
        let start = character.start.ns().unwrap_or_default() as f64;
        let byte = character.byte();
        let parity = u16::from(byte.count_ones() % 2 == 1);
        let bits = u16::from(byte) << 1 | parity << 9 | 1 << 10;
        let mut level = true;
        for bit in 0..11 {
            let now = bits >> bit & 1 == 1;
            if now != level {
                level = now;
                edges.push(((start + f64::from(bit) * 1e9 / 115_200.0) * 4e-3) as u64 + 4_000);
            }
        }
    }
    edges
}

fn levels_to_telegrams(criterion: &mut Criterion) {
    let characters = characters();
    let edges = edges(&characters);
    let sampling =
        Sampling { ticks_per_second: 4_000_000, uncertainty: 250, origin: Moment::from_ns(0) };
    let facts = WireFacts { sampling: Some(sampling), ..WireFacts::default() };
    let mut group = criterion.benchmark_group("line levels to telegrams");
    group.throughput(Throughput::Elements(characters.len() as u64));
    group.bench_function("auto", |bencher| {
        bencher.iter(|| {
            let (mut bus, mut counter, mut number) = (bus(facts), Counter(0), 0);
            let (mut from, mut level) = (0, true);
            for batch in edges.chunks(1024) {
                let until = batch.last().map_or(from, |last| last + 1);
                let levels = Levels { edges: black_box(batch), level, from, until };
                bus.hear(Event::Levels(levels), &mut Output::new(&mut number, &mut counter));
                level ^= batch.len() % 2 == 1;
                from = until;
            }
            bus.finish(Moment::UNKNOWN, &mut Output::new(&mut number, &mut counter));
            assert!(counter.0 > u64::from(EXCHANGES));
        });
    });
    group.finish();
}

/// Rows of the log of a ring.
const ROWS: i64 = 1_000_000;

/// A moving LA-66 at every bus cycle of 1 ms, with a read service in 8 of 100 rows.
fn rows() -> Vec<Row> {
    let row = |n: i64| {
        let position = 100_000 + (n % 50_000) as u32;
        let (out, input) = match n % 100 {
            1 => (0x0100_0000, position),
            2..=4 => (0x8100_0000, position),
            5..=6 => (0x8100_0000, 0x8100_0001),
            7..=8 => (0, 0x8100_0001),
            _ => (0, position),
        };
        let content = Content::Process { out: Some(out), input: Some(input) };
        Row::new(Some(Device::FIRST), content).at(Moment::from_ns(n * 1_000_000), 1_000)
    };
    (0..ROWS).map(row).collect()
}

fn rows_to_records(criterion: &mut Criterion) {
    let rows = rows();
    let facts = WireFacts { medium: Some(Medium::Words), ..WireFacts::default() };
    let mut group = criterion.benchmark_group("rows of words to records");
    group.throughput(Throughput::Elements(rows.len() as u64));
    group.bench_function("one device", |bencher| {
        bencher.iter(|| {
            let (mut bus, mut counter, mut number) = (bus(facts), Counter(0), 0);
            for batch in rows.chunks(1024) {
                bus.hear(
                    Event::Rows(black_box(batch)),
                    &mut Output::new(&mut number, &mut counter),
                );
            }
            // Nothing is found.
            assert_eq!(counter.0, rows.len() as u64);
        });
    });
    group.finish();
}

criterion_group!(benches, characters_to_telegrams, levels_to_telegrams, rows_to_records);
criterion_main!(benches);
