//! Listening through an adapter, whatever becomes of it.

use super::super::super::outbox::{Outbox, Reader};
use super::super::super::{Place, SourceError, SourceOptions};
use super::super::{LiveOptions, PATIENCE, Tap, serial};
use super::adapter::{Adapter, Problem, Rate, Setting};
use super::ear::Ear;
use super::search::{self, Search, Step};
use crate::ports::holders;
use dissectors::event::{Loss, LossCause, Moment};
use serialport::SerialPort;
use std::fs;
use std::io;
use std::thread;
use std::time::{Duration, Instant};

/// There is but one bus.
const BUS: usize = 0;

/// The rate of the port in Bd. Adapters on USB have none, and do not mind.
const PORT_RATE: u32 = 115_200;

/// How often an adapter that is gone is looked for.
const RETURN: Duration = Duration::from_millis(500);

type Port = Adapter<Box<dyn SerialPort>>;

/// An adapter that is listened to.
pub struct SlcanTap {
    path: String,
    source: String,
    options: LiveOptions,
    /// `None` once it failed.
    state: Option<State>,
    ear: Ear,
    /// It was said that the rate is looked for.
    is_search_told: bool,
    /// What was last said of why an adapter that is back cannot be listened to.
    last_refusal: String,
}

enum State {
    Searching(Port, Setting, Search),
    Listening(Port, Setting),
    /// It is waited for, to listen at this rate, or to look for the rate anew.
    Gone {
        rate: Option<Rate>,
        next_look: Instant,
    },
}

impl SlcanTap {
    /// Opens the port of that path and has the adapter listen.
    ///
    /// # Errors
    /// It does not: why, and what to do.
    pub fn open(path: &str, options: &SourceOptions) -> Result<Self, SourceError> {
        let source = format!("slcan:{path}");
        let name = path.strip_prefix("/dev/").unwrap_or(path);
        options.choose_only(name, &source)?;
        let options = options.live.clone();
        let whole = |what: String| SourceError::new(&source, Place::Whole, what);
        let given = options.bitrate.map(Rate::new).transpose().map_err(whole)?;
        if serial::makes_terminals(path.as_ref()) {
            return Err(whole(serial::NO_PORT.to_owned()));
        }
        let search = Search::begin(Instant::now());
        let mut port =
            Adapter::new(open_port(path).map_err(|error| refusal(&source, path, &error))?);
        let setting = port
            .listen(given.unwrap_or(search.rate()), options.allow_active)
            .map_err(|problem| because(&source, problem))?;
        let state = Some(match given {
            Some(_) => State::Listening(port, setting),
            None => State::Searching(port, setting, search.begin_window(Instant::now())),
        });
        let ear = Ear::new(name, &source);
        let last_refusal = String::new();
        Ok(SlcanTap {
            path: path.to_owned(),
            source,
            options,
            state,
            ear,
            is_search_told: false,
            last_refusal,
        })
    }

    fn error(&self, what: impl Into<String>) -> SourceError {
        SourceError::new(&self.source, Place::Whole, what)
    }

    /// Has the adapter listen at another rate: nothing else happens meanwhile, for
    /// [`LONGEST`](super::adapter::LONGEST) at most.
    fn set(&mut self, port: &mut Port, rate: Rate) -> Result<Setting, SourceError> {
        self.ear.begin();
        port.listen(rate, self.options.allow_active)
            .map_err(|problem| because(&self.source, problem))
    }

    /// Listens at a rate that may be that of the bus.
    fn search(
        &mut self,
        (mut port, setting, mut search): (Port, Setting, Search),
        out: &mut Outbox,
    ) -> Result<State, SourceError> {
        if !std::mem::replace(&mut self.is_search_told, true) {
            out.note(&format!("{}: {}", self.source, search::told()));
        }
        if let Err(problem) = self.ear.listen_for_rate(&mut port, &setting, &mut search) {
            return self.lose(None, problem, out);
        }
        match search.step(Instant::now()) {
            Step::Wait => Ok(State::Searching(port, setting, search)),
            Step::Next(rate) => {
                let setting = self.set(&mut port, rate)?;
                Ok(State::Searching(port, setting, search.begin_window(Instant::now())))
            }
            Step::Failed(why) => Err(self.error(why)),
            Step::Found(frames, dropped) => {
                self.ear.announce(&setting, out);
                let last = frames.last().map_or(Moment::UNKNOWN, |frame| frame.start);
                frames.into_iter().for_each(|frame| out.frame(BUS, frame));
                if dropped > 0 {
                    let cause = LossCause::Capture;
                    out.lost(BUS, Loss { start: last, count: Some(dropped), cause });
                }
                Ok(State::Listening(port, setting))
            }
            Step::Likely(rate) => {
                let setting = self.set(&mut port, rate)?;
                self.ear.announce(&setting, out);
                let what = "frames were heard at this bit rate alone, but errors too";
                out.warning(self.error(what));
                Ok(State::Listening(port, setting))
            }
        }
    }

    /// Listens for a moment.
    fn listen(
        &mut self,
        mut port: Port,
        setting: Setting,
        out: &mut Outbox,
    ) -> Result<State, SourceError> {
        self.ear.announce(&setting, out);
        match self.ear.listen(&mut port, &setting, out) {
            Ok(()) => Ok(State::Listening(port, setting)),
            Err(problem) => self.lose(Some(setting.rate), problem, out),
        }
    }

