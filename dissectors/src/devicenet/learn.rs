//! What answers tell about connections: allocated, released, read and written.

use super::allocation::{self, Choice};
use super::cip::service::GET_ATTRIBUTES_ALL;
use super::cip::{DeviceIdentity, Path, class};
use super::codes;
use super::connection::{CONNECTIONS, Connection, Direction, Habit, Instance, State as Stands};
use super::defect::Defect;
use super::explicit::Channel;
use super::identifier::MacId;
use super::layer::Facts;
use super::ledger::{Ledger, Now};
use super::message::{BodyFormat, service};
use super::transactions::Request;
use crate::event::Moment;
use core::cmp::Ordering;

/// The connection object (CIP Vol. 1, chapter 3).
const CONNECTION: u16 = 5;

/// The acknowledge handler (CIP Vol. 1, chapter 5).
const ACKNOWLEDGE_HANDLER: u16 = 0x2B;

/// Attributes of the connection object.
mod attribute {
    pub const TRANSPORT: u16 = 3;
    pub const PRODUCED_SIZE: u16 = 7;
    pub const CONSUMED_SIZE: u16 = 8;
    pub const RATE: u16 = 9;
    pub const WATCHDOG: u16 = 12;
    pub const PRODUCED_PATH: u16 = 14;
    pub const CONSUMED_PATH: u16 = 16;
    pub const INHIBIT: u16 = 17;
    pub const MULTIPLIER: u16 = 18;
}

/// The choices by the instance that they allocate.
const CHOICES: [Choice; CONNECTIONS] =
    [Choice::EXPLICIT, Choice::POLL, Choice::STROBE, Choice::PRODUCING, Choice::MULTICAST];

/// What is wrong with the length of an answer about a connection, where its attribute has a fixed
/// one (CIP Vol. 1, chapter 3, connection object: attributes).
pub(super) fn judge_answer(request: &Request, body: &[u8]) -> Option<Defect> {
    let target = request.target;
    let is_instance = target.class == Some(CONNECTION) && target.instance != Some(0);
    let attribute = target.attribute.filter(|_| is_instance)?;
    let length = match (request.service, attribute) {
        // Who sets the rate is told what it is; older slaves tell nothing.
        (Some(service::SET), attribute::RATE) if body.is_empty() => 0,
        (Some(service::SET), attribute::RATE) => 2,
        (Some(service::GET), 1..=3 | 6 | attribute::WATCHDOG | attribute::MULTIPLIER) => 1,
        (Some(service::GET), 4 | 5 | 7..=9 | 13 | 15 | attribute::INHIBIT) => 2,
        _ => return None,
    };
    match body.len().cmp(&length) {
        Ordering::Less => Some(Defect::Missing),
        Ordering::Equal => None,
        Ordering::Greater => Some(Defect::Excess),
    }
}

fn assembly(path: &[u8]) -> Option<u16> {
    Path::parse(path).and_then(Path::assembly)
}

