//! What is waited for: whatever does not come in time is told at its deadline.

use super::codes;
use super::connection::{Direction, Instance, Mark, State as Stands};
use super::flow::is_timed;
use super::identifier::{MAC_IDS, MacId};
use super::layer::Link;
use super::ledger::Ledger;
use super::node::{Check, Production};
use super::transactions::Request;
use crate::event::Moment;
use crate::finding::{Finding, State};

/// Requests that go unanswered in a row before that is told as a lasting condition.
const IN_A_ROW: u32 = 3;

/// What did not come.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Missing {
    /// The answer to an explicit request: its record.
    Answer(MacId, u64),
    /// The acknowledgement of a fragment: its assembly.
    FragmentAcknowledge(usize),
    /// A message of an I/O connection.
    Message(MacId, Instance, Direction),
    /// The acknowledgement of what a slave produced, or its master (`Poll`).
    IoAcknowledge(MacId, Instance),
    /// An objection to a duplicate MAC ID check.
    Objection(MacId, Mark),
}

/// An alarm, and when it goes off.
#[derive(Clone, Copy, Debug)]
struct Alarm {
    /// The deadline.
    due: Moment,
    /// From when on it is certain that the deadline was missed.
    certain: Moment,
    missing: Missing,
}

/// What an alarm tells, besides the judgement.
#[derive(Clone, Copy, Debug)]
pub(super) struct Told {
    pub at: Moment,
    pub about: Option<u64>,
    pub station: Option<MacId>,
    pub link: Option<Link>,
    /// Who sent what it is about, and to whom, where that matters.
    pub source: Option<MacId>,
    pub destination: Option<MacId>,
}

impl Told {
    /// Something about the bus.
    pub const fn at(at: Moment) -> Self {
        Told { at, about: None, station: None, link: None, source: None, destination: None }
    }
}

impl Ledger {
    /// Lets the first alarm go off that is certain before `now`, if there is one. What it tells is
    /// in the judgement; `None` once none is left. An alarm that tells nothing is passed over.
    pub fn alarm(&mut self, now: Moment) -> Option<Told> {
        // Nearly always nothing is due.
        while now.is_after(self.next) {
            let first = self.first();
            self.next = first.map_or(Moment::UNKNOWN, |alarm| alarm.certain);
            let alarm = first.filter(|alarm| now.is_after(alarm.certain))?;
            self.judgement.clear();
            if let Some(told) = self.go_off(alarm) {
                return Some(told);
            }
        }
        None
    }

    /// The first production that was late when the capture ended, and for which it is too early to
    /// say that its connection timed out.
    pub fn late_at_end(&mut self, end: Moment) -> Option<Told> {
        let percent = self.settings.late_production_percent;
        let late = (0..MAC_IDS as u8).map(MacId::of).filter_map(|mac| {
            let connection = &self.nodes[mac.index()].connections[Instance::Production.index()];
            let is_due = connection.state == Stands::Established;
            let rate = connection.rate_ns().filter(|_| is_due)?;
            let last = connection.produced.last?;
            let limit = rate.saturating_mul(percent) / 100;
            let due = last.start.plus(limit);
            let certain = due.plus(self.timing.patience(last.uncertainty));
            end.is_after(certain).then_some((due, mac, last, rate, limit))
        });
        let (at, mac, last, rate, limit) = late.min_by_key(|(due, ..)| due.ns())?;
        self.node(mac).connection(Instance::Production).produced.last = None;
        self.judgement.clear();
        let finding = Finding::new(&codes::LATE_PRODUCTION).expected(rate).limit(limit);
        self.judgement.find(finding);
        let link = Some(self.link_of(mac, Instance::Production));
        Some(Told { about: Some(last.n), station: Some(mac), link, ..Told::at(at) })
    }

    fn first(&self) -> Option<Alarm> {
        let mut first: Option<Alarm> = None;
        let mut take = |due: Moment, uncertainty: u32, missing: Missing| {
            let certain = due.plus(self.timing.patience(uncertainty));
            if first.is_none_or(|alarm| alarm.certain.is_after(certain)) {
                first = Some(Alarm { due, certain, missing });
            }
        };
        let mut watched = self.watched;
        while watched != 0 {
            let mac = MacId::of(watched.trailing_zeros() as u8);
            watched &= watched - 1;
            self.each_of(mac, &mut take);
        }
        for (place, assembly) in self.assemblies.iter() {
            if let Some(awaiting) = assembly.awaiting.filter(|it| it.sent.is_known()) {
                // The sender waits, sends it once more, and waits again.
                let waits = if awaiting.sendings > 1 { 1 } else { 2 };
                let due = awaiting.sent.plus(waits * self.settings.fragment_acknowledge_ns);
                take(due, awaiting.uncertainty, Missing::FragmentAcknowledge(place));
            }
        }
        first
    }

