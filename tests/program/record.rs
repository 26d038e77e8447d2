//! Recordings: what is on disk, whatever ends them.

use crate::harness::{Run, Scratch, argument, codes, fieldtap, fieldtap_fed, here};
use crate::peers::{ask, miss, run_peer};
use serde_json::Value;
use std::fmt::Write as _;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// The files in a directory, sorted.
fn files(directory: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(directory).expect("the directory is there");
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.expect("readable").path()).collect();
    files.sort();
    files
}

fn is_whole(file: &Path) -> bool {
    file.extension().is_some_and(|extension| extension == "pcapng")
}

/// `read --format json` of these files.
fn read(files: &[PathBuf]) -> Run {
    let files = files.iter().map(|file| argument(file));
    fieldtap(["read", "--format", "json"].into_iter().chain(files))
}

/// An exchange with encoder 0 that begins at this time (TR SLIN §6: 154 is 1A 01, then the footer).
/// At 115200 Bd a character takes 95.486 µs; the answer begins 250 µs after the request.
fn exchange(at_ns: u64, parity: &str) -> String {
    let mut text = String::new();
    for (offset, byte, parity) in
        [(0, 0x80, "ok"), (345_486, 0x1A, parity), (440_972, 0x01, "ok"), (536_458, 0x98, "ok")]
    {
        let ns = at_ns + offset;
        // A String takes any text.
        let _ =
            writeln!(text, "{}.{:09},{byte:02X},{parity}", ns / 1_000_000_000, ns % 1_000_000_000);
    }
    text
}

/// A minute and a half of exchanges, ten a second, with a parity error at these seconds.
fn ninety_seconds(bad: &[u64]) -> String {
    let mut text = "time,byte,parity\n".to_owned();
    for n in 0..900 {
        let is_bad = n % 10 == 0 && bad.contains(&(n / 10));
        text += &exchange(n * 100_000_000, if is_bad { "error" } else { "ok" });
    }
    text
}

fn start(arguments: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_fieldtap"))
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program is there")
}

/// Sends each of these signals 1 ms after the one before.
fn kill_again(child: &Child, signals: [&str; 2]) {
    let [first, second] = signals.map(|signal| format!("kill {signal} {}", child.id()));
    let command = format!("{first}; sleep 0.001; {second}");
    let killed = Command::new("sh").args(["-c", &command]).status();
    assert!(killed.expect("sh is there").success());
}

fn kill(child: &Child, signal: &str) {
    let killed = Command::new("kill").args([signal, &child.id().to_string()]).status();
    assert!(killed.expect("kill is there").success());
}

