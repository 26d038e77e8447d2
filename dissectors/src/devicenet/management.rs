//! Who is there: duplicate MAC ID check, heartbeat, shutdown, and the offline connection set.
//!
//! DeviceNet specification (CIP Vol. 3), chapters 2 (offline connection set) and 6 (network access).

use super::codes;
use super::connection::{Instance, Mark};
use super::defect::Defect;
use super::explicit::Channel;
use super::identifier::{MacId, Port};
use super::layer::{Facts, kind};
use super::ledger::{Ledger, Now};
use super::message::{self, Service, Target, service};
use super::node::Check;
use crate::event::Moment;
use crate::finding::{Finding, State};

/// Highest shutdown code that is not reserved.
const LAST_SHUTDOWN: u16 = 0x04FF;

impl Ledger {
    /// A request or response of the duplicate MAC ID check.
    pub fn duplicate_check(&mut self, now: &Now<'_>, mac: MacId, facts: &mut Facts) {
        (facts.source, facts.station) = (Some(mac), Some(mac));
        let (first, rest) = match now.data.split_first() {
            Some((first, rest)) => (*first, rest),
            None => (0, now.data),
        };
        let is_response = first & 0x80 != 0;
        facts.kind = if is_response { kind::DUP_MAC_RESPONSE } else { kind::DUP_MAC_REQUEST };
        facts.port = (!now.data.is_empty()).then_some(first & 0x7F);
        facts.identity = message::identity(rest).ok().map(|(_, identity)| identity);
        facts.blame((now.data.len() != 7).then_some(Defect::Length));
        if facts.defect.is_some() {
            return;
        }
        if is_response {
            self.taken_mac(now, mac, facts);
        } else {
            self.check(now, mac, facts);
        }
    }

    /// A node that is on line defends its MAC ID: the one that asked is a second one.
    fn taken_mac(&mut self, now: &Now<'_>, mac: MacId, facts: &Facts) {
        let node = self.node(mac);
        node.identity = node.identity.or(facts.identity);
        node.identified = now.mark.start;
        node.check = None;
        self.judgement.find(Finding::new(&codes::DUPLICATE_MAC));
    }

    fn check(&mut self, now: &Now<'_>, mac: MacId, facts: &Facts) {
        let settings = self.settings;
        let start = now.mark.start;
        let node = &mut self.nodes[mac.index()];
        let is_other = node.identity.zip(facts.identity).is_some_and(|(known, told)| known != told);
        if is_other {
            node.check = None;
            self.judgement.find(Finding::new(&codes::DUPLICATE_MAC));
            return;
        }
        (node.identity, node.identified) = (facts.identity, start);
        let belongs = |check: &Check| {
            start.since(check.last).is_some_and(|ns| ns <= settings.check_spacing_ns)
        };
        if let Some(check) = node.check.as_mut().filter(|check| belongs(check)) {
            // A controller that nobody acknowledges sends the same request over and over; all others
            // wait a second. The stamps may be too poor to tell more.
            let waited = start.since(check.last).unwrap_or_default();
            let is_again = now.is_repeating || waited < settings.check_ns / 10;
            check.last = start;
            check.is_alone |= is_again;
            node.online = if check.is_alone { Moment::UNKNOWN } else { start };
            node.errors_before = self.errors;
            if check.is_restart && !check.is_told && !is_again {
                check.is_told = true;
                self.judgement.find(restart(check.errors));
            }
            return;
        }
        let heard = |when: Moment| start.since(when).is_some_and(|ns| ns <= settings.restart_ns);
        let is_restart = heard(node.heard) || heard(node.online);
        let errors = self.errors - node.errors_before;
        node.errors_before = self.errors;
        let first = now.mark;
        node.check = Some(Check { first, last: start, is_restart, errors, ..Check::default() });
        self.wait(Some(mac), start.plus(settings.check_ns));
    }

    /// One second after its first request nobody has objected: the node is as after power-on.
    /// Returns whether that is news.
    pub fn restarted(&mut self, mac: MacId, first: Mark, now: Moment) -> bool {
        let node = &mut self.nodes[mac.index()];
        let Some(check) = node.check.as_mut().filter(|check| check.first == first) else {
            return false;
        };
        check.is_over = true;
        let is_news = check.is_restart && !check.is_told;
        let errors = check.errors;
        check.is_told = true;
        if !check.is_alone {
            node.online = check.last;
        }
        if is_news {
            self.judgement.find(restart(errors));
        }
        for instance in Instance::ALL {
            self.end_states(mac, instance, now);
        }
        let node = &mut self.nodes[mac.index()];
        if let Some(since) = node.fault.take() {
            self.judgement.end(&codes::DEVICE_FAULT, since, now);
        }
        node.restart();
        self.restarted |= mac.bit();
        self.dynamics.restart(mac);
        self.strobed &= !mac.bit();
        !self.judgement.findings.is_empty()
    }

