//! Adapters that are played: what is written to them, and what is believed of their answers.

use super::*;
use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

/// An adapter that answers each command as its script says, and keeps what was written.
struct Script {
    answers: fn(&str) -> &'static str,
    told: VecDeque<u8>,
    heard: Rc<RefCell<String>>,
}

impl Read for Script {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.told.is_empty() {
            std::thread::sleep(Duration::from_millis(1));
            return Err(io::ErrorKind::TimedOut.into());
        }
        // Bytes come one by one, as over a slow line.
        self.told.read(&mut buffer[..1])
    }
}

impl Write for Script {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let command = std::str::from_utf8(bytes).expect("commands are text");
        self.heard.borrow_mut().push_str(command);
        self.told.extend((self.answers)(command).bytes());
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        panic!("an adapter that is stuck never lets this return")
    }
}

/// What came of it, and everything that was written until the adapter was let go.
fn listen(
    answers: fn(&str) -> &'static str,
    may_be_active: bool,
) -> (Result<Setting, String>, String) {
    let heard = Rc::new(RefCell::new(String::new()));
    let told = VecDeque::new();
    let mut adapter = Adapter::new(Script { answers, told, heard: Rc::clone(&heard) });
    let rate = Rate::new(125_000).expect("adapters have it");
    let setting = adapter.listen(rate, may_be_active).map_err(|problem| match problem {
        Problem::Adapter(what) => what,
        Problem::Port(error) => error.to_string(),
    });
    drop(adapter);
    let heard = heard.borrow().replace('\r', " ");
    (setting, heard)
}

#[test]
fn a_good_adapter_is_asked_and_set_and_closed_and_nothing_else() {
    let (setting, heard) = listen(
        |command| match command {
            "V\r" => "V1013\r",
            "N\r" => "NA123\r",
            _ => "\r",
        },
        false,
    );
    let setting = setting.expect("it listens");
    assert_eq!(setting.name, "V1013 NA123");
    assert!(setting.has_stamps && setting.is_confirmed);
    assert_eq!(heard, "C V N S4 Z1 L C ");
}

#[test]
fn one_that_was_open_may_still_send_frames_and_need_not_have_stamps() {
    let (setting, heard) = listen(
        |command| match command {
            "C\r" => "3C10\rt1230\r\x07",
            "V\r" => "t1230\rV0102\r",
            "N\r" | "Z1\r" => "\x07",
            _ => "\r",
        },
        false,
    );
    let setting = setting.expect("it listens");
    assert_eq!((setting.name.as_str(), setting.has_stamps), ("V0102", false));
    assert_eq!(heard, "C C V N S4 Z1 L C ");
}

#[test]
fn one_that_does_not_know_listen_only_is_refused_and_never_opened() {
    let answers: fn(&str) -> &'static str = |command| if command == "L\r" { "\x07" } else { "\r" };
    for may_be_active in [false, true] {
        let (setting, heard) = listen(answers, may_be_active);
        let what = setting.expect_err("it would take part");
        assert!(what.contains("refuses L"), "{what}");
        assert!(heard.ends_with("L C ") && !heard.contains('O'), "{heard}");
    }
}

#[test]
fn one_that_does_not_confirm_is_refused_unless_it_may_be_active() {
    let (setting, _) = listen(|_| "", false);
    assert!(setting.expect_err("it is mute").contains("nothing answers"));
    let but_listen: fn(&str) -> &'static str = |command| if command == "L\r" { "" } else { "\r" };
    let (setting, _) = listen(but_listen, false);
    assert!(setting.expect_err("it may take part").contains("does not confirm L"));
    let (setting, _) = listen(but_listen, true);
    assert!(!setting.expect("the user knows").is_confirmed);
}

/// Answers this late, however long it has more to do; the last is said to `L`.
struct Late {
    by: Duration,
    due: VecDeque<(Instant, u8)>,
    to_listen_only: &'static [u8],
}

impl Read for Late {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        std::thread::sleep(Duration::from_millis(1));
        let due = self.due.pop_front_if(|(at, _)| Instant::now() >= *at);
        let (_, byte) = due.ok_or(io::ErrorKind::TimedOut)?;
        buffer[0] = byte;
        Ok(1)
    }
}

