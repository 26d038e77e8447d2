//! Answers: which request they answer, when, and how.

use super::allocation;
use super::codes;
use super::connection::{Instance, State as Stands};
use super::defect::Defect;
use super::dynamic::Dynamic;
use super::explicit::{Channel, Text};
use super::identifier::MacId;
use super::layer::{Assumed, Facts, Link, kind};
use super::learn::judge_answer;
use super::ledger::{Ledger, Now};
use super::message::{self, BodyFormat, service};
use super::node::Silence;
use super::request::DEVICENET;
use super::timing::Verdict;
use super::transactions::Request;
use crate::finding::Finding;
use crate::record::Turn;

/// General status of what is in the requested state already (CIP Vol. 1, appendix B).
const ALREADY: u8 = 0x0B;

impl Ledger {
    /// An answer, or the first fragment of one.
    pub fn response(&mut self, now: &Now<'_>, channel: Channel, text: Text<'_>, facts: &mut Facts) {
        let Ok((body, answered)) = message::service_byte(text.bytes) else {
            return facts.blame(Some(Defect::NoService));
        };
        facts.service = Some(answered);
        if !answered.is_response {
            return facts.blame(Some(Defect::RequestOnResponsePort));
        }
        facts.blame(answered.is_reserved().then_some(Defect::ReservedService));
        let is_first = self.node(channel.server).hear_client(channel.client, channel.xid);
        let node = &mut self.nodes[channel.server.index()];
        let request = node.transactions.answered(channel.party(), answered.code).copied();
        match request {
            Some(request) => self.pair(now, channel, (request, text.is_whole), facts),
            None if is_first => facts.assumed.add(Assumed::START),
            None if text.at.assembly.is_none() => {
                self.judgement.find(Finding::new(&codes::UNSOLICITED_RESPONSE));
            }
            // Told on the first fragment.
            None => {}
        }
        if !text.is_whole {
            return;
        }
        facts.data = (!body.is_empty()).then_some(text.tail(body.len()));
        let request = request.filter(|request| request.service.is_some());
        if answered.code == service::ERROR {
            self.refused(channel.server, request, body, facts);
        } else if let Some(request) = request {
            self.done(now, channel, (request, body), facts);
        }
    }

    fn pair(
        &mut self,
        now: &Now<'_>,
        channel: Channel,
        (request, is_whole): (Request, bool),
        facts: &mut Facts,
    ) {
        if request.link == Link::Unconnected {
            (facts.kind, facts.link) = (kind::UNCONNECTED_RESPONSE, Some(Link::Unconnected));
        }
        facts.request = request.mark.map(|mark| mark.n);
        if request.mark.is_none() {
            facts.assumed.add(Assumed::START);
        }
        if request.answered.is_none() {
            self.judge_time(now, &request);
            self.heard_from(now, channel);
        }
        let node = &mut self.nodes[channel.server.index()];
        if !is_whole {
            if let Some(waiting) = node
                .transactions
                .answered(channel.party(), request.service.unwrap_or(service::ERROR))
            {
                waiting.answered = Some(now.mark.start);
            }
            return;
        }
        node.transactions.close(&request);
        facts.target = request.target;
        facts.turn = Turn::Answers;
        let answered = request.answered.unwrap_or(now.mark.start);
        facts.response_time = request.mark.and_then(|mark| answered.since(mark.start));
    }

    fn judge_time(&mut self, now: &Now<'_>, request: &Request) {
        let Some(ns) = now.mark.start.since(request.since) else { return };
        let limit = self.settings.late_response_ns;
        let uncertainty = i64::from(request.uncertainty) + i64::from(now.mark.uncertainty);
        let verdict = self.timing.above(ns, limit, uncertainty);
        let finding = Finding::new(&codes::LATE_RESPONSE).actual(ns).limit(limit);
        self.judgement.judge(verdict, finding);
        let limit = self.settings.no_response_ns;
        if self.timing.above(ns, limit, uncertainty) == Verdict::Withheld {
            self.judgement.judge(Verdict::Withheld, Finding::new(&codes::NO_RESPONSE));
        }
    }

