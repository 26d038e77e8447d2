//! Losses and memory over time: counts that are known, at ten times what a bus carries.
//!
//! `FIELDTAP_SOAK=3600` makes each of these take an hour; without it they are short.

use crate::harness::{Scratch, argument, fieldtap, say};
use crate::line::Line;
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

/// Encoder 0 answers 154 (TR SLIN §6).
const EXCHANGE: [u8; 4] = [0x80, 0x1A, 0x01, 0x98];

/// Characters of eleven bits that 115200 Bd carry in a second without a pause, ten times.
const TEN_BUSES: u64 = 10 * 115_200 / 11;

/// What a program may grow by once it runs, in KiB: what its allocator keeps in hand.
const GROWTH: u64 = 4096;

fn span() -> Duration {
    let seconds = std::env::var("FIELDTAP_SOAK").ok();
    Duration::from_secs(seconds.map_or(3, |seconds| seconds.parse().expect("seconds")))
}

fn start(arguments: &[&str], stdout: Stdio) -> Child {
    Command::new(env!("CARGO_BIN_EXE_fieldtap"))
        .args(arguments)
        .stdout(stdout)
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program is there")
}

/// Puts exchanges on a line at ten times the pace of a full bus. How many characters it were, and how
/// far the reader was behind at most.
fn flood(line: &Line, span: Duration) -> (u64, Duration) {
    let block = EXCHANGE.repeat(64);
    let (mut sent, mut behind, begin) = (0_u64, Duration::ZERO, Instant::now());
    while begin.elapsed() < span {
        let due = begin.elapsed().as_micros() as u64 * TEN_BUSES / 1_000_000;
        let full = Instant::now();
        while sent < due {
            // It may end amid an exchange.
            sent += line.put(&block[(sent % 4) as usize..]) as u64;
            behind = behind.max(full.elapsed());
        }
        thread::sleep(Duration::from_millis(1));
    }
    (sent, behind)
}

/// What the program holds in memory, in KiB.
fn memory(child: &Child) -> u64 {
    let path = format!("/proc/{}/status", child.id());
    let status = std::fs::read_to_string(path).expect("it runs");
    let line = status.lines().find(|line| line.starts_with("VmRSS:")).expect("it is told");
    line.split_whitespace().nth(1).and_then(|kib| kib.parse().ok()).expect("a number")
}

/// Processor time that the program took so far. The kernel counts it in hundredths of a second.
fn processor_time(child: &Child) -> Duration {
    let path = format!("/proc/{}/stat", child.id());
    let stat = std::fs::read_to_string(path).expect("it runs");
    let (_, fields) = stat.rsplit_once(") ").expect("its name is in parentheses");
    // Its own and the system's: fields 14 and 15 of proc(5), of which two are before these.
    let ticks = fields.split(' ').skip(11).take(2).map(|ticks| ticks.parse::<u64>());
    Duration::from_millis(10 * ticks.map(|ticks| ticks.expect("a number")).sum::<u64>())
}

fn interrupt(child: &Child) {
    signal(child, "-INT");
}

fn signal(child: &Child, signal: &str) {
    let killed = Command::new("kill").args([signal, &child.id().to_string()]).status();
    assert!(killed.expect("kill is there").success());
}

/// The number before a word in the last lines.
fn told(stderr: &str, word: &str) -> u64 {
    let line = stderr.lines().find(|line| line.starts_with("LINE")).expect(stderr);
    let words: Vec<&str> = line.split([' ', ',']).filter(|word| !word.is_empty()).collect();
    let place = words.iter().position(|other| *other == word).expect(line);
    words[place - 1].parse().expect(line)
}

/// Waits until the port is set: what comes before is thrown away.
fn wait_until_it_listens(child: &mut Child) -> BufReader<std::process::ChildStderr> {
    let mut stderr = BufReader::new(child.stderr.take().expect("it is piped"));
    let mut line = String::new();
    stderr.read_line(&mut line).expect("it says what it listens to");
    assert!(line.contains("115200"), "{line}");
    stderr
}

fn rest(stderr: BufReader<std::process::ChildStderr>) -> String {
    stderr.lines().map(|line| line.expect("UTF-8") + "\n").collect()
}

#[test]
fn slin_at_ten_times_a_full_bus_is_recorded_whole_in_flat_memory() {
    let (line, scratch) = (Line::new(), Scratch::new());
    let (source, tape) = (format!("serial:{}", line.port), scratch.path("tape"));
    let arguments = ["record", &source, "--baud", "115200", "-w", argument(&tape)];
    let mut child = start(&arguments, Stdio::null());
    let stderr = wait_until_it_listens(&mut child);

    let (first, _) = flood(&line, span() / 4);
    let before = memory(&child);
    let (second, behind) = flood(&line, span() * 3 / 4);
    let after = memory(&child);
    let took = processor_time(&child);
    interrupt(&child);
    let (stderr, status) = (rest(stderr), child.wait().expect("it ends"));
    assert_eq!(status.code(), Some(0), "{stderr}");

    let files = std::fs::read_dir(&tape).expect("it is there");
    let files: Vec<_> = files.map(|file| file.expect("it is there").path()).collect();
    let stats = fieldtap(["stats"].into_iter().chain(files.iter().map(|file| argument(file))));
    let heard = told(&stats.stderr, "characters");
    say(&format!(
        "soak: {} characters in {:?}, recorded {heard}, reader behind {behind:?} at most, {before} \
         KiB after a quarter, {after} KiB at the end, {took:?} of processor time",
        first + second,
        span()
    ));
    assert_eq!(heard, first + second, "{}", stats.stderr);
    assert!(after <= before + GROWTH, "{before} KiB, then {after} KiB");
}

