//! Thousands of random exchanges: every fault that the simulator injects is found, and nothing
//! else, in every form a bus can be captured in. The simulator shares nothing with the dissectors
//! and keeps its own account of what must be found.

use crate::harness::{Scratch, argument, fieldtap, fieldtap_fed};
use serde_json::Value;
use std::collections::BTreeSet;

const PROFILES: [&str; 3] = ["baumer", "tr", "tr-reserve-high"];
const RATES: [&str; 4] = ["9600", "19200", "115200", "345594"];
const FORMS: [&str; 4] = ["chars", "pcapng", "sr", "vcd"];
const MOTIONS: [&str; 4] = ["steady", "stop-and-go", "reversing", "still"];

/// Faults of single exchanges. What only some encoders or forms can have is left to its capture.
const FAULTS: [&str; 16] = [
    "parity",
    "framing",
    "checksum",
    "address-mismatch",
    "no-response",
    "missing-footer",
    "too-many-words",
    "duplicate-address",
    "collision",
    "late-response",
    "reserved-bits",
    "stray-data",
    "late-answer",
    "position-jump",
    "glitch",
    "break",
];

/// A stretch of the bus: what must be told in it, and what may.
struct Stretch {
    from: i64,
    expected: BTreeSet<String>,
    allowed: Option<BTreeSet<String>>,
    told: String,
}

/// The account, without its first line, which describes the bus.
fn account(text: &str) -> Vec<Stretch> {
    let codes = |value: &Value| -> BTreeSet<String> {
        let codes = value.as_array().into_iter().flatten();
        codes.map(|code| code.as_str().expect("a code is text").to_owned()).collect()
    };
    let stretch = |line: &str| {
        let told: Value = serde_json::from_str(line).expect(line);
        let expected = codes(&told["expect"]);
        let allowed = (told["may"] != "any").then(|| &codes(&told["may"]) | &expected);
        let from = told["time_ns"].as_i64().expect("a time");
        Stretch { from, expected, allowed, told: line.to_owned() }
    };
    text.lines().skip(1).map(stretch).collect()
}

/// Simulates a bus, reads it, and holds what was found against the account.
fn check(form: &str, simulate: &[&str], read: &[&str]) {
    let scratch = Scratch::new();
    let (capture, truth) = (scratch.path(&format!("bus.{form}")), scratch.path("truth"));
    let mut arguments = vec!["simulate", "slin", "-q", "-o", argument(&capture)];
    arguments.extend(["--truth", argument(&truth), "--samplerate", "8M"]);
    arguments.extend_from_slice(simulate);
    fieldtap(arguments).good();
    let stretches = account(&std::fs::read_to_string(truth).expect("the account was written"));
    let mut arguments = vec!["read", "--format", "json", argument(&capture)];
    arguments.extend_from_slice(read);
    let records = fieldtap(arguments).good().records();

    // Sampled times are off by a few samples, and by the clocks' drift over a character.
    let slack = if matches!(form, "sr" | "vcd") { 60_000 } else { 3_000 };
    let mut found = vec![BTreeSet::new(); stretches.len()];
    for record in &records {
        let time = record["time_ns"].as_i64().expect("a time") + slack;
        let Some(index) = stretches.partition_point(|s| s.from <= time).checked_sub(1) else {
            continue;
        };
        found[index].extend(crate::harness::codes(record));
    }
    // The last exchange may be cut off by the end of the capture.
    let whole = stretches.len() - 1;
    for (stretch, found) in stretches.iter().zip(&found).take(whole) {
        let context = format!("{form} {simulate:?} {read:?}\n{}\nfound {found:?}", stretch.told);
        assert!(stretch.expected.is_subset(found), "missed: {context}");
        if let Some(allowed) = &stretch.allowed {
            assert!(found.is_subset(allowed), "invented: {context}");
        }
    }
}

/// Every profile, rate and form with three faults each, in turn.
#[test]
fn what_was_injected_is_found_and_nothing_else() {
    let mut turn = 0;
    for profile in PROFILES {
        for baud in RATES {
            for form in FORMS {
                turn += 1;
                let seed = turn.to_string();
                let faults: Vec<String> = (0..3)
                    .map(|n| format!("{}=0.03", FAULTS[(turn + 5 * n) % FAULTS.len()]))
                    .collect();
                let mut simulate = vec!["--profile", profile, "--baud", baud, "--seed", &seed];
                simulate.extend(["--exchanges", "150", "--motion", MOTIONS[turn % 4]]);
                simulate.extend(["--scan", "6"]);
                for fault in &faults {
                    simulate.extend(["--fault", fault]);
                }
                check(form, &simulate, &["--profile", profile]);
            }
        }
    }
}

/// Faults that only some buses can have.
#[test]
fn particular_faults_are_found() {
    for (fault, profile, forms) in [
        ("early-response", "tr", &FORMS[..]),
        ("early-response", "tr-reserve-high", &FORMS[..]),
        ("no-data-words", "baumer", &FORMS[..]),
        ("ambiguous", "tr", &FORMS[..]),
        ("late-answer-crossing", "baumer", &FORMS[..]),
        ("lost", "baumer", &["pcapng"][..]),
        ("overrun", "tr", &["pcapng"][..]),
    ] {
        for (seed, form) in (1..).zip(forms) {
            let (fault, seed) = (format!("{fault}=0.05"), seed.to_string());
            let simulate =
                ["--profile", profile, "--seed", &seed, "--exchanges", "300", "--fault", &fault];
            let scan = ["--scan", "7"];
            check(form, &[&simulate[..], &scan[..]].concat(), &["--profile", profile]);
        }
    }
}

