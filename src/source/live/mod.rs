//! Live taps: what is on a bus right now.
//!
//! A tap listens in a thread of its own that does nothing but stamp what it hears and hand it over.
//! Decoding and printing come behind, and may be slow without losing anything: what waits is held
//! here, up to a bound, and beyond that in the kernel. What the kernel drops is counted by CAN sockets
//! and some serial drivers only; so where it was left to hold, a loss is told.

mod can;
mod serial;
mod slcan;
mod wall;

pub use slcan::fuzz as fuzz_slcan;

use super::outbox::{Outbox, Reader};
use super::{Piece, Place, Source, SourceError, SourceOptions};
use crate::interrupt;
use dissectors::event::{Loss, LossCause, Moment};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;
use wall::{Reading, Watch};

/// How long a tap waits for something to be heard before it says that nothing was.
pub const PATIENCE: Duration = Duration::from_millis(10);

/// Deliveries that may wait to be decoded. Those that come while so many wait are put together.
const AHEAD: usize = 64;

/// Characters, frames and other things that are put together at most: 25 s of a bus that is full of
/// characters at 115200 Bd, or of the shortest frames at 500 kbit/s. An idle bus adds nothing.
const MOST_BEHIND: usize = 1 << 18;

/// What the user says about live taps.
#[derive(Clone, Default, Debug)]
pub struct LiveOptions {
    /// A CAN interface that acknowledges what it hears may be listened on.
    pub allow_active: bool,
    /// A tap that vanishes is waited for.
    pub reconnect: bool,
    /// The bit rate of a CAN adapter; to be found out where it is not given.
    pub bitrate: Option<u32>,
}

/// A tap. [`Reader::read_on`] waits for [`PATIENCE`] at most, unless it says otherwise, stamps what it
/// heard at once, and says silence where there was none.
pub trait Tap: Reader + Send {
    /// Nobody listens any more: says what is left to say, such as counters and when it ended.
    fn end(&mut self, _: &mut Outbox) {}

    /// Whether its stamps follow the computer's time of day, which can be set.
    fn follows_the_day(&self) -> bool {
        true
    }

    /// It was not read since then, for nobody took what it had heard: says what may be lost, unless
    /// it finds that out when it is read.
    fn was_kept(&mut self, since: Moment, out: &mut Outbox) {
        out.lost(0, Loss { start: since, count: None, cause: LossCause::Capture });
    }
}

/// Whether a name is that of a live tap: `serial:/dev/ttyUSB0`, `can:can0`, `slcan:/dev/ttyACM0`.
pub fn is_tap(name: &str) -> bool {
    tap_of(name).is_some()
}

/// Opens the tap of that name; `None` where it is no tap's.
///
/// # Errors
/// There is no such tap, or it cannot be used: why, and what to do.
pub fn open(name: &str, options: &SourceOptions) -> Option<Result<Box<dyn Tap>, SourceError>> {
    let (open, place) = tap_of(name)?;
    Some(open(place, options))
}

type Open = fn(&str, &SourceOptions) -> Result<Box<dyn Tap>, SourceError>;

fn tap_of(name: &str) -> Option<(Open, &str)> {
    let kinds: [(&str, Open); 3] =
        [("serial:", serial::open), ("can:", can::open), ("slcan:", slcan::open)];
    kinds.into_iter().find_map(|(prefix, open)| Some((open, name.strip_prefix(prefix)?)))
}

/// A tap that is being listened to, as a source.
pub struct Listening {
    name: String,
    /// `None` once nobody listens any more.
    deliveries: Option<Receiver<Outbox>>,
    give_back: SyncSender<Outbox>,
    current: Outbox,
    is_over: Arc<AtomicBool>,
    /// The ear has said everything.
    has_ended: Arc<AtomicBool>,
    ear: Option<JoinHandle<()>>,
}

impl Listening {
    /// Begins to listen to the tap that the user named so.
    pub fn begin(name: &str, tap: Box<dyn Tap>) -> Self {
        Listening::by(name, tap, Box::new(Reading::take))
    }

    fn by(name: &str, tap: Box<dyn Tap>, clocks: Clocks) -> Self {
        let (sender, deliveries) = sync_channel(AHEAD);
        let (give_back, empty) = sync_channel(AHEAD);
        let is_over = Arc::new(AtomicBool::new(false));
        let behind = Outbox::default();
        let (name, has_ended) = (name.to_owned(), Arc::new(AtomicBool::new(false)));
        let wall = Wall { clocks, watch: Watch::default(), has_bus: false };
        let ear = Ear {
            name: name.clone(),
            tap,
            wall,
            sender,
            empty,
            behind,
            is_over: Arc::clone(&is_over),
            has_ended: Arc::clone(&has_ended),
        };
        let ear = Some(thread::spawn(move || ear.listen()));
        let deliveries = Some(deliveries);
        let current = Outbox::default();
        Listening { name, deliveries, give_back, current, is_over, has_ended, ear }
    }

