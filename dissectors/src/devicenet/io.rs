//! I/O: commands and their answers, change-of-state and cyclic messages and their
//! acknowledgements.
//!
//! DeviceNet specification (CIP Vol. 3), chapters 3 and 5: I/O messages of the predefined set.

use super::allocation::Choice;
use super::codes;
use super::connection::{Direction, Instance, Mark, State as Stands};
use super::defect::Defect;
use super::flow::Piece;
use super::identifier::MacId;
use super::layer::{Assumed, Facts, Link, kind};
use super::ledger::{Ledger, Now};
use super::node::{Command, Production};
use super::timing::Verdict;
use crate::finding::Finding;
use crate::record::Turn;

impl Ledger {
    /// A master polls a slave, or sends it change-of-state or cyclic data.
    pub fn poll_command(&mut self, now: &Now<'_>, slave: MacId, facts: &mut Facts) {
        let is_poll = self.nodes[slave.index()].is_polled();
        (facts.kind, facts.link) = match (is_poll, self.is_cyclic(slave)) {
            (true, _) => (kind::POLL_COMMAND, Some(Link::Poll)),
            (false, true) => (kind::CYCLIC, Some(Link::Cyclic)),
            (false, false) => (kind::COS, Some(Link::Cos)),
        };
        facts.destination = Some(slave);
        facts.source = self.owner(slave);
        self.begin_io(slave, Instance::Poll, facts);
        let node = &self.nodes[slave.index()];
        let is_open = node.poll.is_some_and(|command| command.answered.is_none());
        let piece = self.piece(now, (slave, Instance::Poll, Direction::Consumed), is_open, facts);
        if piece.begins() && !(now.is_repeating && is_open) {
            if is_poll {
                facts.turn = Turn::Asks;
                self.judge_poll(now, slave);
                self.measure_poll(now, slave);
            } else {
                let is_retry = self.is_retry(now, slave, Instance::Poll);
                self.await_io_acknowledge(now, slave, Instance::Poll, is_retry);
            }
            self.node(slave).poll = Some(Command {
                mark: now.mark,
                bits: now.bits.unwrap_or_default(),
                answered: None,
                is_over: false,
            });
        }
        self.flow(now, (slave, Instance::Poll, Direction::Consumed), piece);
    }

    fn is_cyclic(&self, slave: MacId) -> bool {
        self.nodes[slave.index()].has(Choice::CYCLIC)
    }

    /// What holds for all I/O of a slave.
    fn begin_io(&mut self, slave: MacId, instance: Instance, facts: &mut Facts) {
        facts.station = Some(slave);
        if !self.nodes[slave.index()].has_seen(instance) {
            facts.assumed.add(Assumed::ALLOCATION);
        }
        // A slave that produces on a connection that timed out shows that it did not.
        let stands = self.nodes[slave.index()].connections[instance.index()].state;
        if stands == Stands::Gone || facts.source != Some(slave) {
            self.tell_unallocated(slave, instance);
        }
    }

    /// The poll before this one is told as unanswered here.
    fn judge_poll(&mut self, now: &Now<'_>, slave: MacId) {
        let node = &mut self.nodes[slave.index()];
        let Some(Command { mark, answered: None, .. }) = node.poll else { return };
        let answers = node.answers_polls;
        let connection = node.connection(Instance::Poll);
        let must_answer = !connection.is_mute && connection.produced.size != Some(0);
        let is_due = answers || (connection.state == Stands::Established && must_answer);
        if connection.is_judged() && is_due {
            let mut finding = Finding::new(&codes::NO_POLL_RESPONSE);
            finding.actual = now.mark.start.since(mark.start);
            self.judgement.find(finding);
        }
    }

