//! How fast characters become telegrams, and line levels characters.

use crate::{Counter, SAMPLING, bus, hear_levels};
use criterion::{Criterion, Throughput};
use dissectors::bus::WireFacts;
use dissectors::event::{Event, Moment};
use dissectors::record::Output;
use dissectors::uart::{Character, Parity};
use std::hint::black_box;

/// Exchanges of the busy bus that is decoded: three encoders in turn, their positions moving.
const EXCHANGES: u32 = 200_000;

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

pub fn characters_to_telegrams(criterion: &mut Criterion) {
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

pub fn levels_to_telegrams(criterion: &mut Criterion) {
    let characters = characters();
    let edges = edges(&characters);
    let facts = WireFacts { sampling: Some(SAMPLING), ..WireFacts::default() };
    let mut group = criterion.benchmark_group("line levels to telegrams");
    group.throughput(Throughput::Elements(characters.len() as u64));
    group.bench_function("auto", |bencher| {
        bencher.iter(|| {
            let (mut bus, mut counter, mut number) = (bus(facts), Counter(0), 0);
            hear_levels(&mut bus, black_box(&edges), &mut Output::new(&mut number, &mut counter));
            assert!(counter.0 > u64::from(EXCHANGES));
        });
    });
    group.finish();
}
