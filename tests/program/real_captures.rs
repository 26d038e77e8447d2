//! Captures of real lines by others, with another decoder's reading beside each. They are not part
//! of this project: a folder of them is named by `FIELDTAP_REAL_CAPTURES`, or looked for beside it.
//! Those of CAN lines are in the folder `can` beside that one.

use crate::harness::{argument, fieldtap, say};
use crate::peers::ask;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Where the captures are, if they are.
fn folder() -> Option<PathBuf> {
    existing(uart_folder())
}

fn uart_folder() -> PathBuf {
    let beside = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/captures/real/uart");
    std::env::var_os("FIELDTAP_REAL_CAPTURES").map_or(beside.into(), PathBuf::from)
}

fn existing(folder: PathBuf) -> Option<PathBuf> {
    if folder.is_dir() {
        return Some(folder);
    }
    say(&format!("skipped: no captures of real lines in {}", folder.display()));
    None
}

/// A character: its byte, and whether a parity or a framing error was seen.
type Character = (String, bool, bool);

/// What the other decoder read: characters by the first sample of their start bit. Its lines are
/// `START-END decoder: text`; the start bit's line comes before the byte's. A frame error is one of
/// the stop bit with the same samples, or else of a false start.
fn reading_beside(text: &str) -> BTreeMap<i64, Character> {
    let mut characters: BTreeMap<i64, Character> = BTreeMap::new();
    let (mut start, mut frame_error) = (0, "");
    for line in text.lines() {
        let (range, rest) = line.split_once(' ').expect("a line begins with samples");
        let said = rest.split_once(": ").expect("then comes who says it").1;
        let from: i64 = range.split_once('-').expect("a range").0.parse().expect("a sample");
        match said {
            "Start bit" => start = from,
            "Frame error" => frame_error = range,
            "Stop bit" if range == frame_error => {
                characters.get_mut(&start).expect("after the byte").2 = true;
            }
            "Parity error" => characters.get_mut(&start).expect("after the byte").1 = true,
            byte if byte.len() == 2 && byte.bytes().all(|b| b.is_ascii_hexdigit()) => {
                characters.insert(start, (byte.to_owned(), false, false));
            }
            _ => {}
        }
    }
    characters
}

fn check(name: &str, samplerate: i64, options: &[&str]) {
    let Some(folder) = folder() else { return };
    let capture = folder.join(format!("{name}.sr"));
    let beside = std::fs::read_to_string(folder.join(format!("{name}.sr.expected.txt")))
        .expect("the reading is beside the capture");
    let mut arguments = vec!["read", "--protocol", "uart", "--format", "json", argument(&capture)];
    arguments.extend_from_slice(options);
    let records = fieldtap(arguments).good().records();
    let characters = records.iter().filter(|record| record["kind"] == "character");
    let mut ours: Vec<(i64, Character)> = characters
        .map(|record| {
            let ns = record["time_ns"].as_i64().expect("samples have times");
            let uart = &record["uart"];
            let byte = uart["byte"].as_str().expect("a byte is text").to_owned();
            let character = (byte, uart["parity"] == "error", uart["framing"] == "error");
            // Times are cut to whole ns.
            ((ns * samplerate + samplerate / 2) / 1_000_000_000, character)
        })
        .collect();
    ours.sort();
    let theirs: Vec<(i64, Character)> = reading_beside(&beside).into_iter().collect();
    assert_eq!(ours.len(), theirs.len(), "{name}: {ours:?}");
    for ((our_start, ours), (their_start, theirs)) in ours.iter().zip(&theirs) {
        assert_eq!(ours, theirs, "{name} at {their_start}");
        assert!((our_start - their_start).abs() <= 1, "{name}: {our_start} {their_start}");
    }
}

#[test]
fn characters_agree_with_another_decoder() {
    check("hello_world_8e1_115200", 1_000_000, &[]);
    check("hello_world_8o1_115200", 1_000_000, &[]);
    check("hello_world_8n1_19200", 1_000_000, &[]);
    check("flowmeter_graph_tool", 4_000_000, &[]);
    check("sl-814_uart_run", 1_000_000, &[]);
    check("ampel64_4800_8n1_frame_errors", 2_000_000, &["--baud", "4800", "--frame", "8N1"]);
    check("glitch_0x43", 2_000_000, &[]);
    check("glitch_0x4f", 2_000_000, &[]);
}