    /// A slave answers a poll, or acknowledges what its master sent.
    pub fn poll_response(&mut self, now: &Now<'_>, slave: MacId, facts: &mut Facts) {
        let is_poll = self.nodes[slave.index()].is_polled();
        (facts.kind, facts.link) = match (is_poll, self.is_cyclic(slave)) {
            (true, _) => (kind::POLL_RESPONSE, Some(Link::Poll)),
            (false, true) => (kind::IO_ACK, Some(Link::Cyclic)),
            (false, false) => (kind::IO_ACK, Some(Link::Cos)),
        };
        (facts.source, facts.destination) = (Some(slave), self.owner(slave));
        self.begin_io(slave, Instance::Poll, facts);
        let at = (slave, Instance::Poll, Direction::Produced);
        let candidate = self.node(slave).connection(Instance::Poll).produced.habit.candidate;
        let poll = self.nodes[slave.index()].poll;
        let same_cycle = candidate.zip(poll).is_some_and(|((n, _), poll)| n > poll.mark.n);
        let piece = self.piece(now, at, same_cycle, facts);
        if piece.begins() {
            if !is_poll {
                self.take_acknowledge(now, slave, Instance::Poll);
            }
            self.answer_poll(now, slave);
        }
        if let Some(Command { mark, answered: Some(answered), is_over: false, .. }) =
            self.nodes[slave.index()].poll
        {
            facts.request = Some(mark.n);
            if piece.length().is_some() {
                facts.response_time = answered.since(mark.start);
                facts.turn = if is_poll { Turn::Answers } else { Turn::Neither };
            }
        }
        self.flow(now, at, piece);
    }

    fn answer_poll(&mut self, now: &Now<'_>, slave: MacId) {
        let node = &mut self.nodes[slave.index()];
        let Some(command) = &mut node.poll else { return };
        if command.answered.is_some() {
            if !now.is_repeating {
                command.is_over = true;
                self.judgement.find(Finding::new(&codes::UNSOLICITED_RESPONSE));
            }
            return;
        }
        command.answered = Some(now.mark.start);
        let command = *command;
        node.answers_polls = true;
        if node.is_polled() {
            self.measure_response(now, slave, command);
        }
        let node = &mut self.nodes[slave.index()];
        if node.connection(Instance::Poll).state == Stands::TimedOut {
            let asked = node.connection(Instance::Poll).consumed.last;
            self.revive(slave, Instance::Poll, now.mark.start);
            self.node(slave).connection(Instance::Poll).consumed.last = asked;
        }
    }

    /// A slave's change-of-state or cyclic message.
    pub fn production(&mut self, now: &Now<'_>, slave: MacId, facts: &mut Facts) {
        let is_cyclic = self.is_cyclic(slave);
        facts.kind = if is_cyclic { kind::CYCLIC } else { kind::COS };
        facts.link = Some(if is_cyclic { Link::Cyclic } else { Link::Cos });
        (facts.source, facts.destination) = (Some(slave), self.owner(slave));
        self.begin_io(slave, Instance::Production, facts);
        let at = (slave, Instance::Production, Direction::Produced);
        let piece = self.piece(now, at, true, facts);
        if self.node(slave).connection(Instance::Production).state == Stands::TimedOut {
            self.revive(slave, Instance::Production, now.mark.start);
        }
        if piece.begins() {
            let is_retry = self.is_retry(now, slave, Instance::Production);
            self.judge_pace(now, slave, is_retry);
            self.await_io_acknowledge(now, slave, Instance::Production, is_retry);
        }
        if let Some(bits) = now.bits {
            let limit = self.settings.flood_permille;
            if let Some(share) = self.flood.add(slave, bits, now.mark.start, limit.unsigned_abs()) {
                let finding = Finding::new(&codes::IO_FLOOD).actual(share);
                self.judgement.find(finding.limit(limit));
            }
        }
        self.flow(now, at, piece);
    }

    /// The same data again before it was acknowledged is sent again for want of that.
    fn is_retry(&mut self, now: &Now<'_>, slave: MacId, instance: Instance) -> bool {
        self.expects_acknowledge(slave, instance)
            && self.node(slave).last_production(instance).is_some_and(|before| {
                let length = usize::from(before.length);
                !before.is_acknowledged && before.data[..length] == *now.data
            })
    }

