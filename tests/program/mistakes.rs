//! What goes wrong before anything is heard: options that fit nothing, files that are others, and
//! interruptions while nothing comes.

use crate::harness::{Scratch, argument, fieldtap, fieldtap_fed, here};
use std::io::Read;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

const FRAMES: &[u8] = b"(1.0) can0 42C#010E010101\n(2.0) can0 42C#010E010101\n";

#[test]
fn options_that_fit_nothing_are_told_once_at_the_end() {
    let scratch = Scratch::new();
    let names = scratch.file("names.toml", "[station.5]\nname = \"slide\"\n[station.60]\n");
    let options = ["--device", "61=baumer-encoder", "--stations", argument(&names)];
    let run = fieldtap_fed(["read", "-"].into_iter().chain(options), FRAMES).good();
    let device = "fieldtap: warning: --device names 61: no such station of that kind was heard\n";
    assert_eq!(run.stderr.matches(device).count(), 1, "{}", run.stderr);
    // 42Ch is group 2, MAC ID 5 (DeviceNet: bits 3 to 8 of an identifier from 400h on).
    let stations = "fieldtap: warning: --stations names 60: no such station was heard\n";
    assert_eq!(run.stderr.matches(stations).count(), 1, "{}", run.stderr);
    let quiet = fieldtap_fed(["read", "-q", "-"].into_iter().chain(options), FRAMES).good();
    assert_eq!(quiet.stderr, "");

    let run = fieldtap_fed(["read", "--protocol", "slin", "-"], FRAMES).good();
    let other = "warning: --protocol slin: can0 carries CAN frames, which are none of it\n";
    assert_eq!(run.stderr.matches(other).count(), 1, "{}", run.stderr);
}

#[test]
fn a_tap_without_its_kind_is_told_how_it_is_written() {
    for (name, source) in [("can7", "can:can7"), ("ttyUSB77", "serial:/dev/ttyUSB77")] {
        let run = fieldtap(["read", name]);
        assert_eq!(run.status, 3, "{}", run.stderr);
        let told = format!("write {source}; `fieldtap ports` lists what there is");
        assert!(run.stderr.contains(&told), "{}", run.stderr);
    }
    for tap in ["serial:/dev/ttyNone", "slcan:/dev/ttyNone"] {
        let run = fieldtap(["read", tap]);
        assert!(run.stderr.contains("`fieldtap ports` lists"), "{}", run.stderr);
    }
}

/// Four lines that know nothing would push the one that does off the screen.
#[test]
fn of_a_source_that_cannot_be_opened_only_the_reason_is_told() {
    let scratch = Scratch::new();
    let log = scratch.file("a.log", FRAMES);
    for command in ["read", "stats"] {
        let run = fieldtap([command, "/nowhere/bus.sr"]);
        assert_eq!((run.status, run.stdout.as_str()), (3, ""), "{}", run.stderr);
        let lines: Vec<&str> = run.stderr.lines().collect();
        assert!(lines.len() == 1 && lines[0].contains("there is no such file"), "{lines:?}");
        // What was read before is summed up.
        let run = fieldtap([command, argument(&log), "/nowhere/bus.sr"]);
        assert_eq!(run.status, 3, "{}", run.stderr);
        assert!(
            run.stderr.contains("LINE   ok") && run.stderr.contains("OPEN   "),
            "{}",
            run.stderr
        );
    }
}

#[test]
fn a_description_that_is_none_is_refused() {
    let scratch = Scratch::new();
    for content in ["", "neither fish nor fowl", "\u{7f}ELF\0\0", "[readme]\nwords = 1;\n"] {
        let file = scratch.file("device.eds", content);
        let run = fieldtap_fed(["read", "--eds", argument(&file), "-"], FRAMES);
        assert_eq!(run.status, 2, "{content:?}: {}", run.stderr);
        assert!(run.stderr.contains("device.eds: this is no EDS file"), "{}", run.stderr);
    }
}

/// What is no archive may have no end: nothing more of it is read than its first bytes.
#[cfg(unix)]
#[test]
fn a_stream_that_is_no_archive_is_refused_at_once() {
    let zero = std::fs::File::open("/dev/zero").expect("it is there");
    let mut child = Command::new(env!("CARGO_BIN_EXE_fieldtap"))
        .args(["read", "--input-format", "sr", "-"])
        .stdin(zero)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program is there");
    let (status, told) = end(&mut child);
    assert_eq!(status, Some(3), "{told}");
    assert!(told.contains("this is no zip archive"), "{told}");
}