impl Ledger {
    /// A slave accepted an allocation.
    pub fn allocated(
        &mut self,
        now: &Now<'_>,
        channel: Channel,
        (request, body): (&Request, &[u8]),
        facts: &mut Facts,
    ) {
        let format = match *body {
            [format] => format,
            [format, ..] => {
                facts.blame(Some(Defect::Excess));
                format
            }
            [] => return facts.blame(Some(Defect::Missing)),
        };
        facts.body_format = Some(format & 0x0F);
        facts.blame((format & 0xF0 != 0).then_some(Defect::ReservedBits));
        let agreed = BodyFormat::of(format & 0x0F);
        facts.blame(agreed.is_none().then_some(Defect::ReservedFormat));
        let Ok((_, asked)) = allocation::allocate(request.data()) else { return };
        let slave = channel.server;
        self.node(slave).see(asked.choice, true);
        for (instance, choice) in Instance::ALL.into_iter().zip(CHOICES) {
            // What a master sends by change of state or cyclically travels on the poll connection.
            let is_poll = instance == Instance::Poll && !self.node(slave).has(Choice::POLL);
            if asked.choice.has(choice) || is_poll && asked.choice.has(Choice::PRODUCING) {
                self.end_states(slave, instance, now.mark.start);
                let is_explicit = instance == Instance::Explicit;
                let state = if is_explicit { Stands::Established } else { Stands::Configuring };
                self.node(slave).connection(instance).allocate(state, now.mark.start);
            }
        }
        let node = &mut self.nodes[slave.index()];
        node.format = agreed;
        node.owner = Some(channel.client);
        node.choice = node.choice.and(asked.choice);
        if asked.choice.has(Choice::PRODUCING) {
            let other = if asked.choice.has(Choice::COS) { Choice::CYCLIC } else { Choice::COS };
            let kept = node.choice.without(other.and(Choice::NO_ACKNOWLEDGE));
            node.choice = kept.and(asked.choice);
            (node.production, node.master_production) = (None, None);
        }
        if asked.choice.has(Choice::POLL) || !node.is_polled() {
            (node.poll, node.answers_polls) = (None, false);
        }
        if asked.choice.has(Choice::STROBE) {
            (node.strobe, node.answers_strobes) = (None, false);
            self.strobed |= slave.bit();
        }
        if asked.choice.has(Choice::MULTICAST) {
            self.multicaster = Some(channel.client);
        }
    }

    /// A slave gave connections back.
    pub fn release(&mut self, now: &Now<'_>, slave: MacId, released: Choice) {
        for (instance, choice) in Instance::ALL.into_iter().zip(CHOICES) {
            if released.has(choice) {
                self.end_states(slave, instance, now.mark.start);
                let gone = Connection { state: Stands::Gone, ..Connection::default() };
                *self.node(slave).connection(instance) = gone;
            }
        }
        let node = &mut self.nodes[slave.index()];
        node.see(released, false);
        let left = node.choice.without(released);
        node.choice = left;
        if released.has(Choice::EXPLICIT) {
            (node.format, node.guess) = (None, None);
        }
        if left.without(Choice::NO_ACKNOWLEDGE) == Choice::default() {
            node.owner = None;
        }
        if released.has(Choice::POLL) {
            node.poll = None;
        }
        if released.has(Choice::PRODUCING) {
            (node.production, node.master_production) = (None, None);
        }
        if released.has(Choice::STROBE) {
            self.strobed &= !slave.bit();
        }
    }

    /// What a service that was done tells about the slave's connections.
    pub fn learn(&mut self, now: &Now<'_>, slave: MacId, (request, body): (&Request, &[u8])) {
        let target = request.target;
        let instance = target.instance.and_then(Instance::of);
        match (request.service, target.class, instance) {
            (Some(service::GET), Some(CONNECTION), Some(instance)) => {
                if let Some(attribute) = target.attribute {
                    self.note(slave, instance, attribute, body);
                }
            }
            (Some(service::SET), Some(CONNECTION), Some(instance)) => {
                self.written(now, slave, instance, (request, body));
            }
            (Some(service::RESET), Some(CONNECTION), Some(instance)) => {
                self.revive(slave, instance, now.mark.start);
            }
            (Some(service::DELETE), Some(CONNECTION), Some(instance)) => {
                self.release(now, slave, CHOICES[instance.index()]);
            }
            (Some(code), Some(class::IDENTITY), Some(_)) if target.instance == Some(1) => {
                self.identified(slave, now.mark.start, (code, target.attribute, body));
            }
            (Some(code), Some(ACKNOWLEDGE_HANDLER), _) if target.attribute == Some(1) => {
                let value = if code == service::GET { body } else { request.data() };
                if let ([low, high], service::GET | service::SET) = (value, code) {
                    self.node(slave).acknowledge_timer = Some(u16::from_le_bytes([*low, *high]));
                }
            }
            _ => {}
        }
    }

