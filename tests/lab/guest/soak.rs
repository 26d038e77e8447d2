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

/// However many are still queued when the user ends it: each is recorded or counted as lost. A full bus
/// of 500 kbit/s loses none. How much more may come without a loss the machine decides, for sender,
/// kernel and recorder share two emulated processors: that is the lab's lossless maximum.
#[test]
#[ignore = "runs in the virtual machine"]
fn soak_what_is_queued_at_the_end_is_recorded_and_the_rest_is_counted() {
    const SPAN: Duration = Duration::from_secs(2);
    let bus = Interface::virtual_one("vcan0");
    let rates: &[u32] = match std::env::var_os("FIELDTAP_SOAK") {
        Some(_) => &[4_504, 10_000, 20_000, 40_000, 80_000],
        None => &[4_504, 80_000],
    };
    let mut most = 0;
    for &rate in rates {
        let tape = format!("/tmp/{rate}");
        let mut tap = Tap::run(&["record", "can:vcan0", "-w", &tape]);
        tap.wait_for_words("virtual");
        let begin = Instant::now();
        let sent = bus.send_at(rate, SPAN);
        let pace = sent * 1000 / begin.elapsed().as_millis() as u64;
        let run = tap.stop();
        assert_eq!(run.status, Some(0), "{}", run.stderr);
        let lost = lost(&run.stderr);
        println!("soak: {sent} frames at {pace}/s, {rate}/s were asked for: {lost} lost");
        let whole = format!(" {} frames", sent - lost);
        let told = recorded(&tape);
        assert!(told.contains(&whole) && run.stderr.contains(&whole), "{told}{}", run.stderr);
        assert_eq!(told.contains("loss"), lost > 0, "{told}");
        if lost == 0 {
            most = most.max(pace);
        }
        fs::remove_dir_all(&tape).expect("it is there");
    }
    println!("soak: lossless maximum of the lab: {most} frames/s for {SPAN:?}");
    assert!(most > 4_000, "a full bus came at {most} frames/s without a loss");
}

/// How many frames a recording says that the system counted as lost.
fn lost(told: &str) -> u64 {
    let count = told
        .split_once(" counted in the capture")
        .and_then(|(before, _)| before.rsplit(' ').next()?.parse().ok());
    count.unwrap_or(0)
}
