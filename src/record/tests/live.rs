//! A port that a pseudo terminal plays is recorded and decoded at once, from one tap: to the
//! nanosecond, what is recorded gives the records that were given live.

use super::*;
use crate::source::live::{self, LiveOptions, Tap};
use rustix::fd::OwnedFd;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{LocalModes, OptionalActions, tcgetattr, tcsetattr};
use std::os::unix::fs::symlink;
use std::time::{Duration, Instant};

/// The other side of a port, plugged in where the port is looked for.
struct Line(OwnedFd);

impl Line {
    fn plug_in(port: &Path) -> Line {
        let master =
            openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
        grantpt(&master).unwrap();
        unlockpt(&master).unwrap();
        // Bytes reach the reader as they are, marks among them.
        let mut settings = tcgetattr(&master).unwrap();
        settings.local_modes |= LocalModes::EXTPROC;
        tcsetattr(&master, OptionalActions::Now, &settings).unwrap();
        let device = ptsname(&master, Vec::new()).unwrap().into_string().unwrap();
        // It is not there where it was plugged in for the first time.
        let _ = std::fs::remove_file(port);
        symlink(device, port).unwrap();
        Line(master)
    }

    fn send(&self, bytes: &[u8]) {
        assert_eq!(rustix::io::write(&self.0, bytes).unwrap(), bytes.len());
    }
}

/// A tap to which one thing after the other happens, and whose every word is recorded too.
struct Tee {
    tap: Box<dyn Tap>,
    happens: Vec<Box<dyn FnOnce()>>,
    recorder: Recorder,
}

impl Tee {
    fn pass_on(&mut self, mut heard: Outbox, out: &mut Outbox) {
        while let Some(Ok(piece)) = heard.next() {
            self.recorder.take(&piece).unwrap();
            // Those are for the user alone.
            if !matches!(piece, Piece::Warning(_) | Piece::Note(_)) {
                out.pass_on(piece);
            }
        }
    }
}

impl Reader for Tee {
    fn read_on(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
        let mut heard = Outbox::default();
        if self.happens.is_empty() {
            self.tap.end(&mut heard);
            self.pass_on(heard, out);
            self.recorder.finish().unwrap();
            return Ok(false);
        }
        self.happens.remove(0)();
        let begin = Instant::now();
        while begin.elapsed() < Duration::from_millis(40) {
            self.tap.read_on(&mut heard).unwrap();
        }
        self.pass_on(heard, out);
        Ok(true)
    }
}

/// 154 of encoder 0 (TR SLIN §6).
const EXCHANGE: &[u8] = &[0x80, 0x1A, 0x01, 0x98];

/// What happens to a line: exchanges; marks (termios(3)) of a bad character, of a good FFh, and what
/// cannot be where they are in force; a request that nobody answers; a port that is gone and back.
fn happenings(port: PathBuf) -> Vec<Box<dyn FnOnce()>> {
    let first = Line::plug_in(&port);
    let line = std::rc::Rc::new(std::cell::RefCell::new(Some(first)));
    let send = |bytes: &'static [u8]| -> Box<dyn FnOnce()> {
        let line = line.clone();
        Box::new(move || line.borrow().as_ref().unwrap().send(bytes))
    };
    let nothing = || -> Box<dyn FnOnce()> { Box::new(|| {}) };
    let mut happens: Vec<Box<dyn FnOnce()>> = vec![nothing()];
    happens.extend((0..30).map(|_| send(EXCHANGE)));
    happens.push(send(&[0x80, 0xFF, 0, 0x1A, 0x01, 0x98]));
    happens.push(send(&[0x80, 0xFF, 0xFF, 0x01, 0xFF, 0x42]));
    // Nobody answers, and that is heard for a while.
    happens.push(send(&[0x80]));
    happens.extend((0..3).map(|_| nothing()));
    let unplugged = line.clone();
    happens.push(Box::new(move || drop(unplugged.take())));
    let again = line.clone();
    happens.push(Box::new(move || drop(again.replace(Some(Line::plug_in(&port))))));
    // Time for it to be found.
    happens.extend((0..10).map(|_| nothing()));
    happens.extend((0..10).map(|_| send(EXCHANGE)));
    happens
}

#[test]
fn a_serial_port_is_recorded_as_it_is_read() {
    let scratch = tempfile::tempdir().unwrap();
    let (port, tape) = (scratch.path().join("port"), scratch.path().join("tape"));
    let happens = happenings(port.clone());
    let options = SourceOptions {
        baud: Baud::new(115_200),
        live: LiveOptions { reconnect: true, ..LiveOptions::default() },
        ..SourceOptions::default()
    };
    let tap = live::open(&format!("serial:{}", port.display()), &options).unwrap().unwrap();
    let files = Files::new(&tape, Ring::default()).unwrap();
    let recorder = Recorder::new(&options, files, None).unwrap();
    let tee = Reading::new(Tee { tap, happens, recorder });
    let live = json_of([Box::new(tee) as Box<dyn Source>]);
    let file = std::fs::read_dir(&tape).unwrap().next().unwrap().unwrap().path();
    let saved = json_of([source::open(file.to_str().unwrap(), &options).unwrap()]);
    for (saved, live) in saved.lines().zip(live.lines()) {
        assert_eq!(saved, live);
    }
    assert_eq!(saved.lines().count(), live.lines().count());
    for word in ["\"clock\":\"read\"", "uart.framing", "\"kind\":\"lost\"", "slin.no-response"] {
        assert!(live.contains(word), "{word} is in what is compared: {live}");
    }
}
