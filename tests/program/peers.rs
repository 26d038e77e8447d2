//! Real peers: Wireshark reads what we write, and sigrok hears what we hear.
//!
//! Without a peer its test says that it was skipped. Where `FIELDTAP_PEERS=required`, it fails.

use crate::harness::{Scratch, argument, fieldtap, here, say};
use std::collections::BTreeSet;
use std::process::{Command, Output, Stdio};

/// What a peer prints, or nothing if it may be absent and is.
pub fn ask(program: &str, package: &str, arguments: &[&str]) -> Option<String> {
    let output = run_peer(program, package, arguments)?;
    Some(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// What a peer comes to, or nothing if it may be absent and is.
pub fn run_peer(program: &str, package: &str, arguments: &[&str]) -> Option<Output> {
    let run = Command::new(program).args(arguments).output();
    run.map_err(|error| miss(&format!("{program}: {error}: apt-get install {package}"))).ok()
}

/// Says what is missing here. Fails where it must not be.
pub fn miss(what: &str) {
    let is_required = std::env::var_os("FIELDTAP_PEERS").is_some_and(|peers| peers == "required");
    assert!(!is_required, "{what}");
    say(&format!("skipped: {what}"));
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

/// What comes through a pipe must be in the byte order of the machine, unlike what is in a file.
#[test]
fn wireshark_captures_what_we_write_to_a_pipe() {
    let capture = here("captures/slin-parity/parity.pcapng");
    let Some(_) = ask("tshark", "tshark", &["--version"]) else { return };
    let converted = Command::new(env!("CARGO_BIN_EXE_fieldtap"))
        .args(["convert", "-q", "--output-format", "pcapng", argument(&capture), "-"])
        .stdout(Stdio::piped())
        .spawn();
    let mut converted = converted.expect("the program is there");
    let packets = converted.stdout.take().expect("it is piped");
    let shown = Command::new("tshark")
        .args(["-i", "-", "-T", "fields", "-e", "frame.comment"])
        .stdin(packets)
        .output()
        .expect("tshark is there");
    assert!(converted.wait().expect("it ends").success());
    let shown = String::from_utf8_lossy(&shown.stdout);
    assert!(shown.contains("[error slin.parity]"), "{shown}");
}

/// Wireshark shows identifier, length, direction and losses of what we write of a CAN log.
#[test]
fn wireshark_reads_our_can_frames() {
    let scratch = Scratch::new();
    let log = scratch.file(
        "a.log",
        "(1.000001) can0 42C#010E010101 R\n(1.000002) can0 18EBFF00#AA T\nDROPCOUNT: dropped 3 CAN \
         frames on 'can0' socket (total drops 3)\n(1.000003) can0 123#R4\n(1.000004) can0 \
         20000004#0004000000006000\n(1.000005) can0 123##5AABB\n",
    );
    let capture = scratch.path("b.pcapng");
    fieldtap(["convert", "-q", argument(&log), argument(&capture)]).good();
    let fields = [
        "frame.time_epoch",
        "frame.interface_name",
        "can.id",
        "can.flags.xtd",
        "can.flags.rtr",
        "can.flags.err",
        "can.len",
        "canfd.flags.brs",
        "frame.packet_flags_direction",
        "frame.drop_count",
    ];
    let arguments = ["-r", argument(&capture), "-T", "fields", "-E", "separator=,"];
    let named = fields.iter().flat_map(|field| ["-e", field]);
    let arguments: Vec<&str> = arguments.into_iter().chain(named).collect();
    let Some(told) = ask("tshark", "tshark", &arguments) else { return };
    let lines: Vec<&str> = told.lines().collect();
    let is = |word: &str, one: bool| {
        // Versions write truths as 1 and 0 or in words.
        word == if one { "1" } else { "0" } || word == if one { "True" } else { "False" }
    };
    assert_eq!(lines.len(), 5, "{told}");
    let cells: Vec<Vec<&str>> = lines.iter().map(|line| line.split(',').collect()).collect();
    assert_eq!(cells[0][..3], ["1.000001000", "can0", "1068"]);
    assert!(is(cells[0][3], false) && cells[0][6] == "5", "{told}");
    // 18EBFF00h; sent.
    assert_eq!(cells[1][2], "418119424");
    assert!(is(cells[1][3], true), "{told}");
    assert_ne!(cells[0][8], cells[1][8], "{told}");
    assert!(is(cells[2][4], true) && cells[2][9] == "3", "{told}");
    assert!(is(cells[3][5], true), "{told}");
    assert!(is(cells[4][7], true) && cells[4][6] == "2", "{told}");
}

/// can-utils make an ASC log of a candump log, and a candump log of that; we read the same frames
/// of all three.
#[test]
fn can_utils_and_we_read_the_same_logs() {
    let scratch = Scratch::new();
    let log = "(1700000010.000000) can0 42C#010E010101\n(1700000010.001000) can1 42B#018E3600\n\
               (1700000010.002000) can0 18EBFF00#AA\n(1700000010.003000) can0 123#R\n\
               (1700000010.004000) can0 5FD#4300000000000000\n";
    let file = scratch.file("a.log", log);
    let (asc, again) = (scratch.path("b.asc"), scratch.path("c.log"));
    let make = ["-I", argument(&file), "-O", argument(&asc), "can0", "can1"];
    if ask("log2asc", "can-utils", &make).is_none() {
        return;
    }
    ask("asc2log", "can-utils", &["-I", argument(&asc), "-O", argument(&again)]);
    let read = |path: &std::path::Path| {
        let read = ["read", "--protocol", "can", "--format", "json", argument(path)];
        let records = fieldtap(read).good().records();
        let start = records[0]["time_ns"].as_i64().expect("a time");
        let frame = |record: &serde_json::Value| {
            let can = &record["can"];
            // Neither can0 nor can1 is in an ASC log, which counts from 1.
            let ns = record["time_ns"].as_i64().expect("a time") - start;
            (
                ns,
                can["id"].clone(),
                can["extended"].clone(),
                can["remote"].clone(),
                can["data"].clone(),
            )
        };
        records.iter().map(frame).collect::<Vec<_>>()
    };
    let ours = read(&file);
    assert_eq!(ours.len(), 5);
    assert_eq!(read(&asc), ours);
    assert_eq!(read(&again), ours);
    // And what we write they read.
    let written = scratch.path("d.log");
    fieldtap(["convert", "-q", argument(&asc), argument(&written)]).good();
    let asc_again = scratch.path("e.asc");
    let make = ["-I", argument(&written), "-O", argument(&asc_again), "can1", "can2"];
    ask("log2asc", "can-utils", &make);
    assert_eq!(read(&asc_again), ours);
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