    /// The port failed while the adapter listened at this rate, or while the rate was looked for:
    /// then there is no bus yet.
    fn lose(
        &mut self,
        rate: Option<Rate>,
        problem: Problem,
        out: &mut Outbox,
    ) -> Result<State, SourceError> {
        if !self.options.reconnect || matches!(problem, Problem::Adapter(_)) {
            self.ear.tell_rest(out);
            return Err(because(&self.source, problem));
        }
        if rate.is_some() {
            let start = self.ear.now();
            out.lost(BUS, Loss { start, count: None, cause: LossCause::Deaf });
        }
        out.warning(self.error("the adapter is gone: waiting for it to come back"));
        Ok(State::Gone { rate, next_look: Instant::now() + RETURN })
    }

    /// Looks whether it is back.
    fn look(&mut self, rate: Option<Rate>, next_look: Instant, out: &mut Outbox) -> State {
        thread::sleep(PATIENCE);
        if Instant::now() < next_look {
            return State::Gone { rate, next_look };
        }
        match self.find_again(rate) {
            Ok(state) => {
                self.last_refusal.clear();
                out.note(&format!("{}: the adapter is back", self.source));
                state
            }
            Err(refusal) => {
                self.tell_refusal(refusal, out);
                State::Gone { rate, next_look: Instant::now() + RETURN }
            }
        }
    }

    fn find_again(&mut self, rate: Option<Rate>) -> Result<State, Option<String>> {
        let port = open_port(&self.path).map_err(|error| {
            // That it is not there was said.
            let is_there = error.kind != serialport::ErrorKind::Io(io::ErrorKind::NotFound);
            is_there.then(|| refusal(&self.source, &self.path, &error).what)
        })?;
        let mut port = Adapter::new(port);
        let search = Search::begin(Instant::now());
        let setting = match self.set(&mut port, rate.unwrap_or(search.rate())) {
            Ok(setting) => setting,
            Err(error) => return Err(error.cause.is_none().then_some(error.what)),
        };
        Ok(match rate {
            Some(_) => State::Listening(port, setting),
            None => State::Searching(port, setting, search.begin_window(Instant::now())),
        })
    }

    /// Says why an adapter that is there is not listened to, once: it may not be awake yet.
    fn tell_refusal(&mut self, refusal: Option<String>, out: &mut Outbox) {
        let Some(refusal) = refusal.filter(|refusal| *refusal != self.last_refusal) else { return };
        out.warning(self.error(format!("it is back, but {refusal}")));
        self.last_refusal = refusal;
    }
}

/// The port, as plain bytes. RTS and DTR stay as the system sets them: there is no line behind them
/// but the adapter's, and many adapters speak only where DTR is on.
fn open_port(path: &str) -> serialport::Result<Box<dyn SerialPort>> {
    serialport::new(path, PORT_RATE).timeout(PATIENCE).open()
}

/// Why a port cannot be opened, and what to do.
fn refusal(source: &str, path: &str, error: &serialport::Error) -> SourceError {
    use serialport::ErrorKind::{Io, NoDevice};
    let device = fs::canonicalize(path).unwrap_or_else(|_| path.into());
    if let (NoDevice, holders @ [_, ..]) = (error.kind, &*holders(&device)) {
        let what = format!("{} has this port: close it there first", holders.join(", "));
        return SourceError::new(source, Place::Whole, what);
    }
    let what = match error.kind {
        Io(io::ErrorKind::NotFound) => {
            "there is no such port: is the adapter plugged in? `fieldtap ports` lists what there is"
        }
        Io(io::ErrorKind::PermissionDenied) => {
            "this port may not be opened: `sudo usermod -aG dialout $USER`, and log in again"
        }
        NoDevice => "there is no adapter on this port, or another program has it open",
        _ => "this port cannot be opened",
    };
    let cause = Some(io::Error::other(error.description.clone()));
    SourceError { cause, ..SourceError::new(source, Place::Whole, what) }
}

/// Why an adapter is not listened to any more, or not at all.
fn because(source: &str, problem: Problem) -> SourceError {
    match problem {
        Problem::Adapter(what) => SourceError::new(source, Place::Whole, what),
        Problem::Port(cause) => {
            let what = "the adapter is gone: was it unplugged? --reconnect waits for it";
            SourceError { cause: Some(cause), ..SourceError::new(source, Place::Whole, what) }
        }
    }
}

impl Reader for SlcanTap {
    fn read_on(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
        let state = match self.state.take() {
            None => return Ok(false),
            Some(State::Searching(port, setting, search)) => {
                self.search((port, setting, search), out)?
            }
            Some(State::Listening(port, setting)) => self.listen(port, setting, out)?,
            Some(State::Gone { rate, next_look }) => self.look(rate, next_look, out),
        };
        self.state = Some(state);
        Ok(true)
    }
}

impl Tap for SlcanTap {
    fn follows_the_day(&self) -> bool {
        false
    }

    fn end(&mut self, out: &mut Outbox) {
        match self.state.take() {
            Some(State::Listening(..)) => self.ear.end(out),
            Some(State::Searching(_, setting, search)) => {
                self.ear.announce(&setting, out);
                match search.cut_short() {
                    Ok(frames) => frames.into_iter().for_each(|frame| out.frame(BUS, frame)),
                    Err(why) => out.warning(self.error(why)),
                }
                self.ear.end(out);
            }
            _ => {}
        }
    }
}
