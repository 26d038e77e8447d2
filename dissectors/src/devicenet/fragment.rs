//! Messages that are longer than a frame: put together from fragments, whatever gets lost.
//!
//! Explicit fragments are acknowledged one by one, and sent once more if the acknowledgement does
//! not come within 1 s; their count wraps after 63. I/O fragments are not acknowledged, and their
//! count does not wrap. DeviceNet specification (CIP Vol. 3), chapter 4: fragmentation protocols.

use super::identifier::MacId;
use super::message::{Fragment, ONLY, Part};
use crate::event::Moment;
use alloc::vec::Vec;

/// Messages that are put together at the same time.
const ASSEMBLIES: usize = 64;

/// Most bytes that are kept of a message: four rounds of the count.
const MAX_MESSAGE: usize = 4 * 64 * 6;

/// Which message a fragment belongs to: one is under way for each.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Key(u32);

impl Key {
    /// Explicit messages of one transaction on one identifier: the header without FRAG tells
    /// which.
    pub const fn explicit(id: u16, header: u8) -> Self {
        Key((id as u32) << 8 | (header & 0x7F) as u32)
    }

    /// I/O on one identifier.
    pub const fn io(id: u16) -> Self {
        Key((id as u32) << 8 | 0xFF)
    }

    const fn id(self) -> u16 {
        (self.0 >> 8) as u16
    }
}

/// How far a message has come.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Progress {
    /// The last was complete, or was given up.
    Idle,
    /// The last was complete with this fragment.
    Done(Fragment),
    /// This fragment came last.
    Open(Fragment),
    /// A fragment was missing: what follows of the message tells nothing.
    Broken,
    /// It began before anything was heard of its connection.
    Unseen,
}

/// What a fragment does.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Step {
    /// It begins a message.
    Begins,
    /// It begins a message though the one before it was not complete.
    BeginsAnew {
        /// The fragment byte that was due.
        expected: u8,
    },
    /// It continues the message.
    Continues,
    /// It completes the message.
    Completes,
    /// It was sent before.
    Repeats,
    /// Another was due.
    OutOfSequence {
        /// The fragment byte that was due.
        expected: u8,
    },
    /// It belongs to a message that is broken, which was told.
    Ignored,
    /// It belongs to a message whose beginning was not seen.
    Unseen,
    /// The message is longer than any that DeviceNet devices keep.
    TooLong,
}

/// A fragment that waits for its acknowledgement.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Awaiting {
    pub fragment: Fragment,
    /// Record number and stamp of the last sending.
    pub n: u64,
    pub sent: Moment,
    pub uncertainty: u32,
    /// How often it was sent.
    pub sendings: u8,
}

/// What an acknowledgement does.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Acknowledged {
    /// It acknowledges the fragment that waits for it.
    Fragment {
        /// The whole message is taken.
        is_last: bool,
    },
    /// It acknowledges one for the second time, or one that was not seen.
    Nothing,
    /// Another count was due.
    Other {
        /// The count that was due.
        expected: u8,
    },
}

/// One message that is being put together.
#[derive(Clone, Debug)]
pub(super) struct Assembly {
    key: Key,
    /// When it was used last, in fragments.
    used: u64,
    progress: Progress,
    data: Vec<u8>,
    numbers: Vec<u64>,
    pub awaiting: Option<Awaiting>,
    /// The request that is answered, if it was seen.
    pub request: Option<u64>,
    /// The server of an explicit message.
    pub server: Option<MacId>,
}

impl Assembly {
    const fn new(key: Key) -> Self {
        Assembly {
            key,
            used: 0,
            progress: Progress::Idle,
            data: Vec::new(),
            numbers: Vec::new(),
            awaiting: None,
            request: None,
            server: None,
        }
    }

    /// The message so far.
    pub fn data(&self) -> &[u8] {
        &self.data
    }

    /// The records of its fragments, each fragment's first.
    pub fn numbers(&self) -> &[u64] {
        &self.numbers
    }

    /// Whether its beginning was not seen.
    pub fn is_unseen(&self) -> bool {
        self.progress == Progress::Unseen
    }

    /// Takes the next fragment of a message. `was_heard`: something was heard of the connection
    /// before, so that a message cannot begin in the middle. `wraps`: the message is explicit: the
    /// count goes on after 63, and a fragment may be sent again.
    pub fn take(
        &mut self,
        (fragment, data): (Fragment, &[u8]),
        n: u64,
        was_heard: bool,
        wraps: bool,
    ) -> Step {
        let may_begin = fragment.count == 0 || fragment.count == ONLY;
        match (self.progress, fragment.part) {
            (Progress::Open(last) | Progress::Done(last), _)
                if wraps && self.repeats(last, fragment) =>
            {
                Step::Repeats
            }
            (Progress::Open(last), Part::First) if may_begin => {
                let expected = self.due(last, wraps);
                self.begin(fragment, data, n);
                Step::BeginsAnew { expected }
            }
            (_, Part::First) if may_begin => {
                self.begin(fragment, data, n);
                if fragment.count == ONLY { Step::Completes } else { Step::Begins }
            }
            (Progress::Open(last), _) => self.go_on(last, (fragment, data), n, wraps),
            (Progress::Broken, _) => Step::Ignored,
            (Progress::Unseen, _) => self.miss(),
            (Progress::Idle, _) if !was_heard => self.miss(),
            (Progress::Idle | Progress::Done(_), _) => {
                self.progress = Progress::Broken;
                Step::OutOfSequence { expected: 0 }
            }
        }
    }

