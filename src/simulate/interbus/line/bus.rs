//! What goes over the line: status telegrams, ID cycles at the start and after trouble, data cycles.

use super::frame::Frame;
use super::profile::Profile;
use super::telegram::{self, DATA_BITS, STATUS_BITS, Wire};
use super::truth::{Cycle, Purpose};
use crate::simulate::chance::Chance;
use crate::simulate::interbus::fault::Fault;
use crate::simulate::interbus::plan::Plan;
use crate::simulate::interbus::ring::{Data, Ring, Struck};
use crate::simulate::interbus::{Summary, Truth, facts};
use crate::simulate::order::Orderable;
use crate::simulate::samples::Sampler;
use crate::simulate::time::{Clock, MS, Ps, US};
use anyhow::Result;
use serde_json::json;

/// The stream of the seed; those of devices are above.
const LINE: u64 = 1;

/// By how many percent the master's clock may be off: that of a crystal.
const CLOCK_ERROR: f64 = 0.01;

/// Data cycles before anything goes wrong: enough to find out how the line is coded.
const HEALTHY: u64 = 48;

/// Silence after which all devices reset, as Phoenix Contact has it (others say 20 ms).
const RESET: Ps = 25 * MS;

/// Silence before the master is switched on.
const BEFORE: Ps = 30 * MS;

/// Time from one device to the next, in bits: half of what cycle times are reckoned with (Beckhoff:
/// 1.5 bits for the way there and back).
const HOP: f64 = 0.75;

/// The fewest status telegrams between two cycles.
const PAUSE: u64 = 4;

/// A line, and the ring on it.
struct Bus<'a> {
    plan: &'a Plan,
    profile: &'a Profile,
    clock: Clock,
    ring: Ring,
    wires: [Wire; 2],
    tap: Sampler,
    truth: Truth,
    chance: Chance,
    /// Devices in the ring now.
    devices: usize,
    now: Ps,
    /// When the next cycle is due.
    due: Ps,
    cycles: u64,
    /// Data cycles since the ring was set up.
    healthy: u64,
    summary: Summary,
}

/// Lets the ring run on a line of this profile, and writes what the tap sees of it and what is true.
///
/// # Errors
/// The capture or the truth cannot be written.
pub fn run(plan: &Plan, profile: &Profile, tap: Sampler, mut truth: Truth) -> Result<Summary> {
    let mut chance = Chance::new(plan.seed, LINE);
    let clock = Clock::off_by(profile.bitrate, chance.within(-CLOCK_ERROR, CLOCK_ERROR));
    let mut facts = facts(plan);
    facts["profile"] = json!(profile);
    facts["clock_ppm"] = json!(clock.ppm(profile.bitrate));
    truth.tell(&json!({ "bus": facts }))?;
    let mut bus = Bus {
        plan,
        profile,
        clock,
        ring: Ring::new(plan),
        wires: [Wire::new(clock), Wire::new(clock)],
        tap,
        truth,
        chance,
        devices: plan.ring.len(),
        now: BEFORE,
        due: 0,
        cycles: 0,
        healthy: 0,
        summary: Summary::default(),
    };
    bus.go()?;
    bus.end()
}

