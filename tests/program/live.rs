//! Standard input that goes on: records come while it does, and Ctrl-C ends the run well.

use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Encoder 0 answers 154 (TR SLIN §6), and the next request, which shows that the answer is over.
const HEARD: &str = "time,byte,parity\n0.000000000,80,ok\n0.000345486,1A,ok\n0.000440972,01,ok\n\
                     0.000536458,98,ok\n0.010000000,80,ok\n";

fn start(command: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_fieldtap"))
        .args(command)
        .args(["--profile", "baumer", "--baud", "115200", "--protocol", "slin", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program is there")
}

#[test]
fn records_come_while_the_source_goes_on_and_an_interruption_ends_well() {
    let mut child = start(&["read", "--format", "json"]);
    let mut stdin = child.stdin.take().expect("it is piped");
    stdin.write_all(HEARD.as_bytes()).expect("it reads");
    let mut lines = BufReader::new(child.stdout.take().expect("it is piped")).lines();
    let mut next = || lines.next().expect("there is a line").expect("it is UTF-8");
    assert!(next().contains("\"kind\":\"request\""));
    assert!(next().contains("\"position\":154"));

    interrupt(&child);
    // The pipe is still open: it is the signal that ends the run, and soon.
    let begin = Instant::now();
    let status = child.wait().expect("it ends");
    assert!(begin.elapsed() < Duration::from_secs(5));
    assert_eq!(status.code(), Some(130));
    let mut told = String::new();
    child.stderr.take().expect("it is piped").read_to_string(&mut told).expect("UTF-8");
    assert!(told.contains("WHO    asked 0 | answered 0"), "{told}");
    assert!(told.contains("\nOPEN   what comes after the interruption"), "{told}");
    assert!(!told.contains("everything was judged"), "{told}");
    assert!(!told.contains("fieldtap:"), "what is cut is not the source's fault: {told}");
    drop(stdin);
}

fn interrupt(child: &Child) {
    let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(killed.expect("kill is there").success());
}

#[test]
fn statistics_follow_a_stream_until_they_are_asked_for() {
    for (format, has) in [("text", "\nWHO    asked 0 | answered 0"), ("json", "\"asked\": 2")] {
        let mut child = start(&["stats", "--format", format]);
        let mut stdin = child.stdin.take().expect("it is piped");
        stdin.write_all(HEARD.as_bytes()).expect("it reads");
        std::thread::sleep(Duration::from_millis(500));
        interrupt(&child);
        let output = child.wait_with_output().expect("it ends");
        let told = String::from_utf8(output.stderr).expect("UTF-8");
        assert_eq!(output.status.code(), Some(0), "this is how it is meant to end: {told}");
        let tables = String::from_utf8(output.stdout).expect("UTF-8");
        assert!(tables.contains(has), "{tables}");
        assert!(told.contains("LINE   ok") && told.contains("\nOPEN   "), "{told}");
        drop(stdin);
    }
}

/// Samples of one channel at 1 MHz: idle, and then characters at 115200 Bd 8E1.
fn samples(idle_us: usize, bytes: &[u8]) -> Vec<u8> {
    let mut samples = vec![1; idle_us];
    let mut bits = Vec::new();
    for byte in bytes {
        let data = (0..8).map(|bit| byte >> bit & 1);
        let parity = u8::try_from(byte.count_ones() % 2).expect("0 or 1");
        bits.extend(std::iter::once(0).chain(data).chain([parity, 1]));
    }
    let count = bits.len() * 1_000_000 / 115_200;
    samples.extend((0..count).map(|sample| bits[sample * 115_200 / 1_000_000]));
    samples
}

#[test]
fn a_logic_analyzer_is_decoded_as_its_samples_come() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_fieldtap"))
        .args(["read", "--format", "json", "--profile", "baumer", "--input-format", "logic"])
        .args(["--samplerate", "1M", "--protocol", "slin", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program is there");
    let mut stdin = child.stdin.take().expect("it is piped");
    let (sender, records) = std::sync::mpsc::channel();
    let stdout = child.stdout.take().expect("it is piped");
    let reader = std::thread::spawn(move || {
        for line in BufReader::new(stdout).lines() {
            let line = line.expect("it is UTF-8");
            // The test may have seen enough.
            let _ = sender.send((Instant::now(), line));
        }
    });
    // An exchange every 10 ms: the request, 250 us, and the answer (TR SLIN section 6). What the
    // line carries is found in the first two seconds.
    let exchange = [samples(9_000, &[0x80]), samples(250, &[0x1A, 0x01, 0x98])].concat();
    for _ in 0..260 {
        stdin.write_all(&exchange).expect("it reads");
        std::thread::sleep(Duration::from_millis(2));
    }
    std::thread::sleep(Duration::from_millis(300));
    let early = records.try_iter().count();
    assert!(early > 400, "{early} of 520 records while the stream goes on");
    // From then on each comes with its samples.
    for _ in 0..3 {
        let sent = Instant::now();
        stdin.write_all(&exchange).expect("it reads");
        stdin.write_all(&vec![1; 20_000]).expect("it reads");
        let (came, line) = records.recv_timeout(Duration::from_secs(5)).expect("a record comes");
        assert!(came >= sent && line.contains("\"protocol\":\"slin\""), "{line}");
        std::thread::sleep(Duration::from_millis(300));
        records.try_iter().count();
    }
    drop(stdin);
    assert_eq!(child.wait().expect("it ends").code(), Some(0));
    reader.join().expect("it does not panic");
}

#[test]
fn nothing_is_lost_where_the_trace_is_read_slowly() {
    let mut child = start(&["read", "--format", "json"]);
    let mut stdin = child.stdin.take().expect("it is piped");
    let feeder = std::thread::spawn(move || {
        let mut text = "time,byte,parity\n".to_owned();
        for n in 0..20_000_u64 {
            text += &format!("{}.{:03}000000,80,ok\n", n / 100, n % 100 * 10);
            text += &format!("{}.{:03}345486,1A,ok\n", n / 100, n % 100 * 10);
            text += &format!("{}.{:03}440972,01,ok\n", n / 100, n % 100 * 10);
            text += &format!("{}.{:03}536458,98,ok\n", n / 100, n % 100 * 10);
        }
        stdin.write_all(text.as_bytes()).expect("it reads all of it");
    });
    let stdout = child.stdout.take().expect("it is piped");
    // All pipes are full by then.
    std::thread::sleep(Duration::from_secs(1));
    let lines = BufReader::new(stdout).lines().map_while(Result::ok).count();
    assert_eq!(lines, 40_000);
    feeder.join().expect("it does not panic");
    assert_eq!(child.wait().expect("it ends").code(), Some(0));
}
