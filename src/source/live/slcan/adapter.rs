//! An adapter, and how it is made to listen.

use super::exchange::{Answer, Command, Exchange};
use super::line;
use super::split::{Saying, Splitter};
use std::io::{self, Read, Write};
use std::ops::{ControlFlow, Range};
use std::time::{Duration, Instant};

/// How long [`Adapter::listen`] takes at most, whatever the adapter does.
pub const LONGEST: Duration = Duration::from_secs(6);

/// How long an answer is waited for. There are six, and two longer waits: what is left is for a last
/// read of each and for a port that has no room for a command.
const ANSWER: Duration = Duration::from_millis(LONGEST.as_secs() * 1000 / 12);

/// How long that to `L` is, and before it those that are late. A refusal that comes within this time
/// after `L` is believed, whatever came before.
const PATIENCE: Duration = Duration::from_millis(LONGEST.as_secs() * 1000 / 6);

/// How long is read what nobody asked for, before each command.
const STRAYS: Duration = Duration::from_millis(50);

/// Why one that does not know `L` is not listened to.
const REFUSES: &str = "the adapter refuses L, to listen only: it could only acknowledge what it \
                       hears, and so take part in the traffic. Take another one, or newer firmware";

/// Bit rates in bit/s, in the order of the numbers that `S` takes (Lawicel manual).
const RATES: [u32; 9] =
    [10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000];

/// A bit rate that adapters have.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Rate(u8);

impl Rate {
    /// That of so many bit/s.
    ///
    /// # Errors
    /// Adapters do not have it: which ones they have.
    pub fn new(bitrate: u32) -> Result<Rate, String> {
        let rate = RATES.iter().position(|rate| *rate == bitrate);
        rate.and_then(|number| u8::try_from(number).ok()).map(Rate).ok_or_else(|| {
            let rates: Vec<String> = RATES.iter().map(u32::to_string).collect();
            format!("adapters have no {bitrate} bit/s: they have {}", rates.join(", "))
        })
    }

    /// Its bit/s.
    pub fn get(self) -> u32 {
        RATES[usize::from(self.0)]
    }

    /// Its number in `S`.
    pub fn number(self) -> u8 {
        self.0
    }
}

/// What is known of an adapter that listens.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Setting {
    /// Version and serial number, if it told them.
    pub name: String,
    /// The bit rate it was set to.
    pub rate: Rate,
    /// Whether it stamps frames.
    pub has_stamps: bool,
    /// Whether it said that it is listen-only. Else it said nothing.
    pub is_confirmed: bool,
}

/// Why an adapter cannot be listened to.
#[derive(Debug)]
pub enum Problem {
    /// The port failed.
    Port(io::Error),
    /// What it did, and what to do.
    Adapter(String),
}

impl From<io::Error> for Problem {
    fn from(error: io::Error) -> Self {
        Problem::Port(error)
    }
}

/// An adapter on a port that gives up reading after a while.
pub struct Adapter<P: Read + Write> {
    port: P,
    splitter: Splitter,
    buffer: Box<[u8]>,
    /// What of the buffer was read and not yet looked at.
    unread: Range<usize>,
    exchange: Exchange,
    /// Until when a refusal is that of `L`.
    may_refuse_until: Option<Instant>,
    /// What it said last cannot be read.
    is_noise: bool,
}

impl<P: Read + Write> Adapter<P> {
    /// On this port. Nothing is written yet.
    pub fn new(port: P) -> Self {
        let (splitter, buffer) = (Splitter::default(), vec![0; 4096].into());
        let exchange = Exchange::default();
        Adapter {
            port,
            splitter,
            buffer,
            unread: 0..0,
            exchange,
            may_refuse_until: None,
            is_noise: false,
        }
    }

    /// Has it listen at a bit rate, and stamp frames if it can. It is back within [`LONGEST`].
    ///
    /// # Errors
    /// The port failed, or the adapter does not listen: whatever it does not confirm counts as
    /// refused, unless it may be active.
    pub fn listen(&mut self, rate: Rate, may_be_active: bool) -> Result<Setting, Problem> {
        let problem = |what: &str| Err(Problem::Adapter(what.to_owned()));
        self.splitter.forget();
        (self.may_refuse_until, self.is_noise) = (None, false);
        self.take_strays()?;
        self.exchange.begin();
        self.ask(Command::Close, ANSWER)?;
        if !matches!(self.exchange.last(), Answer::Done(_)) {
            // It was closed already, or took this for the end of what another program began.
            self.ask(Command::Close, ANSWER)?;
        }
        for command in [Command::Version, Command::SerialNumber, Command::Rate(rate)] {
            self.ask(command, ANSWER)?;
        }
        self.ask(Command::Stamps, ANSWER)?;
        self.hear_until(PATIENCE, |exchange| !exchange.is_waiting())?;
        if *self.exchange.answer(Command::Rate(rate)) == Answer::Refused {
            return problem(&format!("the adapter refuses {} bit/s", rate.get()));
        }
        let is_mute = self.exchange.is_mute();
        self.ask(Command::ListenOnly, PATIENCE)?;
        if self.exchange.has_refused() {
            return problem(REFUSES);
        }
        let listens = self.exchange.last();
        let is_confirmed = matches!(listens, Answer::Done(_)) && !self.exchange.is_confused();
        if !is_confirmed && !may_be_active {
            return problem(if is_mute && self.exchange.is_mute() {
                "nothing answers: is it an adapter that speaks slcan, and the right port? For one \
                 that never answers, add --allow-active"
            } else {
                "the adapter does not confirm L, to listen only: it may acknowledge what it hears, \
                 and so take part in the traffic. If it may, add --allow-active"
            });
        }
        let has_stamps = matches!(self.exchange.answer(Command::Stamps), Answer::Done(_));
        Ok(Setting { name: self.name(), rate, has_stamps, is_confirmed })
    }

