//! Real peers: Wireshark reads what we write, and sigrok hears what we hear.
//!
//! Without a peer its test says that it was skipped. Where `FIELDTAP_PEERS=required`, it fails.

use crate::harness::{Scratch, argument, fieldtap, here, say};
use std::collections::BTreeSet;
use std::process::Command;

/// What a peer prints, or nothing if it may be absent and is.
pub fn ask(program: &str, package: &str, arguments: &[&str]) -> Option<String> {
    match Command::new(program).args(arguments).output() {
        Ok(output) => Some(String::from_utf8_lossy(&output.stdout).into_owned()),
        Err(error) => {
            let missing = format!("{program}: {error}: apt-get install {package}");
            assert!(
                std::env::var_os("FIELDTAP_PEERS").is_none_or(|peers| peers != "required"),
                "{missing}"
            );
            say(&format!("skipped: {missing}"));
            None
        }
    }
}

#[test]
fn wireshark_shows_our_sentences_and_findings() {
    let scratch = Scratch::new();
    let converted = scratch.path("checksum.pcapng");
    let capture = here("captures/slin-checksum/checksum.pcapng");
    fieldtap(["convert", "-q", argument(&capture), argument(&converted)]).good();
    let records = fieldtap(["read", "--format", "json", argument(&capture)]).good().records();

    let fields = ["-T", "fields", "-e", "frame.time_epoch", "-e", "frame.comment"];
    let show = |filter: &str| {
        let arguments = ["-r", argument(&converted), "-Y", filter];
        ask("tshark", "tshark", &[&arguments[..], &fields].concat())
    };
    let Some(all) = show("frame") else { return };
    // Clocks that drift divide a record into several blocks; the first one has the comments.
    let shown = all.lines().map(|line| line.split_once('\t').expect("two fields"));
    let shown: Vec<(&str, &str)> = shown.filter(|(_, comment)| !comment.is_empty()).collect();
    assert_eq!(shown.len(), records.len());
    for ((time, comment), record) in shown.into_iter().zip(&records) {
        let summary = record["summary"].as_str().expect("text");
        assert!(comment.starts_with(&format!("fieldtap: {summary}")), "{comment}");
        let ns = record["time_ns"].as_i64().expect("a time");
        assert_eq!(time, format!("{}.{:09}", ns / 1_000_000_000, ns % 1_000_000_000));
    }
    let wrong = show("frame.comment contains \"[error slin.checksum]\"").expect("it is there");
    let ours = records.iter().filter(|record| !crate::harness::codes(record).is_empty()).count();
    assert_eq!(wrong.lines().count(), ours);
}

#[test]
fn wireshark_sees_serial_events() {
    let scratch = Scratch::new();
    for (capture, event) in [
        ("slin-parity/parity.pcapng", "0x08"),
        ("uart-framing/framing.pcapng", "0x07"),
        ("uart-break/break.pcapng", "0x09"),
        ("uart-lost/lost.pcapng", "0x05"),
        ("uart-overrun/overrun.pcapng", "0x0a"),
    ] {
        let converted = scratch.path("events.pcapng");
        let original = here("captures").join(capture);
        fieldtap(["convert", "-q", argument(&original), argument(&converted)]).good();
        let arguments = ["-r", argument(&converted), "-T", "fields", "-e", "rtacser.eventtype"];
        let Some(events) = ask("tshark", "tshark", &arguments) else { return };
        assert!(events.lines().any(|line| line == event), "{capture}: {events}");
    }
}

/// sigrok's uart decoder prints `START-END uart-1: 1A`: sample numbers and the byte. Where lines
/// are healthy the two must agree to the sample.
#[test]
fn sigrok_hears_the_same_characters() {
    for (capture, baud, samplerate) in
        [("good/baumer.sr", "115200", 4_000_000_i64), ("good/tr-345594.sr", "345594", 8_000_000)]
    {
        let file = here("captures").join(capture);
        let decoder = format!("uart:rx=BUS:baudrate={baud}:parity=even");
        let arguments = ["-i", argument(&file), "-P", &decoder, "-A", "uart=rx-data:rx-start"];
        let more = ["--protocol-decoder-samplenum"];
        let Some(told) = ask("sigrok-cli", "sigrok-cli", &[&arguments[..], &more].concat()) else {
            return;
        };
        let mut theirs = BTreeSet::new();
        let mut start = 0;
        for line in told.lines() {
            let (range, text) = line.split_once(" uart-1: ").expect("a line of the decoder");
            match text {
                "Start bit" => {
                    let from = range.split_once('-').expect("a range").0;
                    start = from.parse::<i64>().expect("a sample");
                }
                byte => assert!(theirs.insert((start, byte.to_owned()))),
            }
        }
        let records = fieldtap(["read", "--format", "json", argument(&file)]).good().records();
        let characters = records.iter().flat_map(|r| r["slin"]["characters"].as_array().cloned());
        let mut ours: Vec<(i64, String)> = characters
            .flatten()
            .map(|character| {
                let ns = character["time_ns"].as_i64().expect("a time");
                let byte = character["byte"].as_str().expect("text").to_owned();
                ((ns * samplerate + 500_000_000) / 1_000_000_000, byte)
            })
            .collect();
        ours.sort();
        assert!(ours.len() > 200, "{capture}");
        assert_eq!(ours.len(), theirs.len(), "{capture}");
        for ((our_start, our_byte), (their_start, their_byte)) in ours.iter().zip(&theirs) {
            // sigrok rounds half a bit before the sample point.
            assert!((our_start - their_start).abs() <= 1, "{capture}: {our_start} {their_start}");
            assert_eq!(our_byte, their_byte, "{capture} at {their_start}");
        }
    }
}
