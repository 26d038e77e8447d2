//! CAN at the pace of a full bus and beyond, recorded: nothing is lost, and memory stays flat.

use super::can::Interface;
use super::tap::{Tap, recorded};
use std::fs;
use std::time::{Duration, Instant};

/// Frames of eight bytes are 111 bits without stuffing: so many a second fill a bus of 500 kbit/s.
/// Without optimizations an emulated machine takes a quarter of that at best.
const FULL: u32 = if cfg!(debug_assertions) { 1000 } else { 500_000 / 111 };

/// What a program may grow by once it runs, in KiB: what its allocator keeps in hand.
const GROWTH: u64 = 4096;

/// `FIELDTAP_SOAK` is how many seconds it may take.
fn span() -> Duration {
    let seconds = std::env::var("FIELDTAP_SOAK").ok();
    Duration::from_secs(seconds.map_or(4, |seconds| seconds.parse().expect("seconds")))
}

#[test]
#[ignore = "runs in the virtual machine"]
fn soak_a_full_can_bus_is_recorded_whole_in_flat_memory() {
    let bus = Interface::virtual_one("vcan0");
    let mut tap = Tap::run(&["record", "can:vcan0", "-w", "/tmp/full"]);
    tap.wait_for_words("virtual");
    let first = bus.send_at(FULL, span() / 4);
    let (before, busy) = (tap.memory(), tap.processor_time());
    let second = bus.send_at(FULL, span() * 3 / 4);
    let (after, busy) = (tap.memory(), tap.processor_time() - busy);
    let run = tap.stop();
    assert_eq!(run.status, Some(0), "{}", run.stderr);
    let told = recorded("/tmp/full");
    let frame = busy.as_nanos() / u128::from(second.max(1));
    println!(
        "soak: {} frames at {FULL}/s, recorded whole; {before} KiB, at the end {after} KiB; {frame} \
         ns of processor time a frame, emulated",
        first + second
    );
    assert!(told.contains(&format!(" {} frames", first + second)), "{told}{}", run.stderr);
    assert!(!told.contains("loss"), "{told}");
    assert!(after <= before + GROWTH, "{before} KiB, then {after} KiB");
    fs::remove_dir_all("/tmp/full").expect("it is there");
}

/// However many are still queued when the user ends it. The last rate is more than any emulated machine
/// sends, and what it sends then is the lab's lossless maximum: twice what the kernel queues, though a
/// recorder that is not optimized may still have much of it to write, which waits in the tap. The
/// machine sets that figure, for sender, kernel and recorder share two emulated processors.
#[test]
#[ignore = "runs in the virtual machine"]
fn soak_what_is_queued_at_the_end_is_recorded_up_to_the_most_that_the_lab_sends() {
    let bus = Interface::virtual_one("vcan0");
    let rates: &[u32] = match std::env::var_os("FIELDTAP_SOAK") {
        Some(_) => &[10_000, 20_000, 40_000, 80_000],
        None => &[80_000],
    };
    let mut most = 0;
    for &rate in rates {
        let tape = format!("/tmp/{rate}");
        let mut tap = Tap::run(&["record", "can:vcan0", "-w", &tape]);
        tap.wait_for_words("virtual");
        let begin = Instant::now();
        let sent = bus.send_at(rate, Duration::from_secs(2));
        let pace = sent * 1000 / begin.elapsed().as_millis() as u64;
        let run = tap.stop();
        assert_eq!(run.status, Some(0), "{}", run.stderr);
        let told = recorded(&tape);
        let line = told.lines().find(|line| line.starts_with("LINE")).expect("it ends well");
        println!("soak: {sent} frames at {pace}/s, {rate}/s were asked for: {line}");
        assert!(line.contains(&format!(" {sent} frames")), "{told}{}", run.stderr);
        assert!(!told.contains("loss"), "{told}");
        most = most.max(pace);
        fs::remove_dir_all(&tape).expect("it is there");
    }
    println!("soak: lossless maximum of the lab: {most} frames/s for 2 s");
}
