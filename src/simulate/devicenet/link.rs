//! The scanner and one slave: allocation, requests one after the other, and their answers.

use super::air::{Air, Note};
use super::explicit::{
    ALLOCATE, Arrival, ERROR, Incoming, Outgoing, PATIENCE, Piece, RELEASE, RESPONSE, acknowledge,
};
use super::fault::Fault;
use super::frame::{Frame, id};
use super::job::{self, Job, Then};
use super::plan::{Mode, Station};
use super::scanner::{Scanner, Task};
use super::serve::about;
use crate::simulate::time::{MS, Ps, S, US};
use std::collections::VecDeque;

/// How long the scanner waits for an answer.
const ANSWER: Ps = 1_500 * MS;

/// How long a shaft must rest before its preset is set.
const REST: Ps = 600 * MS;

/// How long it goes on as it does when a preset is set, until that is done.
const SETTING: Ps = 300 * MS;

/// Steps that a shaft at rest may move.
const STILL: u32 = 2;

/// A slave as the scanner knows it.
pub struct Link {
    /// As it was ordered.
    pub station: Station,
    /// Its serial number as it sent it.
    pub serial: Option<Vec<u8>>,
    /// Whether its I/O connection works.
    pub is_working: bool,
    /// Whether it is allocated.
    pub is_allocated: bool,
    jobs: VecDeque<Job>,
    /// The request that is on its way or waits for its answer.
    current: Option<(Job, Outgoing)>,
    incoming: Incoming,
    heard_at: Ps,
    /// Nothing is asked before this: the scanner looks away.
    away_until: Ps,
    /// Commands that are still sent to a connection that was released.
    stray: u8,
    position: Option<u32>,
    moved_at: Ps,
    is_open: bool,
    /// It is going to be switched off and on: nothing is asked before.
    is_doomed: bool,
}

impl Link {
    /// A slave that nothing is known of.
    pub fn new(station: Station) -> Self {
        Link {
            station,
            serial: None,
            is_working: false,
            is_allocated: false,
            jobs: VecDeque::new(),
            current: None,
            incoming: Incoming::default(),
            heard_at: 0,
            away_until: 0,
            stray: 0,
            position: None,
            moved_at: 0,
            is_open: false,
            is_doomed: false,
        }
    }

    /// Its MAC ID.
    pub fn mac(&self) -> u8 {
        self.station.mac
    }

    /// It has to be brought to work from the beginning. One that restarted knows no master any
    /// more; another may have to be released first.
    pub fn forget(&mut self, has_restarted: bool) {
        let is_allocated = self.is_allocated && !has_restarted;
        let serial = self.serial.take();
        *self = Link { serial, is_allocated, ..Link::new(self.station) };
    }

    /// Whether nothing is asked, and something may be.
    pub fn is_idle(&self) -> bool {
        self.jobs.is_empty() && self.current.is_none() && !self.is_doomed
    }

    /// Whether it is polled or strobed now.
    pub fn is_scanned(&mut self, now: Ps) -> bool {
        if self.stray > 0 {
            self.stray -= 1;
            return true;
        }
        self.is_working && now >= self.away_until
    }

    /// I/O data came.
    pub fn hear_io(&mut self, data: &[u8], now: Ps) {
        self.heard_at = now;
        let Some(position) = data.first_chunk().map(|bytes| u32::from_le_bytes(*bytes)) else {
            return;
        };
        if self.position.is_none_or(|last| last.abs_diff(position) > STILL) {
            self.moved_at = now;
            self.position = Some(position);
        }
    }

    /// Whether its shaft rested for a while, and goes on to.
    fn is_at_rest(&self, now: Ps, air: &Air) -> bool {
        let pace = air.paces[usize::from(self.mac())];
        self.position.is_some() && now - self.moved_at > REST && pace.rests(now + SETTING)
    }