    /// What is waited for at one node.
    fn each_of(&self, mac: MacId, take: &mut impl FnMut(Moment, u32, Missing)) {
        let node = &self.nodes[mac.index()];
        for request in node.transactions.iter() {
            let due = request.deadline(self.settings.no_response_ns);
            if let (Some(due), Some(mark)) = (due, request.mark) {
                take(due, request.uncertainty, Missing::Answer(mac, mark.n));
            }
        }
        for instance in Instance::ALL {
            let connection = &node.connections[instance.index()];
            if instance == Instance::Explicit && connection.is_deferred() {
                continue;
            }
            for direction in [Direction::Consumed, Direction::Produced] {
                // A slave that never answered may be one that has nothing to answer.
                let answers = match instance {
                    Instance::Poll => node.answers_polls,
                    Instance::Strobe => node.answers_strobes,
                    Instance::Multicast => connection.produced.last.is_some(),
                    _ => true,
                };
                let is_due =
                    is_timed(instance, direction) && (direction == Direction::Consumed || answers);
                if let Some((due, uncertainty)) =
                    connection.deadline(direction, &self.settings).filter(|_| is_due)
                {
                    take(due, uncertainty, Missing::Message(mac, instance, direction));
                }
            }
        }
        for (instance, production) in
            [(Instance::Production, node.production), (Instance::Poll, node.master_production)]
        {
            if let Some(Production { since, is_acknowledged: false, is_told: false, .. }) =
                production
                && since.start.is_known()
            {
                let due = since.start.plus(self.acknowledge_limit(mac));
                take(due, since.uncertainty, Missing::IoAcknowledge(mac, instance));
            }
        }
        if let Some(Check { first, is_over: false, .. }) = node.check
            && first.start.is_known()
        {
            let due = first.start.plus(self.settings.check_ns);
            take(due, first.uncertainty, Missing::Objection(mac, first));
        }
    }

    fn go_off(&mut self, Alarm { due, missing, .. }: Alarm) -> Option<Told> {
        let told = Told::at(due);
        match missing {
            Missing::Answer(mac, n) => {
                let link = self.unanswered(mac, n, due)?;
                Some(Told { about: Some(n), station: Some(mac), link: Some(link), ..told })
            }
            Missing::FragmentAcknowledge(place) => {
                let assembly = self.assemblies.get_mut(place)?;
                let awaiting = assembly.awaiting?;
                let (station, first) = (assembly.server, assembly.numbers().first().copied());
                assembly.give_up();
                let request = station
                    .zip(first)
                    .and_then(|(mac, first)| self.nodes[mac.index()].transactions.by_number(first));
                if let Some(request) = request {
                    request.is_given_up = true;
                }
                let finding = Finding::new(&codes::FRAGMENT_UNACKNOWLEDGED);
                self.judgement.find(finding.actual(i64::from(awaiting.sendings)));
                let link = Some(Link::Explicit);
                Some(Told { about: Some(awaiting.n), station, link, ..told })
            }
            Missing::Message(mac, Instance::Explicit, _) => {
                self.leave_explicit(mac, due);
                None
            }
            Missing::Message(mac, instance, direction) => {
                let about = self.time_out(mac, instance, direction, due);
                let link = Some(self.link_of(mac, instance));
                Some(Told { about, station: Some(mac), link, ..told })
            }
            Missing::IoAcknowledge(mac, instance) => {
                let limit = self.acknowledge_limit(mac);
                let production = self.node(mac).last_production(instance).as_mut()?;
                production.is_told = true;
                let about = Some(production.since.n);
                self.judgement.find(Finding::new(&codes::IO_UNACKNOWLEDGED).limit(limit));
                let link = Some(self.link_of(mac, Instance::Production));
                let ends = (Some(mac), self.owner(mac));
                let (source, destination) = match instance {
                    Instance::Poll => (ends.1, ends.0),
                    _ => ends,
                };
                Some(Told { about, station: Some(mac), link, source, destination, ..told })
            }
            Missing::Objection(mac, first) => {
                let is_news = self.restarted(mac, first, due);
                let about = Some(first.n);
                is_news.then_some(Told { about, station: Some(mac), ..told })
            }
        }
    }

    /// A request goes unanswered. Returns what it travelled on if that is to be told: from the
    /// third in a row on it is one lasting condition.
    fn unanswered(&mut self, mac: MacId, n: u64, now: Moment) -> Option<Link> {
        let node = &mut self.nodes[mac.index()];
        let request: &mut Request = node.transactions.by_number(n)?;
        request.is_given_up = true;
        let link = request.link;
        node.silence.count = node.silence.count.saturating_add(1);
        let mut finding = Finding::new(&codes::NO_RESPONSE).limit(self.settings.no_response_ns);
        if node.silence.count == IN_A_ROW {
            node.silence.since = Some(now);
            finding = finding.state(State::Begin);
        }
        (node.silence.count <= IN_A_ROW).then(|| {
            self.judgement.find(finding);
            link
        })
    }

    /// Nothing is asked any more: the explicit connection goes by itself, which is how a master or
    /// a tool that is done leaves it. It is told when it is used again.
    fn leave_explicit(&mut self, mac: MacId, now: Moment) {
        let node = &mut self.nodes[mac.index()];
        node.connection(Instance::Explicit).time_out(Stands::Gone, now);
        node.guess = node.format.take().or(node.guess);
    }

    /// An I/O connection times out. Returns the record of its last message, if there was one.
    fn time_out(
        &mut self,
        mac: MacId,
        instance: Instance,
        direction: Direction,
        now: Moment,
    ) -> Option<u64> {
        let connection = self.nodes[mac.index()].connection(instance);
        let mut finding = Finding::new(&codes::CONNECTION_TIMEOUT).state(State::Begin);
        finding.expected = connection.rate_ns();
        finding.limit = connection.limit();
        connection.time_out(Stands::TimedOut, now);
        self.judgement.find(finding);
        connection.flow(direction).last.map(|mark| mark.n)
    }

    fn link_of(&self, mac: MacId, instance: Instance) -> Link {
        let is_cyclic = self.nodes[mac.index()].has(super::allocation::Choice::CYCLIC);
        match instance {
            Instance::Explicit => Link::Explicit,
            Instance::Poll => Link::Poll,
            Instance::Strobe => Link::Strobe,
            Instance::Production if is_cyclic => Link::Cyclic,
            Instance::Production => Link::Cos,
            Instance::Multicast => Link::Multicast,
        }
    }
}
