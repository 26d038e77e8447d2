//! Sources that come in several pieces: files one after the other, lines as they are written.

use crate::harness::{Scratch, argument, fieldtap, fieldtap_fed, here};
use std::fmt::Write;

/// The sentences of a trace, in order.
fn sentences(arguments: &[&str]) -> Vec<String> {
    let run = fieldtap(["read", "--format", "json"].iter().chain(arguments)).good();
    let summary = |record: &serde_json::Value| record["summary"].as_str().expect("text").to_owned();
    run.records().iter().map(summary).collect()
}

#[test]
fn a_second_capture_of_the_line_is_read_like_the_first() {
    for name in ["tr.sr", "inverted.sr", "tr-345594.sr", "tr.vcd", "tr.chars", "tr-115200.pcapng"] {
        let capture = here("captures/good").join(name);
        let capture = argument(&capture);
        let once = sentences(&[capture]);
        let twice = sentences(&[capture, capture]);
        let (first, second) = twice.split_at(once.len().min(twice.len()));
        assert_eq!(first, once, "{name}");
        // An address that nobody answers at is told once.
        let differing = second.iter().zip(&once).filter(|(again, before)| again != before);
        assert_eq!(second.len(), once.len(), "{name}");
        assert_eq!(differing.count(), 0, "{name}");
    }
}

/// Four characters 0.9 s apart, then exchanges with encoder 0: 154 is 1A 01 (TR SLIN §6).
fn sparse_beginning() -> String {
    let mut text = "time,byte,parity\n".to_owned();
    let mut line = |ns: u64, byte: u8| {
        // A String takes any text.
        let _ = writeln!(text, "{}.{:09},{byte:02X},ok", ns / 1_000_000_000, ns % 1_000_000_000);
    };
    (0..4).for_each(|n| line(n * 900_000_000, 0x55));
    for n in 0..60 {
        let at = 3_600_000_000 + n * 10_000_000;
        line(at, 0x80);
        [0x1A, 0x01, 0x98].iter().zip(0..).for_each(|(b, i)| line(at + 345_486 + i * 95_486, *b));
    }
    text
}

#[test]
fn a_file_and_a_pipe_give_the_same_trace() {
    let scratch = Scratch::new();
    let text = sparse_beginning();
    let file = scratch.file("sparse.chars", &text);
    let from_file = fieldtap(["read", "--format", "json", argument(&file)]).good();
    let from_pipe = fieldtap_fed(["read", "--format", "json", "-"], text.as_bytes()).good();
    assert_eq!(from_file.stdout, from_pipe.stdout);
    assert_eq!(from_file.records().len(), from_pipe.records().len());
}

#[test]
fn nothing_is_lost_where_time_jumps_back_and_forth() {
    let frames: String = (0..600)
        .map(|n| format!("({}.{:06}) can0 42C#\n", 1_700_000_000 + n % 2 * 10, n * 10))
        .collect();
    let run = fieldtap_fed(["read", "--format", "json", "-"], frames.as_bytes()).good();
    let frames = |record: &&serde_json::Value| record["kind"] != "event";
    assert_eq!(run.records().iter().filter(frames).count(), 600);
    let characters = "time,byte,parity\n0.0,83,ok\n9.0,83,ok\n0.1,5C,ok\n0.2,5C,ok\n0.3,5C,ok\n";
    let run = fieldtap_fed(["read", "--format", "json", "-"], characters.as_bytes()).good();
    let bytes = |record: &serde_json::Value| record["raw"].as_str().map_or(0, |raw| raw.len() / 2);
    assert_eq!(run.records().iter().map(bytes).sum::<usize>(), 5);
}

/// Every medium that has stamps says once how often they run backwards: nothing of what lies
/// between is judged well.
#[test]
fn times_that_run_backwards_are_open() {
    for capture in [
        "time,byte,parity\n0.0,83,ok\n9.0,83,ok\n0.1,5C,ok\n0.2,5C,ok\n0.1,5C,ok\n",
        "(1.0) can0 123#\n(2.0) can0 123#\n(1.5) can0 123#\n(1.5) can0 123#\n(0.5) can0 123#\n",
        "time,out,in\n1.0,0,0\n2.0,0,0\n1.5,0,0\n1.5,0,0\n0.5,0,0\n",
    ] {
        let run = fieldtap_fed(["stats", "-"], capture.as_bytes()).good();
        let open = run.stdout.lines().find(|line| line.starts_with("OPEN")).expect("there is one");
        assert_eq!(open.matches("times run backwards 2 x").count(), 1, "{open}");
    }
}

/// 116 lines are wrong, of which 20 are told one by one.
#[test]
fn lines_that_could_not_be_read_are_open() {
    let wrong = |line: &str| line.repeat(116);
    let frames = format!("(1.0) can0 123#\n{}(2.0) can0 123#\n", wrong("(1.5) can0 123\n"));
    let rows = format!("time,out,in\n1.0,0,0\n{}2.0,0,0\n", wrong("1.5,G,0\n"));
    for capture in [frames, rows] {
        let run = fieldtap_fed(["stats", "-"], capture.as_bytes()).good();
        let line = |heading: &str| {
            let line = run.stdout.lines().find(|line| line.starts_with(heading));
            line.expect("there is one").to_owned()
        };
        assert!(line("OPEN").contains("116 lines could not be read"), "{}", run.stdout);
        let judged = "all judged but lines that could not be read";
        assert!(line("WRONG").contains(judged), "{}", run.stdout);
    }
}

/// Names come from the capture and go to a terminal: the table of buses, the last lines, cells.
#[test]
fn names_do_not_steer_the_terminal() {
    let frames = "(1.0) c\u{1B}[31m\u{B}\u{10}\u{12}\u{202E}n 123#\n(2.0) d\u{9B}\u{2066} 123#\n";
    for command in [&["stats"][..], &["read"], &["read", "--format", "csv"]] {
        let run = fieldtap_fed(command.iter().copied().chain(["-"]), frames.as_bytes()).good();
        let steers = |c: char| c.is_control() && c != '\n' || "\u{202E}\u{2066}".contains(c);
        for told in [&run.stdout, &run.stderr] {
            assert!(!told.contains(steers), "{command:?}: {told:?}");
        }
        assert!(run.stdout.contains("c·[31"), "{command:?}: {}", run.stdout);
    }
}
