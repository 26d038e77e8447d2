//! A live serial port, played by a pseudo terminal: its master is the line.

use crate::harness::{Run, codes, fieldtap};
use rustix::event::{PollFd, PollFlags, Timespec};
use rustix::fd::OwnedFd;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{InputModes, tcgetattr};
use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::{Duration, Instant};

/// Encoder 0 answers 154 (TR SLIN §6, example 1).
const EXCHANGE: [u8; 4] = [0x80, 0x1A, 0x01, 0x90];

/// The program, listening to a line.
struct Tap {
    line: OwnedFd,
    port: String,
    child: Child,
    records: Receiver<String>,
    seen: String,
}

impl Tap {
    /// Starts `fieldtap read` with these arguments, and waits until the port is set.
    fn start(arguments: &[&str]) -> Tap {
        let line = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)
            .expect("a pseudo terminal");
        grantpt(&line).expect("it is ours");
        unlockpt(&line).expect("it is ours");
        let port = ptsname(&line, Vec::new()).expect("it has a name").into_string().expect("UTF-8");
        let mut child = Command::new(env!("CARGO_BIN_EXE_fieldtap"))
            .args(["read", "--format", "json", "--protocol", "slin", "--baud", "115200"])
            .args(arguments)
            .arg(format!("serial:{port}"))
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the program is there");
        let stdout = BufReader::new(child.stdout.take().expect("it is piped"));
        let (sender, records) = channel();
        thread::spawn(move || {
            stdout.lines().map_while(Result::ok).all(|line| sender.send(line).is_ok())
        });
        let begin = Instant::now();
        let is_set = || {
            let settings = tcgetattr(&line).expect("a terminal");
            settings.input_modes.contains(InputModes::PARMRK)
        };
        while !is_set() {
            assert!(begin.elapsed() < Duration::from_secs(20), "the port is not opened");
            thread::sleep(Duration::from_millis(5));
        }
        Tap { line, port, child, records, seen: String::new() }
    }

    fn send(&self, bytes: &[u8]) {
        assert_eq!(rustix::io::write(&self.line, bytes).expect("it takes bytes"), bytes.len());
    }

    /// The next record, and how long it took to come.
    fn next(&mut self) -> (serde_json::Value, Duration) {
        let begin = Instant::now();
        let line = self.records.recv_timeout(Duration::from_secs(20)).expect("a record");
        self.seen += &format!("{line}\n");
        (serde_json::from_str(&line).expect("it is JSON"), begin.elapsed())
    }

    fn interrupt(&self) {
        self.signal("-INT");
    }

    fn signal(&self, signal: &str) {
        let killed = Command::new("kill").args([signal, &self.child.id().to_string()]).status();
        assert!(killed.expect("kill is there").success());
    }

    /// Stops it, and waits until each of its threads is.
    fn stop(&self) {
        self.signal("-STOP");
        let tasks = format!("/proc/{}/task", self.child.id());
        let is_stopped = |task: std::io::Result<std::fs::DirEntry>| {
            let stat = std::fs::read_to_string(task.expect("it is there").path().join("stat"));
            // Its name, in parentheses, and its state (proc(5)).
            stat.expect("it is there").contains(") T ")
        };
        while !std::fs::read_dir(&tasks).expect("it runs").all(is_stopped) {
            thread::sleep(Duration::from_millis(5));
        }
    }

    /// What the run came to, with all that it printed.
    fn end(mut self) -> Run {
        let mut stderr = String::new();
        self.child.stderr.take().expect("it is piped").read_to_string(&mut stderr).expect("UTF-8");
        let status = self.child.wait().expect("it ends").code().expect("it was not killed");
        self.records.iter().for_each(|line| self.seen += &format!("{line}\n"));
        Run { stdout: self.seen, stderr, status }
    }
}

#[test]
fn an_exchange_becomes_records_at_once_and_an_interruption_ends_well() {
    let mut tap = Tap::start(&["--profile", "tr"]);
    tap.send(&EXCHANGE);
    let (request, _) = tap.next();
    let (response, took) = tap.next();
    assert_eq!(request["kind"], "request");
    assert_eq!(response["slin"]["position"], 154);
    // On an idle machine some milliseconds; this one may be busy.
    assert!(took < Duration::from_secs(1), "{took:?}");
    assert_eq!(request["clock"], "read");
    assert_eq!(request["interpolated"], true);
    assert_eq!(request["uncertainty_ns"], 2_000_000);
    assert_eq!(response["slin"]["characters"][0]["parity"], "unknown");

    let begin = Instant::now();
    tap.interrupt();
    let run = tap.end();
    assert!(begin.elapsed() < Duration::from_secs(2), "{:?}", begin.elapsed());
    assert_eq!(run.status, 130, "{}", run.stderr);
    assert_eq!(run.records().len(), 2);
    let line = "LINE   ok: 115200 8E1, 4 characters, 0 damaged (0.00 %)";
    for told in [line, "WHO    asked 0 | answered 0", "WRONG  ", "OPEN   "] {
        assert!(run.stderr.contains(told), "{told} is not in {}", run.stderr);
    }
    assert!(run.stderr.contains("counters of the driver: not available"), "{}", run.stderr);
    assert!(run.stderr.contains("the parity of characters is unknown"), "{}", run.stderr);
}