#[test]
fn the_same_is_found_without_being_told() {
    check("ampel64_4800_8n1_frame_errors", 2_000_000, &[]);
    check("hello_world_8e1_115200", 1_000_000, &["--baud", "115200", "--frame", "8E1"]);
    check("hello_world_8o1_115200", 1_000_000, &["--baud", "115200", "--frame", "8O1"]);
    check("hello_world_8n1_19200", 1_000_000, &["--baud", "19200", "--frame", "8N1"]);
    check("flowmeter_graph_tool", 4_000_000, &["--baud", "9600", "--frame", "8N1"]);
}

/// A CAN frame: the first sample of its start bit, its identifier, its data.
type CanFrame = (i64, u32, String);

/// What sigrok prints of a CAN line: `START-END can-1: Identifier: 1304 (0x518)`, for a long
/// identifier `Full Identifier: …` below, then `Data byte 0: 0x00`. The start bit comes before.
fn frames_of_sigrok(text: &str, bit: i64) -> Vec<CanFrame> {
    let mut frames: Vec<CanFrame> = Vec::new();
    for line in text.lines() {
        let (range, said) = line.split_once(" can-1: ").expect("who says it");
        let (what, value) = said.split_once(": ").expect("what it says");
        let hex = value.rsplit("0x").next().expect("a value").trim_end_matches(')');
        match what {
            "Identifier" => {
                let from: i64 =
                    range.split_once('-').expect("a range").0.parse().expect("a sample");
                let id = u32::from_str_radix(hex, 16).expect("hex");
                frames.push((from - bit, id, String::new()));
            }
            "Full Identifier" => {
                let frame = frames.last_mut().expect("below the first part");
                frame.1 = u32::from_str_radix(hex, 16).expect("hex");
            }
            _ if what.starts_with("Data byte") => {
                frames.last_mut().expect("behind the identifier").2 += &hex.to_uppercase();
            }
            _ => {}
        }
    }
    frames
}

/// 125 kbit/s at 4 MHz: 32 samples a bit, 250 ns a sample. Rate, polarity and that this is CAN are
/// found; every frame has a good checksum and nothing is wrong.
#[test]
fn can_frames_agree_with_sigrok() {
    let Some(folder) = existing(uart_folder().with_file_name("can")) else { return };
    for (load, count) in [("25", 14), ("100", 286)] {
        let capture = folder.join(format!("mcp2515dm-bm-125kbits_bus_load_{load}percent.sr"));
        let run = fieldtap(["read", "--format", "json", argument(&capture)]).good();
        let ours: Vec<CanFrame> = run
            .records()
            .iter()
            .map(|record| {
                assert_eq!(
                    (&record["bus"], &record["can"]["crc"]),
                    (&"CAN_RX".into(), &"ok".into())
                );
                assert_eq!(record["findings"].as_array().map(Vec::len), Some(0), "{record}");
                let ns = record["time_ns"].as_i64().expect("samples have times");
                let id = record["can"]["id"].as_u64().and_then(|id| u32::try_from(id).ok());
                let data = record["can"]["data"].as_str().unwrap_or_default();
                (ns / 250, id.expect("an identifier"), data.to_owned())
            })
            .collect();
        assert_eq!(ours.len(), count);
        assert!(run.stderr.contains("bitrate 125000"), "{}", run.stderr);
        let arguments =
            ["-i", argument(&capture), "-P", "can:can_rx=CAN_RX:nominal_bitrate=125000"];
        let more = ["-A", "can=id:full-id:data", "--protocol-decoder-samplenum"];
        let Some(text) = ask("sigrok-cli", "sigrok-cli", &[&arguments[..], &more].concat()) else {
            return;
        };
        let theirs = frames_of_sigrok(&text, 32);
        assert_eq!(theirs.len(), count);
        for (ours, theirs) in ours.iter().zip(&theirs) {
            assert_eq!((ours.1, &ours.2), (theirs.1, &theirs.2), "at {}", theirs.0);
            assert!((ours.0 - theirs.0).abs() <= 2, "{} {}", ours.0, theirs.0);
        }
    }
}
