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
mod tests;
