//! Two CAN cards on one bus: listening must not be taking part.

use super::can::{Interface, numbers};
use super::tap::{Tap, lost, of_kind};

const ARGUMENTS: [&str; 3] = ["can:can1", "--protocol", "can"];

/// What the kernel counted as sent on an interface, whether it left it or not.
fn sent(interface: &Interface) -> [u64; 4] {
    ["tx_packets", "tx_bytes", "tx_dropped", "tx_errors"].map(|of| interface.count(of))
}

#[test]
#[ignore = "runs in the virtual machine"]
fn kvaser_an_interface_that_acknowledges_is_refused() {
    let active = Interface::card("can1", false);
    let run = Tap::start(&ARGUMENTS).ends();
    assert_eq!(run.status, Some(3), "{}", run.stderr);
    let command = "ip link set can1 type can bitrate 500000 listen-only on";
    assert!(run.stderr.contains(command), "{}", run.stderr);
    assert!(run.stderr.contains("--allow-active"), "{}", run.stderr);
    assert_eq!(sent(&active), [0; 4]);
}

#[test]
#[ignore = "runs in the virtual machine"]
fn kvaser_listening_sends_nothing() {
    const COUNT: u32 = 500;
    let master = Interface::card("can0", false);
    let ours = Interface::card("can1", true);
    let before = sent(&ours);
    let heard_before = ours.count("rx_packets");
    let mut tap = Tap::listen(&ARGUMENTS, "listen-only");
    master.send_to(&ours, 0..COUNT);
    tap.wait_for(COUNT as usize, "frame");
    let run = tap.stop();

    assert_eq!(numbers(&run.records), Vec::from_iter(0..COUNT));
    assert_eq!(lost(&run.records), 0);
    let frames = of_kind(&run.records, "frame");
    assert!(frames.iter().all(|frame| frame["can"]["direction"] == "rx"), "{:?}", frames[0]);
    assert!(run.stderr.contains("500000 bit/s"), "{}", run.stderr);
    assert_eq!(ours.count("rx_packets") - heard_before, u64::from(COUNT));
    assert_eq!(sent(&ours), before, "packets, bytes, dropped, errors");
}

/// The card's queue holds 64 bytes, nine frames of four (SJA1000 data sheet). How many frames an overrun is
/// nobody knows.
#[test]
#[ignore = "runs in the virtual machine"]
fn kvaser_what_the_controller_had_no_room_for_is_told() {
    const COUNT: u32 = 50;
    let master = Interface::card("can0", false);
    let ours = Interface::card("can1", true);
    let before = ours.count("rx_over_errors");
    let mut tap = Tap::listen(&ARGUMENTS, "listen-only");
    ours.interrupts(false);
    let sent_before = master.count("tx_packets");
    master.send(0..COUNT);
    tap.wait_until("all are sent", |_| {
        master.count("tx_packets") - sent_before == u64::from(COUNT)
    });
    ours.interrupts(true);
    tap.wait_until("it is read", |tap| !numbers(&tap.records()).is_empty());
    master.send_to(&ours, COUNT..COUNT + 10);
    tap.wait_until("the end", |tap| numbers(&tap.last()) == [COUNT + 9]);
    let run = tap.stop();

    let heard = numbers(&run.records);
    let overruns = ours.count("rx_over_errors") - before;
    assert!(overruns > 0 && heard.len() < COUNT as usize + 10, "{overruns} overruns: {heard:?}");
    let tells = |record: &serde_json::Value| record["findings"].to_string().contains("can.dropped");
    assert_eq!(run.records.iter().filter(|record| tells(record)).count() as u64, overruns);
}

/// At half the bit rate a bit takes 4 µs instead of 2.
#[test]
#[ignore = "runs in the virtual machine"]
fn kvaser_a_bit_rate_that_was_changed_counts_from_there_on() {
    let master = Interface::card("can0", false);
    let ours = Interface::card("can1", true);
    let mut tap = Tap::listen(&ARGUMENTS, "listen-only");
    master.send_to(&ours, 0..1);
    tap.wait_for(1, "frame");
    ours.down();
    tap.wait_for_words("went down");
    ours.set_bitrate(250_000);
    ours.up();
    tap.wait_for_words("another bit rate");
    master.send_to(&ours, 1..2);
    tap.wait_for(2, "frame");
    let run = tap.stop();

    let of = |frame: &serde_json::Value| {
        (frame["duration_ns"].as_u64(), frame["can"]["bits"].as_u64().expect("it is exact"))
    };
    let frames: Vec<_> = of_kind(&run.records, "frame").into_iter().map(of).collect();
    let [(first, first_bits), (second, second_bits)] = frames[..] else { panic!("{frames:?}") };
    assert_eq!((first, second), (Some(first_bits * 2_000), Some(second_bits * 4_000)));
    assert!(run.stderr.contains("LINE   ok: 250 kbit/s"), "{}", run.stderr);
    assert!(run.stderr.contains("-> nobody listened meanwhile"), "{}", run.stderr);
}

#[test]
#[ignore = "runs in the virtual machine"]
fn kvaser_whoever_allows_it_listens_on_an_active_one() {
    let master = Interface::card("can0", false);
    let ours = Interface::card("can1", false);
    let before = sent(&ours);
    let mut tap = Tap::listen(&[&ARGUMENTS[..], &["--allow-active"]].concat(), "NOT listen-only");
    master.send_to(&ours, 0..10);
    tap.wait_for(10, "frame");
    assert_eq!(numbers(&tap.stop().records), Vec::from_iter(0..10));
    assert_eq!(sent(&ours), before, "packets, bytes, dropped, errors");
}
