//! The simulator through the built program: its captures, its forms, its manners.

use crate::harness::{Run, Scratch, argument, fieldtap, here};
use serde_json::json;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

fn simulate(arguments: &[&str]) -> Run {
    fieldtap(["simulate", "slin"].iter().chain(arguments))
}

fn simulate_devicenet(arguments: &[&str]) -> Run {
    fieldtap(["simulate", "devicenet"].iter().chain(arguments))
}

/// File and arguments of each row of captures/README.md that was simulated.
fn simulated_captures(table: &str) -> Vec<(&str, Vec<&str>)> {
    let rows = table.lines().filter(|line| line.starts_with("| `"));
    rows.filter_map(|row| {
        let cells: Vec<&str> = row.trim_matches('|').split('|').map(str::trim).collect();
        let options = cells[3].strip_prefix('`')?.trim_end_matches('`');
        Some((cells[0].trim_matches('`'), options.split_whitespace().collect()))
    })
    .collect()
}

#[test]
fn the_captures_are_what_the_table_says() {
    let table = fs::read_to_string(here("captures/README.md")).unwrap();
    let captures = simulated_captures(&table);
    assert!(captures.len() > 120);
    let scratch = Scratch::new();
    for (file, options) in captures {
        let kept = fs::read(here("captures").join(file)).unwrap();
        // How tightly a session is packed is the compressor's business.
        if file.ends_with(".sr") {
            continue;
        }
        let form = file.rsplit('.').next().unwrap();
        let made = scratch.path(&format!("made.{form}"));
        let output = ["-q", "-o", argument(&made)];
        fieldtap(["simulate"].iter().chain(&options).chain(&output)).good();
        assert!(fs::read(made).unwrap() == kept, "{file} is not what {options:?} makes");
    }
}

/// The generator says of its own captures that the fault of their folder is in them.
#[test]
fn devicenet_captures_hold_the_fault_of_their_folder() {
    let table = fs::read_to_string(here("captures/README.md")).unwrap();
    let scratch = Scratch::new();
    let truth = scratch.path("truth.jsonl");
    let is_faulty = |file: &str| !file.starts_with("good") && !file.starts_with("manuals");
    let mut codes = BTreeSet::new();
    for (file, options) in simulated_captures(&table) {
        if options[0] != "devicenet" || !is_faulty(file) {
            continue;
        }
        let form = file.rsplit('.').next().unwrap();
        let made = scratch.path(&format!("made.{form}"));
        let output = ["-q", "-o", argument(&made), "--truth", argument(&truth)];
        fieldtap(["simulate"].iter().chain(&options).chain(&output)).good();
        let code = file.split_once('/').unwrap().0.replacen('-', ".", 1);
        let text = fs::read_to_string(&truth).unwrap();
        let told = |line: serde_json::Value| {
            line["code"] == *code
                || line["bus"]["expect"].as_array().is_some_and(|all| all.contains(&json!(code)))
        };
        let lines = text.lines().map(|line| serde_json::from_str(line).unwrap());
        assert!(lines.into_iter().any(told), "{file}");
        codes.insert(code);
    }
    let list = simulate_devicenet(&["--list-faults"]).good().stdout;
    let all = list.lines().map(|line| line.split_whitespace().nth(1).unwrap().to_owned());
    assert_eq!(codes, all.collect());
}

#[test]
fn every_file_is_in_the_table() {
    let table = fs::read_to_string(here("captures/README.md")).unwrap();
    for folder in fs::read_dir(here("captures")).unwrap() {
        let folder = folder.unwrap().path();
        if !folder.is_dir() {
            continue;
        }
        for file in fs::read_dir(&folder).unwrap() {
            let path = file.unwrap().path();
            let name = path.strip_prefix(here("captures")).unwrap().to_str().unwrap();
            assert!(table.contains(&format!("| `{name}` |")), "{name}");
        }
    }
}

#[test]
fn the_simulator_shares_nothing_with_the_dissectors() {
    let mut files = Vec::new();
    let mut rooms = vec![here("src/commands/simulate"), here("src/simulate")];
    while let Some(room) = rooms.pop() {
        for entry in fs::read_dir(room).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() { rooms.push(path) } else { files.push(path) }
        }
    }
    assert!(files.len() > 20);
    for file in files {
        let text = fs::read_to_string(&file).unwrap();
        assert!(!text.contains("dissectors"), "{}", file.display());
    }
}

