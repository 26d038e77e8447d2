//! Listening on a CAN interface, whatever becomes of it.

use super::super::super::outbox::{Outbox, Reader};
use super::super::super::{Place, SourceError, SourceOptions};
use super::super::{LiveOptions, PATIENCE, Tap};
use super::ear::{self, BUS, now};
use super::interface::{self, Interface, Refusal};
use super::socket;
use dissectors::bus::WireFacts;
use dissectors::event::{Clock, Loss, LossCause, Moment};
use dissectors::protocol::Medium;
use dissectors::record::BusInfo;
use socketcan::CanFdSocket;
use std::io;
use std::thread;
use std::time::{Duration, Instant};

/// How often the interface's statistics are read.
const STATISTICS: Duration = Duration::from_secs(1);

/// How often an interface that is down or gone is looked for.
const RETURN: Duration = Duration::from_millis(200);

/// An interface that is listened to.
pub struct CanTap {
    name: String,
    source: String,
    options: LiveOptions,
    interface: Interface,
    is_announced: bool,
    /// `None` once it failed.
    state: Option<State>,
    next_look: Instant,
    /// What was last said of why it cannot be listened to.
    last_refusal: Option<Refusal>,
}

type Ear = ear::Ear<CanFdSocket>;

enum State {
    Hearing(Ear),
    Down(Ear),
    Gone,
}

impl CanTap {
    /// Opens the interface of that name.
    ///
    /// # Errors
    /// It cannot be listened to, or ought not to be: why, and the commands that set it right.
    pub fn open(name: &str, options: &SourceOptions) -> Result<Self, SourceError> {
        let source = format!("can:{name}");
        options.choose_only(name, &source)?;
        let options = options.live.clone();
        let refuse = |refusal: Refusal| SourceError::new(&source, Place::Whole, refusal.text());
        let (interface, ear) = find(name, options.allow_active).map_err(refuse)?;
        Ok(CanTap {
            name: name.to_owned(),
            source,
            options,
            interface,
            is_announced: false,
            state: Some(State::Hearing(ear)),
            next_look: Instant::now() + STATISTICS,
            last_refusal: None,
        })
    }

    fn announce(&mut self, out: &mut Outbox) {
        let bitrate = self.interface.bitrate();
        let facts = WireFacts { medium: Some(Medium::Can), baud: bitrate, ..WireFacts::default() };
        out.bus(BusInfo::new(self.name.clone(), Some(Clock::Kernel)), facts);
        self.describe(out);
        self.compare_with_asked(out);
        self.is_announced = true;
    }

    /// The user's word on the bit rate counts in what is decoded, and does not set the interface.
    fn compare_with_asked(&self, out: &mut Outbox) {
        let set = self.interface.bitrate().map(|rate| rate.get());
        if let Some((set, asked)) = set.zip(self.options.bitrate)
            && set != asked
        {
            out.warning(self.error(format!(
                "it listens at {set} bit/s; load and times on the wire are reckoned with the \
                 {asked} of --bitrate, so leave that out"
            )));
        }
    }

    fn describe(&self, out: &mut Outbox) {
        out.note(&format!("{}: {}", self.source, self.interface.describe()));
    }

    fn error(&self, what: impl Into<String>) -> SourceError {
        SourceError::new(&self.source, Place::Whole, what)
    }

    /// Listens for a moment.
    fn hear(&mut self, mut ear: Ear, out: &mut Outbox) -> Result<State, SourceError> {
        if let Err(error) = ear.listen(out) {
            return self.lose(ear, error, out);
        }
        if Instant::now() >= self.next_look {
            self.next_look = Instant::now() + STATISTICS;
            ear.tell_interface_drops(interface::statistics(&self.name), out);
        }
        Ok(State::Hearing(ear))
    }

    /// The socket told what became of the interface.
    fn lose(
        &mut self,
        mut ear: Ear,
        error: io::Error,
        out: &mut Outbox,
    ) -> Result<State, SourceError> {
        let since = ear.tell_before_stop(out);
        let is_there = interface::is_there(&self.name);
        match error.raw_os_error() {
            Some(libc::ENETDOWN) if is_there => {
                self.miss(since, out);
                out.warning(self.error("the interface went down: waiting for it to come up again"));
                // It may have been for a moment only, in which it was set to something else.
                self.look_up(ear, out)
            }
            Some(libc::ENODEV) => self.vanish(since, out),
            _ if !is_there => self.vanish(since, out),
            _ => {
                let cause = Some(error);
                Err(SourceError { cause, ..self.error("the interface cannot be read") })
            }
        }
    }

    /// The interface is gone.
    fn vanish(&mut self, since: Moment, out: &mut Outbox) -> Result<State, SourceError> {
        if !self.options.reconnect {
            return Err(self.error(
                "the interface is gone: was the adapter unplugged? --reconnect waits for it",
            ));
        }
        self.miss(since, out);
        out.warning(self.error("the interface is gone: waiting for it to come back"));
        Ok(State::Gone)
    }

