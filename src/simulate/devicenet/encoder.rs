//! The encoders: Group 2 only servers that come up, are allocated, and answer.
//!
//! Their explicit messages are in [`super::serve`], what they send without being asked in
//! [`super::produce`], and what goes wrong with them as a whole in [`super::incident`].

use super::agenda::Agenda;
use super::air::{Air, Node, Note, Pace};
use super::connection::Connection;
use super::explicit::{Incoming, Outgoing};
use super::fault::Fault;
use super::frame::{Frame, id};
use super::object::Objects;
use super::plan::{Plan, Station, TOTAL_RESOLUTION};
use super::produce::Production;
use crate::simulate::chance::Chance;
use crate::simulate::motion::{Drive, Shaft};
use crate::simulate::time::{Clock, MS, Ps, S, US};

/// Streams of the seed: what is drawn for one encoder changes nothing for another.
const CLOCKS: u64 = 128;
const SHAFTS: u64 = 256;
const DELAYS: u64 = 384;
const NATURE: u64 = 512;

/// How often it is asked whether something goes wrong with the encoder as a whole.
pub const INCIDENTS: Ps = 250 * MS;

/// What an encoder has to do.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Task {
    /// Send the duplicate MAC ID check for the first or second time.
    Check(u8),
    /// Go on line.
    GoOnline,
    /// See whether there is something to produce.
    Look,
    /// Nobody acknowledged the production.
    Unacknowledged,
    /// Nobody acknowledged the fragment.
    RepeatFragment,
    /// Send a heartbeat.
    Beat,
    /// The alarm or warning is over.
    Calm,
    /// See whether something goes wrong.
    Incident,
}

/// An encoder on the bus.
pub struct Encoder {
    pub(super) station: Station,
    pub(super) clock: Clock,
    pub(super) objects: Objects,
    pub(super) shaft: Shaft,
    pub(super) chance: Chance,
    pub(super) agenda: Agenda<Task>,
    pub(super) is_online: bool,
    checks: u8,
    pub(super) owner: Option<u8>,
    /// Instances 1 to 4.
    pub(super) connections: [Connection; 4],
    pub(super) incoming: Incoming,
    pub(super) outgoing: Option<(Outgoing, Note)>,
    /// When its last answer was ready: it answers one request after the other.
    pub(super) answered: Ps,
    /// Fragments that it does not hear.
    pub(super) deaf: u8,
    pub(super) production: Production,
    /// What is wrong with the next productions.
    streak: Option<(Fault, u32)>,
    /// Heartbeats that are to tell of a fault.
    pub(super) sick: u8,
}

impl Encoder {
    /// An encoder that is switched on now or a little later.
    pub fn new(plan: &Plan, station: Station) -> Self {
        let stream = |base: u64| Chance::new(plan.seed, base + u64::from(station.mac));
        let mut nature = stream(NATURE);
        let is_flooding = plan.has_for(Fault::IoFlood, station.mac);
        let motion =
            if is_flooding { crate::simulate::motion::Motion::Steady } else { plan.motion };
        let speed = if is_flooding { plan.speed.max(20_000.0) } else { plan.speed };
        let drive = Drive { motion, speed, cycle: 20 * MS };
        let start = nature.below(u64::from(TOTAL_RESOLUTION)) as u32;
        let serial = nature.below(1 << 24) as u32 | 0x0100_0000;
        let mut chance = stream(DELAYS);
        let mut agenda = Agenda::new();
        agenda.add(chance.between(MS, 300 * MS), Task::Check(0));
        // The vendor ID of Baumer IVO; Baumer Hübner's is in no public list.
        let mut objects = Objects::new(&station, 468, serial, plan.bitrate);
        objects.heartbeat = plan.heartbeat;
        Encoder {
            station,
            clock: plan.some_clock(&mut stream(CLOCKS)),
            objects,
            shaft: Shaft::new(TOTAL_RESOLUTION, start, drive, stream(SHAFTS)),
            chance,
            agenda,
            is_online: false,
            checks: 0,
            owner: None,
            connections: std::array::from_fn(|index| {
                Connection::new(index as u8 + 1, station.mac, 1)
            }),
            incoming: Incoming::default(),
            outgoing: None,
            answered: 0,
            deaf: 0,
            production: Production::new(plan),
            streak: None,
            sick: 0,
        }
    }

