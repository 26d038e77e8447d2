//! A port that a pseudo terminal plays: its master is the line.

use super::super::super::transcript::of_source;
use super::super::{Listening, LiveOptions};
use super::*;
use crate::source::{Piece, Source};
use rustix::fd::OwnedFd;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{
    ControlModes, InputModes, LocalModes, OptionalActions, OutputModes, Termios, tcgetattr,
    tcsetattr,
};
use std::os::unix::fs::symlink;

/// The line on the other side of a port.
struct Line {
    master: OwnedFd,
    port: String,
}

impl Line {
    fn new() -> Line {
        let master =
            openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
        grantpt(&master).unwrap();
        unlockpt(&master).unwrap();
        let port = ptsname(&master, Vec::new()).unwrap().into_string().unwrap();
        Line { master, port }
    }

    /// One whose bytes reach the reader as they are, so that a test can put marks among them.
    fn with_marks() -> Line {
        let line = Line::new();
        let mut settings = tcgetattr(&line.master).unwrap();
        settings.local_modes |= LocalModes::EXTPROC;
        tcsetattr(&line.master, OptionalActions::Now, &settings).unwrap();
        line
    }

    fn send(&self, bytes: &[u8]) {
        assert_eq!(rustix::io::write(&self.master, bytes).unwrap(), bytes.len());
    }

    /// What the reader has set.
    fn settings(&self) -> Termios {
        tcgetattr(&self.master).unwrap()
    }

    fn tap(&self) -> Serial {
        Serial::open(&self.port, &options(Some(115_200))).unwrap()
    }
}

fn options(baud: Option<u32>) -> SourceOptions {
    SourceOptions { baud: baud.and_then(Baud::new), ..SourceOptions::default() }
}

#[test]
fn a_rate_that_no_port_has_is_refused() {
    let line = Line::new();
    for baud in [1, 49, 12_000_001, u32::MAX] {
        let refused = Serial::open(&line.port, &options(Some(baud))).err().unwrap();
        let told = format!("no serial port has {baud} Bd: they have 50 to 12000000 Bd");
        assert_eq!(refused.what, told);
    }
    for baud in [50, 345_594, 12_000_000] {
        assert!(Serial::open(&line.port, &options(Some(baud))).is_ok(), "{baud}");
    }
}

/// Everything a tap says until it has heard so many characters, without the silence between.
fn hear(tap: &mut Serial, count: usize) -> Vec<String> {
    let (mut said, mut heard) = (Vec::new(), 0);
    let begin = Instant::now();
    while heard < count {
        assert!(begin.elapsed() < Duration::from_secs(20), "heard {heard} of {count}");
        let mut out = Outbox::default();
        tap.read_on(&mut out).unwrap();
        heard += out.heard().len();
        said.extend(words(out));
    }
    said
}

fn words(out: Outbox) -> Vec<String> {
    struct Said(Outbox);
    impl Source for Said {
        fn next_piece(&mut self) -> Result<Option<Piece<'_>>, SourceError> {
            self.0.next().transpose()
        }
    }
    let lines = of_source(&mut Said(out));
    lines.into_iter().filter(|line| !line.starts_with("0: nothing until")).collect()
}

/// The characters among what was said, without their times. A busy computer makes losses of pauses.
fn characters(said: &[String]) -> Vec<String> {
    let lines = said.iter().filter_map(|line| line.strip_prefix("0: "));
    let lines = lines.filter(|line| !line.starts_with("lost"));
    let words = lines.flat_map(|line| line.split(", "));
    words.map(|word| word.split(" @").next().unwrap().to_owned()).collect()
}

#[test]
fn a_port_is_raw_and_tells_that_it_knows_no_parity() {
    let line = Line::new();
    let mut tap = line.tap();
    let settings = line.settings();
    assert_eq!(settings.input_modes, InputModes::INPCK | InputModes::PARMRK);
    assert_eq!(settings.output_modes & OutputModes::OPOST, OutputModes::empty());
    let lines = LocalModes::ECHO | LocalModes::ICANON | LocalModes::ISIG | LocalModes::IEXTEN;
    assert_eq!(settings.local_modes & lines, LocalModes::empty());
    assert_eq!(settings.control_modes & ControlModes::CMSPAR, ControlModes::empty());
    assert_eq!(settings.output_speed(), 115_200);

    // 11h, 13h, 03h, 0Dh and 80h mean something to a terminal; a good FFh comes doubled.
    line.send(&[0x11, 0x13, 0x03, 0x0D, 0x80, 0xFF, 0x00, 0x04, 0x7F]);
    let said = hear(&mut tap, 9);
    let all = ["11", "13", "03", "0D", "80", "FF", "00", "04", "7F"];
    assert_eq!(characters(&said), all.map(|byte| format!("{byte} parity unknown")));
    let warned = said.iter().find(|line| line.starts_with("warning")).unwrap();
    assert!(warned.contains("does not keep the parity setting"), "{warned}");
    assert!(
        said[0].contains("pseudo terminal, 115200 8E1") && said[0].contains("±2.0 ms"),
        "{said:?}"
    );
}

