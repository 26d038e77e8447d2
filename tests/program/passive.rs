//! What the program asks of a port, watched from outside: nothing that reaches a bus.
//!
//! `strace` shows every call that can put something on a line or move one. What is not named here is
//! a failure, whether or not the pseudo terminal would have done it.

use crate::harness::{Scratch, argument};
use crate::line::Line;
use crate::peers::ask;
use std::collections::BTreeSet;
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

/// Calls that can write to a file that is open, or ask a driver for anything. `io_uring` could do
/// all of that unseen.
const WATCHED: &str = "trace=write,writev,pwrite64,pwritev,pwritev2,sendto,sendmsg,sendmmsg,\
                       sendfile,splice,tee,copy_file_range,ioctl,io_uring_setup";

const FIELDTAP: &str = env!("CARGO_BIN_EXE_fieldtap");

/// Questions to a driver, and settings that move no line.
const HARMLESS: [&str; 12] = [
    "TCGETS",
    "TCGETS2",
    "TCSETS",
    "TCSETS2",
    "TCFLSH",
    "TIOCEXCL",
    "TIOCNXCL",
    "TIOCGEXCL",
    "TIOCGICOUNT",
    "TIOCGSERIAL",
    "TIOCSSERIAL",
    "FIONREAD",
];

/// Encoder 0 answers 154 (TR SLIN §6).
const EXCHANGE: [u8; 4] = [0x80, 0x1A, 0x01, 0x98];

/// Runs a command under strace, while a line is played; the calls that concern its port. Nothing if
/// strace may be absent and is.
fn watch(line: &Line, command: &[&str], mut play: impl FnMut(&Line)) -> Option<Vec<Call>> {
    ask("strace", "strace", &["-V"])?;
    let scratch = Scratch::new();
    let log = scratch.file("calls", "");
    let mut child = Command::new("strace")
        .args(["-f", "-y", "-s", "4096", "-e", WATCHED, "-e", "signal=none", "-o"])
        .arg(&log)
        .args(command)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("it was there");
    let begin = Instant::now();
    while child.try_wait().expect("it can be asked").is_none() {
        assert!(begin.elapsed() < Duration::from_secs(60), "the program does not end");
        play(line);
        thread::sleep(Duration::from_millis(20));
    }
    let calls = std::fs::read_to_string(&log).expect("it was written");
    assert!(!calls.contains("io_uring_setup"), "what it does could not be seen");
    let place = format!("<{}>", line.port);
    Some(calls.lines().filter(|call| call.contains(&place)).map(Call::of).collect())
}

/// A call that concerns the port.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Call {
    /// What was asked of the driver, and with what.
    Driver(String, String),
    /// The bytes of a write.
    Write(String),
    /// Anything else.
    Other(String),
}

impl Call {
    /// `123 ioctl(3</dev/pts/0>, TCFLSH, TCIFLUSH) = 0`, `123 write(3</dev/pts/0>, "C\r", 2) = 2`.
    /// One that another thread's call interrupts is shown in two parts, of which the second does not
    /// name the port: `123 ioctl(3</dev/pts/0>, TIOCNXCL <unfinished ...>`.
    fn of(line: &str) -> Call {
        let read = || {
            let line = line.strip_suffix(" <unfinished ...>").unwrap_or(line);
            let (name, rest) = line.split_once(' ')?.1.trim_start().split_once('(')?;
            let (_, rest) = rest.split_once(", ")?;
            match name {
                "ioctl" => {
                    let (request, rest) = rest.split_once([',', ')']).unwrap_or((rest, ""));
                    // Its result stands in a column of its own.
                    let (with, _) = rest.rsplit_once(" = ").unwrap_or((rest, ""));
                    let with = with.trim().trim_end_matches(')');
                    Some(Call::Driver(request.to_owned(), with.to_owned()))
                }
                "write" => Some(Call::Write(rest.split('"').nth(1)?.to_owned())),
                _ => None,
            }
        };
        read().unwrap_or_else(|| Call::Other(line.to_owned()))
    }

    fn is_harmless(&self) -> bool {
        match self {
            // Numbers that several drivers use have several names: "SNDCTL_TMR_START or TCSETS".
            Call::Driver(request, _)
                if request.split(" or ").any(|name| HARMLESS.contains(&name)) =>
            {
                true
            }
            // Lines are dropped, never raised.
            Call::Driver(request, lines) => {
                request == "TIOCMBIC" && lines == "[TIOCM_DTR|TIOCM_RTS]"
            }
            _ => false,
        }
    }
}