    /// What it told of itself.
    fn name(&self) -> String {
        let told = [Command::Version, Command::SerialNumber].map(|command| {
            match self.exchange.answer(command) {
                Answer::Done(name) => name.as_str(),
                _ => "",
            }
        });
        told.join(" ").trim().to_owned()
    }

    /// Writes a command and waits for its answer, for this long.
    fn ask(&mut self, command: Command, patience: Duration) -> io::Result<()> {
        self.take_strays()?;
        self.exchange.ask(command);
        // No flush: it would wait without end for an adapter that takes nothing (`tcdrain(3)`).
        self.port.write_all(command.text().as_bytes())?;
        let listens = command == Command::ListenOnly;
        if listens {
            self.may_refuse_until = Some(Instant::now() + PATIENCE);
        }
        self.hear_until(patience, |exchange| {
            *exchange.last() != Answer::None || listens && exchange.has_refused()
        })
    }

    /// Reads what is there. What nobody asked for is counted.
    fn take_strays(&mut self) -> io::Result<()> {
        let begin = Instant::now();
        let mut exchange = std::mem::take(&mut self.exchange);
        let mut heard = Ok(true);
        while matches!(heard, Ok(true)) && begin.elapsed() < STRAYS {
            heard = self.read_while(|saying| {
                exchange.hear(saying);
                ControlFlow::Continue(())
            });
        }
        self.exchange = exchange;
        heard.map(|_| ())
    }

    /// Hears the answers, for this long or until it is enough.
    fn hear_until(
        &mut self,
        patience: Duration,
        mut is_enough: impl FnMut(&Exchange) -> bool,
    ) -> io::Result<()> {
        let begin = Instant::now();
        let mut exchange = std::mem::take(&mut self.exchange);
        let mut heard = Ok(true);
        while heard.is_ok() && !is_enough(&exchange) && begin.elapsed() < patience {
            heard = self.read_while(|saying| {
                exchange.hear(saying);
                match is_enough(&exchange) {
                    true => ControlFlow::Break(()),
                    false => ControlFlow::Continue(()),
                }
            });
        }
        self.exchange = exchange;
        heard.map(|_| ())
    }

    /// Reads once, and hands over what the adapter said. False where it said nothing.
    ///
    /// # Errors
    /// The port is gone, or the adapter refuses after all to listen only.
    pub fn read(&mut self, mut take: impl FnMut(Saying<'_>)) -> Result<bool, Problem> {
        if self.may_refuse_until.is_none_or(|until| Instant::now() >= until) {
            return Ok(self.read_while(|saying| {
                take(saying);
                ControlFlow::Continue(())
            })?);
        }
        let (mut refuses, mut is_noise) = (false, self.is_noise);
        let is_heard = self.read_while(|saying| {
            // Among noise there is a BEL, too.
            refuses |= saying == Saying::Refusal && !is_noise;
            is_noise = match saying {
                Saying::Line(line) => line::parse(line).is_none(),
                Saying::TooLong | Saying::CutRefusal => true,
                Saying::Refusal => is_noise,
            };
            take(saying);
            ControlFlow::Continue(())
        })?;
        self.is_noise = is_noise;
        if refuses {
            return Err(Problem::Adapter(REFUSES.to_owned()));
        }
        Ok(is_heard)
    }

    /// Whether it began a line and did not end it.
    pub fn has_begun(&self) -> bool {
        self.splitter.has_begun()
    }

    /// The same, for as long as more is wanted. The rest is for who reads next.
    fn read_while(
        &mut self,
        mut take: impl FnMut(Saying<'_>) -> ControlFlow<()>,
    ) -> io::Result<bool> {
        let Adapter { port, splitter, buffer, unread, .. } = self;
        if Range::is_empty(unread) {
            *unread = match port.read(buffer) {
                Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
                Ok(count) => 0..count,
                Err(error) if is_pause(&error) => return Ok(false),
                Err(error) => return Err(error),
            };
        }
        for index in unread {
            if let Some(saying) = splitter.take(buffer[index])
                && take(saying).is_break()
            {
                break;
            }
        }
        Ok(true)
    }
}

fn is_pause(error: &io::Error) -> bool {
    use io::ErrorKind::{Interrupted, TimedOut, WouldBlock};
    matches!(error.kind(), TimedOut | WouldBlock | Interrupted)
}

impl<P: Read + Write> Drop for Adapter<P> {
    /// Has it leave the bus. Nothing can be done where it does not.
    fn drop(&mut self) {
        let _ = self.port.write_all(b"C\r");
    }
}

#[cfg(test)]
mod tests {
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
        let answers: fn(&str) -> &'static str =
            |command| if command == "L\r" { "\x07" } else { "\r" };
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
        let but_listen: fn(&str) -> &'static str =
            |command| if command == "L\r" { "" } else { "\r" };
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
        assert!(
            what.ends_with("10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000, 1000000")
        );
        let numbers =
            [10_000, 125_000, 250_000, 500_000, 1_000_000].map(|b| Rate::new(b).map(|r| r.0));
        assert_eq!(numbers, [Ok(0), Ok(4), Ok(5), Ok(6), Ok(8)]);
    }
}