    /// A heartbeat or shutdown, which nobody asks for. Returns whether it is one.
    pub fn sign_of_life(
        &mut self,
        now: &Now<'_>,
        channel: Channel,
        message: &[u8],
        facts: &mut Facts,
    ) -> bool {
        let Ok((body, sign)) = message::service_byte(message) else { return false };
        let mac = channel.server;
        let is_shutdown = match sign {
            Service { code: service::HEARTBEAT, is_response: true } => false,
            Service { code: service::SHUTDOWN, is_response: true } => true,
            _ => return false,
        };
        facts.kind = if is_shutdown { kind::SHUTDOWN } else { kind::HEARTBEAT };
        (facts.source, facts.station) = (Some(mac), Some(mac));
        (facts.service, facts.xid) = (Some(sign), Some(channel.xid));
        let Ok(body) = <[u8; 6]>::try_from(body) else {
            facts.blame(Some(Defect::Length));
            return true;
        };
        if is_shutdown {
            self.shutdown(body, facts);
        } else {
            self.heartbeat(now, mac, body, facts);
        }
        true
    }

    fn shutdown(&mut self, body: [u8; 6], facts: &mut Facts) {
        let [class_low, class_high, low, high, code_low, code_high] = body;
        let code = u16::from_le_bytes([code_low, code_high]);
        let class = Some(u16::from_le_bytes([class_low, class_high]));
        let instance = Some(u16::from_le_bytes([low, high]));
        facts.target = Target { class, instance, attribute: None };
        facts.blame((code > LAST_SHUTDOWN).then_some(Defect::ReservedValue));
        self.judgement.find(Finding::new(&codes::SHUTDOWN).actual(i64::from(code)));
    }

    fn heartbeat(&mut self, now: &Now<'_>, mac: MacId, body: [u8; 6], facts: &mut Facts) {
        let [low, high, state, flags, ..] = body;
        facts.target.instance = Some(u16::from_le_bytes([low, high]));
        facts.blame((state > 5).then_some(Defect::ReservedValue));
        facts.blame((flags & 0xF0 != 0).then_some(Defect::ReservedBits));
        let node = &mut self.nodes[mac.index()];
        // State 4 or 5, or the flags of a device, user or system fault.
        let is_faulty = matches!(state, 4 | 5) || flags & 0x07 != 0;
        match (is_faulty, node.fault) {
            (true, None) => {
                node.fault = Some(now.mark.start);
                let finding = Finding::new(&codes::DEVICE_FAULT).state(State::Begin);
                self.judgement.find(finding.actual(i64::from(state)));
            }
            (false, Some(since)) => {
                node.fault = None;
                self.judgement.end(&codes::DEVICE_FAULT, since, now.mark.start);
            }
            _ => {}
        }
    }

    /// A tool asks who owns the offline connection set, or is told.
    pub fn ownership(&mut self, now: &Now<'_>, port: Port, facts: &mut Facts) {
        let is_response = port == Port::OwnershipResponse;
        facts.kind = if is_response { kind::OWNERSHIP_RESPONSE } else { kind::OWNERSHIP_REQUEST };
        let [client, service, identity @ ..] = now.data else {
            return facts.blame(Some(Defect::Length));
        };
        facts.service = Some(Service::of(*service));
        facts.identity = message::identity(identity).ok().map(|(_, identity)| identity);
        facts.blame((client & 0xC0 != 0).then_some(Defect::ReservedBits));
        facts.blame((now.data.len() != 8).then_some(Defect::Length));
        let wanted = if is_response { 0xCB } else { 0x4B };
        facts.blame((*service != wanted).then_some(Defect::RefusedService));
        if !is_response {
            (facts.source, facts.station) = (MacId::new(*client), MacId::new(*client));
        }
    }

    /// A tool asks faulted nodes: Who, Identify, or Change MAC ID.
    pub fn comm_fault_request(&mut self, now: &Now<'_>, facts: &mut Facts) {
        facts.kind = kind::COMM_FAULT_REQUEST;
        let [header, asked, rest @ ..] = now.data else {
            return facts.blame(Some(Defect::Length));
        };
        facts.service = Some(Service::of(*asked));
        facts.blame((header & 0x80 != 0).then_some(Defect::ReservedBits));
        match (asked, now.data.len()) {
            // Who: the answer is delayed by a byte of it, 0 to 6.
            (0x4B, 3) => facts.blame((rest[0] > 6).then_some(Defect::ReservedValue)),
            (0x4C, 2) => {}
            (0x4C | 0x4D, 8) => {
                facts.identity = message::identity(rest).ok().map(|(_, identity)| identity);
            }
            (0x4B..=0x4D, _) => facts.blame(Some(Defect::Length)),
            _ => facts.blame(Some(Defect::RefusedService)),
        }
    }

    /// A faulted node answers Who with its identity, or Identify.
    pub fn comm_fault_response(&mut self, now: &Now<'_>, facts: &mut Facts) {
        facts.kind = kind::COMM_FAULT_RESPONSE;
        match now.data {
            [port, identity @ ..] if now.data.len() == 7 => {
                facts.port = Some(port & 0x7F);
                facts.identity = message::identity(identity).ok().map(|(_, identity)| identity);
                facts.blame((port & 0x80 != 0).then_some(Defect::ReservedBits));
            }
            [_, answered @ 0xCC] => facts.service = Some(Service::of(*answered)),
            [_, answered] => {
                facts.service = Some(Service::of(*answered));
                facts.blame(Some(Defect::RefusedService));
            }
            _ => facts.blame(Some(Defect::Length)),
        }
    }
}

/// A node started anew, after so many error frames: then it may have been bus-off.
fn restart(errors: u64) -> Finding {
    let finding = Finding::new(&codes::NODE_RESTART);
    if errors > 0 { finding.actual(errors.cast_signed()) } else { finding }
}
