//! A flight recorder: only what surrounds an event is kept.
//!
//! What was heard is held in memory until it is clear that no event will ask for it. Decoding comes
//! behind, and says which events there were, and up to where there are no more. All times here are
//! by a clock that is never set back, but for the stamps that files are named by.

use super::composer::{Chunk, Edge};
use super::files::{Files, WriteError};
use dissectors::event::Moment;
use std::collections::VecDeque;

/// Most bytes that are held. Where `--before` asks for more, the oldest are let go.
pub const MOST_HELD: usize = 64 * 1024 * 1024;

/// How long after its beginning a record may be told, in ns: what is found out first takes 2 s, and
/// an answer is missed after 1 s.
const LATEST_TOLD: i64 = 4_000_000_000;

/// Chunks are held together up to this span, in ns.
const TOGETHER: i64 = 100_000_000;

/// What surrounds an event.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings {
    /// So much before it, in ns.
    pub before: i64,
    /// So much behind it, in ns.
    pub after: i64,
}

/// The last while, and what of it is being kept.
pub struct Flight {
    kept: Surroundings,
    held: VecDeque<Held>,
    bytes: usize,
    /// Until when the file that is open reaches.
    until: Option<Moment>,
    /// What was heard since what was written last was let go, or some of it.
    is_gap: bool,
    /// Bytes were let go that `--before` asks for.
    pub is_short: bool,
}

struct Held {
    from: Moment,
    to: Moment,
    stamp: Moment,
    bytes: Vec<u8>,
}

impl Flight {
    /// Nothing was heard yet.
    pub fn new(kept: Surroundings) -> Self {
        Flight {
            kept,
            held: VecDeque::new(),
            bytes: 0,
            until: None,
            is_gap: false,
            is_short: false,
        }
    }

    /// Holds a chunk.
    pub fn hold(&mut self, chunk: &Chunk, bytes: &[u8]) {
        self.bytes += bytes.len();
        let joins = |held: &&mut Held| {
            let span = chunk.to.since(held.from);
            // What an open file waits for is not joined with what it does not want.
            self.until.is_none() && span.is_some_and(|span| (0..TOGETHER).contains(&span))
        };
        match self.held.back_mut().filter(joins) {
            Some(held) => {
                held.bytes.extend_from_slice(bytes);
                held.to = if chunk.to.is_after(held.to) { chunk.to } else { held.to };
            }
            None => {
                let Chunk { from, to, stamp, .. } = *chunk;
                self.held.push_back(Held { from, to, stamp, bytes: bytes.to_vec() });
            }
        }
        while self.bytes > MOST_HELD {
            self.is_short = true;
            self.let_go();
        }
    }

    /// There was an event at this time.
    ///
    /// # Errors
    /// What surrounds it cannot be written.
    pub fn event(
        &mut self,
        at: Moment,
        heads: &[Vec<u8>],
        edges: &mut dyn FnMut(Edge) -> Vec<u8>,
        files: &mut Files,
    ) -> Result<(), WriteError> {
        let (from, until) = (at.plus(-self.kept.before), at.plus(self.kept.after));
        if let Some(open) = self.until {
            if from.is_after(open) {
                files.finish(&edges(Edge::End(open)))?;
                self.until = None;
            } else if !until.is_after(open) {
                return Ok(());
            }
        }
        if self.until.is_none() {
            while self.held.front().is_some_and(|held| from.is_after(held.to)) {
                self.let_go();
            }
        }
        self.until = Some(until);
        self.write(heads, edges, files)
    }

