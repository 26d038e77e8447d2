//! Reading a saved capture while what was read before is decoded.

use super::outbox::{Outbox, Reader};
use super::{Piece, Source, SourceError};
use crate::interrupt;
use std::panic;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// Outboxes that may be full and wait to be decoded. More would only leave the processor's cache.
const AHEAD: usize = 4;

/// How long it may take until a user who wants the run to end is heeded.
const TURN: Duration = Duration::from_millis(100);

/// A source whose items are read in a thread of its own. What it says is the same, in the same
/// order, as if it were read by who decodes it.
pub struct ReadingAhead {
    full: Receiver<Outbox>,
    give_back: SyncSender<Outbox>,
    current: Outbox,
    reading: Option<JoinHandle<()>>,
}

impl ReadingAhead {
    /// Begins to read. It must never have to wait for more: nobody could end it then.
    pub fn begin(reader: impl Reader + Send + 'static) -> Self {
        let (sender, full) = sync_channel(AHEAD);
        let (give_back, empty) = sync_channel(AHEAD);
        let reading = thread::spawn(move || read(reader, &sender, &empty));
        ReadingAhead { full, give_back, current: Outbox::default(), reading: Some(reading) }
    }
}

impl ReadingAhead {
    fn end(&mut self) -> Result<Option<Piece<'_>>, SourceError> {
        match self.reading.take().map(JoinHandle::join) {
            Some(Err(panicked)) => panic::resume_unwind(panicked),
            _ => Ok(None),
        }
    }
}

impl Source for ReadingAhead {
    fn next_piece(&mut self) -> Result<Option<Piece<'_>>, SourceError> {
        while self.current.is_empty() {
            // A disk on a network may not answer: whoever reads it is left behind then.
            let next = match self.full.recv_timeout(TURN) {
                Ok(next) => next,
                Err(RecvTimeoutError::Timeout) if interrupt::came() => return Ok(None),
                Err(RecvTimeoutError::Timeout) => continue,
                Err(RecvTimeoutError::Disconnected) => return self.end(),
            };
            let used = std::mem::replace(&mut self.current, next);
            // Nobody needs it once everything is read.
            let _ = self.give_back.try_send(used);
        }
        self.current.next().transpose()
    }
}

fn read(mut reader: impl Reader, full: &SyncSender<Outbox>, empty: &Receiver<Outbox>) {
    let mut has_more = true;
    while has_more {
        let mut out = empty.try_recv().unwrap_or_default();
        out.forget();
        while has_more && !out.is_full() {
            has_more = reader.read_on(&mut out).unwrap_or_else(|error| {
                out.error(error);
                false
            });
        }
        // Nobody wants more where nobody takes it.
        has_more &= full.send(out).is_ok();
    }
}

#[cfg(test)]
mod tests {
    use super::super::Place;
    use super::*;
    use dissectors::event::{Event, Moment};
    use dissectors::uart::{Character, Parity};

    /// Counts up to a number, and has an error there.
    struct Count(i64, i64);

    impl Reader for Count {
        fn read_on(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
            if self.0 == self.1 {
                return Err(SourceError::new("count", Place::Whole, "it is cut"));
            }
            out.characters(0, [Character::new(Moment::from_ns(self.0), 0, 0, Parity::Ok)]);
            self.0 += 1;
            Ok(true)
        }
    }

    #[test]
    fn everything_comes_in_its_order_and_the_error_last() {
        let mut reading = ReadingAhead::begin(Count(0, 100_000));
        let mut next = 0;
        let error = loop {
            match reading.next_piece() {
                Ok(Some(Piece::Heard(0, Event::Characters(characters)))) => {
                    for character in characters {
                        assert_eq!(character.start, Moment::from_ns(next));
                        next += 1;
                    }
                }
                Ok(_) => panic!("there is an error at the end"),
                Err(error) => break error,
            }
        };
        assert_eq!((next, error.what.as_str()), (100_000, "it is cut"));
        assert!(reading.next_piece().is_ok_and(|piece| piece.is_none()));
    }

    #[test]
    #[should_panic = "a defect"]
    fn a_panic_is_one_of_who_takes() {
        struct Defect;
        impl Reader for Defect {
            fn read_on(&mut self, _: &mut Outbox) -> Result<bool, SourceError> {
                panic!("a defect")
            }
        }
        let _ = ReadingAhead::begin(Defect).next_piece();
    }
}
