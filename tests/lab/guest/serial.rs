//! Serial adapters with Linux's own drivers: what a receiver tells arrives, and nothing is sent.

use super::adapters::{Cp210x, Ftdi, Line, Lines, PORT, plug};
use super::tap::{Tap, of_kind};
use super::usbip::{Device, Plug};
use serde_json::Value;

const ARGUMENTS: [&str; 5] = ["serial:/dev/ttyUSB0", "--protocol", "uart", "--baud", "115200"];

/// Byte, parity and framing of each character, as they were told.
fn told(records: &[Value]) -> Vec<String> {
    let told = |record: &Value| {
        let uart = &record["uart"];
        let text = |key: &str| uart[key].as_str().unwrap_or_default().to_owned();
        let byte = record["raw"].as_str().unwrap_or_default();
        [byte.to_owned(), text("parity"), text("framing")].join(" ").trim_end().to_owned()
    };
    of_kind(records, "character").into_iter().map(told).collect()
}

/// Nothing was sent, and both lines are low.
fn assert_silent<D: Device + 'static>(adapter: &Plug<D>, lines: Lines) {
    assert_eq!(adapter.sent(), Vec::<u8>::new());
    assert_eq!(lines, Lines::default());
}

#[test]
#[ignore = "runs in the virtual machine"]
fn serial_ftdi_errors_are_those_of_a_packet() {
    let adapter = plug(0, Ftdi::new());
    let mut tap = Tap::listen(&ARGUMENTS, "latency timer 1 ms");
    assert_eq!(adapter.look(|ftdi| ftdi.latency), 1);
    // 3 MHz / 115200 is 26.04; eight bits, even parity, one stop bit.
    assert_eq!(adapter.look(|ftdi| (ftdi.divisor, ftdi.format & 0x0FFF)), (26, 0x0208));
    assert_silent(&adapter, adapter.look(|ftdi| ftdi.lines));

    adapter.hear(Line::Good, &[0x41, 0xFF, 0x00]);
    adapter.hear(Line::Parity, &[0x81, 0x10, 0xFF]);
    adapter.hear(Line::Good, &[0x42]);
    tap.wait_for(7, "character");
    let run = tap.stop();

    // One of the three, or two, or all: of none of them it is known.
    let expected = ["41 ok", "FF ok", "00 ok", "81 unknown", "10 unknown", "FF unknown", "42 ok"];
    assert_eq!(told(&run.records), expected, "{}", run.stderr);
    assert!(run.stderr.contains("whole packets"), "{}", run.stderr);
    assert!(run.stderr.contains("parity 1"), "the driver's counter: {}", run.stderr);
    assert!(run.stderr.contains("parity of 3 characters not judged (suspect"), "{}", run.stderr);
    assert_silent(&adapter, adapter.look(|ftdi| ftdi.lines));
}

/// Encoder 0 is asked and answers 154 (TR SLIN §6); something in the answer had a parity error.
#[test]
#[ignore = "runs in the virtual machine"]
fn serial_ftdi_a_marked_answer_is_suspect_and_not_wrong() {
    let adapter = plug(0, Ftdi::new());
    let arguments = ["serial:/dev/ttyUSB0", "--baud", "115200", "--protocol", "slin"];
    let mut tap = Tap::listen(&[&arguments[..], &["--profile", "tr"]].concat(), "latency timer");
    for _ in 0..3 {
        adapter.hear(Line::Good, &[0x80]);
        adapter.hear(Line::Parity, &[0x1A, 0x01, 0x98]);
    }
    tap.wait_for(2, "response");
    let run = tap.stop();
    for response in of_kind(&run.records, "response") {
        assert_eq!(response["slin"]["position"], 154, "{response}");
        let characters = response["slin"]["characters"].as_array().expect("an array");
        assert!(characters.iter().all(|one| one["parity"] == "suspect"), "{response}");
        assert!(!response["findings"].to_string().contains("slin.parity"), "{response}");
    }
}

