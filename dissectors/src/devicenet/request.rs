//! Requests: what is asked, and whether it may be asked there.

use super::allocation::{self, Allocation};
use super::codes;
use super::connection::Mark;
use super::defect::Defect;
use super::explicit::{Channel, Text};
use super::layer::{Assumed, Facts, Link};
use super::ledger::{Ledger, Now};
use super::message::{self, BodyFormat, Service, service};
use super::transactions::Request;
use crate::finding::Finding;
use crate::record::Turn;

/// Class and instance that Allocate and Release go to: the DeviceNet object.
pub(super) const DEVICENET: (u16, u16) = (3, 1);

impl Ledger {
    /// A request, or the first fragment of one.
    pub fn request(&mut self, now: &Now<'_>, channel: Channel, text: Text<'_>, facts: &mut Facts) {
        self.node(channel.server).hear_client(channel.client, channel.xid);
        let Ok((body, asked)) = message::service_byte(text.bytes) else {
            return facts.blame(Some(Defect::NoService));
        };
        facts.service = Some(asked);
        if asked.is_response {
            return facts.blame(Some(Defect::ResponseOnRequestPort));
        }
        facts.blame(asked.is_reserved().then_some(Defect::ReservedService));
        let data = match channel.link {
            Link::Ucmm => self.ask_ucmm(asked, body, facts),
            _ => self.ask(channel, asked, (body, text.is_whole), facts),
        };
        if text.is_whole {
            facts.data = (!data.is_empty()).then_some(text.tail(data.len()));
        }
        self.remember(now, channel, (text, data), facts);
    }

    /// What a request on a connection, or on the Group 2 only port, is about. Returns its data.
    fn ask<'a>(
        &mut self,
        channel: Channel,
        asked: Service,
        (body, is_whole): (&'a [u8], bool),
        facts: &mut Facts,
    ) -> &'a [u8] {
        let (format, is_assumed) = self.format(channel, asked.code, body, is_whole);
        if is_assumed {
            facts.assumed.add(Assumed::BODY_FORMAT);
        }
        let Ok((data, target)) = message::target(asked.code, format)(body) else {
            let is_certain = !is_assumed || format == BodyFormat::Byte8Instance8;
            facts.blame((is_whole && is_certain).then_some(Defect::Missing));
            return &[];
        };
        facts.target = target;
        let is_allocation = matches!(asked.code, service::ALLOCATE | service::RELEASE)
            && target.is(DEVICENET.0, DEVICENET.1);
        if channel.link == Link::Unconnected && !is_allocation {
            facts.blame(Some(Defect::RefusedService));
        }
        if is_whole && is_allocation {
            self.ask_allocation(channel, asked.code, data, facts);
        } else if is_whole && !is_assumed {
            facts.blame(message::judge_data(asked.code, data));
        }
        data
    }

    /// The body format of a request, and whether it is only assumed.
    fn format(
        &mut self,
        channel: Channel,
        code: u8,
        body: &[u8],
        is_whole: bool,
    ) -> (BodyFormat, bool) {
        let node = self.node(channel.server);
        let agreed = match channel.link {
            Link::Unconnected => Some(BodyFormat::Byte8Instance8),
            _ => channel.format.or(node.format),
        };
        if let Some(format) = agreed {
            return (format, false);
        }
        if is_whole && code == service::GET {
            node.guess = BodyFormat::guess(body).or(node.guess);
        }
        (node.guess.unwrap_or(BodyFormat::Byte8Instance8), true)
    }

    fn ask_allocation(&mut self, channel: Channel, code: u8, data: &[u8], facts: &mut Facts) {
        let parsed = match code {
            service::ALLOCATE => allocation::allocate(data),
            _ => allocation::release(data),
        };
        let Ok((rest, asked)) = parsed else {
            return facts.blame(Some(Defect::Missing));
        };
        facts.allocation = Some(asked);
        facts.blame((!rest.is_empty()).then_some(Defect::Excess));
        let Allocation { choice, allocator } = asked;
        facts.blame(allocator.is_some_and(|mac| mac > 63).then_some(Defect::ReservedBits));
        let is_invalid = match allocator {
            Some(mac) => choice.is_invalid() || mac != channel.client.get(),
            None => choice.is_invalid_release(),
        };
        if is_invalid {
            let finding = Finding::new(&codes::ALLOCATION_INVALID);
            self.judgement.find(finding.actual(i64::from(choice.byte())));
        }
    }

    /// A request on the unconnected port of a node with a UCMM: Open or Close, nothing else.
    fn ask_ucmm<'a>(&mut self, asked: Service, body: &'a [u8], facts: &mut Facts) -> &'a [u8] {
        match (asked.code, body.len()) {
            (service::ALLOCATE | service::RELEASE, 0 | 1) => facts.blame(Some(Defect::Missing)),
            (service::ALLOCATE | service::RELEASE, 3..) => facts.blame(Some(Defect::Excess)),
            (service::ALLOCATE, _) => {
                facts.blame(allocation::open(body).ok().and_then(|(_, open)| open.defect()));
            }
            (service::RELEASE, _) => {}
            _ => facts.blame(Some(Defect::RefusedService)),
        }
        body
    }

    /// The request now waits for its answer.
    fn remember(
        &mut self,
        now: &Now<'_>,
        channel: Channel,
        (text, data): (Text<'_>, &[u8]),
        facts: &mut Facts,
    ) {
        let limit = self.settings.no_response_ns;
        let first = text.at.assembly.and_then(|place| {
            self.assemblies.get(place).and_then(|assembly| assembly.numbers().first().copied())
        });
        let Mark { start, uncertainty, .. } = now.mark;
        let transactions = &mut self.nodes[channel.server.index()].transactions;
        if let Some(request) = first.and_then(|first| transactions.by_number(first)) {
            // The rest of a message whose beginning waits already.
            request.target = facts.target;
            return request.keep(data);
        }
        facts.turn = Turn::Asks;
        if channel.link != Link::Ucmm && transactions.is_busy(channel.party()) {
            self.judgement.find(Finding::new(&codes::XID_BUSY));
        }
        let mut request = Request::new(channel.party(), channel.link, Some(now.mark));
        (request.service, request.target) = (facts.service.map(|asked| asked.code), facts.target);
        request.keep(data);
        if text.is_whole && text.at.assembly.is_none() {
            (request.since, request.uncertainty) = (start, uncertainty);
        }
        transactions.open(request);
        self.wait(Some(channel.server), start.plus(limit));
    }
}