#[test]
fn what_another_program_left_behind_is_cleared_and_any_rate_is_taken() {
    let line = Line::new();
    let mut left = line.settings();
    left.control_modes |= ControlModes::CMSPAR | ControlModes::PARODD;
    left.input_modes |= InputModes::ISTRIP | InputModes::IGNPAR;
    tcsetattr(&line.master, OptionalActions::Now, &left).unwrap();
    let tap = Serial::open(&line.port, &options(Some(345_594))).unwrap();
    let parity = ControlModes::CMSPAR | ControlModes::PARODD;
    assert_eq!(line.settings().control_modes & parity, ControlModes::empty());
    assert_eq!(line.settings().output_speed(), 345_594);
    assert_eq!(line.settings().input_modes & InputModes::ISTRIP, InputModes::empty());
    drop(tap);
}

#[test]
fn marks_are_read_across_any_split() {
    // 81, a bad 00h, 01, a good FFh, a bad FFh, 89 (vector 34 with two FFh more).
    let bytes = [0x81, 0xFF, 0, 0, 0x01, 0xFF, 0xFF, 0xFF, 0, 0xFF, 0x89];
    for size in 1..=bytes.len() {
        let line = Line::with_marks();
        let mut tap = line.tap();
        let mut said = Vec::new();
        for part in bytes.chunks(size) {
            line.send(part);
            // Each part is read before the next is sent.
            let begin = Instant::now();
            while begin.elapsed() < Duration::from_millis(20) {
                let mut out = Outbox::default();
                tap.read_on(&mut out).unwrap();
                said.extend(words(out));
            }
        }
        let unknown = |byte: &str| format!("{byte} parity unknown");
        let bad = |byte: &str| format!("{byte} parity unknown framing error");
        let all =
            [unknown("81"), bad("00"), unknown("01"), unknown("FF"), bad("FF"), unknown("89")];
        assert_eq!(characters(&said), all, "{size} bytes a read");
    }
}

#[test]
fn a_port_that_does_not_mark_as_asked_is_found_out() {
    let line = Line::with_marks();
    let mut tap = line.tap();
    line.send(&[0x41, 0xFF, 0x42]);
    let mut said = hear(&mut tap, 3);
    line.send(&[0xFF, 0x43]);
    said.extend(hear(&mut tap, 2));
    let all = ["41", "FF", "42", "FF", "43"].map(|byte| format!("{byte} parity unknown"));
    assert_eq!(characters(&said), all);
    let warned = said.iter().filter(|line| line.contains("does not mark errors as asked"));
    assert_eq!(warned.count(), 1, "{said:?}");
}

#[test]
fn a_second_reader_is_told_to_go_elsewhere() {
    let line = Line::new();
    let _first = line.tap();
    let error = Serial::open(&line.port, &options(None)).err().unwrap().to_string();
    assert!(error.contains("another program has this port") || error.contains("has this port"));
}

#[test]
fn a_link_to_a_port_has_the_name_of_its_device() {
    let line = Line::new();
    let folder = tempfile::tempdir().unwrap();
    let link = folder.path().join("usb-FTDI_FT232R_A5XK3RJT-if00-port0");
    symlink(&line.port, &link).unwrap();
    let device = line.port.strip_prefix("/dev/").unwrap();
    assert_eq!(bus_name(link.to_str().unwrap()), device);
    assert_eq!(bus_name(&line.port), device);
    assert_eq!(bus_name("./nowhere"), "./nowhere");
}

#[test]
fn a_port_that_is_not_there_says_so() {
    let error = |path: &str| Serial::open(path, &options(None)).err().unwrap().to_string();
    assert!(error("/dev/ttyNone").contains("serial:/dev/ttyNone: there is no such port"));
    let file = tempfile::NamedTempFile::new().unwrap();
    assert!(error(file.path().to_str().unwrap()).contains("this is no serial port"));
}

