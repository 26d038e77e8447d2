//! Explicit requests that wait for their answers.

use super::connection::Mark;
use super::identifier::MacId;
use super::layer::Link;
use super::message::{Target, service};
use crate::event::Moment;

/// Requests that may wait for one server at the same time.
const WAITING: usize = 4;

/// Bytes of a request's data that are kept until the answer says whether it was done.
const KEPT: usize = 8;

/// The first bytes of a request's data.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Kept {
    length: u8,
    bytes: [u8; KEPT],
}

impl Kept {
    pub fn bytes(&self) -> &[u8] {
        &self.bytes[..usize::from(self.length)]
    }
}

/// Whose request it is: one may be under way for each.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Party {
    /// The identifier that answers it.
    pub answers_on: u16,
    pub client: MacId,
    pub xid: bool,
}

/// A request that waits for its answer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Request {
    pub party: Party,
    pub link: Link,
    /// The record of its first fragment; `None` where its beginning was not seen.
    pub mark: Option<Mark>,
    /// From when the answer's time is judged: unknown until the request is complete and taken.
    pub since: Moment,
    /// ± of `since` in ns.
    pub uncertainty: u32,
    /// What is asked; `None` where its beginning was not seen.
    pub service: Option<u8>,
    pub target: Target,
    pub data: Kept,
    /// Its answer is not waited for any more: that it did not come was told, it was broken on the
    /// way, or a request like it was answered.
    pub is_given_up: bool,
    /// When the first fragment of the answer came.
    pub answered: Option<Moment>,
}

impl Request {
    /// A request by that party.
    pub const fn new(party: Party, link: Link, mark: Option<Mark>) -> Self {
        Request {
            party,
            link,
            mark,
            since: Moment::UNKNOWN,
            uncertainty: 0,
            service: None,
            target: Target { class: None, instance: None, attribute: None },
            data: Kept { length: 0, bytes: [0; KEPT] },
            is_given_up: false,
            answered: None,
        }
    }

    /// Keeps the first bytes of its data.
    pub fn keep(&mut self, data: &[u8]) {
        let length = data.len().min(KEPT);
        self.data.bytes[..length].copy_from_slice(&data[..length]);
        self.data.length = length as u8;
    }

    /// The first bytes of its data.
    pub fn data(&self) -> &[u8] {
        self.data.bytes()
    }

    /// When it is given up; `None` where that is not judged. An Open that nobody answers is
    /// normal: a Group 2 only server has no UCMM.
    pub fn deadline(&self, limit: i64) -> Option<Moment> {
        let is_open = self.link == Link::Ucmm && self.service == Some(service::ALLOCATE);
        let is_judged = !self.is_given_up && self.answered.is_none() && !is_open;
        (is_judged && self.since.is_known()).then(|| self.since.plus(limit))
    }

    fn fits(&self, party: Party, code: u8) -> bool {
        let same_service = self.service.is_none_or(|asked| asked == code);
        self.party == party && (same_service || code == service::ERROR)
    }
}

/// The requests that wait for one server.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct Transactions {
    waiting: [Option<Request>; WAITING],
    next: usize,
}

impl Transactions {
    /// Adds a request: those of its party that were given up are past. Where too many wait, the
    /// oldest is forgotten.
    pub fn open(&mut self, request: Request) {
        for slot in &mut self.waiting {
            slot.take_if(|other| other.party == request.party && other.is_given_up);
        }
        let free = self.waiting.iter().position(Option::is_none).unwrap_or(self.next);
        self.waiting[free] = Some(request);
        self.next = (free + 1) % WAITING;
    }

    /// Whether a request of that party waits, and nobody has given it up.
    pub fn is_busy(&self, party: Party) -> bool {
        self.iter().any(|request| request.party == party && !request.is_given_up)
    }

    /// The request of that party that came last.
    pub fn last(&mut self, party: Party) -> Option<&mut Request> {
        self.waiting
            .iter_mut()
            .flatten()
            .filter(|request| request.party == party)
            .max_by_key(|request| request.mark.map_or(0, |mark| mark.n))
    }

