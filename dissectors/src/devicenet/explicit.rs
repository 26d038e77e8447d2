//! Explicit messages: from frames to requests and answers.

use super::codes;
use super::connection::{Instance, State as Stands};
use super::defect::Defect;
use super::dynamic::Dynamic;
use super::fragment::{Acknowledged, Key, Step};
use super::identifier::{MacId, Port};
use super::layer::{Assumed, Bytes, Facts, Link, kind};
use super::ledger::{Ledger, Now, kind_of};
use super::message::{self, BodyFormat, Fragment, Header, Part};
use super::transactions::{Party, Request};
use crate::finding::Finding;

/// Between whom a message travels, and how.
#[derive(Clone, Copy, Debug)]
pub(super) struct Channel {
    pub link: Link,
    pub client: MacId,
    pub server: MacId,
    /// The server sends.
    pub from_server: bool,
    pub asks_on: u16,
    pub answers_on: u16,
    /// The body format, where the connection has one of its own.
    pub format: Option<BodyFormat>,
    pub xid: bool,
}

impl Channel {
    /// The channel of a message on a predefined port. Its header names the end that the
    /// identifier does not.
    fn on(port: Port, id: u16, header: Header) -> Option<Self> {
        let (link, near, from_server) = match port {
            Port::ExplicitRequest(server) => (Link::Explicit, server, false),
            Port::UnconnectedRequest(server) => (Link::Unconnected, server, false),
            Port::ExplicitResponse(server) => (Link::Explicit, server, true),
            Port::UcmmRequest(client) => (Link::Ucmm, client, false),
            Port::UcmmResponse(server) => (Link::Ucmm, server, true),
            _ => return None,
        };
        let is_client = matches!(port, Port::UcmmRequest(_));
        let (client, server) = if is_client { (near, header.mac) } else { (header.mac, near) };
        let [from, to] = [client, server].map(|mac| u16::from(mac.get()));
        let (asks_on, answers_on) = match link {
            Link::Ucmm => (0x780 | from, 0x740 | to),
            Link::Unconnected => (id, 0x403 | to << 3),
            _ => (0x404 | to << 3, 0x403 | to << 3),
        };
        let xid = header.xid;
        Some(Channel { link, client, server, from_server, asks_on, answers_on, format: None, xid })
    }

    /// The channel of a connection that was opened.
    const fn of(dynamic: Dynamic, from_server: bool, xid: bool) -> Self {
        Channel {
            link: Link::Explicit,
            client: dynamic.client,
            server: dynamic.server,
            from_server,
            asks_on: dynamic.asks_on,
            answers_on: dynamic.answers_on,
            format: Some(dynamic.format),
            xid,
        }
    }

    pub const fn party(&self) -> Party {
        Party { answers_on: self.answers_on, client: self.client, xid: self.xid }
    }

    /// The assembly of the messages of one direction.
    pub const fn key(&self, from_server: bool) -> Key {
        let header = (self.xid as u8) << 6 | self.client.get();
        Key::explicit(if from_server { self.answers_on } else { self.asks_on }, header)
    }

    const fn kind(&self, is_response: bool) -> &'static str {
        match (self.link, is_response) {
            (Link::Ucmm, false) => kind::UCMM_REQUEST,
            (Link::Ucmm, true) => kind::UCMM_RESPONSE,
            (Link::Unconnected, false) => kind::UNCONNECTED_REQUEST,
            (Link::Unconnected, true) => kind::UNCONNECTED_RESPONSE,
            (_, false) => kind::EXPLICIT_REQUEST,
            (_, true) => kind::EXPLICIT_RESPONSE,
        }
    }
}

/// A service and its body, and where they stand.
#[derive(Clone, Copy, Debug)]
pub(super) struct Text<'a> {
    pub bytes: &'a [u8],
    /// Where they are: for records to show.
    pub at: Bytes,
    /// They are all there is; otherwise they are only the first fragment.
    pub is_whole: bool,
}