    /// A fragment is sent again with the same type and count. One that begins a message is only a
    /// repetition while nothing else came of the message.
    fn repeats(&self, last: Fragment, fragment: Fragment) -> bool {
        let is_begin = fragment.part == Part::First;
        last == fragment && (!is_begin || self.awaiting.is_some() || fragment.count != ONLY)
    }

    fn begin(&mut self, fragment: Fragment, data: &[u8], n: u64) {
        self.data.clear();
        self.numbers.clear();
        self.request = None;
        self.progress = match fragment.count {
            ONLY => Progress::Done(fragment),
            _ => Progress::Open(fragment),
        };
        self.add(data, n);
    }

    fn go_on(
        &mut self,
        last: Fragment,
        (fragment, data): (Fragment, &[u8]),
        n: u64,
        wraps: bool,
    ) -> Step {
        let expected = self.due(last, wraps);
        let is_due = fragment.count == expected & 0x3F && (wraps || last.count < 0x3F);
        let is_rest = matches!(fragment.part, Part::Middle | Part::Last);
        if !is_due || !is_rest {
            self.progress = Progress::Broken;
            return Step::OutOfSequence { expected };
        }
        if self.data.len() + data.len() > MAX_MESSAGE {
            self.progress = Progress::Broken;
            return Step::TooLong;
        }
        self.add(data, n);
        if fragment.part == Part::Last {
            self.progress = Progress::Done(fragment);
            return Step::Completes;
        }
        self.progress = Progress::Open(fragment);
        Step::Continues
    }

    /// The fragment byte that is due, taken for a middle one.
    fn due(&self, last: Fragment, wraps: bool) -> u8 {
        let count = if wraps { (last.count + 1) & 0x3F } else { (last.count + 1).min(0x3F) };
        Fragment { part: Part::Middle, count }.byte()
    }

    fn miss(&mut self) -> Step {
        self.progress = Progress::Unseen;
        Step::Unseen
    }

    fn add(&mut self, data: &[u8], n: u64) {
        self.data.extend_from_slice(data);
        self.numbers.push(n);
    }

    /// Lends its bytes out, for as long as what they say is looked at.
    pub fn lend(&mut self) -> Vec<u8> {
        core::mem::take(&mut self.data)
    }

    /// Takes them back.
    pub fn take_back(&mut self, data: Vec<u8>) {
        self.data = data;
    }

    /// What comes next begins a message.
    pub fn reset(&mut self) {
        (self.progress, self.awaiting) = (Progress::Idle, None);
    }

    /// The rest of the message tells nothing.
    pub fn give_up(&mut self) {
        (self.progress, self.awaiting) = (Progress::Broken, None);
    }

    /// The fragment byte that is due, if the message is not complete.
    pub fn unfinished(&self) -> Option<u8> {
        match self.progress {
            Progress::Open(last) => Some(self.due(last, true)),
            _ => None,
        }
    }

    /// The fragment now waits for its acknowledgement.
    pub fn await_acknowledge(&mut self, fragment: Fragment, n: u64, at: (Moment, u32)) {
        let again = self.awaiting.is_some_and(|awaiting| awaiting.fragment == fragment);
        let before = self.awaiting.filter(|_| again).map_or(0, |awaiting| awaiting.sendings);
        let (sent, uncertainty) = at;
        let sendings = before.saturating_add(1);
        self.awaiting = Some(Awaiting { fragment, n, sent, uncertainty, sendings });
    }

    /// An acknowledgement with that count.
    pub fn acknowledge(&mut self, count: u8) -> Acknowledged {
        let last = match self.progress {
            Progress::Open(last) | Progress::Done(last) => last,
            _ => return Acknowledged::Nothing,
        };
        if count != last.count {
            // The one before may be acknowledged twice, where it was sent twice.
            let before = last.count.wrapping_sub(1) & 0x3F;
            return match count == before {
                true => Acknowledged::Nothing,
                false => Acknowledged::Other { expected: last.count },
            };
        }
        match self.awaiting.take() {
            Some(_) => {
                Acknowledged::Fragment { is_last: matches!(self.progress, Progress::Done(_)) }
            }
            None => Acknowledged::Nothing,
        }
    }
}

/// Every message that is being put together on a bus.
#[derive(Default)]
pub(super) struct Assemblies {
    all: Vec<Assembly>,
    used: u64,
}

impl Assemblies {
    /// The place of a message's assembly, if there is one.
    pub fn find(&self, key: Key) -> Option<usize> {
        self.all.iter().position(|assembly| assembly.key == key)
    }