    /// Writes what the open file asks for.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn write(
        &mut self,
        heads: &[Vec<u8>],
        edges: &mut dyn FnMut(Edge) -> Vec<u8>,
        files: &mut Files,
    ) -> Result<(), WriteError> {
        let Some(until) = self.until else { return Ok(()) };
        while self.held.front().is_some_and(|held| !held.from.is_after(until)) {
            let Some(held) = self.held.pop_front() else { break };
            self.bytes -= held.bytes.len();
            if files.is_full_for(held.from, held.bytes.len()) {
                files.finish(&edges(Edge::End(held.from)))?;
            }
            if std::mem::take(&mut self.is_gap) {
                files.write(held.from, held.stamp, &edges(Edge::NotKept(held.stamp)), heads)?;
            }
            files.write(held.from, held.stamp, &held.bytes, heads)?;
        }
        Ok(())
    }

    /// Everything up to `now` was decoded: there is no event before it that was not told.
    ///
    /// # Errors
    /// A file cannot be finished.
    pub fn decoded(
        &mut self,
        now: Moment,
        edges: &mut dyn FnMut(Edge) -> Vec<u8>,
        files: &mut Files,
    ) -> Result<(), WriteError> {
        // Behind it, the next event begins a file of its own.
        let early = self.kept.before.saturating_add(LATEST_TOLD);
        match self.until {
            Some(until) if now.since(until).is_some_and(|since| since > early) => {
                files.finish(&edges(Edge::End(until)))?;
                self.until = None;
            }
            _ => {}
        }
        let horizon = now.plus(early.saturating_neg());
        while self.until.is_none()
            && self.held.front().is_some_and(|held| horizon.is_after(held.to))
        {
            self.let_go();
        }
        Ok(())
    }

    /// Nothing comes any more, and all was decoded.
    ///
    /// # Errors
    /// A file cannot be finished.
    pub fn finish(
        &mut self,
        edges: &mut dyn FnMut(Edge) -> Vec<u8>,
        files: &mut Files,
    ) -> Result<(), WriteError> {
        match self.until.take() {
            Some(until) => files.finish(&edges(Edge::End(until))),
            None => Ok(()),
        }
    }

    fn let_go(&mut self) {
        if let Some(held) = self.held.pop_front() {
            self.bytes -= held.bytes.len();
            self.is_gap = true;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::ring::Ring;
    use super::*;
    use std::path::Path;

    /// Says that what came before was let go.
    const GAP: u8 = 255;

    const SECOND: i64 = 1_000_000_000;

    fn at(second: i64) -> Moment {
        Moment::from_ns(second * SECOND)
    }

    fn hold(flight: &mut Flight, second: i64, bytes: &[u8]) {
        let (from, to, stamp) = (at(second), at(second), at(second));
        let chunk = Chunk { from, to, stamp, bytes: 0..bytes.len() };
        flight.hold(&chunk, bytes);
    }

    /// A flight recorder that keeps 3 s before and 2 s after, hears a byte a second for a minute, and
    /// is told of these events 3 s after they were. What is in its files, as seconds.
    fn kept(events: &[i64]) -> Vec<Vec<u8>> {
        let directory = tempfile::tempdir().unwrap();
        let mut files = Files::new(directory.path(), Ring::default()).unwrap();
        let mut flight = Flight::new(Surroundings { before: 3 * SECOND, after: 2 * SECOND });
        let mut edges =
            |edge| if matches!(edge, Edge::NotKept(_)) { vec![GAP] } else { Vec::new() };
        for second in 0..60 {
            hold(&mut flight, second, &[u8::try_from(second).unwrap()]);
            flight.write(&[], &mut edges, &mut files).unwrap();
            if let Some(event) = events.iter().find(|event| **event == second - 3) {
                flight.event(at(*event), &[], &mut edges, &mut files).unwrap();
            }
            flight.decoded(at(second), &mut edges, &mut files).unwrap();
            assert!(flight.bytes <= 16, "{} are held", flight.bytes);
        }
        flight.finish(&mut edges, &mut files).unwrap();
        files.settle().unwrap();
        contents(directory.path())
    }

    fn contents(directory: &Path) -> Vec<Vec<u8>> {
        let mut paths: Vec<_> =
            std::fs::read_dir(directory).unwrap().map(|entry| entry.unwrap().path()).collect();
        // The time in a name is that of this test; the number is what orders them.
        paths.sort_by_key(|path| path.to_string_lossy().rsplit_once('-').unwrap().1.to_owned());
        paths.iter().map(|path| std::fs::read(path).unwrap()).collect()
    }

    fn behind_gap(seconds: std::ops::RangeInclusive<u8>) -> Vec<u8> {
        std::iter::once(GAP).chain(seconds).collect()
    }

    #[test]
    fn what_surrounds_an_event_is_kept() {
        assert_eq!(kept(&[20]), [behind_gap(17..=22)]);
        assert_eq!(kept(&[]), [[0; 0]; 0]);
        assert_eq!(kept(&[1, 56]), [vec![0, 1, 2, 3], behind_gap(53..=58)]);
    }

    #[test]
    fn surroundings_that_overlap_are_one_file() {
        assert_eq!(kept(&[20, 21]), [behind_gap(17..=23)]);
        // 22 is the last of the one, and the first of the other.
        assert_eq!(kept(&[20, 25]), [behind_gap(17..=27)]);
        // 23 follows 22: nothing is missing between the two.
        assert_eq!(kept(&[20, 26]), [behind_gap(17..=22), (23..=28).collect()]);
    }

    #[test]
    fn memory_is_bounded() {
        let mut flight = Flight::new(Surroundings { before: 3_600 * SECOND, after: 0 });
        let block = vec![0; 1024 * 1024];
        for second in 0..70 {
            assert!(!flight.is_short || second > 60);
            hold(&mut flight, second, &block);
            assert!(flight.bytes <= MOST_HELD);
        }
        assert!(flight.is_short);
        assert_eq!(flight.held.front().map(|held| held.from), Some(at(6)));
    }
}