#[test]
fn a_request_that_nobody_answers_is_told_while_the_line_is_silent() {
    let mut tap = Tap::start(&["--profile", "baumer"]);
    // The encoder has been heard before: else its silence is no error.
    tap.send(&[0x80, 0x1A, 0x01, 0x98]);
    tap.next();
    tap.next();
    tap.send(&[0x80]);
    let (request, took) = tap.next();
    assert_eq!(codes(&request), ["slin.no-response"]);
    // Ten limits of 1 ms, and what may still be on its way for 8 ms; the rest is a busy machine.
    assert!(took > Duration::from_millis(10) && took < Duration::from_secs(1), "{took:?}");
    tap.interrupt();
    assert_eq!(tap.end().status, 130);
}

/// As a virtual machine is that pauses, or a computer that is too busy.
#[test]
fn a_stopped_program_takes_what_came_meanwhile_for_one_piece_and_judges_nothing_across() {
    let mut tap = Tap::start(&["--profile", "tr"]);
    tap.send(&EXCHANGE);
    tap.next();
    tap.next();
    tap.stop();
    // 5000 characters of 95486 ns, which nobody counts, take 0.48 s.
    tap.send(&EXCHANGE.repeat(1250));
    thread::sleep(Duration::from_millis(800));
    tap.signal("-CONT");
    let mut next = || tap.next().0;
    assert_eq!(codes(&next()), ["uart.lost"], "when they came is not known");
    let records: Vec<_> = (0..2500).map(|_| next()).collect();
    assert!(records.iter().all(|record| codes(record).is_empty()));
    let time = |record: &serde_json::Value| record["time_ns"].as_i64().expect("it is known");
    // From the first request to the last answer: all but the three characters of that.
    let span = time(&records[2499]) - time(&records[0]);
    assert!((span - 4997 * 95_486).abs() < 10_000, "{span}");
    assert_eq!(codes(&next()), ["uart.lost"], "what came later may have found no room");
    tap.interrupt();
    let run = tap.end();
    assert_eq!(run.status, 130, "{}", run.stderr);
    assert!(run.stderr.contains("5004 characters, 0 damaged (0.00 %), 2 losses"), "{}", run.stderr);
}

#[test]
fn a_port_that_vanishes_ends_the_run_with_status_3() {
    let mut tap = Tap::start(&[]);
    tap.send(&EXCHANGE);
    tap.next();
    tap.next();
    // A pseudo terminal that is closed takes what was not read with it: all is read before.
    let sent = EXCHANGE.len() * 1000;
    tap.send(&EXCHANGE.repeat(1000));
    let mut records = 0;
    while records < 2000 {
        // Around a pause of a busy computer there is a loss.
        records += usize::from(tap.next().0["kind"] != "lost");
    }
    tap.line = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)
        .expect("a pseudo terminal");
    let run = tap.end();
    assert_eq!(run.status, 3, "{}", run.stderr);
    assert!(run.stderr.contains("the port is gone: was the adapter unplugged?"), "{}", run.stderr);
    assert!(run.stderr.contains("WHO    asked 0 | answered 0"), "{}", run.stderr);
    let count = format!("{} characters, 0 damaged", 4 + sent);
    assert!(run.stderr.contains(&count), "{count}: {}", run.stderr);
}

#[test]
fn a_second_reader_is_told_who_has_the_port() {
    let tap = Tap::start(&[]);
    let second = fieldtap(["read", &format!("serial:{}", tap.port)]);
    assert_eq!(second.status, 3);
    let holder = format!("fieldtap (process {}) has this port", tap.child.id());
    assert!(second.stderr.contains(&holder), "{}", second.stderr);
    tap.interrupt();
    assert_eq!(tap.end().status, 130);
}

/// To open it like a file would raise RTS and DTR, and lock nothing: it is refused before.
#[test]
fn a_port_that_is_named_like_a_file_is_refused_and_not_opened() {
    let line = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)
        .expect("a pseudo terminal");
    grantpt(&line).expect("it is ours");
    unlockpt(&line).expect("it is ours");
    let port = ptsname(&line, Vec::new()).expect("it has a name").into_string().expect("UTF-8");
    for arguments in [&["read", &port][..], &["stats", "--input-format", "bytes", &port]] {
        let run = fieldtap(arguments);
        assert_eq!(run.status, 3, "{}", run.stderr);
        let told = format!("{port}: this is a serial port: write serial:{port}");
        assert!(run.stderr.contains(&told), "{}", run.stderr);
    }
    // Where nobody ever opened the other end, its master hears no hangup (pty(7)).
    let mut poll = [PollFd::new(&line, PollFlags::IN)];
    rustix::event::poll(&mut poll, Some(&Timespec::default())).expect("it is open");
    assert!(!poll[0].revents().contains(PollFlags::HUP), "it was opened");
}