#[test]
fn a_log_that_holds_only_a_header_is_told() {
    let run = fieldtap_fed(["read", "-"], b"time,out,in\n").good();
    assert!(run.stderr.contains("nothing in it but a header"), "{}", run.stderr);
    let rows = b"time,out,in\r1.0,0,0\r2.0,0,0\r";
    let run = fieldtap_fed(["read", "--format", "csv", "-"], rows).good();
    assert_eq!(run.stdout.lines().count(), 3, "{}", run.stdout);
}

/// Nobody writes to the pipe: it is the first signal that ends the run.
#[cfg(unix)]
#[test]
fn a_pipe_that_nobody_opens_can_be_interrupted() {
    let scratch = Scratch::new();
    let pipe = scratch.path("pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status().expect("it is there").success());
    let mut child = start(&["read", argument(&pipe)]);
    std::thread::sleep(Duration::from_millis(500));
    signal(&child, "-INT");
    assert_eq!(end(&mut child).0, Some(130));

    // Somebody does, later.
    let child = start(&["read", argument(&pipe)]);
    std::thread::sleep(Duration::from_millis(300));
    std::fs::write(&pipe, FRAMES).expect("it is read");
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(0));
    assert!(String::from_utf8_lossy(&output.stdout).contains("42C#010E010101"));
}

#[cfg(unix)]
#[test]
fn a_simulation_that_is_interrupted_leaves_nothing() {
    for (bus, amount, file, stop) in [
        ("slin", ["--exchanges", "100000000"], "bus.vcd", "-INT"),
        ("slin", ["--exchanges", "100000000"], "bus.sr", "-TERM"),
        ("devicenet", ["--duration", "80000"], "bus.pcapng", "-INT"),
    ] {
        let scratch = Scratch::new();
        let output = scratch.path(file);
        let truth = scratch.path("truth");
        let files = ["--output", argument(&output), "--truth", argument(&truth)];
        let command: Vec<&str> = ["simulate", bus].into_iter().chain(amount).chain(files).collect();
        let mut child = start(&command);
        let begin = Instant::now();
        let directory = output.parent().expect("it has one");
        while entries(directory) < 2 && begin.elapsed() < Duration::from_secs(10) {
            std::thread::sleep(Duration::from_millis(20));
        }
        signal(&child, stop);
        let (status, told) = end(&mut child);
        assert_eq!(status, Some(130), "{file}: {told}");
        assert_eq!(told, "fieldtap: interrupted: nothing is kept of what was not all written\n");
        assert_eq!(entries(directory), 0, "{file}");
    }
}

/// A pager that shows the first page, or a terminal that is held: the pipe is full, and stays so.
#[cfg(unix)]
#[test]
fn who_takes_nothing_any_more_keeps_no_run_from_ending() {
    let scratch = Scratch::new();
    // More than a pipe holds, 64 KiB.
    let log = scratch.file("long.log", FRAMES.repeat(20_000));
    for stop in ["-INT", "-TERM"] {
        let mut child = start(&["read", argument(&log)]);
        std::thread::sleep(Duration::from_millis(500));
        assert_eq!(child.try_wait().expect("it is ours"), None, "it waits for its reader");
        signal(&child, stop);
        let (status, told) = end(&mut child);
        assert_eq!(status, Some(3), "{told}");
        assert!(told.contains("the output cannot be written: whoever reads it takes nothing"));
        assert!(told.contains("OPEN   what comes after the interruption"), "{told}");
    }
}

/// A device told another vendor than the file has: it was told.
#[test]
fn a_description_of_another_device_does_not_say_that_nobody_told() {
    let scratch = Scratch::new();
    let other = "[Device]\nVendCode = 65000;\nProdCode = 1;\nProdName = \"Other\";\n";
    let file = scratch.file("other.eds", other);
    let told = |capture: &Path| {
        fieldtap(["stats", "--eds", argument(&file), argument(capture)]).good().stdout
    };
    let identified = here("captures/devicenet-node-restart/node-restart.log");
    let silent = scratch.file("silent.log", FRAMES);
    assert!(told(&silent).contains("Other of no station (nobody told"));
    assert!(told(&identified).contains("Other of no station (vendor, product code"));
}

fn entries(directory: &Path) -> usize {
    std::fs::read_dir(directory).expect("it is there").count()
}

fn start(arguments: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_fieldtap"))
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program is there")
}

fn signal(child: &Child, signal: &str) {
    let killed = Command::new("kill").args([signal, &child.id().to_string()]).status();
    assert!(killed.expect("kill is there").success());
}

