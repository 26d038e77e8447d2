//! How runs end: exit statuses, messages, and the last four lines.

use crate::harness::{Scratch, argument, codes, fieldtap, fieldtap_fed};
use serde_json::Value;
use std::io::{Read, Write};
use std::process::{Command, Stdio};

/// An exchange with encoder 0 (TR SLIN §6: 154 is 1A 01, then the footer) and one whose checksum is
/// too high by one. At 115200 Bd a character takes 95.486 µs; answers begin 250 µs after the
/// request.
const GOOD: &str = "time,byte,parity\n0.000000000,80,ok\n0.000345486,1A,ok\n0.000440972,01,ok\n\
                    0.000536458,98,ok\n";
const WRONG: &str = "0.010000000,80,ok\n0.010345486,1A,ok\n0.010440972,01,ok\n0.010536458,A8,ok\n";

#[test]
fn a_source_that_cannot_be_read_is_status_3_and_says_what_to_do() {
    let scratch = Scratch::new();
    let nothing = scratch.file("nothing.chars", "");
    let unknown = scratch.file("unknown", "neither fish nor fowl");
    for (source, says) in [
        (argument(&nothing), "there is nothing in it"),
        (argument(&scratch.path("absent")), "there is no such file"),
        (argument(&scratch.path("")), "this is a directory"),
        (argument(&unknown), "--input-format"),
    ] {
        let run = fieldtap(["read", source]);
        assert_eq!(run.status, 3, "{source}: {}", run.stderr);
        assert!(run.stderr.contains(says) && run.stderr.contains(source), "{}", run.stderr);
        assert!(!run.stderr.contains("panicked"), "{}", run.stderr);
    }
}

#[test]
fn what_comes_before_a_bad_line_is_decoded() {
    let run =
        fieldtap_fed(["read", "--format", "json", "-"], (GOOD.to_owned() + "0.02,8").as_bytes());
    assert_eq!(run.status, 3);
    assert_eq!(run.records().len(), 2);
    assert!(run.stderr.contains("standard input: line 6: not a character"), "{}", run.stderr);
}

#[test]
fn a_capture_with_nothing_in_it_is_good() {
    let run = fieldtap_fed(["read", "-"], b"time,byte,parity\n").good();
    assert_eq!(run.stdout, "");
    assert!(run.stderr.contains("LINE   silent"), "{}", run.stderr);
}

#[test]
fn findings_change_the_status_only_when_asked_to() {
    let capture = GOOD.to_owned() + WRONG;
    let read = |more: &[&str]| {
        let arguments = ["read", "--format", "json", "-"].into_iter().chain(more.iter().copied());
        fieldtap_fed(arguments, capture.as_bytes())
    };
    let plain = read(&[]).good();
    assert_eq!(codes(plain.records().last().expect("there are records")), ["slin.checksum"]);
    assert_eq!(read(&["--fail-on", "error"]).status, 1);
    assert_eq!(read(&["--fail-on", "warning"]).status, 1);
    assert_eq!(fieldtap_fed(["read", "--fail-on", "warning", "-"], GOOD.as_bytes()).status, 0);
    // A source that failed outranks findings.
    let cut = capture.clone() + "?";
    assert_eq!(fieldtap_fed(["read", "--fail-on", "error", "-"], cut.as_bytes()).status, 3);
}

#[test]
fn a_wrong_command_line_is_status_2() {
    for arguments in [
        &["read"][..],
        &["read", "--profile", "siemens", "x"],
        &["read", "--frame", "8X1", "x"],
        &["read", "--baud", "0", "x"],
        &["explain", "slin.nonsense"],
        &["convert", "in.sr", "out.unknown"],
        &["frobnicate"],
    ] {
        assert_eq!(fieldtap(arguments).status, 2, "{arguments:?}");
    }
}

#[test]
fn the_last_lines_say_what_a_technician_asks_first() {
    let run = fieldtap_fed(["read", "--profile", "baumer", "-"], GOOD.as_bytes()).good();
    let lines: Vec<&str> = run.stderr.lines().rev().take(4).collect();
    let [open, wrong, who, line] = lines[..] else { panic!("{}", run.stderr) };
    assert_eq!(line, "LINE   ok: 115200 8E1, 4 characters, 0 damaged (0.00 %)");
    assert_eq!(who, "WHO    asked 0 | answered 0");
    assert_eq!(wrong, "WRONG  nothing found in 2 records; everything was judged");
    assert_eq!(open, "OPEN   nothing");
}

#[test]
fn silent_stations_are_named_with_their_count() {
    // Encoder 2 is asked twice between answers of encoder 0.
    let capture = GOOD.to_owned() + "0.003,82,ok\n0.006,82,ok\n" + WRONG;
    let run = fieldtap_fed(["stats", "--profile", "baumer", "-"], capture.as_bytes()).good();
    assert!(
        run.stderr.contains("WHO    asked 0 2 | answered 0 | never 2 (0 of 2)"),
        "{}",
        run.stderr
    );
    assert!(
        run.stdout.contains("WHO    asked 0 2 | answered 0 | never 2 (0 of 2)"),
        "{}",
        run.stdout
    );
    assert!(run.stderr.contains("WRONG  0: 1 x checksum"), "{}", run.stderr);
}