#[test]
fn the_truth_has_a_line_an_exchange() {
    let scratch = Scratch::new();
    let (capture, truth) = (scratch.path("truth.pcapng"), scratch.path("truth.jsonl"));
    let files = ["-o", argument(&capture), "--truth", argument(&truth)];
    let options = ["--exchanges", "50", "--fault", "parity=0.3", "--start-time", "1000"];
    simulate(&[&files[..], &options].concat()).good();
    let lines: Vec<serde_json::Value> = fs::read_to_string(&truth)
        .unwrap()
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(lines.len(), 51);
    assert_eq!(lines[0]["bus"]["encoders"][0]["profile"], "baumer");
    // The first request is sent 5 ms after the start.
    assert_eq!(lines[1]["time_ns"], 1_000_005_000_000_i64);
    let struck = lines.iter().filter(|line| line["fault"] == "parity");
    assert!(struck.clone().count() > 3);
    for line in struck {
        assert_eq!(line["expect"], json!(["slin.parity"]));
    }
}

#[test]
fn what_cannot_be_is_refused_before_anything_is_written() {
    for (options, reason) in [
        (&["-o", "x.mp3"][..], "names no form"),
        (&["-o", "-", "--output-format", "sr"], "name a file"),
        (&["-o", "x.chars", "--fault", "overrun"], "only pcapng"),
        (&["-o", "x.sr", "--fault", "wrong-rate"], "have no rate"),
        (&["-o", "x.chars", "--fault", "ambiguous"], "bit 3 is high"),
        (&["-o", "x.chars", "--fault", "noise"], "--list-faults"),
        (&["-o", "x.chars", "--encoders", "8"], "an address is 0 to 7"),
        (&["-o", "x.chars", "--bits", "13+16"], "28 together"),
        (&["-o", "x.chars", "--profile", "7=tr"], "not in --encoders"),
        (&[], "--output"),
    ] {
        let refused = simulate(options);
        assert_eq!(refused.status, 2, "{options:?}");
        assert!(refused.stderr.contains(reason), "{options:?}: {}", refused.stderr);
        assert!(refused.stdout.is_empty() && !Path::new("x.chars").exists());
    }
    assert_eq!(simulate(&["-o", "/nowhere/x.chars"]).status, 3);
}

/// A capture bears its name once all of it is written, and the truth as well.
#[cfg(target_os = "linux")]
#[test]
fn a_run_that_fails_leaves_what_was_there() {
    let scratch = Scratch::new();
    let capture = scratch.file("bus.chars", "as before");
    let failed = simulate(&["-o", argument(&capture), "--truth", "/dev/full"]);
    assert_eq!(failed.status, 3, "{}", failed.stderr);
    assert_eq!(fs::read_to_string(&capture).unwrap(), "as before");
}

#[test]
fn faults_are_listed_with_their_codes() {
    let text = simulate(&["--list-faults"]).good().stdout;
    assert!(text.lines().count() >= 25);
    assert!(text.contains("slin.checksum") && text.contains("wrong under every reading"));
}

#[test]
fn the_truth_of_a_devicenet_bus_has_a_line_a_frame() {
    let scratch = Scratch::new();
    let (log, truth) = (scratch.path("bus.log"), scratch.path("truth.jsonl"));
    let files = ["-o", argument(&log), "--truth", argument(&truth)];
    let options = ["--duration", "8", "--start-time", "1000", "--fault", "no-poll-response=0.05"];
    simulate_devicenet(&[&files[..], &options].concat()).good();
    let lines: Vec<serde_json::Value> = fs::read_to_string(&truth)
        .unwrap()
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(lines[0]["bus"]["encoders"][2]["mac"], 23);
    let frames = lines.iter().filter(|line| line["frame"].is_u64());
    let log = fs::read_to_string(&log).unwrap();
    // The log stamps the end of a frame, in µs.
    for (line, frame) in log.lines().zip(frames.clone()) {
        let end = frame["end_ns"].as_i64().unwrap() / 1_000;
        let (id, data) = (frame["id"].as_str().unwrap(), frame["data"].as_str().unwrap());
        let expected = format!("({:010}.{:06}) can0 {id}#{data}", end / 1_000_000, end % 1_000_000);
        assert_eq!(line, expected);
    }
    assert_eq!(log.lines().count(), frames.count());
    let struck: Vec<_> = lines.iter().filter(|line| line["fault"].is_string()).collect();
    assert!(struck.len() > 3);
    assert!(struck.iter().all(|line| line["code"] == "devicenet.no-poll-response"));
}

