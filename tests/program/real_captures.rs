//! Captures of real lines by others, with another decoder's reading beside each. They are not part
//! of this project: a folder of them is named by `FIELDTAP_REAL_CAPTURES`, or looked for beside it.

use crate::harness::{argument, fieldtap, say};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Where the captures are, if they are.
fn folder() -> Option<PathBuf> {
    let beside = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/captures/real/uart");
    let folder = std::env::var_os("FIELDTAP_REAL_CAPTURES").map_or(beside.into(), PathBuf::from);
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