    /// Whether the last two positions differed just now, and the next will.
    fn is_moving(&self, now: Ps, air: &Air) -> bool {
        let pace = air.paces[usize::from(self.mac())];
        now - self.moved_at < 100 * MS && pace.turns(now + SETTING)
    }

    /// Whether it works no more: nothing was heard of it.
    pub fn is_lost(&self, now: Ps, patience: Ps) -> bool {
        let is_scanned = self.is_working && now >= self.away_until + patience;
        is_scanned && now - self.heard_at > patience
    }
}

impl Scanner {
    /// Asks for the explicit connection at the unconnected port, again and again.
    pub(super) fn allocate(&mut self, link: usize, now: Ps, air: &mut Air) {
        self.links[link].is_open = false;
        let master = self.plan.master;
        if std::mem::take(&mut self.links[link].is_allocated) {
            let all = 0x01 | self.links[link].station.mode.choice();
            self.ask_unconnected(link, &[RELEASE, 3, 1, all], now, air);
            self.agenda.set(now + 50 * MS, Task::Allocate(link));
        } else {
            self.ask_unconnected(link, &[ALLOCATE, 3, 1, 0x01, master], now, air);
            self.agenda.set(now + S, Task::Allocate(link));
        }
    }

    fn ask_unconnected(&self, link: usize, body: &[u8], now: Ps, air: &mut Air) {
        let slave = self.links[link].mac();
        let frame = Frame::new(id::unconnected(slave), &[&[self.plan.master], body].concat());
        let note = self.note("unconnected-request", link);
        air.send(now, frame, Note { about: about(body), ..note });
    }

    /// Thinks of something to ask.
    pub(super) fn give_errand(&mut self, link: usize, now: Ps, air: &mut Air) {
        let station = self.links[link].station;
        let fault = self.faulty_errand(link, now, air);
        let jobs = match fault {
            Some(Fault::ConnectionTimeout) => {
                self.look_away(link, now);
                return;
            }
            Some(fault) => job::errand_of(fault, &station, &mut self.chance),
            None => job::errand(&station, self.links[link].is_at_rest(now, air), &mut self.chance),
        };
        self.links[link].jobs.extend(jobs);
    }

    /// The fault that decides what is asked, if one does.
    fn faulty_errand(&mut self, link: usize, now: Ps, air: &mut Air) -> Option<Fault> {
        let Link { station, .. } = &self.links[link];
        let (mac, mode) = (station.mac, station.mode);
        let is_at_rest = self.links[link].is_at_rest(now, air);
        let is_moving = self.links[link].is_moving(now, air);
        let can = |fault: &Fault| match fault {
            Fault::ConnectionTimeout => matches!(mode, Mode::Poll | Mode::Strobe),
            // Who is released is not strobed in particular.
            Fault::NotAllocated => mode != Mode::Strobe,
            Fault::PresetWhileMoving => is_moving,
            Fault::Written | Fault::UnsavedParameter | Fault::FragmentSequence => is_at_rest,
            _ => true,
        };
        [
            Fault::ConnectionTimeout,
            Fault::ErrorResponse,
            Fault::Malformed,
            Fault::ValueOutOfRange,
            Fault::NotSettable,
            Fault::UnsavedParameter,
            Fault::PresetWhileMoving,
            Fault::Written,
            Fault::XidBusy,
            Fault::FragmentSequence,
            Fault::NotAllocated,
        ]
        .into_iter()
        .filter(can)
        .find(|fault| air.fate.strikes(*fault, mac, now))
    }

    /// Leaves a slave alone until it must have timed out, and connects it anew.
    fn look_away(&mut self, link: usize, now: Ps) {
        let packet_rate = Ps::from(self.plan.packet_rate) * MS;
        let away = 6 * packet_rate + 100 * MS;
        self.links[link].away_until = now + away;
        self.links[link].heard_at = now + away;
        let station = self.links[link].station;
        self.links[link].jobs.push_back(job::release(&station));
    }