#[test]
fn a_devicenet_bus_that_cannot_be_is_refused() {
    for (options, reason) in [
        (&["-o", "x.mp3"][..], "names no form"),
        (&["-o", "x.log", "--bitrate", "1M"], "125k, 250k or 500k"),
        (&["-o", "x.log", "--encoders", "64"], "a MAC ID is 0 to 63"),
        (&["-o", "x.log", "--encoders", "0"], "the scanner's"),
        (&["-o", "x.log", "--mode", "9=cos"], "not in --encoders"),
        (&["-o", "x.log", "--fault", "alarm"], "--assembly 2"),
        (&["-o", "x.log", "--fault", "truncated"], "only pcapng"),
        (&["-o", "x.sr", "--fault", "bus-off"], "line levels have none"),
        (&["-o", "x.sr", "--samplerate", "200k"], "2 samples a bit"),
        (&["-o", "x.log", "--lone"], "alone on the bus"),
    ] {
        let refused = simulate_devicenet(options);
        assert_eq!(refused.status, 2, "{options:?}");
        assert!(refused.stderr.contains(reason), "{options:?}: {}", refused.stderr);
        assert!(refused.stdout.is_empty() && !Path::new("x.log").exists());
    }
}

fn simulate_interbus(arguments: &[&str]) -> Run {
    fieldtap(["simulate", "interbus"].iter().chain(arguments))
}

#[test]
fn a_ring_that_cannot_be_is_refused() {
    for (options, reason) in [
        (&["-o", "x.mp3"][..], "names no form"),
        (&["-o", "x.csv", "--ring", "0133"], "name an la66"),
        (&["-o", "x.csv", "--ring", "0833"], "whole bytes"),
        (&["-o", "x.csv", "--rows", "50"], "50ms"),
        (&["-o", "x.csv", "--fault", "crc"], "only line levels"),
        (&["-o", "x.csv", "--random-profile", "1"], "line levels"),
        (&["-o", "x.csv", "--inverted"], "line levels"),
        (&["-o", "x.csv", "--fault", "withdrawn@2"], "no encoder"),
        (&["-o", "x.sr", "--bitrate", "2M"], "8 samples a bit"),
        (&["-o", "-", "--output-format", "sr"], "name a file"),
        (&["-o", "x.sr", "--profile-file", "/nowhere.toml"], "/nowhere.toml"),
    ] {
        let refused = simulate_interbus(options);
        assert_eq!(refused.status, 2, "{options:?}");
        assert!(refused.stderr.contains(reason), "{options:?}: {}", refused.stderr);
        assert!(refused.stdout.is_empty() && !Path::new("x.csv").exists());
    }
}

/// A profile as a file gives the line that it describes.
#[test]
fn a_line_is_coded_as_its_profile_says() {
    let scratch = Scratch::new();
    let profile = "data_bit_order = \"lsb\"\nidle_level = 0\nlbw = { value = \"1234\", mask = \"FFFF\" }\n\
                   flag_order = [\"TYPE\", \"CR\", \"SL\"]\n[crc]\ninit = \"5A5A\"\nrefin = true\n";
    let profile = scratch.file("profile.toml", profile);
    let (dump, truth) = (scratch.path("line.vcd"), scratch.path("truth"));
    let files = ["-q", "-o", argument(&dump), "--truth", argument(&truth)];
    let options = ["--profile-file", argument(&profile), "--cycle", "0.5", "--duration", "0.005"];
    simulate_interbus(&[&files[..], &options].concat()).good();
    let text = fs::read_to_string(&truth).unwrap();
    let lines: Vec<serde_json::Value> =
        text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let told = &lines[0]["bus"]["profile"];
    assert_eq!(told["flag_order"], json!(["TYPE", "CR", "SL"]));
    assert_eq!((&told["crc"]["init"], &told["crc"]["refin"]), (&json!("5A5A"), &json!(true)));
    assert!(lines[1]["do"].as_str().unwrap().starts_with("1234"));
    // Idle is low on both wires.
    assert!(fs::read_to_string(&dump).unwrap().contains("$enddefinitions $end\n#0 0! 0\"\n"));
}

#[test]
fn what_no_bus_can_be_is_refused_with_its_limit() {
    let refused = |arguments: &[&str], limit: &str| {
        let run = fieldtap(["simulate"].iter().chain(arguments).chain(&["-o", "-"]));
        assert_eq!(run.status, 2, "{arguments:?}: {}", run.stderr);
        assert!(run.stderr.contains(limit), "{arguments:?}: {}", run.stderr);
    };
    let log = ["--output-format", "csv"];
    refused(&[&["interbus", "--cycle", "1e-9"][..], &log].concat(), "--cycle: 0.25 ms at least");
    refused(&[&["interbus", "--rows", "0ms"][..], &log].concat(), "longer than 0 ms");
    // 30 answers of 4 bytes and their acknowledges: 30 x (79 + 47) bits in 10 ms at 125 kbit/s.
    let many: Vec<String> = (1..=30).map(|mac| mac.to_string()).collect();
    let many = many.join(",");
    let cyclic = ["devicenet", "--mode", "cyclic", "--packet-rate", "10", "--encoders", &many];
    let log = ["--output-format", "log"];
    refused(&[&cyclic[..], &log].concat(), "302 % of what 125 kbit/s carry");
}