    /// From this time on something may be on the bus that is not heard.
    fn miss(&self, start: Moment, out: &mut Outbox) {
        out.lost(BUS, Loss { start, count: None, cause: LossCause::Deaf });
    }

    /// Looks now and then whether an interface that is down is up again.
    fn stay_down(&mut self, ear: Ear, out: &mut Outbox) -> Result<State, SourceError> {
        match self.is_time_to_look() {
            true => self.look_up(ear, out),
            false => Ok(State::Down(ear)),
        }
    }

    /// Looks whether an interface that went down is up again: its socket hears it then.
    fn look_up(&mut self, ear: Ear, out: &mut Outbox) -> Result<State, SourceError> {
        self.next_look = Instant::now() + RETURN;
        match Interface::ask(&self.name) {
            Ok(interface) if !interface.is_up() => Ok(State::Down(ear)),
            Ok(interface) => {
                let refuse = |refusal: Refusal| {
                    self.error(format!("it is up again, but {}", refusal.text()))
                };
                interface.check(self.options.allow_active).map_err(refuse)?;
                let (interface, ear) = match interface.is_still(&self.interface) {
                    true => (interface, ear),
                    false => find(&self.name, self.options.allow_active).map_err(refuse)?,
                };
                self.come_back(interface, out);
                Ok(State::Hearing(ear))
            }
            Err(Refusal::Missing(_)) => self.vanish(now(), out),
            Err(refusal) => Err(self.error(refusal.text())),
        }
    }

    /// Looks for an interface that is gone.
    fn stay_gone(&mut self, out: &mut Outbox) -> State {
        if !self.is_time_to_look() {
            return State::Gone;
        }
        match find(&self.name, self.options.allow_active) {
            Ok((interface, ear)) => {
                self.last_refusal = None;
                self.come_back(interface, out);
                State::Hearing(ear)
            }
            // That it is not there was said.
            Err(Refusal::Missing(_)) => State::Gone,
            Err(refusal) => {
                if self.last_refusal.as_ref() != Some(&refusal) {
                    out.warning(self.error(format!("it is back, but {}", refusal.text())));
                }
                self.last_refusal = Some(refusal);
                State::Gone
            }
        }
    }

    fn is_time_to_look(&mut self) -> bool {
        thread::sleep(PATIENCE);
        let is_time = Instant::now() >= self.next_look;
        if is_time {
            self.next_look = Instant::now() + RETURN;
        }
        is_time
    }

    fn come_back(&mut self, interface: Interface, out: &mut Outbox) {
        let is_other = interface.bitrate() != self.interface.bitrate();
        self.interface = interface;
        self.next_look = Instant::now() + STATISTICS;
        self.describe(out);
        if is_other {
            out.bitrate(BUS, self.interface.bitrate());
            out.warning(
                self.error("it came back with another bit rate, which counts from here on"),
            );
            self.compare_with_asked(out);
        }
    }
}

/// An interface that may be listened to, and its socket.
fn find(name: &str, allow_active: bool) -> Result<(Interface, Ear), Refusal> {
    let interface = Interface::ask(name)?;
    interface.check(allow_active)?;
    let receiver = socket::open(name).map_err(|error| {
        Refusal::Unknown(match error.raw_os_error() {
            Some(libc::EAFNOSUPPORT | libc::EPROTONOSUPPORT) => {
                "this kernel has no CAN sockets: modprobe can-raw".to_owned()
            }
            _ => format!("it cannot be opened ({error})"),
        })
    })?;
    let ear = Ear::new(receiver, interface::statistics(name), interface.uncertainty());
    Ok((interface, ear))
}

impl Reader for CanTap {
    fn read_on(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
        if !self.is_announced {
            self.announce(out);
        }
        let state = match self.state.take() {
            None => return Ok(false),
            Some(State::Hearing(ear)) => self.hear(ear, out)?,
            Some(State::Down(ear)) => self.stay_down(ear, out)?,
            Some(State::Gone) => self.stay_gone(out),
        };
        self.state = Some(state);
        Ok(true)
    }
}

impl Tap for CanTap {
    /// The socket counts.
    fn was_kept(&mut self, _: Moment, _: &mut Outbox) {}

    fn end(&mut self, out: &mut Outbox) {
        if let Some(State::Hearing(ear) | State::Down(ear)) = &mut self.state
            && self.is_announced
        {
            ear.tell_rest(out);
            // Twice: what an error frame may yet tell has had its time.
            for _ in 0..2 {
                ear.tell_interface_drops(interface::statistics(&self.name), out);
            }
            out.end(BUS, ear.heard_until());
        }
    }
}