impl Text<'_> {
    /// Where the last so many bytes stand.
    pub const fn tail(&self, length: usize) -> Bytes {
        let start = self.at.start + self.bytes.len().saturating_sub(length);
        Bytes { assembly: self.at.assembly, start }
    }
}

impl Ledger {
    /// A message on one of the predefined ports.
    pub fn explicit(&mut self, now: &Now<'_>, port: Port, facts: &mut Facts) {
        facts.kind = kind_of(port);
        let header = message::header(now.data).ok();
        let channel = header.and_then(|(_, header)| Channel::on(port, now.id, header));
        let (Some((rest, header)), Some(channel)) = (header, channel) else {
            facts.blame(Some(Defect::NoHeader));
            facts.source = port.sender();
            match port {
                Port::ExplicitRequest(server) | Port::UnconnectedRequest(server) => {
                    (facts.station, facts.destination) = (Some(server), Some(server));
                }
                // Whom it asks stands in the header.
                Port::UcmmRequest(_) => {}
                _ => facts.station = facts.source,
            }
            return;
        };
        let is_own = header.mac == channel.server && channel.from_server && !header.is_fragment;
        if is_own && self.sign_of_life(now, channel, rest, facts) {
            return;
        }
        self.message(now, channel, header, rest, facts);
    }

    /// A message on a connection that was opened.
    pub fn dynamic(
        &mut self,
        now: &Now<'_>,
        dynamic: Dynamic,
        from_server: bool,
        facts: &mut Facts,
    ) {
        let is_asked =
            |it: Option<Header>| Channel::of(dynamic, from_server, it.is_some_and(|it| it.xid));
        let Ok((rest, header)) = message::header(now.data) else {
            facts.kind = is_asked(None).kind(from_server);
            return facts.blame(Some(Defect::NoHeader));
        };
        let channel = is_asked(Some(header));
        let other = if from_server { dynamic.client } else { dynamic.server };
        if header.mac != other {
            facts.blame(Some(Defect::WrongEnd));
        }
        self.message(now, channel, header, rest, facts);
    }

    fn message(
        &mut self,
        now: &Now<'_>,
        channel: Channel,
        header: Header,
        rest: &[u8],
        facts: &mut Facts,
    ) {
        let Channel { client, server, from_server, .. } = channel;
        let (source, destination) = if from_server { (server, client) } else { (client, server) };
        (facts.source, facts.destination) = (Some(source), Some(destination));
        (facts.station, facts.link) = (Some(server), Some(channel.link));
        (facts.xid, facts.kind) = (Some(header.xid), channel.kind(from_server));
        if channel.format.is_none() && channel.link == Link::Explicit {
            self.keep_alive(now, server, from_server);
        }
        if header.is_fragment {
            return self.fragment(now, channel, rest, facts);
        }
        self.abandon(channel);
        let at = Bytes { assembly: None, start: now.data.len() - rest.len() };
        let text = Text { bytes: rest, at, is_whole: true };
        if from_server {
            self.response(now, channel, text, facts);
        } else {
            self.request(now, channel, text, facts);
        }
    }

    /// The explicit connection of the predefined set is used: it goes by itself when nothing comes
    /// for four times its rate.
    fn keep_alive(&mut self, now: &Now<'_>, server: MacId, from_server: bool) {
        let connection = self.nodes[server.index()].connection(Instance::Explicit);
        connection.consumed.last = Some(now.mark);
        if connection.state == Stands::Established {
            self.wait_for(server, Instance::Explicit);
        } else if !from_server {
            self.tell_unallocated(server, Instance::Explicit);
        }
    }

    /// I/O or requests on a connection that was released, timed out or went with a restart.
    pub fn tell_unallocated(&mut self, slave: MacId, instance: Instance) {
        let connection = self.nodes[slave.index()].connection(instance);
        if connection.is_judged() {
            return;
        }
        // Of a connection that was released, no rate is known any more.
        let mut finding = Finding::new(&codes::NOT_ALLOCATED);
        finding.limit = connection.limit();
        self.judgement.find(finding);
    }

