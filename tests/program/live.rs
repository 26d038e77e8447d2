//! Standard input that goes on: records come while it does, and Ctrl-C ends the run well.

use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Encoder 0 answers 154 (TR SLIN §6), and the next request, which shows that the answer is over.
const HEARD: &str = "time,byte,parity\n0.000000000,80,ok\n0.000345486,1A,ok\n0.000440972,01,ok\n\
                     0.000536458,98,ok\n0.010000000,80,ok\n";

fn start() -> Child {
    Command::new(env!("CARGO_BIN_EXE_fieldtap"))
        .args(["read", "--format", "json", "--profile", "baumer", "--baud", "115200"])
        .args(["--protocol", "slin", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program is there")
}

#[test]
fn records_come_while_the_source_goes_on_and_an_interruption_ends_well() {
    let mut child = start();
    let mut stdin = child.stdin.take().expect("it is piped");
    stdin.write_all(HEARD.as_bytes()).expect("it reads");
    let mut lines = BufReader::new(child.stdout.take().expect("it is piped")).lines();
    let mut next = || lines.next().expect("there is a line").expect("it is UTF-8");
    assert!(next().contains("\"kind\":\"request\""));
    assert!(next().contains("\"position\":154"));

    let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
    assert!(killed.expect("kill is there").success());
    // The pipe is still open: it is the signal that ends the run, and soon.
    let begin = Instant::now();
    let status = child.wait().expect("it ends");
    assert!(begin.elapsed() < Duration::from_secs(5));
    assert_eq!(status.code(), Some(130));
    let mut told = String::new();
    child.stderr.take().expect("it is piped").read_to_string(&mut told).expect("UTF-8");
    assert!(told.contains("WHO    asked 0 | answered 0"), "{told}");
    assert!(!told.contains("fieldtap:"), "what is cut is not the source's fault: {told}");
    drop(stdin);
}