    /// What the Identity object says of the numbers that the duplicate MAC ID check has too.
    fn identified(
        &mut self,
        slave: MacId,
        now: Moment,
        (code, attribute, body): (u8, Option<u16>, &[u8]),
    ) {
        let node = self.node(slave);
        match (code, attribute, body) {
            (service::GET, Some(1), [low, high]) => {
                node.tell_identity(Some(u16::from_le_bytes([*low, *high])), None, now);
            }
            (service::GET, Some(6), [a, b, c, d]) => {
                node.tell_identity(None, Some(u32::from_le_bytes([*a, *b, *c, *d])), now);
            }
            (GET_ATTRIBUTES_ALL, ..) => {
                if let Ok((_, DeviceIdentity { vendor, serial, .. })) = DeviceIdentity::parse(body)
                {
                    node.tell_identity(Some(vendor), Some(serial), now);
                }
            }
            _ => {}
        }
    }

    fn written(
        &mut self,
        now: &Now<'_>,
        slave: MacId,
        instance: Instance,
        (request, body): (&Request, &[u8]),
    ) {
        let Some(attribute) = request.target.attribute else { return };
        // The slave rounds the rate up to what its timer can do, and answers what it uses.
        let is_told = attribute == attribute::RATE && body.len() == 2;
        self.note(slave, instance, attribute, if is_told { body } else { request.data() });
        if attribute == attribute::RATE && instance != Instance::Explicit {
            self.revive(slave, instance, now.mark.start);
        }
        match attribute {
            attribute::PRODUCED_PATH => self.forget_size(now, slave, instance, Direction::Produced),
            attribute::CONSUMED_PATH => self.forget_size(now, slave, instance, Direction::Consumed),
            _ => {}
        }
    }

    /// Another assembly was chosen: it has a size of its own (CIP Vol. 1, chapter 3: the
    /// connection sizes follow the paths).
    fn forget_size(
        &mut self,
        now: &Now<'_>,
        slave: MacId,
        instance: Instance,
        direction: Direction,
    ) {
        let flow = self.nodes[slave.index()].connection(instance).flow(direction);
        (flow.size, flow.habit) = (None, Habit::default());
        if let Some((_, since)) = flow.wrong.take() {
            self.judgement.end(&codes::SIZE_MISMATCH, since, now.mark.start);
        }
    }

    /// The value of an attribute of a connection.
    fn note(&mut self, slave: MacId, instance: Instance, attribute: u16, value: &[u8]) {
        let connection = self.node(slave).connection(instance);
        match (attribute, value) {
            (attribute::TRANSPORT, [transport]) => connection.is_mute = transport & 0x0F == 0,
            (attribute::WATCHDOG, [action]) => connection.watchdog = Some(*action),
            (attribute::MULTIPLIER, [code]) => connection.multiplier = *code,
            (attribute::PRODUCED_PATH, path) => connection.produced.assembly = assembly(path),
            (attribute::CONSUMED_PATH, path) => connection.consumed.assembly = assembly(path),
            (_, [low, high]) => {
                let word = Some(u16::from_le_bytes([*low, *high]));
                match attribute {
                    attribute::PRODUCED_SIZE => connection.produced.size = word,
                    attribute::CONSUMED_SIZE => connection.consumed.size = word,
                    attribute::RATE => connection.rate = word,
                    attribute::INHIBIT => connection.inhibit = word,
                    _ => {}
                }
            }
            _ => {}
        }
    }

    /// An I/O connection is in use from now on.
    pub fn revive(&mut self, slave: MacId, instance: Instance, now: Moment) {
        let connection = self.nodes[slave.index()].connection(instance);
        if connection.state == Stands::Gone {
            return;
        }
        if connection.state == Stands::TimedOut {
            self.judgement.end(&codes::CONNECTION_TIMEOUT, connection.since, now);
        }
        connection.establish(now);
        self.wait_for(slave, instance);
    }
}