#[test]
fn calls_are_read_whole_or_in_two_parts() {
    let call = |line: &str| Call::of(&format!("123 {line}"));
    let driver = |request: &str, with: &str| Call::Driver(request.into(), with.into());
    let dropped = driver("TIOCMBIC", "[TIOCM_DTR|TIOCM_RTS]");
    for (line, read) in [
        ("ioctl(3</dev/pts/0>, TIOCNXCL)      = 0", driver("TIOCNXCL", "")),
        ("ioctl(3</dev/pts/0>, TIOCNXCL <unfinished ...>", driver("TIOCNXCL", "")),
        ("ioctl(3</dev/pts/0>, TCSBRK, 1)     = 0", driver("TCSBRK", "1")),
        ("ioctl(3</dev/pts/0>, TIOCMBIC, [TIOCM_DTR|TIOCM_RTS]) = 0", dropped.clone()),
        ("ioctl(3</dev/pts/0>, TIOCMBIC, [TIOCM_DTR|TIOCM_RTS] <unfinished ...>", dropped),
        ("write(3</dev/pts/0>, \"C\\r\", 2) = 2", Call::Write("C\\r".into())),
        ("write(3</dev/pts/0>, \"C\\r\", 2 <unfinished ...>", Call::Write("C\\r".into())),
    ] {
        assert_eq!(call(line), read, "{line}");
    }
}

/// What was written, and all that is not harmless besides.
fn sort(calls: Vec<Call>) -> (Vec<String>, Vec<Call>) {
    let (mut written, mut harmful) = (Vec::new(), Vec::new());
    for call in calls {
        match call {
            Call::Write(bytes) => written.push(bytes),
            call if call.is_harmless() => {}
            call => harmful.push(call),
        }
    }
    (written, harmful)
}

fn assert_sends_nothing(calls: Vec<Call>) {
    let dropped = |call: &Call| matches!(call, Call::Driver(request, _) if request == "TIOCMBIC");
    assert!(calls.iter().any(dropped), "RTS and DTR are dropped: {calls:?}");
    assert_eq!(sort(calls), (vec![], vec![]));
}

/// Puts an exchange on the line, again and again.
fn play_exchanges(line: &Line) {
    line.put(&EXCHANGE);
}

#[test]
fn a_serial_port_is_only_listened_to() {
    let line = Line::new();
    let source = format!("serial:{}", line.port);
    for rate in ["115200", "auto"] {
        let command = [FIELDTAP, "read", &source, "--baud", rate, "--count", "6"];
        let Some(calls) = watch(&line, &command, play_exchanges) else { return };
        assert_sends_nothing(calls);
    }
}

#[test]
fn recording_sends_nothing_either() {
    let line = Line::new();
    let scratch = Scratch::new();
    let tape = scratch.path("tape");
    let source = format!("serial:{}", line.port);
    let program = [FIELDTAP, "record", &source, "--baud", "115200", "-w", argument(&tape)];
    let command = [&["timeout", "--signal=INT", "3"], &program[..]].concat();
    let calls = watch(&line, &command, play_exchanges);
    let Some(calls) = calls else { return };
    assert_sends_nothing(calls);
}

/// Plays an adapter that knows every command, and hears a frame once it is to listen.
fn play_adapter() -> impl FnMut(&Line) {
    let mut is_listening = false;
    move |line| {
        for command in line.fetch().split_inclusive(|byte| *byte == b'\r') {
            is_listening = command == b"L\r" || (is_listening && command != b"C\r");
            let answer: &[u8] = match command {
                b"V\r" => b"V1013\r",
                b"N\r" => b"NA123\r",
                _ => b"\r",
            };
            line.put(answer);
        }
        if is_listening {
            line.put(b"t3C15F97E1E0000\r");
        }
    }
}

#[test]
fn an_adapter_is_told_to_listen_and_nothing_else() {
    let line = Line::new();
    let source = format!("slcan:{}", line.port);
    for rate in ["125k", "auto"] {
        let command =
            [FIELDTAP, "read", &source, "--bitrate", rate, "--protocol", "can", "--count", "4"];
        let Some(calls) = watch(&line, &command, play_adapter()) else { return };
        let (written, harmful) = sort(calls);
        assert_eq!(harmful, [], "{rate}");
        let known = ["C", "V", "N", "Z0", "Z1", "L"];
        let commands: BTreeSet<&str> =
            written.iter().flat_map(|bytes| bytes.split("\\r")).collect();
        let is_rate = |command: &str| matches!(command.as_bytes(), [b'S', b'0'..=b'8']);
        let others: Vec<_> = commands
            .iter()
            .filter(|command| !command.is_empty() && !known.contains(command) && !is_rate(command))
            .collect();
        assert!(others.is_empty(), "{rate}: {others:?}");
        assert!(commands.contains("L"), "{rate}: {commands:?}");
        assert!(!commands.contains("O"), "it never takes part");
    }
}
