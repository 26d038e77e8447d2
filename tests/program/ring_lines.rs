//! The line of an INTERBUS ring, through the program: wires of one bus, profile, devices.

use crate::harness::{argument, fieldtap, here};
use crate::ring::{Chance, Plan, Recording};
use std::fmt::Write;
use std::path::PathBuf;
use tempfile::TempDir;

/// A value change dump of both wires under these names, in this order.
fn dump(folder: &TempDir, recording: &Recording, names: [(&str, usize); 2]) -> PathBuf {
    let mut text = String::from("$timescale 250 ns $end\n$scope module top $end\n");
    for (name, wire) in names {
        writeln!(text, "$var wire 1 {} {name} $end", wire + 1).expect("a String takes any text");
    }
    text.push_str("$upscope $end\n$enddefinitions $end\n#0 11 12\n");
    let mut edges: Vec<(u64, usize)> = Vec::new();
    for (wire, all) in recording.edges.iter().enumerate() {
        edges.extend(all.iter().map(|edge| (*edge, wire)));
    }
    edges.sort_unstable();
    let mut level = [true; 2];
    for (tick, wire) in edges {
        level[wire] = !level[wire];
        let value = u8::from(level[wire]);
        writeln!(text, "#{tick} {value}{}", wire + 1).expect("a String takes any text");
    }
    writeln!(text, "#{}", recording.until).expect("a String takes any text");
    let path = folder.path().join("ring.vcd");
    std::fs::write(&path, text).expect("it can be written");
    path
}

#[test]
fn two_wires_are_one_bus_by_their_names() {
    let folder = TempDir::new().expect("a folder");
    let plan = Plan { jitter: 0.03, pause: 0.8, ..Plan::plain() };
    let (recording, told) = plan.record_with(150, &[], &mut Chance::new(11));
    for names in [[("DO", 0), ("DI", 1)], [("DI", 1), ("DO", 0)], [("a", 0), ("b", 1)]] {
        let path = dump(&folder, &recording, names);
        let options = ["--protocol", "interbus", "--device", "2=la66"];
        let read = ["read", "--format", "json", argument(&path)];
        let records = fieldtap(read.iter().chain(&options)).good().records();
        let of_kind = |kind: &str| records.iter().filter(|it| it["kind"] == kind).count();
        assert_eq!((of_kind("id-cycle"), of_kind("data-cycle")), (4, 150), "{names:?}");
        let words = |value: &serde_json::Value| {
            let part = |key: &str| value["interbus"][key].as_str().expect("words").to_owned();
            part("out") + " " + &part("in")
        };
        let device: Vec<String> =
            records.iter().filter(|it| it["station"] == 2).map(words).collect();
        assert_eq!(device, told, "{names:?}");
        let cycle = records.iter().find(|it| it["kind"] == "data-cycle").expect("a cycle");
        assert_eq!(cycle["interbus"]["crc"], "ok");
        assert_eq!(cycle["interbus"]["words"].as_array().map(Vec::len), Some(3));
        let first = &records[0]["interbus"];
        assert_eq!(first["ids"], serde_json::json!(["0203", "0233", "0132"]));
        // 2 + 6 + 4 characters of 13 bits, 2 µs each, and up to 0.8 bits between them.
        let duration = records[0]["duration_ns"].as_i64().expect("a number");
        assert!((312_000..=312_000 + 12 * 1_600).contains(&duration), "{duration}");
        let text = fieldtap(["stats", "--format", "json", argument(&path)].iter().chain(&options));
        let stats: serde_json::Value =
            serde_json::from_str(&text.good().stdout).expect("one object");
        let profile = &stats["buses"][0]["interbus"]["profile"];
        assert_eq!(profile["bitrate"]["value"], "500000");
        assert_eq!(profile["lbw"]["value"], "B5E3");
        assert_eq!(profile["crc"]["poly"]["origin"], "found");
        assert_eq!(profile["ring"]["value"], "32:0203 32:0233 16:0132");
    }
}

#[test]
fn what_is_spoken_is_found_and_how_to_join_the_wires_is_said() {
    let folder = TempDir::new().expect("a folder");
    let recording = Plan::plain().record(150, &mut Chance::new(12));
    let path = dump(&folder, &recording, [("DO", 0), ("DI", 1)]);
    let run = fieldtap(["read", argument(&path)]).good();
    assert!(run.stderr.contains("LINE   DO ok: 500 kbit/s, 154 cycles"), "{}", run.stderr);
    assert!(run.stderr.contains("as DO and DI with --protocol interbus"), "{}", run.stderr);
}

#[test]
fn a_profile_says_what_is_known() {
    let folder = TempDir::new().expect("a folder");
    let plan = Plan { id_cycles: 0, is_standing: true, ..Plan::plain() };
    let (recording, told) = plan.record_with(150, &[], &mut Chance::new(13));
    let path = dump(&folder, &recording, [("DO", 0), ("DI", 1)]);
    let profile = folder.path().join("line.toml");
    let text = "[[ring]]\nwidth_bits = 32\n[[ring]]\nwidth_bits = 32\ndecoder = \"la66\"\n\
                [[ring]]\nwidth_bits = 16\n[crc]\ninit = \"FFFF\"\nxorout = \"0000\"\n\
                refin = false\nrefout = false\nbyte_order = \"hi-lo\"\ncovers_lbw = true\n";
    std::fs::write(&profile, text).expect("it can be written");
    let read = ["read", "--format", "json", argument(&path), "--protocol", "interbus"];
    let records =
        fieldtap(read.iter().chain(&["--line-profile", argument(&profile)])).good().records();
    assert_eq!(records.iter().filter(|it| it["station"] == 2).count(), told.len());
    assert!(records.iter().all(|it| it["interbus"]["crc"] != "bad"));
    assert_eq!(records[0]["interbus"]["crc"], "ok");
    std::fs::write(&profile, "lbw = 3\n").expect("it can be written");
    let run = fieldtap(read.iter().chain(&["--line-profile", argument(&profile)]));
    assert_eq!(run.status, 2, "{}", run.stderr);
}

/// A serial line and a CAN line under `--protocol interbus`: they are not silent.
#[test]
fn a_line_of_another_protocol_is_not_called_silent() {
    for capture in ["captures/good/baumer.sr", "captures/good-devicenet/line-125k.sr"] {
        let capture = here(capture);
        let run = fieldtap(["read", argument(&capture), "--protocol", "interbus"]).good();
        let told = &run.stderr;
        assert!(told.contains("LINE   not this protocol's: "), "{told}");
        assert!(told.contains("WRONG  not judged: what was heard is another protocol's"), "{told}");
        assert!(!told.contains("silent") && !told.contains("nothing was heard"), "{told}");
    }
}

/// Without options, each wire is a bus: the command that joins them is told, and does so.
#[test]
fn wires_that_were_read_apart_are_told_with_the_command_that_joins_them() {
    let capture = here("captures/good-interbus/line.sr");
    let run = fieldtap(["stats", argument(&capture)]).good();
    let command = format!("fieldtap stats {} --protocol interbus", argument(&capture));
    assert!(run.stderr.contains("DO and DI carry INTERBUS each"), "{}", run.stderr);
    assert!(run.stderr.contains(&command), "{}", run.stderr);
    let run = fieldtap(command.split(' ').skip(1)).good();
    assert!(!run.stderr.contains("read apart"), "{}", run.stderr);
}