impl Write for Late {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let free = self.due.back().map_or(Instant::now(), |(at, _)| *at).max(Instant::now());
        let told = if bytes == b"L\r" { self.to_listen_only } else { b"\r" };
        self.due.extend(told.iter().map(|byte| (free + self.by, *byte)));
        Ok(bytes.len())
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn listen_late(to_listen_only: &'static [u8]) -> Result<Setting, Problem> {
    let by = Duration::from_millis(550);
    let mut adapter = Adapter::new(Late { by, due: VecDeque::new(), to_listen_only });
    adapter.listen(Rate::new(125_000).expect("adapters have it"), false)
}

#[test]
fn a_late_answer_to_another_command_does_not_confirm() {
    match listen_late(b"\x07") {
        Err(Problem::Adapter(what)) => assert!(what.contains("refuses L"), "{what}"),
        other => panic!("it refused: {other:?}"),
    }
    assert!(listen_late(b"\r").expect("it is but slow").is_confirmed);
}

#[test]
fn one_that_answers_more_than_it_is_asked_confirms_nothing() {
    let (setting, _) = listen(|_| "\r\r\r", false);
    assert!(setting.expect_err("it says yes to all").contains("does not confirm L"));
}

/// What comes of an adapter that confirms `L` and then says what it hears.
fn read_all(answers: fn(&str) -> &'static str) -> Result<(), Problem> {
    let (told, heard) = (VecDeque::new(), Rc::default());
    let mut adapter = Adapter::new(Script { answers, told, heard });
    adapter.listen(Rate::new(125_000).expect("adapters have it"), true)?;
    while adapter.read(|_| {})? {}
    Ok(())
}

#[test]
fn a_refusal_that_comes_after_the_confirmation_is_believed_but_no_noise() {
    let late = read_all(|command| if command == "L\r" { "\rt1230\r\x07" } else { "\r" });
    assert!(matches!(late, Err(Problem::Adapter(what)) if what.contains("refuses L")));
    let noise = read_all(|command| if command == "L\r" { "\rx\x07\x07y\r\x07" } else { "\r" });
    assert!(noise.is_ok(), "{noise:?}");
}

#[test]
fn no_adapter_keeps_the_tap_longer_than_said() {
    /// Says something else again and again, or nothing.
    struct Stubborn(&'static [u8]);
    impl Read for Stubborn {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            std::thread::sleep(Duration::from_millis(10));
            match self.0 {
                b"" => Err(io::ErrorKind::TimedOut.into()),
                mut told => told.read(buffer),
            }
        }
    }
    impl Write for Stubborn {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            Ok(bytes.len())
        }
        fn flush(&mut self) -> io::Result<()> {
            panic!("an adapter that is stuck never lets this return")
        }
    }
    let rate = Rate::new(125_000).expect("adapters have it");
    let listen = |told: &'static str| {
        let (begin, mut adapter) = (Instant::now(), Adapter::new(Stubborn(told.as_bytes())));
        assert!(adapter.listen(rate, false).is_err());
        assert!(begin.elapsed() < LONGEST, "{told:?}: {:?}", begin.elapsed());
    };
    std::thread::scope(|scope| {
        for told in ["", "t1230\r", "x"] {
            scope.spawn(move || listen(told));
        }
    });
}

#[test]
fn a_bit_rate_that_it_does_not_have_is_told() {
    let (setting, _) = listen(|command| if command == "S4\r" { "\x07" } else { "\r" }, false);
    assert_eq!(setting.expect_err("it refuses"), "the adapter refuses 125000 bit/s");
    let what = Rate::new(123_456).expect_err("nobody has it");
    assert!(what.ends_with("10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000, 1000000"));
    let numbers = [10_000, 125_000, 250_000, 500_000, 1_000_000].map(|b| Rate::new(b).map(|r| r.0));
    assert_eq!(numbers, [Ok(0), Ok(4), Ok(5), Ok(6), Ok(8)]);
}
