//! A virtual CAN interface: everything comes or is counted, in its order and with its time.

use super::can::{Interface, numbers};
use super::tap::{Tap, lost, of_kind, recorded};
use serde_json::Value;
use socketcan::{CanErrorFrame, CanFrame};
use std::fs;
use std::time::{Duration, SystemTime};

const ARGUMENTS: [&str; 3] = ["can:vcan0", "--protocol", "can"];

/// It says so once it listens.
const LISTENS: &str = "virtual";

/// How late a busy machine may notice something, in ns.
const SOON_NS: u64 = 500_000_000;

/// The time in ns, as records have it.
fn now() -> u64 {
    SystemTime::UNIX_EPOCH.elapsed().expect("after 1970").as_nanos() as u64
}

fn assert_ascending(records: &[Value]) {
    for pair in records.windows(2) {
        assert!(pair[0]["time_ns"].as_u64() <= pair[1]["time_ns"].as_u64(), "{pair:#?}");
    }
}

#[test]
#[ignore = "runs in the virtual machine"]
fn vcan_frames_come_whole_in_order_and_with_times() {
    const COUNT: u32 = 2000;
    let bus = Interface::virtual_one("vcan0");
    let mut tap = Tap::listen(&ARGUMENTS, LISTENS);
    bus.send(0..COUNT);
    tap.wait_for(COUNT as usize, "frame");
    let run = tap.stop();

    assert_eq!(numbers(&run.records), Vec::from_iter(0..COUNT));
    assert_eq!(lost(&run.records), 0);
    assert_ascending(&run.records);
    let frames = of_kind(&run.records, "frame");
    assert!(frames.iter().all(|frame| frame["clock"] == "kernel"));
    // Another program of this host sent them.
    assert!(frames.iter().all(|frame| frame["can"]["direction"] == "tx"), "{:?}", frames[0]);
    assert_eq!(run.status, Some(130), "{}", run.stderr);
}

#[test]
#[ignore = "runs in the virtual machine"]
fn vcan_error_frames_are_heard() {
    let bus = Interface::virtual_one("vcan0");
    let mut tap = Tap::listen(&ARGUMENTS, LISTENS);
    // Classes of `linux/can/error.h`: a stuff error in the data field, no acknowledge, bus-off.
    let errors = [(0x88, [0, 0, 0x04, 0x0A, 0, 0, 0, 0]), (0x20, [0; 8]), (0x40, [0; 8])];
    for (class, data) in errors {
        let frame = CanErrorFrame::new_error(class, &data).expect("eight bytes");
        bus.send_frame(&CanFrame::Error(frame));
    }
    tap.wait_for(errors.len(), "can-error");
    let run = tap.stop();

    let heard = of_kind(&run.records, "can-error");
    let codes = heard.iter().map(|record| record["findings"].to_string()).collect::<Vec<_>>();
    assert!(codes[0].contains("can.error-frame"), "{codes:?}");
    assert!(codes[1].contains("can.not-acknowledged"), "{codes:?}");
    assert!(codes[2].contains("can.bus-off"), "{codes:?}");
}

/// Who may not set the size of the kernel's queue has one for some 280 frames (measured).
#[test]
#[ignore = "runs in the virtual machine"]
fn vcan_frames_that_are_dropped_are_counted() {
    const COUNT: u32 = 3000;
    let bus = Interface::virtual_one("vcan0");
    let mut tap = Tap::listen_as_nobody(&ARGUMENTS, LISTENS);
    tap.signal(libc::SIGSTOP);
    bus.send(0..COUNT);
    tap.signal(libc::SIGCONT);
    // No frame comes after the last one that was dropped: the count must come by itself.
    let heard = |tap: &Tap| numbers(&tap.records()).len() as u64 + lost(&tap.records());
    tap.wait_until("all of them, heard or lost", |tap| heard(tap) == u64::from(COUNT));
    bus.send(COUNT..COUNT + 1);
    tap.wait_until("another one", |tap| heard(tap) > u64::from(COUNT));
    let run = tap.stop();

    let numbers = numbers(&run.records);
    assert!(lost(&run.records) > 1000, "{}", lost(&run.records));
    assert_eq!(numbers.len() as u64 + lost(&run.records), u64::from(COUNT) + 1);
    assert!(numbers.is_sorted() && numbers.last() == Some(&COUNT));
    assert_ascending(&run.records);
    assert!(run.stderr.contains(" x dropped"), "{}", run.stderr);
}

#[test]
#[ignore = "runs in the virtual machine"]
fn vcan_the_kernel_holds_what_a_slow_reader_has_not_read() {
    const COUNT: u32 = 10_000;
    let bus = Interface::virtual_one("vcan0");
    let mut tap = Tap::listen(&ARGUMENTS, LISTENS);
    tap.signal(libc::SIGSTOP);
    bus.send(0..COUNT);
    tap.signal(libc::SIGCONT);
    tap.wait_for(COUNT as usize, "frame");
    let run = tap.stop();
    assert_eq!(numbers(&run.records), Vec::from_iter(0..COUNT));
    assert_eq!(lost(&run.records), 0);
}

