//! Logs of an INTERBUS ring: what is summed up of them.

use crate::harness::{Scratch, argument, fieldtap};
use serde_json::Value;

/// Row by row, a ms each: the measuring length is written, and the axis moves on.
const WRITTEN: &str = "time,out,in
0.000,00000000,00012345
0.001,42001388,00012345
0.002,C2001388,00012345
0.003,C2001388,00012345
0.004,C2001388,C2001388
0.005,42001388,C2001388
0.006,42001388,00000100
0.007,42001388,00000102
";

fn line<'a>(text: &'a str, heading: &str) -> &'a str {
    text.lines().find(|line| line.starts_with(heading)).expect("the line is there")
}

#[test]
fn a_service_is_summed_up() {
    let directory = Scratch::new();
    let log = directory.file("written.csv", WRITTEN);
    let run = fieldtap(["stats", "--format", "json", argument(&log)]).good();
    let stats: Value = serde_json::from_str(&run.stdout).expect("one object");
    let station = &stats["stations"][0];
    assert_eq!((&station["asked"], &station["answered"]), (&1.into(), &1.into()));
    // Asked in row 3, acknowledged in row 5.
    assert_eq!(station["services"]["measuring length in steps"], 1);
    assert!(
        (1_990_000..2_010_000).contains(&station["response_time_ns"]["max"].as_i64().unwrap_or(0))
    );
    // 12345h is 74565, 102h is 258, 100h is 256.
    let position = &station["position"];
    let known = ["first", "lowest", "highest", "last"].map(|key| position[key].as_i64());
    assert_eq!(known, [Some(74_565), Some(256), Some(74_565), Some(258)]);
    assert_eq!(position["moved_ns"], 7_000_000);
    assert_eq!(line(&run.stderr, "WHO"), "WHO    asked 1 | answered 1");
}

#[test]
fn devices_that_only_tell_positions_are_heard() {
    let directory = Scratch::new();
    let log =
        directory.file("still.csv", "time,out,in\n0.0,00000000,00000007\n0.1,00000000,00000008\n");
    let run = fieldtap(["stats", argument(&log)]).good();
    assert_eq!(line(&run.stderr, "WHO"), "WHO    asked nobody | answered nobody | heard 1");
    assert!(line(&run.stderr, "WRONG").contains("everything was judged"), "{}", run.stderr);
}

#[test]
fn what_a_coarse_log_cannot_tell_is_open() {
    let directory = Scratch::new();
    let rows = "time,out,in\n0.00,00000000,00000007\n0.05,01000000,00000007\n0.10,81000000,00000007\n0.15,00000000,00000007\n";
    let log = directory.file("coarse.csv", rows);
    let run = fieldtap(["read", argument(&log)]).good();
    let open = line(&run.stderr, "OPEN");
    assert!(open.contains("withdrawn not judged 1 x (rows may be missing"), "{open}");
    let run = fieldtap(["read", "--every-cycle", argument(&log)]).good();
    assert!(line(&run.stderr, "WRONG").contains("withdrawn"), "{}", run.stderr);
}
