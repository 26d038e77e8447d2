//! The bus: who sends when, and what becomes of it.

use super::air::{Air, Node, Sending};
use super::encoder::Encoder;
use super::fate::Fate;
use super::fault::Fault;
use super::plan::Plan;
use super::scanner::Scanner;
use super::wire::{Course, Flaw};
use crate::simulate::chance::Chance;
use crate::simulate::time::{NS, Ps};
use serde_json::{Value, json};

/// The stream of the seed for how frames are destroyed.
const FLAWS: u64 = 3;

/// Attempts without an acknowledge after which a sender is error passive: its error counter grows
/// by 8 each time, and 128 is passive.
const ACTIVE_TRIES: u32 = 16;

/// An attempt to send a frame that is over.
pub struct Attempt {
    /// Who sent what.
    pub sending: Sending,
    /// How it went.
    pub course: Course,
    /// What was wrong.
    pub flaw: Option<Flaw>,
    /// The fault that this was.
    pub fault: Option<Fault>,
    /// First bit.
    pub start: Ps,
    /// End of the frame, or of the error's delimiter.
    pub end: Ps,
    /// The bus is free again.
    pub free: Ps,
}

/// The bus and everybody on it.
pub struct Bus {
    plan: Plan,
    nodes: Vec<Box<dyn Node>>,
    /// What nodes share.
    pub air: Air,
    free: Ps,
    flying: Option<Attempt>,
    chance: Chance,
    facts: Value,
}

impl Bus {
    /// A bus as it was ordered, on which nothing happened yet.
    pub fn new(plan: Plan) -> Self {
        let encoders: Vec<Encoder> =
            plan.stations.iter().map(|station| Encoder::new(&plan, *station)).collect();
        let facts = facts(&plan, &encoders);
        let mut nodes: Vec<Box<dyn Node>> = Vec::new();
        if !plan.is_lone() {
            nodes.push(Box::new(Scanner::new(&plan)));
        }
        for encoder in encoders {
            nodes.push(Box::new(encoder));
        }
        let mut fate = Fate::new(&plan);
        if !plan.starts_late {
            fate.open(0);
        }
        Bus {
            air: Air::new(fate, plan.clock()),
            chance: Chance::new(plan.seed, FLAWS),
            nodes,
            free: 0,
            flying: None,
            facts,
            plan,
        }
    }

    /// What there is to tell beforehand.
    pub fn facts(&self) -> &Value {
        &self.facts
    }

    /// The next attempt that is over, or `None` when the capture is.
    pub fn next(&mut self) -> Option<Attempt> {
        loop {
            let (wake, node) =
                self.nodes.iter().enumerate().map(|(n, node)| (node.next(), n)).min()?;
            let done = self.flying.as_ref().map(|flying| flying.free);
            let event = done.or_else(|| self.air.next_start(self.free)).unwrap_or(Ps::MAX);
            if self.air.fate.end().is_some_and(|end| wake.min(event) >= end) {
                return None;
            }
            let ended = self.flying.as_ref().map(|flying| flying.end);
            if wake <= ended.unwrap_or(event) {
                self.air.turn = (node, self.nodes[node].clock());
                self.nodes[node].wake(wake, &mut self.air);
            } else if let Some(attempt) = self.flying.take() {
                return Some(self.land(attempt));
            } else {
                self.flying = self.take_off(event);
            }
        }
    }

    /// Somebody begins to send.
    fn take_off(&mut self, start: Ps) -> Option<Attempt> {
        let sending = self.air.arbitrate(start)?;
        let (fault, flaw) = self.flaw_of(&sending, start);
        let flawed = flaw.and_then(|flaw| Course::flawed(&sending.frame, flaw, &mut self.chance));
        let (flaw, course) = match flawed {
            Some(course) => (flaw, course),
            None => (None, Course::whole(&sending.frame)),
        };
        let at = |bits: usize| start + sending.clock.bits(bits as f64);
        let (end, free) = (at(course.end), at(course.free));
        Some(Attempt {
            fault: fault.filter(|_| flaw.is_some()),
            flaw,
            start,
            end,
            free,
            course,
            sending,
        })
    }

    /// What is wrong with this attempt.
    fn flaw_of(&mut self, sending: &Sending, start: Ps) -> (Option<Fault>, Option<Flaw>) {
        if self.plan.is_lone() {
            let is_active = sending.tries < ACTIVE_TRIES;
            let flaw = if is_active { Flaw::Unacknowledged } else { Flaw::UnacknowledgedPassive };
            return (Some(Fault::NotAcknowledged), Some(flaw));
        }
        let station = sending.note.station.unwrap_or(sending.note.source);
        let choices = [
            (Fault::ErrorFrame, Flaw::Flagged),
            (Fault::Stuff, Flaw::Stuff),
            (Fault::Form, Flaw::Form),
            (Fault::Crc, Flaw::Crc),
            (Fault::Overload, Flaw::Overload),
        ];
        for (fault, flaw) in choices {
            // Not every frame has a stuff bit that could be turned over.
            let can = self.plan.has(fault)
                && Course::flawed(&sending.frame, flaw, &mut self.chance).is_some();
            if can && self.air.fate.strikes(fault, station, start) {
                return (Some(fault), Some(flaw));
            }
        }
        (None, None)
    }

    /// An attempt is over: everybody hears it, or it is made again.
    fn land(&mut self, attempt: Attempt) -> Attempt {
        self.free = attempt.free;
        if attempt.flaw.is_some_and(Flaw::destroys) {
            self.air.again(attempt.sending.clone());
            return attempt;
        }
        let Sending { frame, sender, .. } = attempt.sending;
        for (number, node) in self.nodes.iter_mut().enumerate() {
            self.air.turn = (number, node.clock());
            if number == sender {
                node.sent(&frame, attempt.end, &mut self.air);
            } else {
                node.hear(&frame, attempt.end, &mut self.air);
            }
        }
        attempt
    }
}

/// The bus as it was ordered, and what chance made of it.
fn facts(plan: &Plan, encoders: &[Encoder]) -> Value {
    let encoders = encoders.iter().map(|encoder| encoder.facts(plan.bitrate));
    let nature = plan.faults.iter().filter(|order| order.fault.is_nature());
    json!({
        "protocol": "devicenet",
        "seed": plan.seed,
        "bitrate": plan.bitrate,
        "master": if plan.is_lone() { None } else { Some(plan.master) },
        "encoders": encoders.collect::<Vec<_>>(),
        "scan_ns": plan.scan / NS,
        "packet_rate_ms": plan.packet_rate,
        "inhibit_ms": plan.inhibit,
        "delta": plan.delta,
        "acknowledged": plan.is_acknowledged,
        "heartbeat_s": plan.heartbeat,
        "starts_late": plan.starts_late,
        "faults": plan.faults.iter().map(ToString::to_string).collect::<Vec<_>>(),
        "expect": nature.map(|order| order.fault.code()).collect::<Vec<_>>(),
    })
}