    /// Sends the next request, if none is on its way.
    pub(super) fn ask(&mut self, link: usize, now: Ps, air: &mut Air) {
        let Link { current, jobs, away_until, .. } = &mut self.links[link];
        if now < *away_until {
            self.agenda.set(*away_until, Task::Ask(link));
            return;
        }
        if current.is_some() {
            return;
        }
        let Some(job) = jobs.pop_front() else { return };
        let slave = self.links[link].mac();
        let message = Outgoing::new(id::request(slave), self.plan.master, job.body.clone());
        let is_twice = job.fault == Some(Fault::XidBusy);
        self.links[link].current = Some((job, message));
        self.send_fragment(link, now, air);
        if is_twice {
            let second = Job::get(super::object::ENCODER, 1, 80);
            let message = Outgoing::new(id::request(slave), self.plan.master, second.body.clone());
            let note = self.note("explicit-request", link);
            let note = Note { about: about(&second.body), ..note };
            air.send(now + 50 * US, message.frame(), note);
        }
        self.agenda.set(now + ANSWER, Task::Unanswered(link));
    }

    fn send_fragment(&mut self, link: usize, ready: Ps, air: &mut Air) {
        let note = self.note("explicit-request", link);
        let Some((_, message)) = &self.links[link].current else { return };
        let piece = message.piece();
        let is_end = matches!(piece, Piece::Whole | Piece::Last);
        let about = about(message.body()).filter(|_| is_end);
        air.send(ready, message.frame(), Note { piece, about, ..note });
    }

    /// A frame of a request is on its way: if it is a fragment, its acknowledge is waited for.
    pub(super) fn sent_request(&mut self, link: usize, now: Ps) {
        let Some((_, message)) = &self.links[link].current else { return };
        if message.is_fragmented() && message.piece() != Piece::Whole {
            self.agenda.set(now + PATIENCE, Task::RepeatFragment(link));
            self.agenda.set(now + PATIENCE + ANSWER, Task::Unanswered(link));
        }
    }

    /// Nobody acknowledged: once more, and then no more.
    pub(super) fn repeat_fragment(&mut self, link: usize, now: Ps, air: &mut Air) {
        let Some((_, message)) = &mut self.links[link].current else { return };
        if std::mem::replace(&mut message.is_second, true) {
            self.give_up(link, now);
        } else {
            self.send_fragment(link, now, air);
        }
    }

    /// The slave does not answer. What was wrong is not asked again.
    pub(super) fn give_up(&mut self, link: usize, now: Ps) {
        self.agenda.cancel(Task::Unanswered(link));
        self.agenda.cancel(Task::RepeatFragment(link));
        let Some((job, _)) = self.links[link].current.take() else { return };
        if self.links[link].is_working {
            self.links[link].jobs.clear();
        } else {
            // Without it the slave cannot come to work.
            self.links[link].jobs.push_front(job);
        }
        self.agenda.set(now + 50 * MS, Task::Ask(link));
    }

    /// A frame on the identifier of the slave's responses.
    pub(super) fn hear_response(&mut self, link: usize, data: &[u8], now: Ps, air: &mut Air) {
        let is_mine = data.first().is_some_and(|header| header & 0x3F == self.plan.master);
        if !is_mine {
            return;
        }
        if let ([_, service, ..], false) = (data, self.links[link].is_open) {
            if *service == ALLOCATE | RESPONSE {
                self.open_for_requests(link, now);
            }
            return;
        }
        match self.links[link].incoming.take(data) {
            Arrival::Message(_, body) => self.hear_answer(link, &body, now, air),
            Arrival::Fragment(count, body) => {
                let slave = self.links[link].mac();
                let ready = now + self.some(200 * US, 2 * MS);
                let frame = acknowledge(id::request(slave), self.plan.master, count, 0);
                let note = self.note("explicit-response", link).piece(Piece::Acknowledge);
                air.send(ready, frame, note);
                self.agenda.set(now + ANSWER, Task::Unanswered(link));
                if let Some(body) = body {
                    self.hear_answer(link, &body, now, air);
                }
            }
            Arrival::Acknowledge(count, status) => {
                self.hear_acknowledge(link, count, status, now, air);
            }
            Arrival::Nothing => {}
        }
    }