#[test]
fn a_port_that_vanishes_ends_the_run_with_a_reason() {
    let line = Line::new();
    let mut tap = line.tap();
    line.send(&[0x80]);
    hear(&mut tap, 1);
    let line_name = format!("serial:{}", line.port);
    drop(line);
    let mut source = Listening::begin(&line_name, Box::new(tap));
    let said = of_source(&mut source);
    let last = said.last().unwrap();
    assert!(last.contains("the port is gone: was the adapter unplugged?"), "{said:?}");
    assert!(said.iter().any(|line| line.contains("counters of the driver: not available")));
}

#[test]
fn a_port_that_vanishes_ends_no_earlier_than_what_was_heard_on_it() {
    for reconnect in [false, true] {
        let line = Line::new();
        let live = LiveOptions { reconnect, ..LiveOptions::default() };
        let options = SourceOptions { live, ..options(Some(115_200)) };
        let mut tap = Serial::open(&line.port, &options).unwrap();
        hear(&mut tap, 0);
        tap.read_on(&mut Outbox::default()).unwrap();
        // A line is slower than that: these are placed up to 2 ms after they were read.
        let until = now() + 1_500_000;
        tap.hearing.hear(
            &[0x80; 40],
            until - 1_500_000,
            &Default::default(),
            &mut Outbox::default(),
        );
        tap.hearing.hear(
            &[0x80; 40],
            until - 1_500_000,
            &Default::default(),
            &mut Outbox::default(),
        );
        let mut out = Outbox::default();
        let _ = tap.vanish(io::ErrorKind::UnexpectedEof.into(), &mut out);
        let said = words(out);
        let told = said.iter().find(|line| line.starts_with("0: ")).unwrap();
        let (_, at) = told.split_once('@').unwrap();
        assert!(at.parse::<i64>().unwrap() >= until, "{told}");
    }
}

#[test]
fn a_port_that_comes_back_is_listened_to_again_after_a_loss() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("port");
    let line = Line::new();
    symlink(&line.port, &path).unwrap();
    let live = LiveOptions { reconnect: true, ..LiveOptions::default() };
    let options = SourceOptions { live, ..options(Some(19_200)) };
    let mut tap = Serial::open(path.to_str().unwrap(), &options).unwrap();
    line.send(&[0x80]);
    hear(&mut tap, 1);
    drop(line);
    std::fs::remove_file(&path).unwrap();
    let mut out = Outbox::default();
    while !words(std::mem::take(&mut out)).iter().any(|line| line.contains("lost")) {
        tap.read_on(&mut out).unwrap();
    }
    let line = Line::new();
    symlink(&line.port, &path).unwrap();
    while tap.port.is_none() {
        tap.read_on(&mut out).unwrap();
    }
    assert_eq!(line.settings().output_speed(), 19_200);
    line.send(&[0x81]);
    let said = hear(&mut tap, 1);
    assert_eq!(characters(&said), ["81 parity unknown"]);
}

#[test]
fn at_its_end_a_tap_tells_the_counters_and_until_when_it_heard() {
    let line = Line::new();
    let mut tap = line.tap();
    hear(&mut tap, 0);
    tap.read_on(&mut Outbox::default()).unwrap();
    let mut out = Outbox::default();
    tap.end(&mut out);
    let said = words(out);
    assert!(said[0].contains("counters of the driver: not available"), "{said:?}");
    assert!(said[1].starts_with("0: end @"), "{said:?}");
}

/// Encoder 0 answers 154 (TR SLIN §6, example 1).
const EXCHANGE: [u8; 4] = [0x80, 0x1A, 0x01, 0x90];

#[test]
fn the_rate_at_which_something_is_spoken_is_settled_on() {
    let line = Line::new();
    let mut tap = Serial::open(&line.port, &options(None)).unwrap();
    let begin = Instant::now();
    let (mut said, mut rates) = (Vec::new(), Vec::new());
    while tap.seek.is_some() {
        assert!(begin.elapsed() < Duration::from_secs(20));
        let rate = line.settings().output_speed();
        if rates.last() != Some(&rate) {
            rates.push(rate);
        }
        // The master of this line speaks at 9600 Bd.
        if rate == 9_600 {
            line.send(&EXCHANGE);
        }
        let mut out = Outbox::default();
        tap.read_on(&mut out).unwrap();
        said.extend(words(out));
    }
    assert_eq!(rates, [115_200, 19_200, 9_600]);
    let told = said.iter().find(|line| line.contains("baud 9600")).unwrap();
    assert!(told.contains("115200 silent; 19200 silent; 9600 slin: "), "{told}");
    assert!(characters(&said).len() >= 16, "what was heard is kept: {said:?}");
    assert_eq!(line.settings().output_speed(), 9_600);
}