impl Bus<'_> {
    fn go(&mut self) -> Result<()> {
        self.set_up()?;
        while self.now < BEFORE + self.plan.duration {
            self.rest()?;
            self.exchange()?;
        }
        self.rest()
    }

    fn end(mut self) -> Result<Summary> {
        let until = self.now + 100 * US;
        self.show(until)?;
        let Bus { ring, tap, mut truth, mut summary, .. } = self;
        truth.tell_struck(&ring.open(), until)?;
        tap.finish(until)?;
        truth.end()?;
        summary.faults.extend(ring.counts);
        Ok(Summary { duration: until, ..summary })
    }

    /// The master finds out who is in the ring.
    fn set_up(&mut self) -> Result<()> {
        self.healthy = 0;
        for _ in 0..self.chance.between(3, 6) {
            self.rest()?;
            self.identify()?;
        }
        Ok(())
    }

    fn identify(&mut self) -> Result<()> {
        let ids: Vec<u16> = self.plan.ring[..self.devices].iter().map(|member| member.id).collect();
        let words: Vec<[u8; 2]> = ids.iter().map(|id| id.to_be_bytes()).collect();
        let devices: Vec<(&[u8], &[u8])> =
            words.iter().map(|word| (&[0, 0][..], &word[..])).collect();
        let frame = Frame::new(self.profile, self.lbw(), &devices);
        self.send(&Purpose::Identify(&ids), &frame, None)
    }

    fn exchange(&mut self) -> Result<()> {
        let data = self.ring.cycle(self.now);
        let struck = self.ring.take_struck();
        self.truth.tell_struck(&struck, Ps::MAX)?;
        let data = &data[..self.devices];
        let devices: Vec<(&[u8], &[u8])> =
            data.iter().map(|data| (&data.out[..], &data.input[..])).collect();
        let frame = Frame::new(self.profile, self.lbw(), &devices);
        self.healthy += 1;
        match self.strikes() {
            None => self.send(&Purpose::Exchange(data), &frame, None),
            Some(fault) => self.go_wrong(fault, data, frame),
        }
    }

    /// The fault that strikes this cycle, if one does.
    fn strikes(&mut self) -> Option<Fault> {
        let fate = self.chance.fraction();
        let mut threshold = 0.0;
        let orders = self.plan.faults.iter().filter(|order| order.fault.is_on_the_line());
        let order = orders.into_iter().find(|order| {
            threshold += order.probability;
            fate < threshold
        })?;
        let is_possible = order.fault != Fault::Reconfiguration || self.devices > 1;
        (self.healthy > HEALTHY && is_possible).then_some(order.fault)
    }

    /// A cycle in which, or after which, something goes wrong.
    fn go_wrong(&mut self, fault: Fault, data: &[Data], mut frame: Frame) -> Result<()> {
        *self.summary.faults.entry(fault.name()).or_default() += 1;
        let mut struck = Struck { fault, device: 0, from: self.now, until: self.now };
        let is_out = self.chance.happens(0.5);
        let bytes = if is_out { &mut frame.out } else { &mut frame.input };
        // Neither loopback word nor control word: those of DO are at the front, those of DI at
        // the back.
        let size = bytes.len() - 4;
        let at = self.chance.below(size as u64 - 2) as usize + if is_out { 2 } else { 0 };
        match fault {
            Fault::Crc => bytes[at] ^= 1 << self.chance.below(8),
            Fault::MissingCharacter => drop(bytes.remove(at)),
            Fault::ExtraCharacter => bytes.insert(at, self.chance.below(256) as u8),
            Fault::ControlWord => {
                let control = bytes.len() - 1;
                bytes[control] ^= 1 + self.chance.below(255) as u8;
            }
            _ => {}
        }
        let is_after = matches!(fault, Fault::Reset | Fault::Reconfiguration);
        self.send(&Purpose::Exchange(data), &frame, Some(fault).filter(|_| !is_after))?;
        match fault {
            Fault::Reset => {
                struck.from = self.now + RESET;
                self.silence()?;
                self.set_up()?;
            }
            Fault::Reconfiguration => {
                self.devices -= 1;
                self.set_up()?;
                // The first data cycle is as short as the ring is now.
                self.rest()?;
                self.exchange()?;
            }
            Fault::ControlWord => {}
            _ if self.chance.happens(0.5) => {
                self.rest()?;
                self.identify()?;
            }
            _ => {}
        }
        struck.until = self.now + self.plan.cycle;
        self.truth.tell_struck(&[struck], Ps::MAX)
    }

    /// Nobody says anything for so long that all devices reset.
    fn silence(&mut self) -> Result<()> {
        self.now += RESET + self.chance.between(5 * MS, 20 * MS);
        self.due = self.now;
        self.show(self.now)
    }

    /// Status telegrams until the next cycle is due.
    fn rest(&mut self) -> Result<()> {
        let status = telegram::status(self.profile.flags(false, false, false));
        let length = self.clock.bits(STATUS_BITS);
        let wanted = (self.due - self.now) / length;
        let count = PAUSE + u64::try_from(wanted).unwrap_or(0) + self.chance.below(3);
        for _ in 0..count {
            self.say(&status);
            self.now += length;
        }
        self.due = self.due.max(self.now) + self.plan.cycle;
        self.show(self.now)
    }

    /// The same bits on both wires: those on DI have come all the way round.
    fn say(&mut self, bits: &[bool]) {
        let round = self.clock.bits(HOP * 2.0 * self.devices as f64);
        self.wires[0].send(self.now, bits);
        self.wires[1].send(self.now + round, bits);
    }

    /// Sends a frame, and tells of it.
    fn send(&mut self, purpose: &Purpose<'_>, frame: &Frame, fault: Option<Fault>) -> Result<()> {
        self.cycles += 1;
        let start = self.now;
        let is_id_cycle = matches!(purpose, Purpose::Identify(_));
        let round = self.clock.bits(HOP * 2.0 * self.devices as f64);
        let longest = frame.out.len().max(frame.input.len());
        let mut end = self.now;
        for number in 0..longest {
            for (wire, (bytes, delay)) in
                [(&frame.out, 0), (&frame.input, round)].into_iter().enumerate()
            {
                let Some(byte) = bytes.get(number) else { continue };
                let is_check = number + 4 >= bytes.len();
                let flags = self.profile.flags(is_id_cycle, is_check, true);
                let bits = telegram::data(flags, *byte, self.profile);
                self.wires[wire].send(self.now + delay, &bits);
                if wire == 0 {
                    end = self.now + self.clock.bits(DATA_BITS);
                }
            }
            let gap = self.chance.within(0.0, self.profile.gap_bits);
            self.now += self.clock.bits(DATA_BITS + gap);
        }
        self.summary.count += 1;
        let times = (self.truth.ns(start), self.truth.ns(end));
        let mut cycle = Cycle::new(self.cycles, times, purpose, frame);
        cycle.damaged = fault.is_some();
        self.truth.tell(&cycle)?;
        self.show(self.now)
    }

    /// The loopback word of the next cycle.
    fn lbw(&self) -> [u8; 2] {
        self.profile.lbw.in_cycle(self.cycles)
    }

    /// Both wires are known up to this time.
    fn show(&mut self, until: Ps) -> Result<()> {
        let [out, input] = self.wires.each_mut().map(|wire| wire.take(until));
        self.tap.watch_all(&[&out, &input], until)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::interbus::line::profile::BitOrder;
    use crate::simulate::interbus::plan::example;
    use crate::simulate::samples::{Levels, Samples};
    use serde_json::Value;
    use std::cell::RefCell;
    use std::io::{self, Write};
    use std::rc::Rc;

    /// Samples a bit: 4 MHz at 500 kbit/s.
    const BIT: f64 = 8.0;

    #[derive(Clone, Default)]
    struct Kept(Rc<RefCell<Vec<u8>>>);

    impl Samples for Kept {
        fn run(&mut self, levels: Levels, samples: u64) -> Result<()> {
            let mut kept = self.0.borrow_mut();
            let size = kept.len() + samples as usize;
            kept.resize(size, levels);
            Ok(())
        }
        fn end(self: Box<Self>) -> Result<()> {
            Ok(())
        }
    }

    impl Write for Kept {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.borrow_mut().extend(bytes);
            Ok(bytes.len())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    /// The samples of both wires, and the lines of the truth.
    fn run_for(ms: Ps, ring: &[&str], faults: &[&str], profile: &Profile) -> (Vec<u8>, Vec<Value>) {
        let (samples, told) = (Kept::default(), Kept::default());
        let plan = Plan { duration: ms * MS, cycle: MS / 2, ..example(ring, faults) };
        let tap = Sampler::new(4_000_000, 2, false, Box::new(samples.clone()));
        run(&plan, profile, tap, Truth::new(Some(Box::new(told.clone())), 0)).unwrap();
        let text = String::from_utf8(told.0.take()).unwrap();
        let lines = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        (samples.0.take(), lines)
    }

    /// What a receiver hears that knows the profile: runs of data telegrams, as bytes.
    fn heard(samples: &[u8], wire: usize, profile: &Profile) -> Vec<String> {
        let level = |at: f64| samples.get(at as usize).is_none_or(|it| it >> wire & 1 == 1);
        let status = profile.flags(false, false, false);
        let (mut at, mut runs) = (0.0, vec![String::new()]);
        while (at as usize) < samples.len() {
            if level(at) {
                at += 1.0;
                continue;
            }
            let bit = |number: f64| level(at + (number + 0.5) * BIT);
            if [bit(1.0), bit(2.0), bit(3.0)] == status {
                assert!(bit(4.0), "a stop bit");
                runs.push(String::new());
                at += 4.5 * BIT;
                continue;
            }
            let byte = (4..12).fold(0, |byte, number| byte << 1 | u8::from(bit(f64::from(number))));
            let is_lsb = profile.data_bit_order == BitOrder::Lsb;
            let byte = if is_lsb { byte.reverse_bits() } else { byte };
            assert!(bit(12.0), "a stop bit");
            runs.last_mut().unwrap().push_str(&format!("{byte:02X}"));
            at += 12.5 * BIT;
        }
        runs.retain(|run| !run.is_empty());
        runs
    }

    #[test]
    fn both_wires_carry_what_is_told() {
        for seed in 0..8 {
            let profile = Profile { idle_level: 1, ..Profile::random(seed) };
            let (samples, lines) = run_for(20, &["la66", "0132", "la66"], &[], &profile);
            for (wire, key) in ["do", "di"].into_iter().enumerate() {
                let told: Vec<&str> = lines.iter().filter_map(|line| line[key].as_str()).collect();
                assert!(told.len() > 20);
                assert_eq!(heard(&samples, wire, &profile), told, "{seed} {key}");
            }
            let kinds: Vec<&Value> = lines[1..].iter().map(|line| &line["kind"]).collect();
            assert_eq!(kinds[..3], ["id-cycle"; 3]);
            assert_eq!(*kinds[kinds.len() - 1], "data-cycle");
            assert_eq!(lines[1]["ids"], json!(["0233", "0132", "0233"]));
        }
    }

    #[test]
    fn faults_of_the_line_strike_and_show() {
        let faults = ["crc", "missing-character", "extra-character", "control-word", "reset"];
        let profile = Profile::default();
        for fault in faults.into_iter().chain(["reconfiguration"]) {
            let order = format!("{fault}=0.1");
            let (samples, lines) = run_for(60, &["la66", "0132"], &[&order], &profile);
            let struck = lines.iter().find(|line| line["fault"] == *fault).expect(fault);
            let from = struck["time_ns"].as_i64().unwrap();
            let data = |line: &&Value| line["kind"] == "data-cycle";
            let frames: Vec<&Value> = lines.iter().filter(data).collect();
            assert!(frames[..HEALTHY as usize].iter().all(|it| it["damaged"].is_null()));
            let is_after = ["reset", "reconfiguration"].contains(&fault);
            let damaged = frames.iter().find(|it| it["damaged"] == true);
            assert_eq!(damaged.is_none(), is_after, "{fault}");
            if let Some(damaged) = damaged {
                assert_eq!(damaged["time_ns"], from);
            }
            if fault == "reset" {
                // 25 ms before it is told, nothing more is on the wires, and nothing follows for
                // 5 ms at least.
                let sample = |ns: i64| (ns / 250) as usize;
                let silence = sample(from - 24_900_000)..sample(from + 4_900_000);
                assert!(samples[silence].iter().all(|levels| *levels == 0b11));
            }
            if fault == "reconfiguration" {
                let size = |frame: &Value| frame["do"].as_str().unwrap().len();
                assert_eq!(size(frames[0]) - size(frames[frames.len() - 1]), 4, "one word");
            }
        }
    }
}