/// Waits until something holds, for ten seconds at most.
fn wait_for(what: &str, mut holds: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !holds() {
        assert!(begin.elapsed() < Duration::from_secs(10), "{what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn a_recording_reads_like_what_was_recorded() {
    for capture in [
        "captures/good/tr-115200.pcapng",
        "captures/good/tr.chars",
        "captures/slin-parity/one-station.pcapng",
        "captures/good-devicenet/errands.log",
    ] {
        let scratch = Scratch::new();
        let bytes = std::fs::read(here(capture)).expect(capture);
        let directory = scratch.path("tape");
        let run = fieldtap_fed(["record", "-", "-w", argument(&directory)], &bytes).good();
        assert!(run.stderr.contains("recorded ") && run.stderr.contains("in 1 file;"), "{run:?}");
        assert!(run.stderr.contains("-> fieldtap read"), "{}", run.stderr);
        let live = fieldtap_fed(["read", "--format", "json", "-"], &bytes).good();
        let saved = read(&files(&directory)).good();
        assert_eq!(saved.stdout, live.stdout, "{capture}");
        let last = |run: &Run| run.stderr.lines().rev().take(4).map(str::to_owned).collect();
        let (saved, live): (Vec<String>, Vec<String>) = (last(&saved), last(&live));
        assert_eq!(saved, live, "{capture}");
    }
}

/// A name without content is what a power cut leaves of a file that was renamed too early.
#[test]
fn a_file_is_on_the_disk_before_it_has_its_name() {
    if ask("strace", "strace", &["-V"]).is_none() {
        return;
    }
    let scratch = Scratch::new();
    let (log, directory) = (scratch.file("calls", ""), scratch.path("tape"));
    let heard = scratch.file("heard.chars", ninety_seconds(&[]));
    let recording = Command::new("strace")
        .args(["-f", "-y", "-e", "trace=write,fsync,fdatasync,rename,renameat,renameat2", "-o"])
        .arg(&log)
        .args([env!("CARGO_BIN_EXE_fieldtap"), "record", "-q", "--ring", "duration=30s", "-w"])
        .args([&directory, &heard])
        .status();
    assert!(recording.expect("it was there").success());
    assert_eq!(files(&directory).len(), 3);
    let calls = std::fs::read_to_string(&log).expect("it was written");
    for file in files(&directory) {
        let whole = argument(&file);
        let part = format!("{whole}.part");
        let mut calls = calls.lines().enumerate();
        let mut after = |what: &str, is_it: &dyn Fn(&str) -> bool| {
            let found = calls.find(|(_, call)| is_it(call));
            assert!(found.is_some(), "{what} of {part}");
        };
        after("a write", &|call| call.contains("write(") && call.contains(&part));
        after("a sync", &|call| call.contains("fsync(") && call.contains(&part));
        after("the name", &|call| call.contains("rename") && call.contains(&part));
        let directory = format!("<{}>", argument(&directory));
        after("a sync of the folder", &|call| call.contains("fsync(") && call.contains(&directory));
        let synced = calls.any(|(_, call)| call.contains("write(") && call.contains(&part));
        assert!(!synced, "nothing is written to {part} behind that");
    }
}

#[test]
fn a_killed_recording_reads_back_to_within_a_second() {
    let scratch = Scratch::new();
    let directory = scratch.path("tape");
    let mut child = start(&["record", "-", "--baud", "115200", "-w", argument(&directory)]);
    let mut stdin = child.stdin.take().expect("it is piped");
    stdin.write_all(b"time,byte,parity\n").expect("it reads");
    let begin = Instant::now();
    // From when on it listens, it hears something every 20 ms, for 2.5 s.
    while begin.elapsed() < Duration::from_millis(2_500) {
        let now = begin.elapsed().as_nanos() as u64;
        stdin.write_all(exchange(now, "ok").as_bytes()).expect("it reads");
        std::thread::sleep(Duration::from_millis(20));
    }
    let end = begin.elapsed().as_nanos() as i64;
    kill(&child, "-KILL");
    child.wait().expect("it ends");
    let files = files(&directory);
    assert!(files.len() == 1 && !is_whole(&files[0]), "{files:?}");
    let run = read(&files);
    let last = run.records().last().expect("records").clone();
    let last = last["time_ns"].as_i64().expect("it has times");
    assert!(end - last < 1_000_000_000, "{last} of {end}");
    assert!(run.status == 0 || run.stderr.contains("it was cut"), "{}", run.stderr);

    // Cut inside the last block, it is told, and what is before is read.
    let bytes = std::fs::read(&files[0]).expect("it is there");
    let cut = scratch.file("cut.pcapng.part", &bytes[..bytes.len() - 5]);
    let again = read(&[cut]);
    assert_eq!(again.status, 3);
    assert!(again.stderr.contains("it was cut"), "{}", again.stderr);
    assert!(again.records().len() + 2 >= run.records().len());
}

#[test]
fn a_ring_keeps_the_newest() {
    let scratch = Scratch::new();
    let directory = scratch.path("tape");
    let capture = ninety_seconds(&[]);
    let arguments = [
        "record",
        "-",
        "--baud",
        "115200",
        "--ring",
        "files=3,duration=10s",
        "-w",
        argument(&directory),
    ];
    let run = fieldtap_fed(arguments, capture.as_bytes()).good();
    assert!(run.stderr.contains("in 9 files"), "{}", run.stderr);
    let files = files(&directory);
    assert_eq!(files.len(), 3, "{files:?}");
    assert!(files.iter().all(|file| is_whole(file)));
    let records = read(&files).good().records();
    let time = |record: &Value| record["time_ns"].as_i64().expect("it has times") as f64 / 1e9;
    // The last three of nine times ten seconds; blocks of 0.1 s stay together.
    let begin = time(&records[0]);
    assert!((59.9..60.3).contains(&begin), "{begin}");
    // Ten exchanges a second, two records each, and none is missing.
    let expected = (90.0 - begin) * 20.0;
    assert!((records.len() as f64 - expected).abs() < 2.0, "{expected}");
}

#[test]
fn a_flight_recorder_keeps_what_surrounds_events() {
    let scratch = Scratch::new();
    let directory = scratch.path("tape");
    // The windows of 40 s and 44 s overlap.
    let capture = ninety_seconds(&[40, 44, 80]);
    let arguments = ["record", "-", "--baud", "115200", "--trigger", "slin.parity"];
    let window = ["--before", "3s", "--after", "2s", "-w", argument(&directory)];
    let run = fieldtap_fed(arguments.into_iter().chain(window), capture.as_bytes()).good();
    assert!(run.stderr.contains("3 events") && run.stderr.contains("in 2 files"), "{}", run.stderr);
    // It was decoded: the last lines say what was found.
    assert!(run.stderr.contains("WRONG  0: 3 x parity"), "{}", run.stderr);
    let files = files(&directory);
    assert_eq!(files.len(), 2, "{files:?}");
    for (file, first, last, events) in [(&files[0], 37.0, 46.0, 2), (&files[1], 77.0, 82.0, 1)] {
        let records = read(std::slice::from_ref(file)).good().records();
        let time = |record: &Value| record["time_ns"].as_i64().expect("times") as f64 / 1e9;
        let (begin, end) = (time(&records[0]), time(records.last().expect("records")));
        // An exchange every 0.1 s; blocks of 0.1 s are kept or not as a whole.
        assert!((begin - first).abs() < 0.25 && (end - last).abs() < 0.25, "{begin} to {end}");
        let found = records.iter().flat_map(codes).filter(|code| code == "slin.parity");
        assert_eq!(found.count(), events);
    }
}

/// A ring of a flight recorder keeps the files of the last events.
#[test]
fn a_ring_keeps_the_last_events() {
    let scratch = Scratch::new();
    let directory = scratch.path("tape");
    let capture = ninety_seconds(&[10, 30, 50, 70]);
    let arguments = ["record", "-", "--baud", "115200", "--trigger", "slin.parity"];
    let kept = ["--ring", "files=2", "--before", "3", "--after", "2"];
    let into = ["-w", argument(&directory)];
    let arguments = arguments.into_iter().chain(kept).chain(into);
    let run = fieldtap_fed(arguments, capture.as_bytes()).good();
    assert!(run.stderr.contains("4 events") && run.stderr.contains("in 4 files"), "{}", run.stderr);
    let records = read(&files(&directory)).good().records();
    let bad = records.iter().filter(|record| codes(record).iter().any(|it| it == "slin.parity"));
    let seconds: Vec<i64> =
        bad.map(|record| record["time_ns"].as_i64().expect("times") / 1_000_000_000).collect();
    assert_eq!((files(&directory).len(), seconds), (2, vec![50, 70]));
}

/// Parity is not known of every port, and no event comes where it is not.
#[test]
fn a_trigger_that_waits_for_nothing_is_told_at_the_start() {
    let scratch = Scratch::new();
    let capture =
        fieldtap(["convert", "-q", "captures/good/tr.chars", "-", "--output-format", "chars"]);
    let unknown = capture.stdout.replace(",ok", ",unknown");
    for (chars, is_told) in [(&unknown, true), (&capture.stdout, false)] {
        let tape = scratch.path(&format!("tape-{is_told}"));
        let bus = scratch.file("bus.chars", chars);
        let pcapng = scratch.path(&format!("{is_told}.pcapng"));
        fieldtap(["convert", "-q", argument(&bus), argument(&pcapng)]);
        let trigger = ["--trigger", "parity", "-w", argument(&tape)];
        let run = fieldtap(["record", argument(&pcapng)].into_iter().chain(trigger)).good();
        let told = run.stderr.contains("warning: --trigger slin.parity: the parity");
        assert_eq!(told, is_told, "{}", run.stderr);
    }
}

/// Between two files of a flight recorder is what it let go. Each says so where it begins, and what
/// comes behind is not compared with what came before: an axis that moved meanwhile did not jump.
#[test]
fn files_of_a_flight_recorder_are_joined_without_a_false_word() {
    let scratch = Scratch::new();
    let slin = "slin --fault parity=0.001 --motion steady --encoders 2 --pause 20 --duration 120";
    let devicenet = "devicenet --fault dropped=0.001 --encoders 7 --duration 90";
    for (bus, ending) in [(slin, "chars"), (devicenet, "log")] {
        let capture = scratch.path(&format!("bus.{ending}"));
        let simulated = ["simulate"].into_iter().chain(bus.split(' '));
        fieldtap(simulated.chain(["-o", argument(&capture)])).good();
        let tape = scratch.path(&format!("tape-{ending}"));
        let record = ["record", argument(&capture), "--baud", "115200", "--bitrate", "125k"];
        let around = ["--trigger", "warning", "--before", "1s", "--after", "1s"];
        fieldtap(record.into_iter().chain(around).chain(["-w", argument(&tape)])).good();
        let files = files(&tape);
        assert!(files.len() > 1, "{bus}: {files:?}");
        let is_gap = |record: &Value| record["summary"].to_string().contains("nothing was kept");
        let joined = read(&files);
        let mut gaps = 0;
        for file in &files {
            let records = read(std::slice::from_ref(file)).records();
            gaps += usize::from(is_gap(&records[0]));
            assert!(!records[1..].iter().any(is_gap), "{bus}: {file:?}");
        }
        // Two that follow each other have nothing between them.
        assert!(gaps > 2, "{bus}: {gaps} of {files:?}");
        let records = joined.records();
        let told: Vec<&Value> = records.iter().filter(|record| is_gap(record)).collect();
        assert_eq!(told.len(), gaps, "{bus}");
        assert!(told.iter().all(|gap| gap["kind"] == "lost" && codes(gap).is_empty()));
        let whole = fieldtap(["read", "--format", "json", argument(&capture)]).records();
        let found: Vec<String> = records.iter().flat_map(codes).collect();
        let real: Vec<String> = whole.iter().flat_map(codes).collect();
        assert!(found.iter().all(|code| real.contains(code)), "{bus}: {found:?}");
        let open = format!("what was on the line while nothing was kept, {gaps} x");
        assert!(joined.stderr.contains(&open), "{}", joined.stderr);
        assert!(ending == "log" || !joined.stderr.contains("loss"), "{}", joined.stderr);
        // Converted, they are one file that says the same.
        let one = scratch.path(&format!("one-{ending}.pcapng"));
        let first = argument(&files[1]);
        fieldtap(["convert", first, argument(&one), "--bitrate", "125k"]).good();
        assert!(is_gap(&read(&[one]).records()[0]), "{bus}");
    }
}

/// A minute of exchanges, ten a second. Before this one, the clock is set back by an hour.
const SET_BACK: u64 = 200;

/// Its capture, with a parity error in these exchanges.
fn set_back(bad: &[u64]) -> String {
    const BEGIN: u64 = 1_795_335_300_000_000_000;
    let mut text = "time,byte,parity\n".to_owned();
    for n in 0..600 {
        let behind = if n < SET_BACK { 0 } else { 3_600_000_000_000 };
        let parity = if bad.contains(&n) { "error" } else { "ok" };
        text += &exchange(BEGIN + n * 100_000_000 - behind, parity);
    }
    text
}

#[test]
fn a_clock_that_is_set_back_costs_a_flight_recorder_nothing() {
    let scratch = Scratch::new();
    let directory = scratch.path("tape");
    // One whose surroundings are on both sides of it, and one behind.
    let capture = set_back(&[195, 400]);
    let arguments = ["record", "-", "--baud", "115200", "--trigger", "slin.parity"];
    let window = ["--before", "3s", "--after", "2s", "-w", argument(&directory)];
    let run = fieldtap_fed(arguments.into_iter().chain(window), capture.as_bytes()).good();
    assert!(run.stderr.contains("2 events") && run.stderr.contains("in 2 files"), "{}", run.stderr);
    let files = files(&directory);
    // The later one bears the earlier time.
    for file in [&files[1], &files[0]] {
        let records = read(std::slice::from_ref(file)).good().records();
        // Five seconds of ten exchanges of two records; blocks of 0.1 s are kept or not as a whole.
        assert!((98..=108).contains(&records.len()), "{}", records.len());
        let found = records.iter().flat_map(codes).filter(|code| code == "slin.parity");
        assert_eq!(found.count(), 1);
    }
    let begin = |file: &Path| file.file_name().map(|name| name.to_string_lossy().into_owned());
    // 16.5 s and 37 s after 08:15:00, less an hour.
    assert_eq!(begin(&files[1]).as_deref(), Some("fieldtap-20261122T081516Z-0001.pcapng"));
    assert_eq!(begin(&files[0]).as_deref(), Some("fieldtap-20261122T071537Z-0002.pcapng"));
}

#[test]
fn an_event_at_the_very_end_is_kept_and_none_leaves_nothing() {
    for (bad, count) in [(&[89_u64][..], 1), (&[], 0)] {
        let scratch = Scratch::new();
        let directory = scratch.path("tape");
        let capture = ninety_seconds(bad);
        let arguments =
            ["record", "-", "--baud", "115200", "--trigger", "error", "-w", argument(&directory)];
        fieldtap_fed(arguments, capture.as_bytes()).good();
        assert_eq!(files(&directory).iter().filter(|file| is_whole(file)).count(), count);
        assert_eq!(files(&directory).len(), count);
    }
}

#[test]
fn a_write_to_an_encoder_is_an_event() {
    let scratch = Scratch::new();
    let directory = scratch.path("tape");
    let capture = here("captures/good-devicenet/errands.log");
    let arguments = ["record", argument(&capture), "--trigger", "encoder.written"];
    let window = ["--before", "100ms", "--after", "0s", "-w", argument(&directory)];
    let run = fieldtap(arguments.into_iter().chain(window)).good();
    let is_written = |record: &&Value| codes(record).contains(&"encoder.written".to_owned());
    let all = fieldtap(["read", "--format", "json", argument(&capture)]).good().records();
    let written = all.iter().filter(is_written).count();
    assert!(written > 0 && run.stderr.contains(&format!(", {written} event")), "{}", run.stderr);
    let kept = read(&files(&directory)).good().records();
    assert!(kept.len() < all.len(), "{} of {}", kept.len(), all.len());
    // What an answer means may need what came long before; the frames of all writes are there.
    let stamp = |record: &Value| (record["time_ns"].as_i64(), record["raw"].to_string());
    for record in all.iter().filter(is_written) {
        assert!(kept.iter().any(|kept| stamp(kept) == stamp(record)), "{record}");
    }
}

#[test]
fn signals_end_a_recording_well() {
    for signal in ["-INT", "-TERM", "-HUP"] {
        let scratch = Scratch::new();
        let directory = scratch.path("tape");
        let mut child = start(&["record", "-", "--baud", "115200", "-w", argument(&directory)]);
        let mut stdin = child.stdin.take().expect("it is piped");
        let capture = "time,byte,parity\n".to_owned() + &exchange(0, "ok");
        stdin.write_all(capture.as_bytes()).expect("it reads");
        wait_for("it records", || directory.exists() && files(&directory).len() == 1);
        assert!(!is_whole(&files(&directory)[0]), "it is not whole yet");
        kill(&child, signal);
        let output = child.wait_with_output().expect("it ends");
        let told = String::from_utf8(output.stderr).expect("UTF-8");
        assert_eq!(output.status.code(), Some(0), "{signal}: {told}");
        assert!(told.contains("recorded ") && told.contains(": 4 characters;"), "{told}");
        assert!(told.contains("LINE   ok: 115200 8E1, 4 characters, 0 damaged"), "{told}");
        assert!(told.contains("\nOPEN   everything"), "{told}");
        let files = files(&directory);
        assert!(files.len() == 1 && is_whole(&files[0]), "{files:?}");
        assert_eq!(read(&files).good().records().len(), 2);
        drop(stdin);
    }
}

/// A terminal that is closed sends SIGHUP twice: the kernel's, and the shell's.
#[test]
fn a_terminal_that_is_closed_ends_a_recording_well() {
    for signals in [["-HUP", "-HUP"], ["-TERM", "-HUP"]] {
        let scratch = Scratch::new();
        let directory = scratch.path("tape");
        let mut child = start(&["record", "-", "--baud", "115200", "-w", argument(&directory)]);
        let mut stdin = child.stdin.take().expect("it is piped");
        let capture = "time,byte,parity\n".to_owned() + &exchange(0, "ok");
        stdin.write_all(capture.as_bytes()).expect("it reads");
        wait_for("it records", || directory.exists() && files(&directory).len() == 1);
        kill_again(&child, signals);
        let output = child.wait_with_output().expect("it ends");
        let told = String::from_utf8(output.stderr).expect("UTF-8");
        assert_eq!(output.status.code(), Some(0), "{signals:?}: {told}");
        assert!(is_whole(&files(&directory)[0]), "{signals:?}");
        drop(stdin);
    }
}

/// `nohup` has a program ignore SIGHUP, and a script SIGINT where it ends a command with `&`.
#[cfg(target_os = "linux")]
#[test]
fn what_is_ignored_does_not_end_a_recording() {
    for (ignored, signal, end) in [("HUP", "-HUP", "-INT"), ("INT", "-INT", "-TERM")] {
        let scratch = Scratch::new();
        let directory = scratch.path("tape");
        let ignoring = format!("trap '' {ignored}; exec \"$0\" \"$@\"");
        let mut child = Command::new("sh")
            .args(["-c", &ignoring, env!("CARGO_BIN_EXE_fieldtap"), "record", "-"])
            .args(["--baud", "115200", "-w", argument(&directory)])
            .stdin(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("sh is there");
        let mut stdin = child.stdin.take().expect("it is piped");
        let capture = "time,byte,parity\n".to_owned() + &exchange(0, "ok");
        stdin.write_all(capture.as_bytes()).expect("it reads");
        let length = || std::fs::metadata(&files(&directory)[0]).map_or(0, |file| file.len());
        wait_for("it records", || directory.exists() && files(&directory).len() == 1);
        wait_for("it writes", || length() > 0);
        let before = length();
        kill(&child, signal);
        std::thread::sleep(Duration::from_millis(300));
        stdin.write_all(exchange(1_000_000_000, "ok").as_bytes()).expect("it reads on");
        wait_for("it records on", || length() > before);
        kill(&child, end);
        let output = child.wait_with_output().expect("it ends");
        let told = String::from_utf8(output.stderr).expect("UTF-8");
        assert_eq!(output.status.code(), Some(0), "{signal}: {told}");
        assert!(told.contains(": 8 characters;"), "{signal}: {told}");
        drop(stdin);
    }
}

/// A deleted file takes all that is written to it: nobody shall record into one for days.
#[test]
fn a_recording_ends_where_its_file_is_deleted() {
    let scratch = Scratch::new();
    let directory = scratch.path("tape");
    let mut child = start(&["record", "-", "--baud", "115200", "-w", argument(&directory)]);
    let mut stdin = child.stdin.take().expect("it is piped");
    let capture = "time,byte,parity\n".to_owned() + &exchange(0, "ok");
    stdin.write_all(capture.as_bytes()).expect("it reads");
    wait_for("it records", || directory.exists() && files(&directory).len() == 1);
    std::fs::remove_dir_all(&directory).expect("it is ours");
    // More comes, as from a tap: it may end before all of it.
    for n in 1..60 {
        std::thread::sleep(Duration::from_millis(50));
        let _ = stdin.write_all(exchange(n * 50_000_000, "ok").as_bytes());
    }
    wait_for("it ends", || child.try_wait().expect("it is ours").is_some());
    let output = child.wait_with_output().expect("it ended");
    let told = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(3), "{told}");
    assert!(told.contains("somebody deleted or moved it"), "{told}");
    assert!(told.contains("; 0 bytes in 0 files;"), "{told}");
    assert!(told.contains("OPEN   everything: no recorded file is there"), "{told}");
    assert!(!told.contains("is whole") && !told.contains("fieldtap read"), "{told}");
}

#[test]
fn a_recording_says_where_its_source_broke_off() {
    let scratch = Scratch::new();
    let directory = scratch.path("tape");
    let log: String = (0..1_100).map(|n| format!("(0.{n:06}) can{n} 123#00\n")).collect();
    let run = fieldtap_fed(["record", "-", "-w", argument(&directory)], log.as_bytes());
    assert_eq!(run.status, 3, "{}", run.stderr);
    let limit = "line 1025: more than 1024 interfaces, which is as many as fieldtap follows";
    assert!(run.stderr.contains(limit), "{}", run.stderr);
    assert!(run.stderr.contains("; nothing lost before the source failed\n"), "{}", run.stderr);
    let open = "OPEN   what comes after the source's failure; everything: a recording is not";
    assert!(run.stderr.contains(open), "{}", run.stderr);
}

#[test]
fn an_empty_file_among_others_is_left_out() {
    let scratch = Scratch::new();
    let bytes = |from| format!("time,byte,parity\n{}", exchange(from, "ok"));
    let first = scratch.file("1.chars", bytes(0));
    let empty = scratch.file("2.chars", "");
    let last = scratch.file("3.chars", bytes(1_000_000_000));
    let run = read(&[first, empty.clone(), last]).good();
    assert_eq!(run.records().len(), 4);
    assert!(run.stderr.contains("warning: ") && run.stderr.contains("2.chars: there is nothing"));
    let run = read(&[empty.clone(), empty]);
    assert!(run.status == 3 && run.stderr.contains("there is nothing in it"), "{}", run.stderr);
}

/// A limit on the size of files is met like a full disk.
#[test]
fn a_full_disk_ends_a_recording_and_leaves_what_came_before() {
    let scratch = Scratch::new();
    let directory = scratch.path("tape");
    let source = scratch.file("long.chars", ninety_seconds(&[]));
    let program = env!("CARGO_BIN_EXE_fieldtap");
    // Of 512 bytes, as POSIX has it, or of 1024.
    let command = format!(
        "ulimit -f 100; exec {program} record {} --baud 115200 -w {}",
        argument(&source),
        argument(&directory)
    );
    let output = Command::new("sh").args(["-c", &command]).output().expect("sh is there");
    let told = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(3), "{told}");
    assert!(told.contains("cannot be written") && told.contains("what came before"), "{told}");
    assert!(told.contains("\nLINE   ok"), "{told}");
    assert!(told.contains("what was heard last could not be written"), "{told}");
    let files = files(&directory);
    assert!(files.len() == 1 && is_whole(&files[0]), "{files:?}");
    let length = std::fs::metadata(&files[0]).expect("it is there").len();
    assert!(told.contains(&format!("; {length} bytes in 1 file;")), "{length}: {told}");
    let records = read(&files).good().records();
    assert!(records.len() > 500, "{}", records.len());
    let whole = read(&[source]);
    let before: Vec<&str> = whole.stdout.lines().take(records.len() - 2).collect();
    // The clock's ± and all: the same records.
    assert_eq!(before.len(), records.len() - 2);
    for (line, record) in before.iter().zip(&records) {
        let line: Value = serde_json::from_str(line).expect("an object");
        assert_eq!((&line["n"], &line["time_ns"]), (&record["n"], &record["time_ns"]));
    }
}

/// The same on a file system that is full, where one can be mounted. Like a peer, it may be absent
/// unless `FIELDTAP_PEERS=required`.
#[test]
fn a_full_file_system() {
    let scratch = Scratch::new();
    let directory = scratch.path("small");
    std::fs::create_dir(&directory).expect("temporary directories can be made");
    let source = scratch.file("long.chars", ninety_seconds(&[]));
    let (small, program) = (argument(&directory), env!("CARGO_BIN_EXE_fieldtap"));
    let command = format!(
        "mount -t tmpfs -o size=64k none {small} || exit 77; {program} record {} --baud 115200 \
         --ring size=20k -w {small}; echo status $? >&2; cat {small}/*.pcapng; ls {small} >&2",
        argument(&source)
    );
    let Some(output) = run_peer("unshare", "util-linux", &["-rm", "sh", "-c", &command]) else {
        return;
    };
    let told = String::from_utf8(output.stderr).expect("UTF-8");
    if output.status.code() == Some(77) || !told.contains("status ") {
        return miss(&format!("no file system can be mounted here: {told}"));
    }
    assert!(told.contains("status 3") && told.contains("No space left"), "{told}");
    assert!(!told.contains(".part\n"), "{told}");
    // The sections of all files, one behind the other, read as one.
    let run = fieldtap_fed(["read", "--format", "json", "-"], &output.stdout).good();
    assert!(run.records().len() > 500, "{}", run.records().len());
}

/// Where not even the first block has room, there is no file that looks like a capture.
#[test]
fn a_limit_that_leaves_no_room_leaves_no_file() {
    let scratch = Scratch::new();
    let directory = scratch.path("tape");
    let source = scratch.file("long.chars", ninety_seconds(&[]));
    let program = env!("CARGO_BIN_EXE_fieldtap");
    let (source, tape) = (argument(&source), argument(&directory));
    let command = format!("ulimit -f 0; exec {program} record {source} --baud 115200 -w {tape}");
    // What it says goes through a pipe, which has no such limit.
    let output = Command::new("sh").args(["-c", &command]).output().expect("sh is there");
    let told = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(3), "{told}");
    assert!(files(&directory).is_empty(), "{:?}", files(&directory));
    assert!(told.contains("; 0 bytes in 0 files; what was heard last could not be"), "{told}");
    assert!(!told.contains("is whole") && !told.contains("fieldtap read"), "{told}");
}