    /// The server answers again.
    fn heard_from(&mut self, now: &Now<'_>, channel: Channel) {
        let node = &mut self.nodes[channel.server.index()];
        let silence = core::mem::take(&mut node.silence);
        if let Silence { since: Some(since), .. } = silence {
            self.judgement.end(&codes::NO_RESPONSE, since, now.mark.start);
        }
        let connection = node.connection(Instance::Explicit);
        if channel.link == Link::Explicit && connection.state == Stands::Gone {
            (connection.state, connection.rate) = (Stands::Unknown, None);
        }
    }

    fn refused(&mut self, server: MacId, request: Option<Request>, body: &[u8], facts: &mut Facts) {
        match *body {
            [general, additional] => facts.error = Some((general, additional)),
            [general, additional, ..] => {
                facts.error = Some((general, additional));
                facts.blame(Some(Defect::Excess));
            }
            _ => facts.blame(Some(Defect::Missing)),
        }
        let allocate = request.filter(|request| {
            request.service == Some(service::ALLOCATE)
                && request.target.is(DEVICENET.0, DEVICENET.1)
        });
        let general = facts.error.map_or(0, |(general, _)| general);
        if let (Some(request), ALREADY) = (allocate, general)
            && let Ok((_, asked)) = allocation::allocate(request.data())
        {
            // It granted that before, and the answer did not come through.
            self.node(server).doubt(asked.choice);
        }
        let is_allocate = allocate.is_some();
        let code = if is_allocate { &codes::ALLOCATION_REFUSED } else { &codes::ERROR_RESPONSE };
        let general = i64::from(general);
        self.judgement.find(Finding::new(code).actual(general));
    }

    /// What was asked was done.
    fn done(
        &mut self,
        now: &Now<'_>,
        channel: Channel,
        (request, body): (Request, &[u8]),
        facts: &mut Facts,
    ) {
        let is_allocation = request.target.is(DEVICENET.0, DEVICENET.1);
        match (request.link, request.service) {
            (Link::Ucmm, Some(service::ALLOCATE)) => self.opened(channel, &request, body, facts),
            (Link::Ucmm, Some(service::RELEASE)) => {
                facts.blame((!body.is_empty()).then_some(Defect::Excess));
                if let [low, high] = *request.data() {
                    self.dynamics.close(channel.server, u16::from_le_bytes([low, high]));
                }
            }
            (_, Some(service::ALLOCATE)) if is_allocation => {
                self.allocated(now, channel, (&request, body), facts);
            }
            (_, Some(service::RELEASE)) if is_allocation => {
                facts.blame((!body.is_empty()).then_some(Defect::Excess));
                if let Ok((_, released)) = allocation::release(request.data()) {
                    self.release(now, channel.server, released.choice);
                }
            }
            (_, code) => {
                facts.written = (code == Some(service::SET)).then_some(request.data);
                facts.blame(judge_answer(&request, body));
                self.learn(now, channel.server, (&request, body));
            }
        }
    }

    fn opened(&mut self, channel: Channel, request: &Request, body: &[u8], facts: &mut Facts) {
        let Ok((rest, opened)) = allocation::opened(body) else {
            return facts.blame(Some(Defect::Missing));
        };
        facts.blame((!rest.is_empty()).then_some(Defect::Excess));
        facts.body_format = Some(opened.format & 0x0F);
        let Ok((_, open)) = allocation::open(request.data()) else { return };
        facts.blame(opened.defect(open));
        let (client, server) = (channel.client, channel.server);
        let identifiers = opened.identifiers(open, client, server);
        let format = BodyFormat::of(opened.format & 0x0F);
        if let (Some((asks_on, answers_on)), Some(format)) = (identifiers, format) {
            let instance = opened.instance;
            let it = Dynamic { instance, client, server, asks_on, answers_on, format };
            self.dynamics.open(it);
        }
    }
}
