//! The ring: a PLC with a task for every encoder, and what each bus cycle carries.

use super::carriage::Carriage;
use super::encoder::Encoder;
use super::fault::Fault;
use super::master::{Act, Task};
use super::plan::{Member, Plan};
use super::script::Author;
use super::word::DATA;
use crate::simulate::chance::Chance;
use crate::simulate::order::Orderable;
use crate::simulate::time::{MS, Ps};
use std::collections::BTreeMap;

/// Streams of the seed: so many a device, from these on.
const STREAMS: u64 = 8;

/// The resolution that encoders have at first: 0.01 mm (manual §3.2).
const STEPS_PER_MM: f64 = 100.0;

/// A fault that struck.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Struck {
    /// Which.
    pub fault: Fault,
    /// Whom; nobody in particular if 0.
    pub device: u16,
    /// From when on it is to be told.
    pub from: Ps,
    /// Until when.
    pub until: Ps,
}

/// What a bus cycle carries from and to a device.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct Data {
    /// Its place in the ring, from 1.
    pub device: u16,
    /// Whether it is an encoder.
    pub is_encoder: bool,
    /// From the master.
    pub out: Vec<u8>,
    /// To the master.
    pub input: Vec<u8>,
    /// The external preset input was used.
    pub is_preset: bool,
}

/// What an encoder sends is not what it should be.
#[derive(Clone, Copy)]
enum Wrong {
    /// These bits are turned over, for so many cycles.
    Bits(u32, u8),
    /// The position is off, in this cycle.
    Off(i32),
}

/// An encoder in the ring.
struct Station {
    device: u16,
    encoder: Encoder,
    carriage: Carriage,
    task: Task,
    author: Author,
    chance: Chance,
    /// The look of the PLC at this station, in cycles of its scan.
    phase: u64,
    /// What it was sent, and sent, in the cycle before.
    before: (u32, u32),
    wrong: Option<Wrong>,
    struck: Option<(Fault, Ps)>,
    is_preset: bool,
}

/// A device that is none of ours: what it is sent stays, what it sends changes now and then.
struct Other {
    device: u16,
    member: Member,
    out: Vec<u8>,
    input: Vec<u8>,
    chance: Chance,
}

/// The ring and its master.
pub struct Ring {
    plan: Plan,
    stations: Vec<Station>,
    others: Vec<Other>,
    cycle: u64,
    /// Faults that struck and are over.
    struck: Vec<Struck>,
    /// How often each fault struck.
    pub counts: BTreeMap<String, u64>,
}

impl Ring {
    /// A ring as it was ordered.
    pub fn new(plan: &Plan) -> Self {
        let members: Vec<(u16, Member)> = (1..).zip(plan.ring.iter().copied()).collect();
        let encoders = members.iter().filter(|(_, member)| member.is_encoder);
        let others = members.iter().filter(|(_, member)| !member.is_encoder);
        Ring {
            stations: encoders.map(|(device, _)| Station::new(*device, plan)).collect(),
            others: others.map(|(device, member)| Other::new(*device, *member, plan)).collect(),
            cycle: 0,
            struck: Vec::new(),
            counts: BTreeMap::new(),
            plan: plan.clone(),
        }
    }

    /// The next bus cycle, at this time: what goes to and comes from each device, in the order of
    /// the ring.
    pub fn cycle(&mut self, now: Ps) -> Vec<Data> {
        for station in &mut self.stations {
            if let Some(struck) = station.go_on(now, &self.plan) {
                *self.counts.entry(struck.fault.name()).or_default() += 1;
                self.struck.push(struck);
            }
        }
        let (cycle, plan) = (self.cycle, &self.plan);
        let encoders = self.stations.iter_mut().map(|station| station.exchange(cycle, now, plan));
        let others = self.others.iter_mut().map(Other::exchange);
        let mut data: Vec<Data> = encoders.chain(others).collect();
        data.sort_by_key(|data| data.device);
        self.cycle += 1;
        data
    }

    /// The faults that are over.
    pub fn take_struck(&mut self) -> Vec<Struck> {
        std::mem::take(&mut self.struck)
    }

    /// Faults that are not over: they may be told, but need not.
    pub fn open(&self) -> Vec<Struck> {
        let open = |station: &Station| {
            let (fault, from) = station.struck?;
            Some(Struck { fault, device: station.device, from, until: Ps::MAX })
        };
        self.stations.iter().filter_map(open).collect()
    }
}