#[test]
fn what_cannot_be_recorded_is_refused() {
    let scratch = Scratch::new();
    let tape = scratch.path("tape");
    let directory = argument(&tape);
    let levels = here("captures/good/tr.sr");
    for (more, status, says) in [
        (&[argument(&levels)][..], 3, "line levels"),
        (&["absent.pcapng"], 3, "there is no such file"),
        #[cfg(target_os = "linux")]
        (&["serial:/dev/absent", "--baud", "115200"], 3, "LINE   not heard: no bus appeared"),
        (&["-", "--ring", "files=3"], 2, "without size or duration"),
        (&["-", "--ring", "duration=1ms"], 2, "duration is 1s or more"),
        (&["-", "--trigger", "error", "--before", "-1s"], 2, "-1s is no time such as 30s"),
        (&["-", "--trigger", "error", "--after", "-1s"], 2, "-1s is no time such as 30s"),
        (&["-", "--trigger", "slin.nonsense"], 2, "fieldtap explain"),
        (&["-", "--trigger", "nonsense"], 2, "nor error, warning or info"),
        (&["-", "--trigger", "encoder.alarm", "--protocol", "slin"], 2, "--protocol slin"),
        (&["can:can0", "--trigger", "parity"], 2, "slin.parity never comes"),
        (&["-", "--trigger", "interbus.crc"], 2, "rings are not recorded"),
        (&["-", "--count", "3"], 2, "keeps everything"),
        (&["-", "-v"], 2, "--verbose has no effect on a recording"),
        (&["-", "--words", "hex"], 2, "--words has no effect on a recording"),
        (&["can:can0", "can:can1"], 2, "one live tap"),
    ] {
        let run = fieldtap(["record", "-w", directory].iter().chain(more));
        assert_eq!(run.status, status, "{more:?}: {}", run.stderr);
        assert!(run.stderr.contains(says), "{more:?}: {}", run.stderr);
        // What looks like a capture says that there was one.
        assert!(!tape.exists() || files(&tape).is_empty(), "{more:?}: {:?}", files(&tape));
    }
    let file = scratch.file("file", "");
    let run = fieldtap_fed(["record", "-", "-w", argument(&file)], b"time,byte,parity\n");
    assert_eq!((run.status, run.stderr.lines().count()), (2, 1), "{}", run.stderr);
    assert!(run.stderr.contains("is a file: -w wants a folder"), "{}", run.stderr);
    // Nor can a folder be made in a file.
    let inside = file.join("tape");
    let run = fieldtap_fed(["record", "-", "-w", argument(&inside)], b"time,byte,parity\n");
    assert!(run.status == 3 && run.stderr.contains("cannot be written"), "{}", run.stderr);
}