#[test]
fn every_request_of_a_silence_is_counted() {
    // Encoder 0 answers, is silent for 500 requests from 1 s on, 20 ms apart, and answers again.
    let silence: String =
        (50..550).map(|n| format!("{}.{:02}0,80,ok\n", n / 50, n % 50 * 2)).collect();
    let answer = "11.000000,80,ok\n11.000345,1A,ok\n11.000440,01,ok\n11.000536,98,ok\n";
    let capture = GOOD.to_owned() + &silence + answer;
    let stats = ["stats", "--format", "json", "--profile", "baumer", "-"];
    let run = fieldtap_fed(stats, capture.as_bytes()).good();
    let stats: Value = serde_json::from_str(&run.stdout).expect("an object");
    let finding = &stats["findings"][0];
    assert_eq!((&finding["code"], &finding["count"]), (&"slin.no-response".into(), &500.into()));
    // The last one is asked at 10.98 s.
    assert_eq!(finding["first_ns"], 1_000_000_000_i64);
    assert_eq!(finding["last_ns"], 10_980_000_000_i64);
    assert!(
        run.stderr.contains("WRONG  0: 500 x no-response, 1.000 s to 10.980 s"),
        "{}",
        run.stderr
    );
    // Yet it is told as a state: twice singly, its begin, its end.
    let read = ["read", "--format", "json", "--profile", "baumer", "-"];
    let records = fieldtap_fed(read, capture.as_bytes()).good().records();
    let told = records.iter().flat_map(codes).filter(|code| code == "slin.no-response");
    assert_eq!(told.count(), 4);
}

#[test]
fn a_closed_pipe_ends_quietly() {
    let mut capture = GOOD.to_owned();
    for n in 0..20_000 {
        capture += &format!("{}.{:04}00000,80,ok\n", 1 + n / 10_000, n % 10_000);
    }
    let scratch = Scratch::new();
    let file = scratch.file("long.chars", capture);
    let mut child = Command::new(env!("CARGO_BIN_EXE_fieldtap"))
        .args(["read", argument(&file)])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program is there");
    let mut stdout = child.stdout.take().expect("it is piped");
    let mut first = [0; 100];
    stdout.read_exact(&mut first).expect("it prints");
    drop(stdout);
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
}

#[test]
fn quiet_is_quiet() {
    let run = fieldtap_fed(["read", "-q", "-"], GOOD.as_bytes()).good();
    assert_eq!(run.stderr, "");
}

/// A sigrok session with these samples at 1 MHz, one byte each.
fn session(metadata: &[u8], chunks: &[(&str, &[u8])]) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let plain = zip::write::SimpleFileOptions::default();
    let header = "[device 1]\ncapturefile=logic-1\nsamplerate=1 MHz\nunitsize=1\n";
    let metadata = [header.as_bytes(), metadata].concat();
    for (name, bytes) in
        [("version", &b"2"[..]), ("metadata", &metadata)].into_iter().chain(chunks.iter().copied())
    {
        archive.start_file(name, plain).expect("it is in memory");
        archive.write_all(bytes).expect("it is in memory");
    }
    archive.finish().expect("it is in memory").into_inner()
}

#[test]
fn a_session_that_lacks_something_is_not_taken_for_whole() {
    let scratch = Scratch::new();
    let samples: &[u8] = &[1; 1000];
    let many: String = (1..=2000).map(|n| format!("probe{n}=D{n}\n")).collect();
    for (metadata, chunks, says) in [
        ("probe1=A\n", &[("logic-1-1", samples), ("logic-1-3", samples)][..], "logic-1-2"),
        ("probe1=A\n", &[], "logic-1 cannot be unpacked: it is missing"),
        ("", &[("logic-1", samples)], "no logic channels"),
        ("probe9=A\n", &[("logic-1", samples)], "channel A is bit 8 of samples of 1 bytes"),
        (&many, &[("logic-1", samples)], "the metadata is damaged"),
    ] {
        let file = scratch.file("it.sr", session(metadata.as_bytes(), chunks));
        let run = fieldtap(["read", argument(&file)]);
        assert_eq!(run.status, 3, "{says}: {}", run.stderr);
        assert!(run.stderr.contains(says), "{says}: {}", run.stderr);
    }
    // A name that is no UTF-8 is still a channel.
    let bytes = session(b"probe1=A\xE4B\n", &[("logic-1", samples)]);
    let run = fieldtap(["read", argument(&scratch.file("latin.sr", bytes))]);
    assert!(!run.stderr.contains("UTF-8"), "{}", run.stderr);
}

#[test]
fn absurd_times_are_errors_of_their_line() {
    for time in ["1e2147483647", "-1e2147483647", "9e99"] {
        let text = format!("time,byte,parity\n{time},83,ok\n");
        let run = fieldtap_fed(["read", "-"], text.as_bytes());
        assert!(!run.stderr.contains("panicked"), "{time}: {}", run.stderr);
        assert!(run.status == 3 && run.stderr.contains("line 2"), "{time}: {}", run.stderr);
    }
}

#[cfg(unix)]
#[test]
fn nobody_need_read_the_messages() {
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").expect("Linux has it");
    let status = Command::new(env!("CARGO_BIN_EXE_fieldtap"))
        .args(["stats", "--fail-on", "error"])
        .arg(crate::harness::here("captures/slin-parity/parity.pcapng"))
        .stdout(Stdio::null())
        .stderr(full)
        .status()
        .expect("the program is there");
    assert_eq!(status.code(), Some(1));
}
