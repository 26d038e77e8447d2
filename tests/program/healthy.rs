//! Healthy DeviceNet traffic, as the simulator makes it in every mode: nothing above info, wherever
//! a capture begins, and from the first allocation on the same as if it had begun earlier.

use crate::harness::{Scratch, argument, fieldtap, fieldtap_fed, say};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// All modes on one bus, with heartbeats, fragments and encoders that move.
const MIXED: &str = "--encoders 5,7,23,42 --mode 5=poll --mode 7=strobe --mode 23=cos \
                     --mode 42=cyclic --assembly 2 --heartbeat 1";

fn simulated(scratch: &Scratch, options: &str) -> String {
    let log = scratch.path("bus.log");
    let options = options.split_whitespace();
    let arguments = ["simulate", "devicenet", "-q", "-o", argument(&log)];
    fieldtap(arguments.into_iter().chain(options)).good();
    std::fs::read_to_string(log).expect("it was written")
}

fn read(log: &[&str]) -> Vec<Value> {
    // Where the rate has to be found, it is found the sooner the more there is to find it in.
    let arguments = ["read", "-q", "--bitrate", "125k", "--format", "json", "-"];
    let run = fieldtap_fed(arguments, log.join("\n").as_bytes());
    run.good().stdout.lines().map(|line| serde_json::from_str(line).expect(line)).collect()
}

/// A record whose numbers are so many less.
fn shifted(mut record: Value, by: u64) -> Value {
    let places = ["/n", "/about", "/devicenet/request"].map(str::to_owned);
    let fragments = record["devicenet"]["fragments"].as_array().map_or(0, Vec::len);
    let fragments = (0..fragments).map(|index| format!("/devicenet/fragments/{index}"));
    for place in places.into_iter().chain(fragments) {
        if let Some(number) = record.pointer_mut(&place) {
            *number = json!(number.as_i64().expect("a number") - by as i64);
        }
    }
    record
}

/// The records from this time on, numbered from 0.
fn from(records: Vec<Value>, ns: i64) -> Vec<Value> {
    let is_later = |record: &Value| record["time_ns"].as_i64().is_some_and(|at| at >= ns);
    let later: Vec<Value> = records.into_iter().filter(is_later).collect();
    let first = later[0]["n"].as_u64().expect("a number");
    later.into_iter().map(|record| shifted(record, first)).collect()
}

#[test]
fn a_healthy_bus_is_healthy_from_any_frame_on() {
    let log = simulated(&Scratch::new(), &format!("{MIXED} --scan 100 --duration 8 --seed 3"));
    let lines: Vec<&str> = log.lines().collect();
    let is_allocate = |line: &&str| line.contains("004B0301");
    let allocate = lines.iter().position(is_allocate).expect("the scanner allocates");
    let whole = read(&lines);
    let at = whole[allocate]["time_ns"].as_i64().expect("a time");
    let whole = from(whole, at);
    assert!(allocate > 20 && whole.len() > 400, "{allocate} {}", whole.len());
    for cut in (0..allocate).chain((allocate..lines.len()).step_by(11)) {
        let records = read(&lines[cut..]);
        for finding in records.iter().flat_map(|it| it["findings"].as_array().expect("an array")) {
            assert_eq!(finding["severity"], "info", "cut at {cut}: {finding}");
        }
        if cut <= allocate {
            for (late, whole) in from(records, at).iter().zip(&whole) {
                assert_eq!(late, whole, "cut at {cut}");
            }
        }
    }
}

/// How many findings 100,000 frames of healthy traffic bring in each mode: `docs/measurements.md`
/// has those of as many frames.
#[test]
fn findings_of_healthy_traffic_by_mode() {
    for (mode, options) in [
        ("poll", "--mode poll --duration 24"),
        ("change of state", "--mode cos --duration 30"),
        ("cyclic", "--mode cyclic --duration 40"),
        ("bit-strobe", "--mode strobe --duration 30"),
        ("all of them", &format!("{MIXED} --duration 24")),
        ("explicit", "--scan 200 --packet-rate 400 --errands 30 --motion still --duration 40"),
    ] {
        let scratch = Scratch::new();
        let frames = simulated(&scratch, options).lines().count();
        let log = scratch.path("bus.log");
        let stats = fieldtap(["read", "-q", "--format", "json", argument(&log)]).good().stdout;
        let mut counts: BTreeMap<(String, String), usize> = BTreeMap::new();
        for line in stats.lines().filter(|line| !line.contains("\"findings\":[]")) {
            let record: Value = serde_json::from_str(line).expect(line);
            for finding in record["findings"].as_array().expect("an array") {
                let text = |key: &str| finding[key].as_str().expect("text").to_owned();
                *counts.entry((text("severity"), text("code"))).or_default() += 1;
            }
        }
        let above = counts.keys().filter(|(severity, _)| severity != "info").count();
        assert_eq!(above, 0, "{mode}: {counts:?}");
        // What is written is worth knowing of a healthy bus; all else would be noise.
        assert!(counts.keys().all(|(_, code)| code == "encoder.written"), "{mode}: {counts:?}");
        let each = |((_, code), count): (&(String, String), &usize)| {
            format!("{code} {}", count * 100_000 / frames)
        };
        let infos: Vec<String> = counts.iter().map(each).collect();
        say(&format!(
            "{mode}: nothing above info in {frames} frames; per 100,000: {}",
            infos.join(", ")
        ));
    }
}