/// Whoever reads what is printed takes a line, and then a rest.
#[test]
fn a_slow_reader_of_the_trace_costs_no_characters() {
    let line = Line::new();
    let source = format!("serial:{}", line.port);
    let arguments = ["read", &source, "--baud", "115200", "--protocol", "slin"];
    let mut child = start(&arguments, Stdio::piped());
    let stderr = wait_until_it_listens(&mut child);
    let trace = BufReader::new(child.stdout.take().expect("it is piped"));
    let reader = thread::spawn(move || {
        let rest = |number: usize| if number < 20 { span() / 60 } else { Duration::ZERO };
        trace.lines().enumerate().inspect(|(number, _)| thread::sleep(rest(*number))).count()
    });
    // Twenty rests are as long, in which nothing is fetched but what a pipe holds.
    let (sent, behind) = flood(&line, span() / 3);
    thread::sleep(Duration::from_millis(500));
    interrupt(&child);
    let (stderr, lines) = (rest(stderr), reader.join().expect("it reads"));
    assert_eq!(child.wait().expect("it ends").code(), Some(130), "{stderr}");
    say(&format!("soak: {sent} characters, {lines} lines, {behind:?} behind at most"));
    assert_eq!(told(&stderr, "characters"), sent, "{stderr}");
}

/// Whoever reads what is printed rests until no more is taken from the line: as much waits as may.
#[test]
fn a_reader_who_rests_too_long_is_told_that_something_may_be_lost() {
    let line = Line::new();
    let source = format!("serial:{}", line.port);
    let arguments = ["read", &source, "--baud", "115200", "--protocol", "slin"];
    let mut child = start(&arguments, Stdio::piped());
    let stderr = wait_until_it_listens(&mut child);

    let (mut sent, mut taken) = (0_u64, Instant::now());
    // A program that fetches nothing for a second waits for room.
    while taken.elapsed() < Duration::from_secs(1) {
        let count = line.put(&EXCHANGE.repeat(26)[(sent % 4) as usize..]) as u64;
        if count > 0 {
            (sent, taken) = (sent + count, Instant::now());
        }
        thread::sleep(Duration::from_millis(1));
    }
    let trace = BufReader::new(child.stdout.take().expect("it is piped"));
    let reader = thread::spawn(move || trace.lines().count());
    thread::sleep(Duration::from_millis(500));
    interrupt(&child);
    let (stderr, lines) = (rest(stderr), reader.join().expect("it reads"));
    assert_eq!(child.wait().expect("it ends").code(), Some(130), "{stderr}");
    say(&format!("soak: {sent} characters until no more were taken, {lines} lines"));
    // A pseudo terminal lets its other side wait, so that none is lost; a bus does not.
    assert_eq!(told(&stderr, "characters"), sent, "{stderr}");
    assert!(sent > 1 << 18, "so many may wait: {sent}");
    assert!(stderr.contains(" loss"), "{stderr}");
}

/// A machine that was busy has not fetched all that came before Ctrl-C.
#[test]
fn what_came_before_the_end_is_heard() {
    let line = Line::new();
    let source = format!("serial:{}", line.port);
    let arguments = ["read", &source, "--baud", "115200", "--protocol", "slin"];
    let mut child = start(&arguments, Stdio::null());
    let stderr = wait_until_it_listens(&mut child);
    signal(&child, "-STOP");
    let sent = line.put(&EXCHANGE.repeat(4000)) as u64;
    signal(&child, "-INT");
    signal(&child, "-CONT");
    let stderr = rest(stderr);
    assert_eq!(child.wait().expect("it ends").code(), Some(130), "{stderr}");
    assert!(sent > 10_000, "a pseudo terminal holds more than {sent}");
    assert_eq!(told(&stderr, "characters"), sent, "{stderr}");
}

/// From the line to a printed line: under 5 ms at the median on an idle machine; this one may be busy.
#[test]
fn what_is_heard_is_printed_soon() {
    let line = Line::new();
    let source = format!("serial:{}", line.port);
    let arguments = ["read", &source, "--baud", "115200", "--protocol", "uart"];
    let mut child = start(&arguments, Stdio::piped());
    let stderr = wait_until_it_listens(&mut child);
    let mut trace = BufReader::new(child.stdout.take().expect("it is piped"));
    let mut waits: Vec<Duration> = Vec::new();
    for _ in 0..200 {
        let begin = Instant::now();
        line.put(&[0x55]);
        trace.read_line(&mut String::new()).expect("it prints");
        waits.push(begin.elapsed());
        thread::sleep(Duration::from_millis(3));
    }
    interrupt(&child);
    let stderr = rest(stderr);
    assert_eq!(child.wait().expect("it ends").code(), Some(130), "{stderr}");
    waits.sort();
    let (median, most) = (waits[waits.len() / 2], waits[waits.len() - 1]);
    say(&format!("soak: printed after {median:?} at the median, {most:?} at most"));
    assert!(median < Duration::from_millis(50), "{median:?}");
}