    /// A message that is no fragment ends what was being put together for its direction.
    fn abandon(&mut self, channel: Channel) {
        let own = self.assemblies.find(channel.key(channel.from_server));
        if let Some(assembly) = own.and_then(|place| self.assemblies.get_mut(place)) {
            let unfinished = assembly.unfinished();
            assembly.reset();
            if let Some(expected) = unfinished {
                let finding = Finding::new(&codes::FRAGMENT_SEQUENCE).expected(i64::from(expected));
                self.judgement.find(finding);
                self.give_up(channel);
            }
        }
        if channel.from_server {
            self.settle(channel);
        }
    }

    /// The server answers: it has the request, whether its acknowledgements were seen or not.
    fn settle(&mut self, channel: Channel) {
        let asked = self.assemblies.find(channel.key(false));
        if let Some(assembly) = asked.and_then(|place| self.assemblies.get_mut(place)) {
            assembly.reset();
        }
    }

    fn fragment(&mut self, now: &Now<'_>, channel: Channel, rest: &[u8], facts: &mut Facts) {
        let Ok((data, fragment)) = message::fragment(rest) else {
            return facts.blame(Some(Defect::NoFragmentByte));
        };
        facts.fragment = Some(fragment);
        if channel.link != Link::Explicit {
            return facts.blame(Some(Defect::Fragmented));
        }
        if fragment.part == Part::Acknowledge {
            return self.acknowledge(now, channel, (fragment, data), facts);
        }
        let was_heard = self.node(channel.server).knows_client(channel.client, channel.xid);
        if channel.from_server && fragment.part == Part::First {
            self.settle(channel);
        }
        let place = self.assemblies.of(channel.key(channel.from_server));
        let Some(assembly) = self.assemblies.get_mut(place) else { return };
        assembly.server = Some(channel.server);
        let step = assembly.take((fragment, data), now.mark.n, was_heard, true);
        let sequence = Finding::new(&codes::FRAGMENT_SEQUENCE).actual(i64::from(fragment.byte()));
        match step {
            Step::Begins => {}
            Step::BeginsAnew { expected } => {
                self.judgement.find(sequence.expected(i64::from(expected)));
                self.give_up(channel);
            }
            Step::Continues => facts.request = assembly.request,
            Step::Completes => facts.request = assembly.request,
            Step::Repeats => {
                facts.request = assembly.request;
                let again = assembly.awaiting.map_or(1, |awaiting| awaiting.sendings);
                let finding = Finding::new(&codes::FRAGMENT_RETRY).actual(i64::from(again) + 1);
                self.judgement.find(finding);
            }
            Step::OutOfSequence { expected } => {
                assembly.give_up();
                self.judgement.find(sequence.expected(i64::from(expected)));
                return self.give_up(channel);
            }
            Step::Ignored => return,
            Step::Unseen => {
                facts.assumed.add(Assumed::START);
                return self.unseen(channel, fragment);
            }
            Step::TooLong => {
                assembly.give_up();
                self.give_up(channel);
                return facts.blame(Some(Defect::TooLong));
            }
        }
        self.await_acknowledge(now, place, fragment);
        if step == Step::Begins || matches!(step, Step::BeginsAnew { .. }) {
            let start = now.data.len() - data.len();
            let at = Bytes { assembly: None, start };
            let text = Text { bytes: data, at, is_whole: false };
            self.first_fragment(now, channel, text, place, facts);
        } else if step == Step::Completes {
            self.last_fragment(now, channel, place, facts);
        }
    }

    /// A message is broken: if it is a request, no answer is waited for.
    fn give_up(&mut self, channel: Channel) {
        if !channel.from_server {
            self.node(channel.server).transactions.give_up(channel.party());
        }
    }

