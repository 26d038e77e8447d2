//! What an encoder sends without being asked: change of state and cyclic productions, heartbeats.

use super::air::{Air, Note};
use super::encoder::{Encoder, Task};
use super::explicit::{HEARTBEAT, SHUTDOWN};
use super::fault::Fault;
use super::frame::{Frame, id};
use super::plan::Plan;
use crate::simulate::time::{MS, Ps, S};

/// State of the connection that produces.
pub struct Production {
    /// Whether time triggers it, and not a change.
    pub is_cyclic: bool,
    /// How often an encoder looks whether it moved.
    look: Ps,
    last: Option<Last>,
    /// Whether an acknowledge is waited for, and whether that is for the second time.
    waiting: Option<bool>,
    /// Nothing is produced before this.
    mute_until: Ps,
}

/// The production before.
#[derive(Clone)]
struct Last {
    at: Ps,
    data: Vec<u8>,
    position: Option<u32>,
}

impl Production {
    /// An encoder that produces nothing yet.
    pub fn new(plan: &Plan) -> Self {
        // Two milliseconds at 125 kbit/s, less where the bus is faster.
        let look = 2 * MS * 125_000 / Ps::from(plan.bitrate);
        Production { is_cyclic: false, look, last: None, waiting: None, mute_until: 0 }
    }

    /// The connection works no more.
    pub fn stop(&mut self) {
        (self.last, self.waiting, self.mute_until) = (None, None, 0);
    }
}

impl Encoder {
    /// The packet rate was set.
    pub(super) fn start_production(&mut self, now: Ps) {
        self.production.stop();
        let soon = self.some(5 * MS, 15 * MS);
        self.agenda.set(now + soon, Task::Look);
    }

    /// Produces if it is time.
    pub(super) fn look(&mut self, now: Ps, air: &mut Air) {
        let connection = &self.connections[3];
        if !connection.is_established() {
            return;
        }
        let rate = Ps::from(connection.rate) * MS;
        let next = if self.production.is_cyclic && rate > 0 {
            rate + self.some(-rate / 1_000, rate / 1_000)
        } else {
            self.production.look
        };
        self.agenda.set(now + next, Task::Look);
        if now < self.production.mute_until {
            return;
        }
        if self.is_due(now, rate) {
            self.keep_silent_or_produce(now, rate, air);
        } else {
            self.produce_needlessly(now, rate, air);
        }
    }

    /// Whether time or the position's change asks for a production.
    fn is_due(&mut self, now: Ps, rate: Ps) -> bool {
        let Some(last) = self.production.last.clone() else { return true };
        if self.production.is_cyclic {
            return true;
        }
        let inhibit = Ps::from(self.connections[3].inhibit) * MS;
        // A little more than asked for, as the time that counts is that on the bus.
        let is_inhibited = now < last.at + inhibit + inhibit / 20;
        let is_free = self.production.waiting.is_none() && !is_inhibited;
        is_free && (self.has_changed(&last, now) || rate > 0 && now >= last.at + rate)
    }

    fn has_changed(&mut self, last: &Last, now: Ps) -> bool {
        let disc = self.shaft.position_at(now);
        let position = self.objects.parameters.position(disc);
        let flags = self.objects.assembly(self.connections[3].assembly, disc);
        let is_flagged = flags.get(4) != last.data.get(4) && last.data.len() > 4;
        let total = self.objects.parameters.total;
        let delta = self.objects.parameters.delta;
        is_flagged || last.position.is_none_or(|last| distance(last, position, total) >= delta)
    }

    fn keep_silent_or_produce(&mut self, now: Ps, rate: Ps, air: &mut Air) {
        let mac = self.mac();
        let before = self.production.last.as_ref().map(|last| last.at);
        if let Some(before) = before.filter(|_| rate > 0)
            && air.fate.strikes(Fault::LateProduction, mac, now)
        {
            self.production.mute_until = before + self.some(rate * 17 / 10, rate * 29 / 10);
            return;
        }
        let (data, position) = self.io(4, now, air);
        self.send_production(data, position, now, air);
    }