    /// Whether change-of-state and cyclic messages are acknowledged: those of the slave
    /// (`Production`) by the master, those of the master (`Poll`) by the slave.
    fn expects_acknowledge(&self, slave: MacId, instance: Instance) -> bool {
        let node = &self.nodes[slave.index()];
        let connection = &node.connections[instance.index()];
        node.has(Choice::PRODUCING) && !node.has(Choice::NO_ACKNOWLEDGE) && !connection.is_mute
    }

    fn judge_pace(&mut self, now: &Now<'_>, slave: MacId, is_retry: bool) {
        let timing = self.timing;
        let connection = self.nodes[slave.index()].connection(Instance::Production);
        let Some(last) = connection.produced.last.filter(|_| connection.is_judged()) else {
            return;
        };
        let Some(gap) = now.mark.start.since(last.start) else { return };
        let uncertainty = i64::from(last.uncertainty) + i64::from(now.mark.uncertainty);
        let rate = connection.rate_ns().filter(|_| connection.state == Stands::Established);
        if let Some(rate) = rate {
            let limit = rate.saturating_mul(self.settings.late_production_percent) / 100;
            let verdict = timing.above(gap, limit, uncertainty);
            let finding = Finding::new(&codes::LATE_PRODUCTION).expected(rate);
            self.judgement.judge(verdict, finding.actual(gap).limit(limit));
        }
        let inhibit = connection.inhibit.filter(|inhibit| *inhibit > 0 && !is_retry);
        if let Some(inhibit) = inhibit {
            let limit = i64::from(inhibit) * 1_000_000;
            let verdict = timing.below(gap, limit, uncertainty);
            let finding = Finding::new(&codes::INHIBIT_VIOLATED).actual(gap).limit(limit);
            self.judgement.judge(verdict, finding);
        }
    }

    /// Waits for the acknowledgement of a slave's message (`Production`), or of its master's
    /// (`Poll`).
    fn await_io_acknowledge(
        &mut self,
        now: &Now<'_>,
        slave: MacId,
        instance: Instance,
        is_retry: bool,
    ) {
        let expects = self.expects_acknowledge(slave, instance) && self.is_ready(slave, instance);
        let limit = self.acknowledge_limit(slave);
        let last = self.nodes[slave.index()].last_production(instance);
        if is_retry && last.is_some_and(|before| !before.is_told) {
            self.judgement.find(Finding::new(&codes::IO_UNACKNOWLEDGED));
        }
        let mut data = [0; 8];
        let length = now.data.len().min(8);
        data[..length].copy_from_slice(&now.data[..length]);
        let waiting = last.filter(|before| !before.is_acknowledged && !before.is_told);
        let since = waiting.map_or(now.mark, |before| before.since);
        *last = Some(Production {
            mark: now.mark,
            since,
            length: length as u8,
            data,
            is_acknowledged: false,
            // A retry that is not acknowledged either is the same story.
            is_told: is_retry || !expects,
        });
        if expects && !is_retry {
            self.wait(Some(slave), since.start.plus(limit));
        }
    }

    /// Whether who is to acknowledge takes messages already: the master may not know that the
    /// slave produces before it has set the rate, and the slave takes nothing before.
    fn is_ready(&self, slave: MacId, instance: Instance) -> bool {
        match (instance, self.nodes[slave.index()].connections[instance.index()].state) {
            (Instance::Poll, stands) => stands == Stands::Established,
            (_, stands) => stands != Stands::Configuring,
        }
    }

    /// How long an acknowledgement may take, in ns: the slave's own timer, where it was read.
    pub fn acknowledge_limit(&self, slave: MacId) -> i64 {
        let timer = self.nodes[slave.index()].acknowledge_timer;
        timer.map_or(self.settings.io_acknowledge_ns, |ms| i64::from(ms) * 1_000_000)
    }

