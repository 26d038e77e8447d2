//! Thousands of handshakes of encoders in a ring: each row is what the simulator's account says,
//! every fault is found where it was injected, and nothing else is. The simulator shares nothing
//! with the dissectors.

use crate::harness::{Scratch, argument, codes, fieldtap};
use serde_json::Value;
use std::collections::BTreeSet;

/// The faults of process data.
const FAULTS: [&str; 17] = [
    "unrequested-acknowledge",
    "service-mismatch",
    "echo-mismatch",
    "error-bit",
    "undefined-service",
    "access",
    "reserved-bits",
    "value-out-of-range",
    "magnet",
    "no-acknowledge",
    "no-release",
    "data-with-service-bit",
    "request-changed",
    "withdrawn",
    "position-jump",
    "repeated-write",
    "written",
];

/// A log, as it was read and as it is.
struct Log {
    records: Vec<Value>,
    /// The rows of the account.
    rows: Vec<Value>,
    /// The faults of the account.
    struck: Vec<Value>,
}

impl Log {
    /// Simulates a ring and reads its log.
    fn of(simulate: &[&str], read: &[&str]) -> Log {
        let scratch = Scratch::new();
        let (log, truth) = (scratch.path("ring.csv"), scratch.path("truth"));
        let files = ["-q", "-o", argument(&log), "--truth", argument(&truth)];
        fieldtap(["simulate", "interbus"].iter().chain(&files).chain(simulate)).good();
        let reading = ["read", "--format", "json", argument(&log)];
        let run = fieldtap(reading.iter().chain(read)).good();
        // So many that checking each against the schemas would take minutes.
        let record = |line| serde_json::from_str(line).expect("a record is JSON");
        let records = run.stdout.lines().map(record).collect();
        let account = std::fs::read_to_string(truth).expect("the account was written");
        let lines = account.lines().map(|line| serde_json::from_str(line).expect(line));
        let (rows, rest): (Vec<Value>, Vec<Value>) =
            lines.skip(1).partition(|line: &Value| line["row"].is_u64());
        Log { records, rows, struck: rest }
    }

    /// The faults that may show on this device at this time.
    fn struck_at(&self, device: &Value, time: i64) -> impl Iterator<Item = &Value> {
        let is_then = move |struck: &&Value| {
            let (from, until) = (ns(struck, "time_ns"), ns(struck, "until_ns"));
            struck["device"] == *device && (from..=until).contains(&time)
        };
        self.struck.iter().filter(is_then)
    }

    /// What the rows mean: kind, service and position of each, unless a fault is in it.
    fn check_rows(&self, context: &str) {
        let records: Vec<&Value> = self.records.iter().filter(|it| it["kind"] != "event").collect();
        assert_eq!(records.len(), self.rows.len(), "{context}");
        for (record, row) in records.into_iter().zip(&self.rows) {
            if self.struck_at(&row["device"], ns(row, "time_ns")).next().is_some() {
                continue;
            }
            let context = format!("{context}\n{row}\n{record}");
            let found = &record["interbus"];
            assert_eq!(record["kind"], row["kind"], "{context}");
            assert_eq!(record["station"], row["device"], "{context}");
            for key in ["out", "in", "position"] {
                assert_eq!(found[key], row[key], "{key}: {context}");
            }
            for key in ["service", "access", "data"].into_iter().filter(|key| !row[key].is_null()) {
                assert_eq!(found[key], row[key], "{key}: {context}");
            }
        }
    }

    /// Every fault is told where it is, and nothing else anywhere.
    fn check_findings(&self, context: &str) {
        let texts = |value: &Value| -> BTreeSet<String> {
            let texts = value.as_array().into_iter().flatten();
            texts.map(|text| text.as_str().expect("text").to_owned()).collect()
        };
        let mut rows = self.rows.iter();
        for record in &self.records {
            let is_event = record["kind"] == "event";
            let row = if is_event { &Value::Null } else { rows.next().expect("a row a record") };
            let found: BTreeSet<String> = codes(record).into_iter().collect();
            let mut expected = texts(&row["expect"]);
            let mut allowed = expected.clone();
            let time = ns(record, "time_ns");
            for struck in self.struck_at(&record["station"], time) {
                allowed.insert(struck["code"].as_str().expect("a code").to_owned());
                allowed.extend(texts(&struck["may"]));
                allowed.insert("interbus.written".to_owned());
                expected.clear();
            }
            let context = format!("{context}\n{row}\n{record}");
            assert!(expected.is_subset(&found), "missed: {context}");
            assert!(found.is_subset(&allowed), "invented: {context}");
        }
        for struck in self.struck.iter().filter(|struck| struck["open"].is_null()) {
            let is_it = |record: &&Value| {
                let time = ns(record, "time_ns");
                record["station"] == struck["device"]
                    && (ns(struck, "time_ns")..=ns(struck, "until_ns")).contains(&time)
            };
            let code = struck["code"].as_str().expect("a code").to_owned();
            let told = self.records.iter().filter(is_it).any(|it| codes(it).contains(&code));
            assert!(told, "missed: {context}\n{struck}");
        }
    }

    /// Nothing is told that is worse than information.
    fn check_health(&self, context: &str) {
        for record in &self.records {
            for finding in record["findings"].as_array().expect("an array") {
                assert_eq!(finding["severity"], "info", "{context}\n{record}");
            }
        }
    }