/// The status with which a run ends, and what it said. It must not take long.
fn end(child: &mut Child) -> (Option<i32>, String) {
    let begin = Instant::now();
    let status = loop {
        if let Some(status) = child.try_wait().expect("it is ours") {
            break status;
        }
        if begin.elapsed() > Duration::from_secs(20) {
            child.kill().expect("it is ours");
            panic!("it does not end");
        }
        std::thread::sleep(Duration::from_millis(20));
    };
    let mut told = String::new();
    child.stderr.take().expect("it is piped").read_to_string(&mut told).expect("UTF-8");
    (status.code(), told)
}

/// The last lines say `17 x parity`: that is what people ask for next.
#[test]
fn words_of_the_output_are_explained_and_listed() {
    let list = fieldtap(["explain"]).good().stdout;
    for word in ["withheld", "suspect", "interpolated", "assumed", "unknown", "±", "lost"]
        .into_iter()
        .chain(["kernel", "read", "hardware", "sample", "log"])
    {
        let told = fieldtap(["explain", word]).good().stdout;
        assert!(told.starts_with(&format!("{word}\n")) && told.contains("What follows"), "{told}");
        assert!(list.lines().any(|line| line.starts_with(&format!("{word} "))), "{word}");
    }
    // What a finding is called too is told with it.
    let lost = fieldtap(["explain", "lost"]).good().stdout;
    assert!(lost.contains("\nuart.lost (warning)\n"), "{lost}");
}

#[test]
fn a_finding_is_explained_by_its_short_name() {
    let whole = fieldtap(["explain", "slin.parity"]).good().stdout;
    assert_eq!(fieldtap(["explain", "parity"]).good().stdout, whole);
    let run = fieldtap(["explain", "crc"]);
    assert!(run.status == 2 && run.stderr.contains("interbus.crc, can.crc"), "{}", run.stderr);
    let run = fieldtap(["explain", "nonsense"]);
    assert!(run.status == 2 && run.stderr.contains("there is no finding or word nonsense"));
}

#[test]
fn a_form_that_cannot_hold_a_bus_names_those_that_can() {
    let scratch = Scratch::new();
    let refused = |capture: &str, out: &str, forms: &str| {
        let out = scratch.path(out);
        let run = fieldtap(["convert", argument(&here(capture)), argument(&out)]);
        assert!(run.status == 3 && run.stderr.contains(forms), "{}", run.stderr);
    };
    for out in ["ring.pcapng", "ring.log", "ring.chars"] {
        let forms =
            "write CSV or JSON, or process words of a log with --output-format interbus-log";
        refused("captures/good-interbus/50ms.csv", out, forms);
    }
    let can = "captures/good-devicenet/poll.log";
    refused(can, "can.chars", "write pcapng, candump, CSV or JSON");
    refused("captures/good/baumer.chars", "serial.log", "write pcapng, chars, CSV or JSON");
}

/// Nodes that nobody asks, and ID words, which nobody answers.
#[test]
fn who_was_only_heard_is_named() {
    let scratch = Scratch::new();
    let ids = scratch.file("ids.csv", "device,id\n1,0233\n2,0132\n");
    let run = fieldtap(["read", argument(&ids)]).good();
    assert!(run.stderr.contains("WHO    heard 1 2\n"), "{}", run.stderr);
    // 42Fh: MAC ID 5, group 2 message 7, the duplicate MAC ID check.
    let checks = b"(1.0) can0 42F#00D40133FC8501\n(2.0) can0 42F#00D40133FC8501\n";
    let run = fieldtap_fed(["read", "--protocol", "devicenet", "-"], checks).good();
    assert!(run.stderr.contains("WHO    heard 5\n"), "{}", run.stderr);
}

#[test]
fn a_number_below_its_range_is_told_with_the_range() {
    for (arguments, range) in [
        (["simulate", "devicenet", "--encoders", "-5"], "a MAC ID is 0 to 63"),
        (["simulate", "interbus", "--cycle", "-5"], "0 to 10000 milliseconds"),
        (["simulate", "devicenet", "--packet-rate", "-5"], "10..=10000"),
    ] {
        let run = fieldtap(arguments.into_iter().chain(["-o", "-"]));
        assert!(run.status == 2 && run.stderr.contains(range), "{}", run.stderr);
        assert!(!run.stderr.contains("unexpected argument"), "{}", run.stderr);
    }
    let run = fieldtap(["simulate", "devicenet", "--lone", "-o", "-"]);
    assert!(run.stderr.contains("--lone: one encoder is alone on the bus: name it"));
}