    /// The place of a message's assembly. Where there are too many, the one that was used least
    /// recently is given up.
    pub fn of(&mut self, key: Key) -> usize {
        self.used += 1;
        let place = self.find(key).unwrap_or_else(|| {
            if self.all.len() < ASSEMBLIES {
                self.all.push(Assembly::new(key));
                return self.all.len() - 1;
            }
            let oldest = (0..ASSEMBLIES).min_by_key(|place| self.all[*place].used).unwrap_or(0);
            self.all[oldest].key = key;
            self.all[oldest].reset();
            oldest
        });
        self.all[place].used = self.used;
        place
    }

    pub fn get(&self, place: usize) -> Option<&Assembly> {
        self.all.get(place)
    }

    pub fn get_mut(&mut self, place: usize) -> Option<&mut Assembly> {
        self.all.get_mut(place)
    }

    /// All of them, by place.
    pub fn iter(&self) -> impl Iterator<Item = (usize, &Assembly)> {
        self.all.iter().enumerate()
    }

    /// A frame with this identifier may have been any fragment, or any acknowledgement of this
    /// server or to it.
    pub fn miss(&mut self, id: u16, server: Option<MacId>) {
        for assembly in &mut self.all {
            if assembly.key.id() == id {
                assembly.miss();
            }
            if assembly.server.is_some() && assembly.server == server {
                assembly.awaiting = None;
            }
        }
    }

    /// What was lost may have been anything.
    pub fn lose(&mut self) {
        self.all.iter_mut().for_each(Assembly::reset);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    fn read(bytes: &[(u8, u8)], wraps: bool) -> (Vec<Step>, Assembly) {
        let mut assembly = Assembly::new(Key::io(0));
        let steps = (1..).zip(bytes).map(|(n, (byte, data))| {
            assembly.take((Fragment::of(*byte), &[*data]), n, true, wraps)
        });
        (steps.collect(), assembly.clone())
    }

    #[test]
    fn a_message_is_put_together() {
        let (steps, assembly) = read(&[(0x00, 10), (0x41, 11), (0x82, 12)], true);
        assert_eq!(steps, [Step::Begins, Step::Continues, Step::Completes]);
        assert_eq!((assembly.data(), assembly.numbers()), (&[10, 11, 12][..], &[1, 2, 3][..]));
    }

    #[test]
    fn counts_wrap_after_63_where_they_may() {
        let mut bytes: Vec<(u8, u8)> = (0..=63).map(|count| (0x40 | count, count)).collect();
        bytes[0].0 = 0;
        bytes.push((0x80, 64));
        assert_eq!(read(&bytes, true).0.last(), Some(&Step::Completes));
        assert_eq!(read(&bytes, false).0.last(), Some(&Step::OutOfSequence { expected: 0x7F }));
    }

    #[test]
    fn repeated_fragments_are_taken_once() {
        let (steps, assembly) = read(&[(0, 1), (0, 1), (0x81, 2), (0x81, 2), (0, 3)], true);
        let wanted = [Step::Begins, Step::Repeats, Step::Completes, Step::Repeats, Step::Begins];
        assert_eq!(steps, wanted);
        assert_eq!(assembly.data(), [3]);
    }

    #[test]
    fn a_lost_fragment_is_told_once() {
        let (steps, _) = read(&[(0, 1), (0x42, 3), (0x83, 4), (0, 5), (0x81, 6)], true);
        let wanted = [
            Step::Begins,
            Step::OutOfSequence { expected: 0x41 },
            Step::Ignored,
            Step::Begins,
            Step::Completes,
        ];
        assert_eq!(steps, wanted);
        // The first is lost; the last is lost.
        assert_eq!(read(&[(0x41, 1), (0x82, 2)], true).0[0], Step::OutOfSequence { expected: 0 });
        let (steps, _) = read(&[(0, 1), (0x41, 2), (0, 3)], true);
        assert_eq!(steps[2], Step::BeginsAnew { expected: 0x42 });
        // Pico manual p. 4-11: the second fragment is printed as a first one.
        assert_eq!(read(&[(0, 1), (1, 2)], true).0[1], Step::OutOfSequence { expected: 0x41 });
    }

    #[test]
    fn hostile_keys_use_no_more_memory() {
        let mut assemblies = Assemblies::default();
        for id in 0..2_000 {
            let place = assemblies.of(Key::io(id));
            assert!(place < ASSEMBLIES);
        }
        assert_eq!(assemblies.iter().count(), ASSEMBLIES);
        let mut long = Assembly::new(Key::io(0));
        let steps: Vec<Step> = (0..2_000_u32)
            .map(|n| {
                let part = if n == 0 { Part::First } else { Part::Middle };
                let fragment = Fragment { part, count: n as u8 & 0x3F };
                long.take((fragment, &[0; 6]), u64::from(n), true, true)
            })
            .collect();
        assert_eq!(steps[256], Step::TooLong);
        assert_eq!(long.data().len(), MAX_MESSAGE);
    }
}