/// Encoders, rate, frame and profile are found without being told, and a healthy bus has no
/// finding above info: clocks are off, addresses are scanned in vain, axes stop and go.
#[test]
fn a_healthy_bus_is_healthy() {
    let mut seed = 100;
    for profile in PROFILES {
        for baud in RATES {
            for form in FORMS {
                seed += 1;
                let seed_text = seed.to_string();
                let mut simulate = vec!["--profile", profile, "--baud", baud, "--seed", &seed_text];
                simulate.extend(["--exchanges", "120", "--motion", MOTIONS[seed % 4]]);
                if seed % 2 == 0 {
                    simulate.extend(["--scan", "5,6", "--full"]);
                }
                if seed % 3 == 0 {
                    simulate.push("--fixed-length");
                }
                check(form, &simulate, &[]);
            }
        }
    }
}

/// Wherever a capture of a healthy bus begins and ends, no finding is above info.
#[test]
fn a_healthy_bus_is_healthy_wherever_it_is_cut() {
    for (seed, (profile, baud)) in
        [("baumer", "115200"), ("tr", "9600"), ("tr-reserve-high", "19200")].into_iter().enumerate()
    {
        let scratch = Scratch::new();
        let capture = scratch.path("bus.chars");
        let seed = (seed + 1).to_string();
        let arguments = ["simulate", "slin", "-q", "--exchanges", "12", "--scan", "6"];
        let more =
            ["--profile", profile, "--baud", baud, "--seed", &seed, "-o", argument(&capture)];
        fieldtap(arguments.iter().chain(&more)).good();
        let text = std::fs::read_to_string(&capture).expect("it was written");
        let lines: Vec<&str> = text.lines().collect();
        for cut in 1..lines.len() {
            for piece in [&lines[cut..], &lines[1..=cut]] {
                let input = format!("{}\n{}\n", lines[0], piece.join("\n"));
                let read = fieldtap_fed(["read", "--format", "json", "-"], input.as_bytes()).good();
                for record in read.records() {
                    for finding in record["findings"].as_array().expect("an array") {
                        assert_eq!(finding["severity"], "info", "{profile} cut at {cut}: {record}");
                    }
                }
            }
        }
    }
}

/// A line capture that begins anywhere, inside a character too, brings no character that the whole
/// capture does not have.
#[test]
fn no_character_is_invented_wherever_a_line_capture_begins() {
    const RATE: i64 = 1_000_000;
    let scratch = Scratch::new();
    let capture = scratch.path("bus.vcd");
    let arguments = ["simulate", "slin", "-q", "--exchanges", "4", "--seed", "7", "--samplerate"];
    fieldtap(arguments.iter().chain(&["1M", "-o", argument(&capture)])).good();
    let samples = samples(&std::fs::read_to_string(&capture).expect("it was written"));
    let characters = |samples: &[u8], from: i64| -> BTreeSet<(i64, String)> {
        let arguments = ["read", "--protocol", "uart", "--format", "json", "--input-format"];
        let more = ["logic", "--samplerate", "1M", "--baud", "115200", "--frame", "8E1", "-"];
        let records = fieldtap_fed(arguments.iter().chain(&more), samples).good().records();
        let heard = records.iter().filter(|record| record["kind"] != "event");
        let sample =
            |record: &Value| record["time_ns"].as_i64().expect("a time") * RATE / 1_000_000_000;
        heard.map(|record| (from + sample(record), record["raw"].to_string())).collect()
    };
    let whole = characters(&samples, 0);
    assert!(whole.len() > 16);
    let (begin, end) = (whole.first().expect("characters").0, whole.last().expect("characters").0);
    for cut in (begin..end - 600).step_by(3) {
        let rest = characters(&samples[cut as usize..], cut);
        assert!(rest.is_subset(&whole), "cut at {cut}: {:?}", rest.difference(&whole));
        assert!(!rest.is_empty(), "cut at {cut}");
    }
}

/// The samples of a dump with one wire, at 1 MHz: sigrok's form, `#TIME VALUE!` in units that the
/// header names.
fn samples(dump: &str) -> Vec<u8> {
    let unit = dump.lines().find_map(|line| line.strip_prefix("$timescale ")).expect("a timescale");
    let ns_per_tick = match unit.trim_end_matches(" $end") {
        "1 us" => 1_000,
        "100 ns" => 100,
        "10 ns" => 10,
        "1 ns" => 1,
        other => panic!("{other}"),
    };
    let mut samples = Vec::new();
    let mut level = 1;
    for line in dump.lines().filter_map(|line| line.strip_prefix('#')) {
        let (time, value) = line.split_once(' ').unwrap_or((line, ""));
        let sample = time.parse::<usize>().expect("a time") * ns_per_tick / 1_000;
        samples.resize(sample, level);
        level = match value.as_bytes().first() {
            Some(b'0') => 0,
            Some(b'1') => 1,
            _ => level,
        };
    }
    samples
}
