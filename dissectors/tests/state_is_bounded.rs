//! Whatever is on a bus, what is kept of it is bounded: hostile frames use no more memory the
//! longer they come.

use fieldtap_dissectors::bus::{Bus, WireFacts};
use fieldtap_dissectors::can::{Frame, FrameKind, Identifier};
use fieldtap_dissectors::devicenet::PROTOCOL;
use fieldtap_dissectors::event::{Clock, Event, Moment};
use fieldtap_dissectors::protocol::Settings;
use fieldtap_dissectors::record::{BusInfo, Output, Record, Sink};
use fieldtap_dissectors::uart::Baud;
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// Counts the bytes that are held.
struct Counting;

static HELD: AtomicUsize = AtomicUsize::new(0);

// SAFETY: the system's allocator does everything; counting touches no memory of its blocks.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        HELD.fetch_add(layout.size(), Relaxed);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size(), Relaxed);
        unsafe { System.dealloc(block, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

struct Nobody;

impl Sink for Nobody {
    fn record(&mut self, record: &Record<'_>) {
        assert!(record.findings.len() < 16);
    }
}

/// A stream of numbers that look random (Knuth's MMIX generator).
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % limit
    }
}

/// A frame of anybody: half of them open connections, begin messages or go on with them.
fn any_frame(numbers: &mut Numbers, ns: i64) -> Frame {
    let id = numbers.below(0x800) as u16;
    let mut data = [0; 8];
    data.iter_mut().for_each(|byte| *byte = numbers.below(256) as u8);
    let id = match numbers.below(8) {
        0 => 0x780 | id & 0x3F,
        1 => 0x740 | id & 0x3F,
        2 | 3 => 0x400 | id & 0x1FF,
        _ => id,
    };
    match numbers.below(6) {
        // Opens and their answers; allocations; fragments.
        0 => data[1..4].copy_from_slice(&[0x4B, numbers.below(5) as u8, 0x30]),
        1 => data[1..5].copy_from_slice(&[0xCB, numbers.below(5) as u8, 0, 1]),
        2 => data[1..5].copy_from_slice(&[0x4B, 3, 1, numbers.below(64) as u8]),
        3 => data[0] |= 0x80,
        _ => {}
    }
    let length = numbers.below(9) as usize;
    let kind = if numbers.below(200) == 0 { FrameKind::Error } else { FrameKind::Data };
    Frame::new(Moment::from_ns(ns), 1_000, kind, Identifier::Standard(id), length as u8)
        .with(&data[..length])
}

#[test]
fn hostile_frames_use_no_more_memory_the_longer_they_come() {
    // An unoptimised build takes its time.
    let count = if cfg!(debug_assertions) { 200_000 } else { 2_000_000 };
    let settings = Settings { protocol: Some(&PROTOCOL), ..Settings::default() };
    let facts = WireFacts { baud: Baud::new(125_000), ..WireFacts::default() };
    let before = HELD.load(Relaxed);
    let mut bus = Bus::new(BusInfo::new("can0", Some(Clock::Kernel)), facts, settings);
    let (mut numbers, mut n, mut ns, mut sink) = (Numbers(1), 0, 0, Nobody);
    let mut most = [0, 0];
    for frame in 0..count {
        ns += numbers.below(if frame % 1_000 == 0 { 20_000_000_000 } else { 2_000_000 }) as i64;
        let frame_of = any_frame(&mut numbers, ns);
        bus.hear(Event::Frames(&[frame_of]), &mut Output::new(&mut n, &mut sink));
        let held = HELD.load(Relaxed) - before;
        let half = usize::from(frame >= count / 2);
        most[half] = most[half].max(held);
    }
    let [first, second] = most;
    // All there is to hold is held soon: nothing grows in the second half.
    assert!(second <= first + 4_096, "{first} {second}");
    assert!(second < 1 << 20, "{second} bytes");
}