    /// The ear is gone. One that has not said everything panicked, and said that much.
    fn end(&self) -> Result<Option<Piece<'_>>, SourceError> {
        if self.has_ended.swap(true, Ordering::Relaxed) {
            return Ok(None);
        }
        let what = "the tap failed: this is a fault of fieldtap, please report it with what was \
                    printed; what comes after is not heard";
        Err(SourceError::new(&self.name, Place::Whole, what))
    }
}

impl Source for Listening {
    fn next_piece(&mut self) -> Result<Option<Piece<'_>>, SourceError> {
        while self.current.is_empty() {
            // A tap may have nothing to say for long, and the user is still to be heeded: what is
            // left comes after `stop`.
            if interrupt::came() && !self.is_over.load(Ordering::Relaxed) {
                return Ok(None);
            }
            let next = self.deliveries.as_ref().and_then(|deliveries| deliveries.recv().ok());
            let Some(next) = next else { return self.end() };
            let used = std::mem::replace(&mut self.current, next);
            // Nobody needs it where the ear is gone.
            let _ = self.give_back.try_send(used);
        }
        self.current.next().transpose()
    }

    fn stop(&mut self) -> bool {
        self.is_over.store(true, Ordering::Relaxed);
        true
    }
}

impl Drop for Listening {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        // An ear that waits for room to deliver finds nobody there, and ends too.
        self.deliveries = None;
        if let Some(ear) = self.ear.take() {
            // The tap leaves its device as it should before the program ends. One that panicked
            // has said so.
            let _ = ear.join();
        }
    }
}

type Clocks = Box<dyn FnMut() -> Reading + Send>;

/// What is known of the computer's clock.
struct Wall {
    clocks: Clocks,
    watch: Watch,
    /// Something can be said of a bus.
    has_bus: bool,
}

/// The thread that listens.
struct Ear {
    name: String,
    tap: Box<dyn Tap>,
    wall: Wall,
    sender: SyncSender<Outbox>,
    empty: Receiver<Outbox>,
    /// What was heard while too many deliveries waited.
    behind: Outbox,
    is_over: Arc<AtomicBool>,
    has_ended: Arc<AtomicBool>,
}

impl Ear {
    fn listen(mut self) {
        while !self.is_over.load(Ordering::Relaxed) {
            let mut delivery = self.empty.try_recv().unwrap_or_default();
            delivery.forget();
            let has_more = self.tap.read_on(&mut delivery).unwrap_or_else(|error| {
                delivery.error(error);
                false
            });
            let delivery = self.mind_the_clock(delivery);
            if !has_more {
                return self.deliver_last(delivery);
            }
            if !self.deliver(delivery) {
                return;
            }
        }
        let mut last = Outbox::default();
        self.tap.end(&mut last);
        self.deliver_last(last);
    }

    /// Where the clock was set, says so before what may have been stamped since, and that nothing is
    /// to be judged across it: a step is no silence.
    fn mind_the_clock(&mut self, delivery: Outbox) -> Outbox {
        let Wall { clocks, watch, has_bus } = &mut self.wall;
        let had_bus = std::mem::replace(has_bus, *has_bus || delivery.has_bus());
        let step = watch.look(clocks()).filter(|_| self.tap.follows_the_day());
        let Some(step) = step else { return delivery };
        let mut told = Outbox::default();
        let seconds = step.by as f64 / 1e9;
        let what = format!(
            "the computer's clock was set by {seconds:+.3} s: times before and after do not compare"
        );
        told.warning(SourceError::new(&self.name, Place::Whole, what));
        if had_bus {
            told.lost(0, Loss { start: step.before, count: None, cause: LossCause::Capture });
        }
        told.absorb(delivery);
        told
    }

    /// Hands over, without waiting for room unless very much is behind. False where nobody listens.
    fn deliver(&mut self, delivery: Outbox) -> bool {
        let delivery = if self.behind.is_empty() {
            delivery
        } else {
            self.behind.absorb(delivery);
            std::mem::take(&mut self.behind)
        };
        match self.sender.try_send(delivery) {
            Ok(()) => true,
            Err(TrySendError::Full(delivery)) if delivery.len() < MOST_BEHIND => {
                self.behind = delivery;
                true
            }
            Err(TrySendError::Full(delivery)) => self.wait_for_room(delivery),
            Err(TrySendError::Disconnected(_)) => false,
        }
    }

    fn wait_for_room(&mut self, delivery: Outbox) -> bool {
        let since = Moment::from_ns(Reading::take().day);
        let is_taken = self.sender.send(delivery).is_ok();
        self.tap.was_kept(since, &mut self.behind);
        is_taken
    }