#[test]
#[ignore = "runs in the virtual machine"]
fn serial_cp210x_errors_are_those_of_a_character() {
    let adapter = plug(0, Cp210x::new());
    let mut tap = Tap::listen(&ARGUMENTS, "low latency");
    assert_eq!(adapter.look(|cp210x| (cp210x.baud, cp210x.format)), (115_200, 0x0820));
    assert_silent(&adapter, adapter.look(|cp210x| cp210x.lines));
    let escape = adapter.look(|cp210x| cp210x.escape);
    assert_ne!(escape, 0, "the driver looks for errors");

    adapter.hear(&[(Line::Good, 0x41), (Line::Parity, 0x81), (Line::Good, 0xFF)]);
    adapter.hear(&[(Line::Parity, 0xFF), (Line::Good, escape), (Line::Framing, 0x30)]);
    adapter.hear(&[(Line::Good, 0x42)]);
    tap.wait_for(7, "character");
    let run = tap.stop();

    let told = told(&run.records);
    let expected = ["41 ok", "81 error", "FF ok", "FF error", "EC ok"];
    assert_eq!(told[..5], expected, "{}", run.stderr);
    assert!(told[5].starts_with("30") && told[5].ends_with("error"), "{told:?}");
    assert_eq!(told[6], "42 ok");
    assert!(run.stderr.contains("parity 2, framing 1"), "{}", run.stderr);
    assert_silent(&adapter, adapter.look(|cp210x| cp210x.lines));
}

#[test]
#[ignore = "runs in the virtual machine"]
fn serial_breaks_and_overruns_are_told() {
    let adapter = plug(0, Cp210x::new());
    let mut tap = Tap::listen(&ARGUMENTS, "low latency");
    adapter.hear(&[(Line::Good, 0x41), (Line::Break, 0x00), (Line::Good, 0x42)]);
    tap.wait_for(1, "break");
    adapter.hear(&[(Line::Good, 0x43), (Line::Overrun, 0x44), (Line::Good, 0x45)]);
    tap.wait_for(1, "lost");
    let run = tap.stop();

    assert_eq!(of_kind(&run.records, "break").len(), 1);
    // The driver does not say where in a packet it was.
    let lost = of_kind(&run.records, "lost");
    assert_eq!(lost.len(), 1);
    assert!(lost[0]["findings"].to_string().contains("uart.overrun"), "{lost:?}");
    assert!(run.stderr.contains("overrun 1"), "{}", run.stderr);
    let bytes: String = told(&run.records).iter().map(|told| &told[..2]).collect();
    assert_eq!(bytes, "4142434445");
}

#[test]
#[ignore = "runs in the virtual machine"]
fn serial_an_adapter_that_is_unplugged_ends_the_run() {
    let adapter = plug(0, Ftdi::new());
    let mut tap = Tap::listen(&ARGUMENTS, "latency timer");
    adapter.hear(Line::Good, &[0x41]);
    tap.wait_for(1, "character");
    drop(adapter);
    let run = tap.ends();
    assert_eq!(run.status, Some(3), "{}", run.stderr);
    assert_eq!(told(&run.records), ["41 ok"]);
    assert!(run.stderr.contains("gone") && run.stderr.contains(PORT), "{}", run.stderr);
    assert!(run.stderr.contains("LINE"), "the last lines come all the same: {}", run.stderr);
}

#[test]
#[ignore = "runs in the virtual machine"]
fn serial_whoever_waits_hears_an_adapter_that_comes_back() {
    let adapter = plug(0, Ftdi::new());
    let arguments = [&ARGUMENTS[..], &["--reconnect"]].concat();
    let mut tap = Tap::listen(&arguments, "latency timer");
    adapter.hear(Line::Good, &[0x41]);
    tap.wait_for(1, "character");
    drop(adapter);
    tap.wait_for_words("gone");
    let adapter = plug(0, Ftdi::new());
    tap.wait_for_words("is back");
    assert_eq!(adapter.look(|ftdi| ftdi.latency), 1);
    assert_silent(&adapter, adapter.look(|ftdi| ftdi.lines));
    adapter.hear(Line::Good, &[0x42]);
    tap.wait_for(2, "character");
    let run = tap.stop();
    assert_eq!(told(&run.records), ["41 ok", "42 ok"]);
    assert_eq!(of_kind(&run.records, "lost").len(), 1, "{:?}", run.records);
    assert_eq!(run.status, Some(130), "{}", run.stderr);
}