    /// The request that this answer fits: the first that is waited for.
    pub fn answered(&mut self, party: Party, code: u8) -> Option<&mut Request> {
        let fitting = self.waiting.iter_mut().flatten().filter(|it| it.fits(party, code));
        fitting.min_by_key(|request| (request.is_given_up, request.mark.map_or(0, |mark| mark.n)))
    }

    /// A request was answered. If its client asked again before, that may have been the answer to
    /// both, or another is to come: it is no longer waited for.
    pub fn close(&mut self, answered: &Request) {
        for slot in &mut self.waiting {
            slot.take_if(|request| {
                request.party == answered.party && request.mark == answered.mark
            });
            if let Some(other) = slot.as_mut().filter(|other| other.party == answered.party) {
                other.is_given_up = true;
            }
        }
    }

    /// A party's requests did not get through: no answer is waited for.
    pub fn give_up(&mut self, party: Party) {
        let of_party = self.waiting.iter_mut().flatten().filter(|it| it.party == party);
        of_party.for_each(|request| request.is_given_up = true);
    }

    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = &Request> {
        self.waiting.iter().flatten()
    }

    /// The request whose record that is.
    pub fn by_number(&mut self, n: u64) -> Option<&mut Request> {
        let is_it = |request: &&mut Request| request.mark.is_some_and(|mark| mark.n == n);
        self.waiting.iter_mut().flatten().find(is_it)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn party(xid: bool) -> Party {
        Party { answers_on: 0x4BB, client: MacId::of(0), xid }
    }

    fn asked(n: u64, xid: bool, code: u8) -> Request {
        let mark = Mark { n, start: Moment::from_ns(0), uncertainty: 0 };
        let mut request = Request::new(party(xid), Link::Explicit, Some(mark));
        request.service = Some(code);
        request
    }

    #[test]
    fn an_answer_has_the_service_and_the_xid_of_its_request() {
        let mut waiting = Transactions::default();
        waiting.open(asked(1, false, 0x0E));
        waiting.open(asked(2, true, 0x10));
        let mut answered = |xid, code| {
            waiting.answered(party(xid), code).and_then(|it| it.mark).map(|mark| mark.n)
        };
        assert_eq!(answered(false, 0x0E), Some(1));
        assert_eq!(answered(true, 0x10), Some(2));
        assert_eq!(answered(true, 0x0E), None);
        // An error response (94h) answers any service.
        assert_eq!(answered(true, 0x14), Some(2));
        waiting.close(&asked(2, true, 0x10));
        assert!(waiting.is_busy(party(false)) && !waiting.is_busy(party(true)));
    }

    #[test]
    fn two_requests_alike_may_have_one_answer_or_two() {
        let mut waiting = Transactions::default();
        waiting.open(asked(1, false, 0x0E));
        waiting.open(asked(2, false, 0x0E));
        for n in [1, 2] {
            let request = *waiting.answered(party(false), 0x0E).unwrap();
            assert_eq!(request.mark.map(|mark| mark.n), Some(n));
            waiting.close(&request);
            assert!(!waiting.is_busy(party(false)));
        }
        assert!(waiting.answered(party(false), 0x0E).is_none());
        // One answer, and then the next request.
        waiting.open(asked(3, false, 0x0E));
        waiting.open(asked(4, false, 0x0E));
        waiting.close(&asked(3, false, 0x0E));
        waiting.open(asked(5, false, 0x0E));
        let request = waiting.answered(party(false), 0x0E).and_then(|it| it.mark);
        assert_eq!(request.map(|mark| mark.n), Some(5));
    }

    #[test]
    fn many_requests_use_no_more_memory() {
        let mut waiting = Transactions::default();
        for n in 0..100 {
            waiting.open(asked(n, false, 0x0E));
        }
        assert_eq!(waiting.iter().count(), WAITING);
        assert_eq!(waiting.last(party(false)).and_then(|it| it.mark).map(|it| it.n), Some(99));
    }
}