#[test]
#[ignore = "runs in the virtual machine"]
fn vcan_an_interface_that_goes_down_is_waited_for() {
    let bus = Interface::virtual_one("vcan0");
    let mut tap = Tap::listen(&ARGUMENTS, LISTENS);
    bus.send(0..10);
    bus.down();
    tap.wait_for_words("went down");
    bus.up();
    tap.wait_for_words("up again");
    bus.send(10..20);
    tap.wait_for(20, "frame");
    let run = tap.stop();

    assert_eq!(numbers(&run.records), Vec::from_iter(0..20));
    // Nobody knows what was on the bus meanwhile.
    let kinds = run.records.iter().map(|record| record["kind"].as_str().expect("text"));
    let kinds: Vec<&str> = kinds.skip_while(|kind| *kind == "frame").collect();
    assert_eq!(kinds.first(), Some(&"lost"), "{:?}", run.records);
    assert!(run.stderr.contains("-> nobody listened meanwhile"), "{}", run.stderr);
    assert_eq!(run.status, Some(130), "{}", run.stderr);
}

/// Whoever sets an interface to something else takes it down for a moment only, and a busy bus leaves
/// no pause behind.
#[test]
#[ignore = "runs in the virtual machine"]
fn vcan_an_interface_that_is_down_for_a_moment_on_a_busy_bus_is_told_at_once() {
    let bus = Interface::virtual_one("vcan0");
    let mut tap = Tap::listen(&ARGUMENTS, LISTENS);
    let traffic = bus.keep_sending(Duration::from_millis(1));
    tap.wait_for(100, "frame");
    let mut falls = Vec::new();
    for _ in 0..3 {
        let before = now();
        bus.down();
        bus.up();
        falls.push(before..now() + SOON_NS);
        tap.wait_for(tap.records().len() + 500, "frame");
    }
    let sent = traffic.stop();
    let run = tap.stop();

    // An interface that goes down takes some and throws them away; the kernel counts most of them.
    let numbers = numbers(&run.records);
    assert!(numbers.is_sorted() && numbers.last() == Some(&(sent - 1)));
    let accounted = numbers.len() as u64 + lost(&run.records);
    assert!(
        (u64::from(sent - 100)..=u64::from(sent)).contains(&accounted),
        "{accounted} of {sent}"
    );
    let losses = of_kind(&run.records, "lost");
    let falls_told = losses.iter().filter(|record| record["lost"].is_null());
    let told: Vec<u64> = falls_told.map(|it| it["time_ns"].as_u64().expect("a time")).collect();
    assert_eq!(told.len(), falls.len(), "{losses:?}");
    let is_soon = told.iter().zip(&falls).all(|(at, fall)| fall.contains(at));
    assert!(is_soon, "{told:?} {falls:?}");
    assert_eq!(run.stderr.matches("went down").count(), falls.len(), "{}", run.stderr);
    assert_eq!(run.stderr.matches(LISTENS).count(), 1 + falls.len(), "{}", run.stderr);
    assert_ascending(&run.records);
}

/// The user ends it while it waits.
#[test]
#[ignore = "runs in the virtual machine"]
fn vcan_a_recording_of_an_interface_that_is_down_ends_well() {
    let bus = Interface::virtual_one("vcan0");
    let mut tap = Tap::run(&["record", "can:vcan0", "-w", "/tmp/down"]);
    tap.wait_for_words(LISTENS);
    bus.send(0..10);
    tap.signal(libc::SIGSTOP);
    bus.send(10..500);
    bus.down();
    tap.signal(libc::SIGCONT);
    tap.wait_for_words("went down");
    let run = tap.stop();
    assert_eq!(run.status, Some(0), "{}", run.stderr);
    let told = recorded("/tmp/down");
    assert!(told.contains(" 500 frames"), "{told}{}", run.stderr);
    fs::remove_dir_all("/tmp/down").expect("it is there");
}

#[test]
#[ignore = "runs in the virtual machine"]
fn vcan_an_interface_that_vanishes_ends_the_run() {
    let bus = Interface::virtual_one("vcan0");
    let mut tap = Tap::listen(&ARGUMENTS, LISTENS);
    bus.send(0..10);
    tap.wait_for(10, "frame");
    drop(bus);
    let run = tap.ends();
    assert_eq!(numbers(&run.records), Vec::from_iter(0..10));
    assert_eq!(run.status, Some(3), "{}", run.stderr);
    assert!(run.stderr.contains("gone"), "{}", run.stderr);
    assert!(run.stderr.contains("LINE"), "the last lines come all the same: {}", run.stderr);
}

#[test]
#[ignore = "runs in the virtual machine"]
fn vcan_an_interface_that_is_down_or_missing_is_refused_with_a_command() {
    let bus = Interface::virtual_one("vcan0");
    bus.down();
    let run = Tap::start(&ARGUMENTS).ends();
    assert_eq!(run.status, Some(3), "{}", run.stderr);
    assert!(run.stderr.contains("ip link set vcan0 up"), "{}", run.stderr);
    let run = Tap::start(&["can:vcan7"]).ends();
    assert_eq!(run.status, Some(3), "{}", run.stderr);
    assert!(run.stderr.contains("vcan0"), "those that are there: {}", run.stderr);
}