    /// What there is to tell of it beforehand.
    pub fn facts(&self, bitrate: u32) -> serde_json::Value {
        serde_json::json!({
            "mac": self.station.mac,
            "vendor": self.objects.vendor,
            "serial": self.objects.serial,
            "product_code": self.objects.product,
            "mode": format!("{:?}", self.station.mode).to_lowercase(),
            "assembly": self.station.assembly,
            "steps_per_turn": self.station.steps,
            "total_resolution": self.station.total,
            "clock_ppm": self.clock.ppm(bitrate),
        })
    }

    pub(super) fn mac(&self) -> u8 {
        self.station.mac
    }

    /// The connection object of an instance, 1 to 4.
    pub(super) fn connection(&mut self, instance: u8) -> Option<&mut Connection> {
        self.connections.get_mut(usize::from(instance).checked_sub(1)?)
    }

    /// A frame of its own to its owner.
    pub(super) fn note(&self, kind: &'static str) -> Note {
        Note::new(kind, self.mac(), self.owner, self.mac())
    }

    pub(super) fn some(&mut self, least: Ps, most: Ps) -> Ps {
        self.chance.between(least, most)
    }

    /// Whether it has a master and an I/O connection that works.
    pub(super) fn is_at_work(&self) -> bool {
        self.is_online && self.connections[1..].iter().any(Connection::is_established)
    }

    /// The I/O data of a connection, and the position in it. Data can be wrong for a while.
    pub(super) fn io(&mut self, instance: u8, now: Ps, air: &mut Air) -> (Vec<u8>, Option<u32>) {
        let disc = self.shaft.position_at(now);
        air.paces[usize::from(self.mac())] = Pace::new(self.shaft.pace());
        let assembly = self.connections[usize::from(instance) - 1].assembly;
        let mut data = self.objects.assembly(assembly, disc);
        let mut position = Some(self.objects.parameters.position(disc));
        match self.streak(now, air) {
            Some(Fault::SizeMismatch) => data.push(0),
            Some(Fault::Idle) => {
                data.clear();
                position = None;
            }
            Some(Fault::PositionOutOfRange) => {
                let beyond = self.objects.parameters.total + 1 + self.chance.below(1_000) as u32;
                data[..4].copy_from_slice(&beyond.to_le_bytes());
                position = Some(beyond);
            }
            _ => {}
        }
        (data, position)
    }

    /// What is wrong with the data now.
    fn streak(&mut self, now: Ps, air: &mut Air) -> Option<Fault> {
        let mac = self.mac();
        if self.streak.is_none() {
            self.streak = if air.fate.strikes(Fault::SizeMismatch, mac, now) {
                Some((Fault::SizeMismatch, 1 + self.chance.below(5) as u32))
            } else if air.fate.strikes(Fault::Idle, mac, now) {
                Some((Fault::Idle, 1 + self.chance.below(5) as u32))
            } else if air.fate.strikes(Fault::PositionOutOfRange, mac, now) {
                Some((Fault::PositionOutOfRange, 1))
            } else {
                None
            };
        }
        let (fault, left) = self.streak?;
        self.streak = (left > 1).then_some((fault, left - 1));
        Some(fault)
    }

    fn answer_poll(&mut self, now: Ps, air: &mut Air) {
        let mac = self.mac();
        if !self.connections[1].is_established() {
            return;
        }
        self.connections[1].hear(now);
        if air.fate.strikes(Fault::NoPollResponse, mac, now) {
            return;
        }
        self.answer_io(2, id::poll_response(mac), "poll-response", now, air);
    }

    fn answer_strobe(&mut self, data: &[u8], now: Ps, air: &mut Air) {
        let mac = self.mac();
        let is_asked =
            data.get(usize::from(mac / 8)).is_some_and(|byte| byte >> (mac % 8) & 1 == 1);
        if !is_asked || !self.connections[2].is_established() {
            return;
        }
        self.connections[2].hear(now);
        if air.fate.strikes(Fault::NoStrobeResponse, mac, now) {
            return;
        }
        self.answer_io(3, id::strobe_response(mac), "strobe-response", now, air);
    }

    fn answer_io(&mut self, instance: u8, id: u16, kind: &'static str, now: Ps, air: &mut Air) {
        let (data, position) = self.io(instance, now, air);
        let ready = now + self.some(80 * US, 500 * US);
        air.send(ready, Frame::new(id, &data), Note { position, ..self.note(kind) });
    }