    fn open_for_requests(&mut self, link: usize, now: Ps) {
        self.agenda.cancel(Task::Allocate(link));
        let jobs = job::start_up(&self.plan, &self.links[link].station);
        let link_of = &mut self.links[link];
        (link_of.is_open, link_of.current) = (true, None);
        link_of.jobs = jobs.into();
        link_of.incoming.reset();
        self.agenda.set(now + 5 * MS, Task::Ask(link));
    }

    fn hear_acknowledge(&mut self, link: usize, count: u8, status: u8, now: Ps, air: &mut Air) {
        let Some((job, message)) = &mut self.links[link].current else { return };
        if status != 0 {
            self.give_up(link, now);
            return;
        }
        if message.advance(count) != Some(true) {
            self.agenda.cancel(Task::RepeatFragment(link));
            return;
        }
        if job.fault == Some(Fault::FragmentSequence) {
            message.slip = 1;
        }
        let ready = now + self.some(300 * US, 2 * MS);
        self.send_fragment(link, ready, air);
    }

    /// The answer to the current request.
    fn hear_answer(&mut self, link: usize, body: &[u8], now: Ps, air: &mut Air) {
        let Some((job, _)) = &self.links[link].current else { return };
        let [service, ..] = body else { return };
        if *service != job.body[0] | RESPONSE && *service != ERROR {
            return;
        }
        let then = job.then;
        let fault = job.fault;
        self.links[link].current = None;
        self.agenda.cancel(Task::Unanswered(link));
        self.agenda.cancel(Task::RepeatFragment(link));
        let soon = self.some(2 * MS, 12 * MS);
        self.agenda.set(now + soon, Task::Ask(link));
        self.do_then(then, fault, link, now, air);
    }

    fn do_then(&mut self, then: Then, fault: Option<Fault>, link: usize, now: Ps, air: &mut Air) {
        let link_of = &mut self.links[link];
        match then {
            Then::Next => {}
            Then::Work => {
                (link_of.is_working, link_of.is_allocated) = (true, true);
                (link_of.heard_at, link_of.moved_at) = (now, now);
            }
            Then::Reallocate => {
                link_of.is_working = false;
                link_of.is_allocated = false;
                if fault == Some(Fault::NotAllocated) {
                    self.go_on_with_io(link, now, air);
                }
                let soon = self.some(300 * MS, 600 * MS);
                self.agenda.set(now + soon, Task::Reconnect(link));
            }
            Then::PowerCycle => {
                link_of.is_doomed = true;
                let slave = link_of.mac();
                air.fate.power_cycles.push((slave, now + 700 * MS));
            }
        }
    }

    /// I/O on a connection that was just released: polls, or a production that was on its way.
    fn go_on_with_io(&mut self, link: usize, now: Ps, air: &mut Air) {
        let Link { station, position, .. } = &self.links[link];
        let slave = station.mac;
        if !station.mode.is_produced() {
            self.links[link].stray = 3;
            return;
        }
        let kind = if station.mode == Mode::Cos { "cos" } else { "cyclic" };
        let position = position.unwrap_or_default();
        let mut data = position.to_le_bytes().to_vec();
        data.resize(3 + usize::from(station.assembly), 0);
        let note = Note::new(kind, slave, Some(self.plan.master), slave);
        let frame = Frame::new(id::production(slave), &data);
        air.send_as_stranger(now + 20 * MS, frame, Note { position: Some(position), ..note });
    }

    /// Connects the slave's I/O anew.
    pub(super) fn reconnect(&mut self, link: usize, now: Ps) {
        self.links[link].stray = 0;
        let jobs = job::connect(&self.plan, &self.links[link].station);
        self.links[link].jobs.extend(jobs);
        self.agenda.set(now, Task::Ask(link));
    }
}