impl Station {
    fn new(device: u16, plan: &Plan) -> Self {
        let stream = u64::from(device) * STREAMS;
        let chance = |part| Chance::new(plan.seed, stream + part);
        let hold = (2_000.0 * plan.cycles_per_ms()) as u64;
        let mut author = Author::new(hold, plan.has_external_presets, chance(0));
        let length = (plan.rod * STEPS_PER_MM) as u32;
        let mut rest = chance(1);
        Station {
            device,
            encoder: Encoder::new(length, plan.cycles_per_ms(), chance(2)),
            carriage: Carriage::new(plan.motion, plan.speed / plan.rod, chance(3)),
            task: Task::new(author.first(plan.pause), chance(4)),
            author,
            phase: rest.below(plan.scan_cycles()),
            chance: rest,
            before: (0, 0),
            wrong: None,
            struck: None,
            is_preset: false,
        }
    }

    /// Once all is done, something else is to be done. Returns the fault that is over with it.
    fn go_on(&mut self, now: Ps, plan: &Plan) -> Option<Struck> {
        if !self.task.is_done(now) {
            return None;
        }
        let from = self.task.told_from;
        let over = self.struck.take().map(|(fault, begin)| Struck {
            fault,
            device: self.device,
            from: from.unwrap_or(begin),
            until: now,
        });
        let fate = self.chance.fraction();
        let mut threshold = 0.0;
        let order = plan.orders_for(self.device).find(|order| {
            threshold += order.probability;
            fate < threshold
        });
        let pause = (plan.pause as f64 * self.chance.within(0.5, 1.5)) as Ps;
        let mut acts = match order {
            Some(order) => {
                self.struck = Some((order.fault, now));
                self.author.mishap(order.fault)
            }
            None => self.author.errand(now, self.carriage.is_at_rest()),
        };
        acts.push(Act::Wait(pause.max(20 * MS)));
        self.task.order(acts);
        over
    }

    fn exchange(&mut self, cycle: u64, now: Ps, plan: &Plan) -> Data {
        let place = self.carriage.place_at(now);
        let is_scan = (cycle + self.phase).is_multiple_of(plan.scan_cycles());
        let act = if is_scan { self.task.scan(now, self.before.1) } else { None };
        self.is_preset = false;
        if let Some(act) = act {
            self.perform(act, place);
        }
        let input = self.encoder.answer(cycle, self.before.0, place);
        let input = self.distort(input);
        self.before = (self.task.out, input);
        Data {
            device: self.device,
            is_encoder: true,
            out: self.task.out.to_be_bytes().to_vec(),
            input: input.to_be_bytes().to_vec(),
            is_preset: self.is_preset,
        }
    }

    fn perform(&mut self, act: Act, place: f64) {
        match act {
            Act::Serve(_, _, slip) => self.encoder.slip = slip,
            Act::Wait(_) => {}
            Act::Magnet { is_outside } => self.encoder.is_magnet_outside = is_outside,
            Act::Shift(steps) => self.encoder.shift(steps),
            Act::Spike(steps) => self.wrong = Some(Wrong::Off(steps)),
            Act::Garble(bits) => self.wrong = Some(Wrong::Bits(bits, 3)),
            Act::ExternalPreset => {
                self.encoder.adjust(self.encoder.preset, place);
                self.is_preset = true;
            }
        }
    }

    fn distort(&mut self, input: u32) -> u32 {
        match self.wrong.take() {
            None => input,
            Some(Wrong::Off(steps)) => input & !DATA | input.wrapping_add_signed(steps) & DATA,
            Some(Wrong::Bits(bits, cycles)) => {
                self.wrong = (cycles > 1).then(|| Wrong::Bits(bits, cycles - 1));
                input ^ bits
            }
        }
    }
}

impl Other {
    fn new(device: u16, member: Member, plan: &Plan) -> Self {
        let bytes = member.bytes().unwrap_or_default();
        let chance = Chance::new(plan.seed, u64::from(device) * STREAMS);
        let mut other =
            Other { device, member, out: vec![0; bytes], input: vec![0; bytes], chance };
        (0..8 * bytes).for_each(|_| other.change());
        other
    }