    /// Its own MAC ID is claimed by somebody, or it hears that it is somebody else's.
    fn hear_check(&mut self, data: &[u8], now: Ps, air: &mut Air) {
        let is_response = data.first().is_some_and(|byte| byte & 0x80 != 0);
        if !is_response && self.is_online {
            let ready = now + self.some(100 * US, MS);
            self.send_check("dup-mac-response", 0x80, ready, air);
        }
    }

    fn send_check(&self, kind: &'static str, response: u8, ready: Ps, air: &mut Air) {
        let mac = self.mac();
        let frame = mac_check(mac, response, self.objects.vendor, self.objects.serial);
        air.send(ready, frame, Note::new(kind, mac, None, mac));
    }

    /// Power fails, and comes back a little later.
    pub(super) fn lose_power(&mut self, now: Ps, air: &mut Air) {
        air.fall_silent();
        self.agenda.clear();
        self.objects.restart();
        self.is_online = false;
        self.owner = None;
        self.connections.iter_mut().for_each(Connection::release);
        self.incoming.reset();
        (self.outgoing, self.streak, self.deaf) = (None, None, 0);
        self.production.stop();
        let back = self.some(100 * MS, 250 * MS);
        self.agenda.add(now + back, Task::Check(0));
    }

    fn go_online(&mut self, now: Ps) {
        self.is_online = true;
        self.agenda.set(now + INCIDENTS, Task::Incident);
        if self.objects.heartbeat > 0 {
            self.agenda.set(now + Ps::from(self.objects.heartbeat) * S, Task::Beat);
        }
    }

    fn do_task(&mut self, task: Task, now: Ps, air: &mut Air) {
        match task {
            Task::Check(number) => {
                self.checks = number;
                self.send_check("dup-mac-request", 0, now, air);
            }
            Task::GoOnline => self.go_online(now),
            Task::Look => self.look(now, air),
            Task::Unacknowledged => self.produce_again(now, air),
            Task::RepeatFragment => self.repeat_fragment(now, air),
            Task::Beat => self.beat(now, air),
            Task::Calm => (self.objects.is_alarmed, self.objects.is_warned) = (false, false),
            Task::Incident => self.incident(now, air),
        }
    }

    fn time_out(&mut self, now: Ps) {
        for connection in &mut self.connections {
            if connection.time_out(now) {
                self.production.stop();
                self.agenda.cancel(Task::Look);
            }
        }
    }
}

/// A duplicate MAC ID check: R/R bit and port, vendor, serial number.
pub fn mac_check(mac: u8, response: u8, vendor: u16, serial: u32) -> Frame {
    let data = [&[response], &vendor.to_le_bytes()[..], &serial.to_le_bytes()].concat();
    Frame::new(id::mac_check(mac), &data)
}

impl Node for Encoder {
    fn next(&self) -> Ps {
        let deadlines = self.connections.iter().map(|connection| connection.deadline);
        deadlines.min().unwrap_or(Ps::MAX).min(self.agenda.next())
    }

    fn wake(&mut self, now: Ps, air: &mut Air) {
        self.time_out(now);
        while let Some(task) = self.agenda.due(now) {
            self.do_task(task, now, air);
        }
    }

    fn hear(&mut self, frame: &Frame, now: Ps, air: &mut Air) {
        let Some(id) = frame.devicenet_id() else { return };
        let mac = self.mac();
        if id == id::mac_check(mac) {
            self.hear_check(frame.bytes(), now, air);
        }
        if !self.is_online {
            return;
        }
        if id == id::poll_command(mac) {
            self.answer_poll(now, air);
        } else if id == id::acknowledge(mac) {
            self.hear_acknowledge(now);
        } else if id == id::unconnected(mac) {
            self.hear_unconnected(frame.bytes(), now, air);
        } else if id == id::request(mac) {
            self.hear_explicit(frame.bytes(), now, air);
        } else if self.owner.is_some_and(|master| id == id::strobe_command(master)) {
            self.answer_strobe(frame.bytes(), now, air);
        }
    }

    fn sent(&mut self, frame: &Frame, now: Ps, air: &mut Air) {
        let Some(id) = frame.devicenet_id() else { return };
        let mac = self.mac();
        if id == id::mac_check(mac) && !self.is_online {
            let next = if self.checks == 0 { Task::Check(1) } else { Task::GoOnline };
            let second = self.some(S - 2 * MS, S + 8 * MS);
            self.agenda.set(now + second, next);
        } else if id == id::production(mac) {
            self.produced(now, air);
        } else if id == id::response(mac) {
            self.sent_fragment(now);
        }
    }

    fn clock(&self) -> Clock {
        self.clock
    }
}
