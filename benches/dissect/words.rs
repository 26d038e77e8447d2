//! How fast rows of words become records.

use crate::{Counter, bus};
use criterion::{Criterion, Throughput};
use dissectors::bus::WireFacts;
use dissectors::event::{Event, Moment};
use dissectors::interbus::{Content, Device, Row};
use dissectors::protocol::Medium;
use dissectors::record::Output;
use std::hint::black_box;

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

/// Rows of a log, as a controller wrote them.
pub fn rows_to_records(criterion: &mut Criterion) {
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
