//! Live taps: what is on a bus right now.
//!
//! A tap listens in a thread of its own that does nothing but stamp what it hears and hand it over.
//! Decoding and printing come behind, and may be slow without losing anything: what waits is held
//! here, up to a bound, and beyond that in the kernel, which counts what it drops.

mod can;
mod serial;
mod slcan;

pub use slcan::fuzz as fuzz_slcan;

use super::outbox::{Outbox, Reader};
use super::{Piece, Source, SourceError, SourceOptions};
use crate::interrupt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// How long a tap waits for something to be heard before it says that nothing was.
pub const PATIENCE: Duration = Duration::from_millis(10);

/// Deliveries that may wait to be decoded.
const AHEAD: usize = 4096;

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

/// A tap. [`Reader::read_on`] waits for [`PATIENCE`] at most, stamps what it heard at once, and says
/// silence where there was none.
pub trait Tap: Reader + Send {
    /// Nobody listens any more: says what is left to say, such as counters and when it ended.
    fn end(&mut self, _: &mut Outbox) {}
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
    /// `None` once nobody listens any more.
    deliveries: Option<Receiver<Outbox>>,
    give_back: SyncSender<Outbox>,
    current: Outbox,
    is_over: Arc<AtomicBool>,
    ear: Option<JoinHandle<()>>,
}

impl Listening {
    /// Begins to listen.
    pub fn begin(tap: Box<dyn Tap>) -> Self {
        let (sender, deliveries) = sync_channel(AHEAD);
        let (give_back, empty) = sync_channel(AHEAD);
        let is_over = Arc::new(AtomicBool::new(false));
        let ear = Ear { tap, sender, empty, is_over: Arc::clone(&is_over) };
        let ear = Some(thread::spawn(move || ear.listen()));
        let deliveries = Some(deliveries);
        Listening { deliveries, give_back, current: Outbox::default(), is_over, ear }
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
            // The ear is gone once it has said everything.
            let next = self.deliveries.as_ref().and_then(|deliveries| deliveries.recv().ok());
            let Some(next) = next else { return Ok(None) };
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

/// The thread that listens.
struct Ear {
    tap: Box<dyn Tap>,
    sender: SyncSender<Outbox>,
    empty: Receiver<Outbox>,
    is_over: Arc<AtomicBool>,
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
            if self.sender.send(delivery).is_err() || !has_more {
                return;
            }
        }
        let mut last = Outbox::default();
        self.tap.end(&mut last);
        // Nobody needs it where the listener is gone.
        let _ = self.sender.send(last);
    }
}
