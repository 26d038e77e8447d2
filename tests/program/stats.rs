//! The tables of `stats`: what their numbers are worth, and in which order stations stand.

use crate::harness::fieldtap_fed;

/// Stamps of whole milliseconds. A character takes 11 bits at 115200 Bd, 95.486 µs, and so the
/// answers begin 904.514 µs after the request's end; with ± 1 ms of each stamp, 2.904 ms at most.
const COARSE: &[u8] = b"0.000,83,ok\n0.001,1A,ok\n0.001,01,ok\n0.001,9B,ok\n\
    0.011,80,ok\n0.012,1A,ok\n0.012,01,ok\n0.012,98,ok\n0.021,81,ok\n";

const OPTIONS: [&str; 7] =
    ["--profile", "baumer", "--baud", "115200", "--input-format", "chars", "-"];

#[test]
fn a_time_below_its_uncertainty_is_told_by_what_it_is_at_most() {
    let run = fieldtap_fed(["stats", "-q"].iter().chain(&OPTIONS), COARSE).good();
    let lines: Vec<&str> = run.stdout.lines().collect();
    let cells = |line: &str| {
        let cells = line.split("  ").map(str::trim).filter(|cell| !cell.is_empty());
        cells.map(str::to_owned).collect::<Vec<_>>()
    };
    let times = ["< 2.90 ms"; 4];
    // By number, though 3 was asked first.
    assert_eq!(cells(lines[1]), [&["serial", "0", "1", "1"], &times[..]].concat());
    assert_eq!(cells(lines[2])[1], "1");
    assert!(lines[2].ends_with("-          -          -          -"), "{}", lines[2]);
    assert_eq!(cells(lines[3]), [&["serial", "3", "1", "1"], &times[..]].concat());
    assert_eq!(lines[4], "times ±2.00 ms: two stamps");
    assert_eq!(lines[5], "-: no answer to a request was timed");
}

#[test]
fn a_sentence_says_what_the_time_is_at_most() {
    let run = fieldtap_fed(["read", "-q"].iter().chain(&OPTIONS), COARSE).good();
    assert!(run.stdout.contains("0 answers 154 in under 2.90 ms\n"), "{}", run.stdout);
}

#[test]
fn scripts_are_told_the_uncertainty() {
    let form = ["stats", "-q", "--format", "json"];
    let run = fieldtap_fed(form.iter().chain(&OPTIONS), COARSE).good();
    let told: serde_json::Value = serde_json::from_str(&run.stdout).expect("it is JSON");
    assert_eq!(told["stations"][0]["response_time_uncertainty_ns"], 2_000_000);
    assert!(told["stations"][1]["response_time_uncertainty_ns"].is_null());
}

/// Who sees nothing for minutes takes it for hung.
#[cfg(target_os = "linux")]
#[test]
fn a_tap_is_said_to_be_counted_before_anything_is_shown() {
    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
    use std::io::{BufRead, BufReader};
    use std::process::{Command, Stdio};
    let line = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)
        .expect("a pseudo terminal");
    grantpt(&line).expect("it is ours");
    unlockpt(&line).expect("it is ours");
    let port = ptsname(&line, Vec::new()).expect("it has a name").into_string().expect("UTF-8");
    let mut child = Command::new(env!("CARGO_BIN_EXE_fieldtap"))
        .args(["stats", "--baud", "115200", &format!("serial:{port}")])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program is there");
    let mut told = BufReader::new(child.stderr.take().expect("it is piped")).lines();
    let first = told.next().expect("a line").expect("UTF-8");
    assert_eq!(first, "fieldtap: counting; Ctrl-C shows the tables");
    let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(killed.expect("kill is there").success());
    assert!(told.any(|line| line.expect("UTF-8").starts_with("OPEN ")));
    assert_eq!(child.wait().expect("it ends").code(), Some(0));
}