    /// A bit here and there.
    fn change(&mut self) {
        let (takes, gives) = self.member.has();
        let bit = |bytes: &mut [u8], bit: u64| {
            if let Some(byte) = bytes.get_mut(bit as usize / 8) {
                *byte ^= 1 << (bit % 8);
            }
        };
        let bits = 8 * self.input.len() as u64;
        let (first, second) = (self.chance.below(bits), self.chance.below(bits));
        if takes && self.chance.happens(0.5) {
            bit(&mut self.out, first);
        }
        if gives {
            bit(&mut self.input, second);
        }
    }

    fn exchange(&mut self) -> Data {
        if self.chance.happens(0.3) {
            self.change();
        }
        let (out, input) = (self.out.clone(), self.input.clone());
        Data { device: self.device, out, input, ..Data::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::interbus::plan::example;
    use crate::simulate::time::S;
    use clap::ValueEnum;

    fn words(data: &Data) -> (u32, u32) {
        let word = |bytes: &[u8]| u32::from_be_bytes(bytes.try_into().unwrap());
        (word(&data.out), word(&data.input))
    }

    fn run(plan: &Plan) -> (Vec<(u32, u32)>, Ring) {
        let mut ring = Ring::new(plan);
        let cycles = plan.duration / plan.cycle;
        let rows = (0..cycles).map(|cycle| words(&ring.cycle(cycle * plan.cycle)[0])).collect();
        (rows, ring)
    }

    /// The service bits of master and encoder only go the way of the manual's handshake.
    #[test]
    fn handshakes_go_their_way() {
        let (rows, _) = run(&Plan { duration: 60 * S, ..example(&["la66"], &[]) });
        let bits = |(out, input): &(u32, u32)| (out >> 31, input >> 31);
        let mut requests = 0;
        for two in rows.windows(2) {
            let (before, after) = (bits(&two[0]), bits(&two[1]));
            let is_next = matches!(
                (before, after),
                ((0, 0), (1, 0)) | ((1, 0), (1, 1)) | ((1, 1), (0, 1)) | ((0, 1), (0, 0))
            );
            assert!(before == after || is_next, "{:X?}", two);
            requests += u32::from(before == (0, 0) && after == (1, 0));
            // Data first, the service bit a scan later.
            assert!(after.0 == before.0 || (two[0].0 ^ two[1].0) << 1 == 0 || after.0 == 0);
        }
        assert!(requests > 500, "{requests}");
    }

    /// Without a preset, no step is longer than the carriage is fast: 200 mm/s on average and
    /// 1.5 times that at most, or 30 steps of 0.01 mm in 1 ms.
    #[test]
    fn positions_follow_the_carriage() {
        let plan = Plan { cycle: MS, pause: 10 * S, ..example(&["la66"], &[]) };
        let (rows, _) = run(&Plan { duration: 10 * S, ..plan });
        let positions: Vec<u32> =
            rows.iter().map(|row| row.1).filter(|input| input >> 24 == 0).collect();
        assert!(positions.len() > 9_000);
        assert!(positions.windows(2).all(|two| two[0].abs_diff(two[1]) <= 31));
    }

    #[test]
    fn every_fault_of_process_data_strikes_and_is_over() {
        for fault in Fault::value_variants().iter().filter(|fault| !fault.is_on_the_line()) {
            let order = format!("{}=0.2", fault.name());
            let (_, mut ring) = run(&example(&["la66"], &[&order]));
            let struck = ring.take_struck();
            assert!(!struck.is_empty(), "{order}");
            assert_eq!(ring.counts[&fault.name()], struck.len() as u64);
            assert!(struck.iter().all(|it| it.from <= it.until && it.device == 1), "{order}");
        }
    }

    #[test]
    fn a_seed_is_a_ring() {
        let plan = example(&["la66", "0132", "la66"], &["withdrawn=0.1"]);
        assert_eq!(run(&plan).0, run(&plan).0);
        assert_ne!(run(&plan).0, run(&Plan { seed: 2, ..plan.clone() }).0);
        let data = Ring::new(&plan).cycle(0);
        let shape: Vec<_> = data.iter().map(|it| (it.device, it.input.len())).collect();
        assert_eq!(shape, [(1, 4), (2, 2), (3, 4)]);
        // ID 0132 has input only.
        assert_eq!(data[1].out, [0, 0]);
    }
}