    fn deliver_last(mut self, last: Outbox) {
        self.behind.absorb(last);
        // It is seen by whoever sees that the channel is closed.
        self.has_ended.store(true, Ordering::Relaxed);
        // Nobody needs it where the listener is gone.
        let _ = self.sender.send(self.behind);
    }
}

#[cfg(test)]
mod tests {
    use super::super::transcript::of_source;
    use super::*;
    use dissectors::bus::WireFacts;
    use dissectors::event::{Clock, Event};
    use dissectors::record::BusInfo;
    use dissectors::uart::{Character, Parity};
    use std::sync::atomic::AtomicUsize;
    use std::time::Instant;

    /// Hears a character a read, each 1 µs after the one before.
    struct Steady {
        next: Arc<AtomicUsize>,
        last: usize,
    }

    impl Reader for Steady {
        fn read_on(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
            let next = self.next.fetch_add(1, Ordering::Relaxed);
            if next == 0 {
                out.bus(BusInfo::new("steady", Some(Clock::Read)), WireFacts::default());
            }
            let start = Moment::from_ns(1_000 * next as i64);
            out.characters(0, [Character::new(start, 0, 0x55, Parity::Ok)]);
            Ok(next + 1 < self.last)
        }
    }

    impl Tap for Steady {}

    /// The times of so many characters, and how many losses, as one hears them who begins to take
    /// them when the tap has read so many, or no more.
    fn hear(last: usize, wait_for: usize) -> (Vec<i64>, usize) {
        let next = Arc::new(AtomicUsize::new(0));
        let mut listening =
            Listening::begin("steady", Box::new(Steady { next: Arc::clone(&next), last }));
        let (mut before, mut since) = (0, Instant::now());
        while before < wait_for || since.elapsed() < Duration::from_millis(300) {
            let now = next.load(Ordering::Relaxed);
            if before != now {
                (before, since) = (now, Instant::now());
            }
            thread::sleep(Duration::from_millis(10));
        }
        let (mut starts, mut losses) = (Vec::new(), 0);
        while let Ok(Some(piece)) = listening.next_piece() {
            match piece {
                Piece::Heard(_, Event::Characters(characters)) => {
                    starts.extend(characters.iter().filter_map(|it| it.start.ns()));
                }
                Piece::Heard(_, Event::Lost(_)) => losses += 1,
                _ => {}
            }
        }
        (starts, losses)
    }

    #[test]
    fn a_slow_listener_loses_nothing() {
        // All is heard before the first is taken; as much as may wait.
        for (last, wait_for) in [(10 * AHEAD, 10 * AHEAD), (4 * MOST_BEHIND, 0)] {
            let (starts, _) = hear(last, wait_for);
            assert!(starts.iter().copied().eq((0..last as i64).map(|n| 1_000 * n)));
        }
    }

    #[test]
    fn what_the_kernel_was_left_to_hold_is_a_loss() {
        let most = MOST_BEHIND;
        assert_eq!(hear(most / 2, most / 2).1, 0);
        let (starts, losses) = hear(2 * most, most / 2);
        assert_eq!((starts.len(), losses), (2 * most, 1));
    }

    #[test]
    fn a_clock_that_is_set_is_told_before_what_is_stamped_since() {
        const HOUR: i64 = 3_600_000_000_000;
        let mut turns = 0;
        // The third turn is the first after the step.
        let clocks = move || {
            turns += 1;
            let day = if turns < 3 { turns } else { turns + HOUR };
            Reading { day, running: [turns; 2] }
        };
        let tap = Steady { next: Arc::default(), last: 4 };
        let mut listening = Listening::by("steady", Box::new(tap), Box::new(clocks));
        let said = of_source(&mut listening);
        let warning = "warning: steady: the computer's clock was set by +3600.000 s: times before \
                       and after do not compare";
        let at = |n: i64| format!("0: 55 @{}±0", 1_000 * n);
        let all = [&at(0), &at(1), warning, "0: lost Capture @2", &at(2), &at(3)];
        assert_eq!(said[1..], all);
    }

    /// Hears something, and fails.
    struct Faulty(Steady);

    impl Reader for Faulty {
        fn read_on(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
            assert!(self.0.read_on(out).expect("it hears"), "this tap fails");
            Ok(true)
        }
    }

    impl Tap for Faulty {}

    #[test]
    fn a_tap_that_fails_is_no_good_end() {
        let tap = Faulty(Steady { next: Arc::default(), last: 3 });
        let said = of_source(&mut Listening::begin("faulty", Box::new(tap)));
        let [.., heard, end] = &said[..] else { panic!("{said:?}") };
        assert_eq!(heard, "0: 55 @1000±0", "what came before is good");
        assert!(end.starts_with("faulty: the tap failed: "), "{end}");
    }
}
