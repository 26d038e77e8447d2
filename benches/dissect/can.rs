//! How fast CAN frames become DeviceNet records and rows, and line levels CAN frames.

use crate::{Counter, SAMPLING, bus, hear_levels};
use criterion::{Criterion, Throughput};
use dissectors::bus::WireFacts;
use dissectors::can::{Frame, Identifier};
use dissectors::event::{Event, Moment};
use dissectors::protocol::Medium;
use dissectors::record::{Output, Sink};
use dissectors::uart::Baud;
use fieldtap::export::{Columns, Csv};
use std::hint::black_box;

/// Frames of the bus that is decoded.
const FRAMES: usize = 200_000;

/// Slaves that are polled in turn.
const SLAVES: usize = 10;

/// From one frame to the next in ns: at 250 kbit/s 125 bits. A frame of four bytes takes 79, and at
/// most 16 stuff bits.
const DISTANCE: usize = 500_000;

/// Samples a bit.
const BIT: u64 = 16;

/// The frame of that number: of each slave the poll, which is Group 2 message 5, and its answer,
/// which is Group 1 message 15 (DeviceNet specification, volume I, table 7-2.1).
fn frame(n: usize) -> Frame {
    let (slave, start) = ((n / 2 % SLAVES) as u16, Moment::from_ns((n * DISTANCE) as i64));
    if n.is_multiple_of(2) {
        Frame::data(start, 250, Identifier::Standard(0x400 | slave << 3 | 5), &[])
    } else {
        let position = 1_000_000 + 37 * n as u32;
        Frame::data(start, 250, Identifier::Standard(0x3C0 | slave), &position.to_le_bytes())
    }
}

/// Hands the frames to a bus in batches, as a source would.
fn hear(frames: &[Frame], sink: &mut dyn Sink) {
    let mut number = 0;
    let (baud, medium) = (Baud::new(250_000), Some(Medium::Can));
    let mut bus = bus(WireFacts { baud, medium, ..WireFacts::default() });
    let mut out = Output::new(&mut number, sink);
    for batch in frames.chunks(256) {
        bus.hear(Event::Frames(black_box(batch)), &mut out);
    }
    bus.finish(Moment::UNKNOWN, &mut out);
}

pub fn frames_to_records(criterion: &mut Criterion) {
    let frames: Vec<Frame> = (0..FRAMES).map(frame).collect();
    let mut group = criterion.benchmark_group("CAN frames to DeviceNet records");
    group.throughput(Throughput::Elements(FRAMES as u64));
    group.bench_function("auto", |bencher| {
        bencher.iter(|| {
            let mut counter = Counter(0);
            hear(&frames, &mut counter);
            assert_eq!(counter.0, FRAMES as u64);
        });
    });
    group.finish();
}

pub fn frames_to_csv(criterion: &mut Criterion) {
    let frames: Vec<Frame> = (0..FRAMES).map(frame).collect();
    let mut group = criterion.benchmark_group("CAN frames to rows of CSV");
    group.throughput(Throughput::Elements(FRAMES as u64));
    group.bench_function("auto", |bencher| {
        bencher.iter(|| hear(&frames, &mut Csv::new(std::io::sink(), Columns::default())));
    });
    group.finish();
}

/// The levels of a data frame with an 11-bit identifier, bit by bit; `true` is recessive (CAN 2.0,
/// part A §3.1.1).
fn levels(frame: &Frame) -> Vec<bool> {
    // Start of frame, identifier, RTR, IDE and r0 dominant, length; then data.
    let head = u128::from(frame.id.value()) << 7 | u128::from(frame.dlc);
    let body = frame.bytes().iter().fold(head, |bits, byte| bits << 8 | u128::from(*byte));
    let length = 19 + 8 * frame.bytes().len();
    let bit = |number: usize| body >> (length - 1 - number) & 1 == 1;
    let sum = (0..length).fold(0_u16, |sum, number| {
        let shifted = sum << 1 & 0x7FFF;
        if (sum >> 14 & 1 == 1) == bit(number) { shifted } else { shifted ^ 0x4599 }
    });
    let mut levels = Vec::new();
    for bit in (0..length).map(bit).chain((0..15).rev().map(|place| sum >> place & 1 == 1)) {
        levels.push(bit);
        if levels.len() >= 5 && levels[levels.len() - 5..].iter().all(|other| *other == bit) {
            levels.push(!bit);
        }
    }
    // Delimiter, acknowledge and its delimiter, end of frame.
    levels.extend([true, false, true]);
    levels.extend([true; 7]);
    levels
}

/// Level changes of the bus in samples of 4 MHz.
fn edges(frames: &[Frame]) -> Vec<u64> {
    let mut edges = Vec::new();
    let mut before = true;
    for frame in frames {
        let start = frame.start.ns().unwrap_or_default() as u64 / 250 + 4_000;
        for (level, tick) in levels(frame).into_iter().zip((start..).step_by(BIT as usize)) {
            if level != before {
                before = level;
                edges.push(tick);
            }
        }
    }
    edges
}

pub fn levels_to_frames(criterion: &mut Criterion) {
    let frames: Vec<Frame> = (0..FRAMES).map(frame).collect();
    let edges = edges(&frames);
    let facts = WireFacts { sampling: Some(SAMPLING), ..WireFacts::default() };
    let mut group = criterion.benchmark_group("CAN line levels to DeviceNet records");
    group.throughput(Throughput::Elements(FRAMES as u64));
    group.bench_function("auto", |bencher| {
        bencher.iter(|| {
            let (mut bus, mut counter, mut number) = (bus(facts), Counter(0), 0);
            hear_levels(&mut bus, black_box(&edges), &mut Output::new(&mut number, &mut counter));
            // Each frame is whole, and no checksum is wrong.
            assert_eq!(counter.0, FRAMES as u64);
        });
    });
    group.finish();
}