    /// A master acknowledges a slave's change-of-state or cyclic message.
    pub fn io_acknowledge(&mut self, now: &Now<'_>, slave: MacId, facts: &mut Facts) {
        facts.kind = kind::IO_ACK;
        facts.link = Some(if self.is_cyclic(slave) { Link::Cyclic } else { Link::Cos });
        (facts.source, facts.destination) = (self.owner(slave), Some(slave));
        self.begin_io(slave, Instance::Production, facts);
        let node = &mut self.nodes[slave.index()];
        if node.has(Choice::PRODUCING) && node.has(Choice::NO_ACKNOWLEDGE) {
            self.judgement.find(Finding::new(&codes::UNEXPECTED_ACK));
        }
        if let Some(mark) = self.take_acknowledge(now, slave, Instance::Production) {
            facts.request = Some(mark.n);
            facts.response_time = now.mark.start.since(mark.start);
        }
    }

    /// What was produced last is acknowledged, and so is what came before. Returns what that was,
    /// if it was not acknowledged yet.
    fn take_acknowledge(
        &mut self,
        now: &Now<'_>,
        slave: MacId,
        instance: Instance,
    ) -> Option<Mark> {
        let limit = self.acknowledge_limit(slave);
        let production = self.nodes[slave.index()].last_production(instance).as_mut();
        let production = production.filter(|production| !production.is_acknowledged)?;
        production.is_acknowledged = true;
        let (mark, since) = (production.mark, production.since);
        let gap = now.mark.start.since(since.start).filter(|_| !production.is_told);
        let uncertainty = i64::from(since.uncertainty) + i64::from(now.mark.uncertainty);
        // Whatever is certainly late was told at its deadline.
        if gap.is_some_and(|gap| self.timing.above(gap, limit, uncertainty) != Verdict::Kept) {
            self.judgement.judge(Verdict::Withheld, Finding::new(&codes::IO_UNACKNOWLEDGED));
        }
        Some(mark)
    }

    /// A master strobes its slaves: a bit for each, in eight bytes.
    pub fn strobe_command(&mut self, now: &Now<'_>, master: MacId, facts: &mut Facts) {
        (facts.kind, facts.link) = (kind::STROBE_COMMAND, Some(Link::Strobe));
        // It is no slave's record, but all slaves'.
        facts.source = Some(master);
        facts.blame((now.data.len() != 8).then_some(Defect::Length));
        self.show(now, facts);
        self.strobes[master.index()] = Some(now.mark);
        self.last_strober = Some(master);
        for slave in macs(self.strobed) {
            if self.owner(slave) == Some(master) {
                // It has a bit for each, whatever size the slave says that it consumes.
                self.flow(now, (slave, Instance::Strobe, Direction::Consumed), Piece::First);
            }
        }
    }

    /// Slaves that did not answer the strobe before this one, with its record's number.
    pub fn missing_strobes(&self, master: MacId) -> impl Iterator<Item = (MacId, Mark)> + use<> {
        let strobe = self.strobes[master.index()];
        let missing = strobe.map_or(0, |strobe| {
            let is_missing = |slave: &MacId| {
                let node = &self.nodes[slave.index()];
                let connection = &node.connections[Instance::Strobe.index()];
                let is_his = match node.owner {
                    Some(owner) => owner == master,
                    None => self.last_strober == Some(master),
                };
                // A slave that was just set up may not be in its master's strobe yet.
                let settled = strobe.start.since(connection.since);
                let is_settled = settled.is_some_and(|ns| ns > self.settings.settle_ns);
                let is_due =
                    node.answers_strobes || (connection.state == Stands::Established && is_settled);
                let answered = node.strobe.is_some_and(|answered| answered.mark.n == strobe.n);
                is_his && is_due && connection.is_judged() && !answered
            };
            macs(self.strobed).filter(is_missing).fold(0, |set, slave| set | slave.bit())
        });
        macs(missing).zip(core::iter::repeat(strobe.unwrap_or_default()))
    }