    fn await_acknowledge(&mut self, now: &Now<'_>, place: usize, fragment: Fragment) {
        let Some(assembly) = self.assemblies.get_mut(place) else { return };
        let at = (now.mark.start, now.mark.uncertainty);
        assembly.await_acknowledge(fragment, now.mark.n, at);
        let patience = self.settings.fragment_acknowledge_ns;
        self.wait(None, now.mark.start.plus(patience));
    }

    /// The last fragment of a request whose beginning was not seen: its answer is no surprise.
    fn unseen(&mut self, channel: Channel, fragment: Fragment) {
        self.node(channel.server).hear_client(channel.client, channel.xid);
        if fragment.part != Part::Last {
            return;
        }
        let place = self.assemblies.of(channel.key(channel.from_server));
        if let Some(assembly) = self.assemblies.get_mut(place).filter(|it| it.is_unseen()) {
            assembly.reset();
        }
        if !channel.from_server {
            let request = Request::new(channel.party(), channel.link, None);
            self.node(channel.server).transactions.open(request);
        }
    }

    fn first_fragment(
        &mut self,
        now: &Now<'_>,
        channel: Channel,
        text: Text<'_>,
        place: usize,
        facts: &mut Facts,
    ) {
        if channel.from_server {
            self.response(now, channel, text, facts);
        } else {
            self.request(now, channel, text, facts);
        }
        if let Some(assembly) = self.assemblies.get_mut(place) {
            assembly.request = facts.request;
        }
    }

    fn last_fragment(&mut self, now: &Now<'_>, channel: Channel, place: usize, facts: &mut Facts) {
        let Some(assembly) = self.assemblies.get_mut(place) else { return };
        let bytes = assembly.lend();
        let at = Bytes { assembly: Some(place), start: 0 };
        let text = Text { bytes: &bytes, at, is_whole: true };
        facts.completes = Some(place);
        if channel.from_server {
            self.response(now, channel, text, facts);
        } else {
            self.request(now, channel, text, facts);
        }
        if let Some(assembly) = self.assemblies.get_mut(place) {
            assembly.take_back(bytes);
        }
    }

    fn acknowledge(
        &mut self,
        now: &Now<'_>,
        channel: Channel,
        (fragment, data): (Fragment, &[u8]),
        facts: &mut Facts,
    ) {
        // An acknowledgement has the kind of what it acknowledges.
        facts.kind = channel.kind(!channel.from_server);
        match *data {
            [status] => {
                facts.status = Some(status);
                facts.blame((status > 1).then_some(Defect::ReservedValue));
            }
            _ => facts.blame(Some(Defect::Acknowledgement)),
        }
        let Some(place) = self.assemblies.find(channel.key(!channel.from_server)) else { return };
        let Some(assembly) = self.assemblies.get_mut(place) else { return };
        if facts.status == Some(1) {
            assembly.give_up();
            self.judgement.find(Finding::new(&codes::FRAGMENT_REJECTED));
            if channel.from_server {
                self.node(channel.server).transactions.give_up(channel.party());
            }
            return;
        }
        match assembly.acknowledge(fragment.count) {
            Acknowledged::Fragment { is_last: true } if channel.from_server => {
                self.taken(now, channel);
            }
            Acknowledged::Fragment { .. } | Acknowledged::Nothing => {}
            Acknowledged::Other { expected } => {
                let finding = Finding::new(&codes::FRAGMENT_SEQUENCE).expected(i64::from(expected));
                self.judgement.find(finding.actual(i64::from(fragment.count)));
            }
        }
    }

    /// The server has the whole request: from now on its answer is waited for.
    fn taken(&mut self, now: &Now<'_>, channel: Channel) {
        let limit = self.settings.no_response_ns;
        let transactions = &mut self.node(channel.server).transactions;
        let Some(request) = transactions.last(channel.party()) else { return };
        if request.service.is_some() {
            (request.since, request.uncertainty) = (now.mark.start, now.mark.uncertainty);
            self.wait(Some(channel.server), now.mark.start.plus(limit));
        }
    }
}