    /// How often a service was acknowledged.
    fn handshakes(&self) -> usize {
        let is_done = |row: &Value| row["kind"] == "service-acknowledge";
        let pairs = self.rows.windows(2);
        pairs.filter(|two| is_done(&two[1]) && !is_done(&two[0])).count()
    }
}

fn ns(line: &Value, key: &str) -> i64 {
    line[key].as_i64().unwrap_or_else(|| panic!("{key} in {line}"))
}

/// 3000 handshakes, healthy, with a row for every bus cycle.
#[test]
fn a_healthy_encoder_is_healthy_at_every_cycle() {
    let mut handshakes = 0;
    for (seed, motion) in ["steady", "stop-and-go", "reversing", "still"].into_iter().enumerate() {
        let seed = seed.to_string();
        let simulate = [
            "--duration",
            "50",
            "--pause",
            "20",
            "--plc",
            "4",
            "--motion",
            motion,
            "--seed",
            &seed,
        ];
        let log = Log::of(&simulate, &["--every-cycle", "--device", "1=la66:500mm"]);
        log.check_rows(motion);
        log.check_findings(motion);
        log.check_health(motion);
        handshakes += log.handshakes();
    }
    assert!(handshakes > 3_000, "{handshakes}");
}

/// Somebody uses the external preset input, whose value the PLC has read: that is named, and no
/// jump is told.
#[test]
fn an_external_preset_is_named_and_healthy() {
    let (mut used, mut named) = (0, 0);
    for seed in ["1", "2", "3"] {
        let simulate = ["--duration", "40", "--pause", "60", "--external-presets", "--seed", seed];
        let log = Log::of(&simulate, &["--every-cycle"]);
        log.check_rows(seed);
        log.check_findings(seed);
        log.check_health(seed);
        used += log.rows.iter().filter(|row| row["preset"] == true).count();
        for event in log.records.iter().filter(|record| record["kind"] == "event") {
            let summary = event["summary"].as_str().expect("text");
            assert!(summary.ends_with(": external preset input (preset value 1)"), "{event}");
            let about = &event["about"];
            let place = log.records.iter().filter(|record| record["kind"] != "event");
            let row = place.clone().position(|record| record["n"] == *about).expect("a record");
            assert!(log.rows[row]["preset"] == true, "{event}\n{}", log.rows[row]);
            named += 1;
        }
    }
    // A jump by nearly a whole measuring length, and one right behind a service, are not seen.
    assert!(used > 20 && named * 4 > used * 3, "{named} of {used}");
}

/// A log that is coarser than the bus skips states, and that is no fault.
#[test]
fn a_healthy_encoder_is_healthy_in_a_coarse_log() {
    for (seed, rows) in ["50ms", "50ms", "10ms", "23ms", "100ms", "1000ms"].into_iter().enumerate()
    {
        let (pause, seed) = (["30", "100", "400"][seed % 3], seed.to_string());
        let simulate = ["--duration", "100", "--rows", rows, "--pause", pause, "--seed", &seed];
        let log = Log::of(&simulate, &["--device", "1=la66:500mm"]);
        log.check_rows(rows);
        log.check_health(rows);
    }
}

/// Each fault alone, on the second of two encoders.
#[test]
fn each_fault_is_found_where_it_is() {
    for (seed, fault) in (1..).zip(FAULTS) {
        let (order, seed) = (format!("{fault}@3=0.25"), seed.to_string());
        let ring = ["--ring", "la66,0132,la66", "--cycle", "4", "--plc", "8", "--pause", "80"];
        let simulate = ["--duration", "16", "--fault", &order, "--seed", &seed];
        let log = Log::of(&[&ring[..], &simulate].concat(), &["--every-cycle"]);
        assert!(log.struck.iter().all(|it| it["device"] == 3) && log.struck.len() > 3, "{fault}");
        log.check_rows(fault);
        log.check_findings(fault);
    }
}

/// Several faults at a time, PLCs and buses of several speeds.
#[test]
fn faults_among_each_other_are_found_and_nothing_else() {
    for turn in 0..8 {
        let orders: Vec<String> =
            (0..4).map(|n| format!("{}=0.05", FAULTS[(turn + 5 * n) % FAULTS.len()])).collect();
        let seed = (100 + turn).to_string();
        let mut simulate = vec!["--duration", "15", "--pause", "40", "--seed", &seed];
        simulate.extend([
            "--cycle",
            ["1", "2", "4"][turn % 3],
            "--plc",
            ["4", "10", "20"][turn % 3],
        ]);
        simulate.extend(orders.iter().flat_map(|order| ["--fault", order]));
        let log = Log::of(&simulate, &["--every-cycle", "--device", "1=la66:500mm"]);
        log.check_rows(&orders.join(" "));
        log.check_findings(&orders.join(" "));
    }
}

/// Two words of 16 bits are the same log.
#[test]
fn split_words_say_the_same() {
    let simulate = ["--duration", "10", "--pause", "50", "--split-words"];
    let log = Log::of(&simulate, &["--every-cycle"]);
    assert!(log.handshakes() > 50);
    log.check_rows("split");
    log.check_findings("split");
}
