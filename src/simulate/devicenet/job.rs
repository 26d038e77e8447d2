//! What the scanner asks an encoder explicitly: when it starts up, and now and then.

use super::explicit::{ALLOCATE, GET, RELEASE, SAVE, SET};
use super::fault::Fault;
use super::object::{ENCODER, PARAMETER};
use super::plan::{Mode, Plan, Station};
use crate::simulate::chance::Chance;

/// A request.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Job {
    /// Service, class, instance, data.
    pub body: Vec<u8>,
    /// What is done when the answer is there.
    pub then: Then,
    /// The fault that it commits.
    pub fault: Option<Fault>,
}

/// What is done when the answer to a request is there.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Then {
    /// The next request.
    Next,
    /// The encoder is at work.
    Work,
    /// Its I/O connection was released: it comes back after a moment.
    Reallocate,
    /// The encoder is switched off and on.
    PowerCycle,
}

impl Job {
    fn new(body: &[u8]) -> Self {
        Job { body: body.to_vec(), then: Then::Next, fault: None }
    }

    /// Get_Attribute_Single.
    pub fn get(class: u8, instance: u8, attribute: u8) -> Self {
        Job::new(&[GET, class, instance, attribute])
    }

    /// Set_Attribute_Single.
    pub fn set(class: u8, instance: u8, attribute: u8, value: &[u8]) -> Self {
        Job::new(&[&[SET, class, instance, attribute], value].concat())
    }

    fn save() -> Self {
        Job::new(&[SAVE, ENCODER, 1])
    }

    fn then(self, then: Then) -> Self {
        Job { then, ..self }
    }

    fn faulty(self, fault: Fault) -> Self {
        Job { fault: Some(fault), ..self }
    }
}

/// Bits of an allocation choice: how the station is scanned.
pub fn choice(plan: &Plan, station: &Station) -> u8 {
    let is_suppressed = station.mode.is_produced() && !plan.is_acknowledged;
    station.mode.choice() | if is_suppressed { 0x40 } else { 0 }
}

/// What is asked when the explicit connection is there.
pub fn start_up(plan: &Plan, station: &Station) -> Vec<Job> {
    let mut jobs = vec![
        // Vendor, device type, product code, revision.
        Job::get(0x01, 1, 1),
        Job::get(0x01, 1, 2),
        Job::get(0x01, 1, 3),
        Job::get(0x01, 1, 4),
        // Time-out action deferred delete, as scanners set it.
        Job::set(0x05, 1, 12, &[3]),
        Job::get(ENCODER, 1, 7),
        Job::get(ENCODER, 1, 8),
    ];
    if station.mode == Mode::Cos {
        let is_flooding = plan.has_for(Fault::IoFlood, station.mac);
        let delta = if is_flooding { 1 } else { plan.delta };
        jobs.push(Job::set(ENCODER, 1, 11, &delta.to_le_bytes()));
    }
    jobs.extend(connect(plan, station));
    jobs
}

/// What makes its I/O connection work.
pub fn connect(plan: &Plan, station: &Station) -> Vec<Job> {
    let instance = station.mode.instance();
    let choice = choice(plan, station);
    let mut jobs = vec![Job::new(&[ALLOCATE, 3, 1, choice, plan.master])];
    if station.assembly == 2 {
        jobs.push(Job::set(0x05, instance, 14, &[0x20, 0x04, 0x24, 0x02]));
    }
    jobs.push(Job::get(0x05, instance, 7));
    jobs.push(Job::get(0x05, instance, 8));
    let is_flooding = plan.has_for(Fault::IoFlood, station.mac);
    if station.mode == Mode::Cos && plan.inhibit > 0 && !is_flooding {
        jobs.push(Job::set(0x05, instance, 17, &plan.inhibit.to_le_bytes()));
    }
    let rate = Job::set(0x05, instance, 9, &plan.packet_rate.to_le_bytes());
    jobs.push(rate.then(Then::Work));
    jobs
}

/// Releases its I/O connection, and connects anew a moment later.
pub fn release(station: &Station) -> Job {
    Job::new(&[RELEASE, 3, 1, station.mode.choice()]).then(Then::Reallocate)
}