    /// A slave answers a strobe.
    pub fn strobe_response(&mut self, now: &Now<'_>, slave: MacId, facts: &mut Facts) {
        (facts.kind, facts.link) = (kind::STROBE_RESPONSE, Some(Link::Strobe));
        (facts.source, facts.destination) = (Some(slave), self.owner(slave));
        self.begin_io(slave, Instance::Strobe, facts);
        let at = (slave, Instance::Strobe, Direction::Produced);
        let piece = self.piece(now, at, false, facts);
        let master = self.owner(slave).or(self.last_strober);
        let strobe = master.and_then(|master| self.strobes[master.index()]);
        let node = &mut self.nodes[slave.index()];
        if let Some(mark) = strobe {
            let before = node.strobe.filter(|answered| answered.mark.n == mark.n);
            let is_second = before.is_some() && piece.begins() && !now.is_repeating;
            if is_second {
                self.judgement.find(Finding::new(&codes::UNSOLICITED_RESPONSE));
            }
            let is_over = is_second || before.is_some_and(|before| before.is_over);
            node.strobe = Some(Command { mark, bits: 0, answered: Some(now.mark.start), is_over });
            node.answers_strobes = true;
            self.strobed |= slave.bit();
            if !is_over {
                facts.request = Some(mark.n);
                facts.response_time = now.mark.start.since(mark.start);
                facts.turn = Turn::Answers;
            }
            if self.node(slave).connection(Instance::Strobe).state == Stands::TimedOut {
                self.revive(slave, Instance::Strobe, now.mark.start);
                self.node(slave).connection(Instance::Strobe).consumed.last = Some(mark);
            }
        }
        self.flow(now, at, piece);
    }

    /// A master polls a multicast group, if anybody allocated such a connection.
    pub fn multicast_command(&mut self, now: &Now<'_>, _group: MacId, facts: &mut Facts) {
        facts.kind = kind::IO;
        self.show(now, facts);
        if self.multicaster.is_none() {
            return facts.assumed.add(Assumed::ALLOCATION);
        }
        (facts.kind, facts.link) = (kind::MULTICAST_POLL_COMMAND, Some(Link::Multicast));
        facts.source = self.multicaster;
        self.multicast = Some(now.mark);
        // Which group a slave is of, the traffic does not tell: any command keeps it.
        let nodes = &self.nodes;
        let is_member = |mac: &MacId| nodes[mac.index()].has(Choice::MULTICAST);
        let members = macs(u64::MAX).filter(is_member).fold(0, |set, slave| set | slave.bit());
        for slave in macs(members) {
            self.flow(now, (slave, Instance::Multicast, Direction::Consumed), Piece::First);
        }
    }

    /// A slave answers a multicast poll.
    pub fn multicast_response(&mut self, now: &Now<'_>, slave: MacId, facts: &mut Facts) {
        (facts.kind, facts.link) = (kind::MULTICAST_POLL_RESPONSE, Some(Link::Multicast));
        (facts.source, facts.destination) = (Some(slave), self.owner(slave));
        self.begin_io(slave, Instance::Multicast, facts);
        let at = (slave, Instance::Multicast, Direction::Produced);
        let piece = self.piece(now, at, false, facts);
        if let Some(mark) = self.multicast {
            facts.request = Some(mark.n);
            facts.response_time = now.mark.start.since(mark.start);
        }
        if self.node(slave).connection(Instance::Multicast).state == Stands::TimedOut {
            let asked = self.multicast;
            self.revive(slave, Instance::Multicast, now.mark.start);
            self.node(slave).connection(Instance::Multicast).consumed.last = asked;
        }
        self.flow(now, at, piece);
    }

    /// I/O on an identifier whose connection was not seen to be opened.
    pub fn unknown_io(&mut self, now: &Now<'_>, source: MacId, facts: &mut Facts) {
        facts.kind = kind::IO;
        (facts.source, facts.station) = (Some(source), Some(source));
        facts.assumed.add(Assumed::ALLOCATION);
        self.show(now, facts);
    }
}

/// The MAC IDs of a set.
fn macs(mut set: u64) -> impl Iterator<Item = MacId> {
    core::iter::from_fn(move || {
        let mac = MacId::of(set.trailing_zeros() as u8);
        let is_empty = set == 0;
        set &= set.wrapping_sub(1);
        (!is_empty).then_some(mac)
    })
}