    /// A production that a delta or an inhibit time forbids, if it is time for such a fault.
    fn produce_needlessly(&mut self, now: Ps, rate: Ps, air: &mut Air) {
        let Some(last) = self.production.last.clone() else { return };
        let Some(position) = last.position else { return };
        if self.production.is_cyclic || self.production.waiting.is_some() {
            return;
        }
        let since = now - last.at;
        let inhibit = Ps::from(self.connections[3].inhibit) * MS;
        let delta = self.objects.parameters.delta;
        let change = if since < inhibit / 2 && since > MS {
            self.forbidden(Fault::InhibitViolated, now, air).then_some(delta)
        } else if since > inhibit * 3 / 2 && since < rate * 3 / 4 {
            self.forbidden(Fault::DeltaIgnored, now, air).then_some(delta / 2)
        } else {
            None
        };
        let Some(change) = change else { return };
        let position = (position + change) % self.objects.parameters.total;
        let mut data = last.data;
        data[..4].copy_from_slice(&position.to_le_bytes());
        self.send_production(data, Some(position), now, air);
    }

    fn forbidden(&mut self, fault: Fault, now: Ps, air: &mut Air) -> bool {
        let mac = self.mac();
        air.fate.strikes(fault, mac, now)
    }

    fn send_production(&mut self, data: Vec<u8>, position: Option<u32>, now: Ps, air: &mut Air) {
        let mac = self.mac();
        if air.is_waiting(id::production(mac)) {
            return;
        }
        let kind = if self.production.is_cyclic { "cyclic" } else { "cos" };
        let frame = Frame::new(id::production(mac), &data);
        air.send(now, frame, Note { position, ..self.note(kind) });
        self.production.last = Some(Last { at: now, data, position });
        if self.connections[3].is_acknowledged {
            self.production.waiting = Some(self.production.waiting.is_some());
        }
    }

    /// The production is on the bus: from now on its acknowledge is waited for.
    pub(super) fn produced(&mut self, now: Ps, _: &mut Air) {
        if let Some(last) = &mut self.production.last {
            last.at = now;
        }
        if self.production.waiting.is_some() {
            self.agenda.set(now + Plan::ACKNOWLEDGE_TIMER, Task::Unacknowledged);
        }
    }

    /// The master acknowledges.
    pub(super) fn hear_acknowledge(&mut self, now: Ps) {
        self.connections[3].hear(now);
        self.production.waiting = None;
        self.agenda.cancel(Task::Unacknowledged);
    }

    /// Nobody acknowledged: the same data once more (retry limit 1).
    pub(super) fn produce_again(&mut self, now: Ps, air: &mut Air) {
        let is_second = self.production.waiting.take().unwrap_or(true);
        let Some(last) = self.production.last.clone().filter(|_| !is_second) else { return };
        self.production.waiting = Some(false);
        self.send_production(last.data, last.position, now, air);
    }

    /// Device heartbeat: own MAC ID, identity instance, state, flags, configuration consistency.
    pub(super) fn beat(&mut self, now: Ps, air: &mut Air) {
        let mac = self.mac();
        if self.is_at_work() && self.sick == 0 && air.fate.strikes(Fault::DeviceFault, mac, now) {
            self.sick = 1 + self.chance.below(2) as u8;
        }
        // Operational; or a major recoverable fault, and the flag of a device fault.
        let (state, flags) = if self.sick > 0 { (4, 1) } else { (3, 0) };
        self.sick = self.sick.saturating_sub(1);
        let frame =
            Frame::new(id::response(mac), &[mac, HEARTBEAT, 1, 0, state, flags, 0x34, 0x12]);
        air.send(now, frame, Note { destination: None, ..self.note("heartbeat") });
        self.agenda.set(now + Ps::from(self.objects.heartbeat) * S, Task::Beat);
    }

    /// Device shutdown: own MAC ID, class, instance, code.
    pub(super) fn say_goodbye(&mut self, now: Ps, air: &mut Air) {
        let mac = self.mac();
        let frame = Frame::new(id::response(mac), &[mac, SHUTDOWN, 0x01, 0, 1, 0, 0x01, 0x00]);
        air.send(now, frame, Note { destination: None, ..self.note("shutdown") });
    }
}

/// How far two positions of a circle are apart.
fn distance(one: u32, other: u32, total: u32) -> u32 {
    let apart = one.abs_diff(other);
    apart.min(total.saturating_sub(apart))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_are_near_across_zero() {
        assert_eq!(distance(10, 990, 1_000), 20);
        assert_eq!(distance(990, 10, 1_000), 20);
        assert_eq!(distance(100, 400, 1_000), 300);
    }
}