/// A preset that is saved, as it should be.
fn preset(station: &Station, chance: &mut Chance) -> Vec<Job> {
    let preset = chance.below(u64::from(station.total)) as u32;
    vec![Job::set(ENCODER, 1, 10, &preset.to_le_bytes()), Job::save()]
}

/// Something that a technician might want to know, or set while the shaft is at rest.
pub fn errand(station: &Station, is_at_rest: bool, chance: &mut Chance) -> Vec<Job> {
    let choice = chance.below(10);
    match choice {
        0 | 1 => vec![Job::get(ENCODER, 1, 12)],
        2 => vec![Job::get(ENCODER, 1, 2)],
        3 => vec![Job::get(ENCODER, 1, 83), Job::get(ENCODER, 1, 86)],
        4 => vec![Job::get(ENCODER, 1, 80), Job::get(ENCODER, 1, 89)],
        5 => vec![Job::get(PARAMETER, 1 + chance.below(19) as u8, 1)],
        6 => vec![Job::get(0x01, 1, 6), Job::get(0x01, 1, 7)],
        7 => vec![Job::get(0x04, station.assembly, 3)],
        8 if is_at_rest => preset(station, chance),
        _ => vec![Job::get(ENCODER, 1, 85), Job::get(ENCODER, 1, 88)],
    }
}

/// What a fault makes the scanner ask; nothing if it is none of the scanner's requests.
pub fn errand_of(fault: Fault, station: &Station, chance: &mut Chance) -> Vec<Job> {
    let job = match fault {
        Fault::ErrorResponse => {
            let choices = [(ENCODER, 1, 99), (0x23, 1, 10), (0x01, 1, 60), (0x05, 4, 101)];
            let (class, instance, attribute) = chance.one_of(&choices).unwrap_or(choices[0]);
            Job::get(class, instance, attribute)
        }
        Fault::Malformed => Job::new(&[0x64 + chance.below(0x1C) as u8, 0x01, 1]),
        Fault::ValueOutOfRange => {
            let steps = 8_193 + chance.below(50_000) as u32;
            Job::set(ENCODER, 1, 7, &steps.to_le_bytes())
        }
        Fault::NotSettable => Job::set(ENCODER, 1, 12, &[0, 0, 0, 0]),
        Fault::UnsavedParameter => {
            let preset = chance.below(u64::from(station.total)) as u32;
            Job::set(ENCODER, 1, 10, &preset.to_le_bytes()).then(Then::PowerCycle)
        }
        Fault::PresetWhileMoving | Fault::Written => {
            let mut jobs = preset(station, chance);
            jobs[0].fault = Some(fault);
            return jobs;
        }
        Fault::XidBusy => Job::get(ENCODER, 1, 12),
        // Something that takes fragments.
        Fault::FragmentSequence => Job::set(ENCODER, 1, 10, &[0; 4]),
        Fault::NotAllocated => release(station),
        _ => return Vec::new(),
    };
    vec![job.faulty(fault)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::devicenet::plan::example;

    #[test]
    fn start_up_asks_who_it_is_and_ends_with_the_packet_rate() {
        let plan = example(Mode::Cos, &[]);
        let jobs = start_up(&plan, &plan.stations[0]);
        assert_eq!(jobs[2].body, [0x0E, 0x01, 0x01, 0x03]);
        let allocate = jobs.iter().find(|job| job.body[0] == ALLOCATE).unwrap();
        assert_eq!(allocate.body, [0x4B, 3, 1, 0x10, 0]);
        let last = jobs.last().unwrap();
        assert_eq!(last.body, [0x10, 0x05, 0x04, 0x09, 75, 0]);
        assert_eq!(last.then, Then::Work);
    }

    #[test]
    fn acknowledges_are_suppressed_by_bit_6() {
        let plan = Plan { is_acknowledged: false, ..example(Mode::Cyclic, &[]) };
        assert_eq!(choice(&plan, &plan.stations[0]), 0x60);
        let plan = Plan { is_acknowledged: false, ..example(Mode::Poll, &[]) };
        assert_eq!(choice(&plan, &plan.stations[0]), 0x02);
    }
}
