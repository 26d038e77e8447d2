//! How fast what is heard becomes records.

mod can;
mod serial;
mod words;

use criterion::{criterion_group, criterion_main};
use dissectors::bus::{Bus, Sampling, WireFacts};
use dissectors::event::{Clock, Event, Levels, Moment};
use dissectors::protocol::Settings;
use dissectors::record::{BusInfo, Output, Record, Sink};

/// Samples of 4 MHz.
const SAMPLING: Sampling =
    Sampling { ticks_per_second: 4_000_000, uncertainty: 250, origin: Moment::from_ns(0) };

/// Counts records and looks at nothing else.
#[derive(Default)]
struct Counter(u64);

impl Sink for Counter {
    fn record(&mut self, record: &Record<'_>) {
        self.0 += 1 + record.findings.len() as u64;
    }
}

fn bus(facts: WireFacts) -> Bus {
    let info = BusInfo::new("bus", Some(Clock::Sample));
    Bus::new(info, facts, Settings::default())
}

/// Passes all level changes of a line on, as a source would: in batches.
fn hear_levels(bus: &mut Bus, edges: &[u64], out: &mut Output<'_>) {
    let (mut from, mut level) = (0, true);
    for batch in edges.chunks(1024) {
        let until = batch.last().map_or(from, |last| last + 1);
        bus.hear(Event::Levels(Levels { edges: batch, level, from, until }), out);
        level ^= batch.len() % 2 == 1;
        from = until;
    }
    bus.finish(Moment::UNKNOWN, out);
}

criterion_group!(
    benches,
    serial::characters_to_telegrams,
    serial::levels_to_telegrams,
    can::frames_to_records,
    can::frames_to_csv,
    can::levels_to_frames,
    words::rows_to_records,
);
criterion_main!(benches);
