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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::devicenet::candump::text;
    use crate::simulate::devicenet::plan::{Mode, example};
    use crate::simulate::order::Orderable;
    use crate::simulate::time::{MS, S};
    use clap::ValueEnum;

    fn run(plan: Plan) -> (Vec<Attempt>, Fate) {
        let mut bus = Bus::new(plan.settle().unwrap());
        let attempts = std::iter::from_fn(|| bus.next()).collect();
        (attempts, bus.air.fate)
    }

    fn texts(attempts: &[Attempt]) -> Vec<String> {
        attempts.iter().map(|attempt| text(&attempt.sending.frame)).collect()
    }

    /// One encoder with MAC ID 23 and a scanner with 0.
    fn only_23(mode: Mode) -> Plan {
        let mut plan = example(mode, &[]);
        plan.stations.retain(|station| station.mac == 23);
        plan.stations[0].assembly = 1;
        Plan { duration: 12 * S, ..plan }
    }

    #[test]
    fn a_scanner_brings_mac_23_to_work() {
        let (attempts, _) = run(only_23(Mode::Poll));
        let texts = texts(&attempts);
        // In this order: both checks, both opens, allocation, identity, I/O, packet rate 75 ms that
        // the encoder rounds up to 80, scan. The preset is worked out in the explicit messages.
        let story = [
            "4BF#00D401",
            "4BF#00D401",
            "780#174B0234",
            "780#174B0234",
            "4BE#004B03010100",
            "4BB#00CB00",
            "4BC#000E010101",
            "4BB#008ED401",
            "4BC#000E010103",
            "4BB#008E0A00",
            "4BC#004B03010200",
            "4BB#00CB00",
            "4BC#000E050207",
            "4BB#008E0400",
            "4BC#00100502094B00",
            "4BB#00905000",
            "4BD#",
            "3D7#",
            "4BC#000E2F010C",
            "4BB#008E",
        ];
        let mut rest = texts.iter();
        for frame in story {
            assert!(rest.any(|text| text.starts_with(frame)), "{frame} in {texts:?}");
        }
        assert_eq!(texts.iter().filter(|text| text.starts_with("4BF")).count(), 2);
        let acknowledged = run(only_23(Mode::Cos)).0;
        assert!(
            self::texts(&acknowledged)
                .windows(2)
                .any(|two| { two[0].starts_with("357#") && two[1] == "4BA#" })
        );
    }

    #[test]
    fn checks_are_a_second_apart_and_polls_keep_their_pace() {
        let (attempts, _) = run(only_23(Mode::Poll));
        let times = |id: &str| -> Vec<Ps> {
            let of = |attempt: &&Attempt| text(&attempt.sending.frame).starts_with(id);
            attempts.iter().filter(of).map(|attempt| attempt.start / NS).collect()
        };
        let [first, second] = times("4BF#")[..] else { panic!("two checks") };
        assert!((990_000_000..1_020_000_000).contains(&(second - first)));
        let polls = times("4BD#");
        assert!(polls.len() > 100);
        // 25 ms ± 5 %, and at most a frame of somebody else before it.
        assert!(polls.windows(2).all(|two| (22_600_000..27_400_000).contains(&(two[1] - two[0]))));
        assert!(times("3D7#").len().abs_diff(polls.len()) <= 1);
    }

    #[test]
    fn productions_keep_inhibit_time_delta_and_packet_rate() {
        let plan = Plan { duration: 30 * S, ..only_23(Mode::Cos) };
        let (attempts, _) = run(plan);
        let is_io = |attempt: &&Attempt| attempt.sending.note.kind == "cos";
        let io: Vec<(Ps, u32)> = attempts
            .iter()
            .filter(is_io)
            .filter_map(|attempt| Some((attempt.end, attempt.sending.note.position?)))
            .collect();
        assert!(io.len() > 200);
        let preset = |at: Ps| {
            attempts.iter().any(|attempt| {
                let about = attempt.sending.note.about;
                (at - S / 10..at).contains(&attempt.start)
                    && about.is_some_and(|about| about.attribute == Some(10))
            })
        };
        for two in io.windows(2).filter(|two| !preset(two[1].0)) {
            let (gap, change) = (two[1].0 - two[0].0, two[1].1.abs_diff(two[0].1));
            // Inhibit time 20 ms, delta 100 steps, packet rate 80 ms.
            assert!(gap >= 20 * MS, "{gap}");
            assert!(change >= 100 || gap >= 80 * MS, "{change} after {gap}");
            assert!(gap <= 120 * MS, "{gap}");
        }
    }

    #[test]
    fn frames_do_not_overlap_and_last_as_long_as_their_bits() {
        for bitrate in [125_000, 250_000, 500_000] {
            let plan = Plan { bitrate, clock_error: 0.0, ..example(Mode::Strobe, &[]) };
            let mut free = 0;
            for attempt in run(plan).0 {
                let bits = crate::simulate::devicenet::bits::length(&attempt.sending.frame) as i64;
                let bit = 1_000_000_000_000 / i64::from(bitrate);
                assert!(attempt.start >= free);
                assert_eq!(attempt.free - attempt.start, bits * bit);
                free = attempt.free;
            }
        }
    }

    #[test]
    fn a_healthy_bus_has_no_error_answer_and_no_silence_in_any_mode() {
        for mode in [Mode::Poll, Mode::Cos, Mode::Cyclic, Mode::Strobe] {
            for is_acknowledged in [true, false] {
                let plan = Plan { is_acknowledged, duration: 30 * S, ..example(mode, &[]) };
                let (attempts, fate) = run(plan);
                assert!(fate.counts.is_empty());
                assert!(attempts.iter().all(|attempt| attempt.flaw.is_none()));
                let is_error = |attempt: &Attempt| {
                    let frame = attempt.sending.frame;
                    attempt.sending.note.kind.ends_with("-response")
                        && !attempt.sending.note.kind.starts_with(['p', 's'])
                        && frame.bytes()[1] == 0x94
                };
                assert!(!attempts.iter().any(is_error), "{mode:?}");
                // Everybody comes up once.
                let checks = attempts.iter().filter(|a| a.sending.note.kind == "dup-mac-request");
                assert_eq!(checks.count(), 8, "{mode:?}");
                let mut io = attempts.iter().filter(|a| a.sending.note.position.is_some());
                assert!(io.clone().count() > 300, "{mode:?}");
                assert!(io.next_back().unwrap().start > 29 * S, "{mode:?}");
            }
        }
    }

    #[test]
    fn every_fault_strikes() {
        for fault in Fault::value_variants().iter().filter(|fault| !fault.is_nature()) {
            if fault.is_in_the_tap() {
                continue;
            }
            let order = format!("{}=0.5", fault.name());
            let tried = [Mode::Poll, Mode::Strobe, Mode::Cos].into_iter().any(|mode| {
                [true, false].into_iter().any(|is_acknowledged| {
                    let plan =
                        Plan { is_acknowledged, duration: 40 * S, ..example(mode, &[&order]) };
                    plan.clone().settle().is_ok() && run(plan).1.counts.contains_key(fault)
                })
            });
            assert!(tried, "{} never strikes", fault.name());
        }
    }

    #[test]
    fn destroyed_frames_are_sent_again() {
        let (attempts, fate) = run(example(Mode::Poll, &["stuff=0.02"]));
        let destroyed: Vec<usize> =
            (0..attempts.len()).filter(|n| attempts[*n].flaw.is_some()).collect();
        assert_eq!(destroyed.len() as u64, fate.counts[&Fault::Stuff]);
        for number in destroyed {
            // Next, or after who won the arbitration meanwhile.
            let frame = attempts[number].sending.frame;
            let later = &attempts[number + 1..attempts.len().min(number + 8)];
            assert!(later.iter().any(|attempt| attempt.sending.frame == frame));
        }
    }

    #[test]
    fn nobody_hears_a_lone_encoder() {
        let mut plan = example(Mode::Poll, &["not-acknowledged"]);
        plan.stations.truncate(1);
        let (attempts, _) = run(Plan { duration: S, ..plan });
        assert!(attempts.len() > 500);
        let first = text(&attempts[0].sending.frame);
        assert!(first.starts_with("42F#00D401"));
        assert!(attempts.iter().all(|attempt| text(&attempt.sending.frame) == first));
        assert_eq!(attempts[15].flaw, Some(Flaw::Unacknowledged));
        assert_eq!(attempts[16].flaw, Some(Flaw::UnacknowledgedPassive));
    }

    #[test]
    fn the_same_seed_makes_the_same_bus() {
        let frames = |seed| {
            let plan = Plan { seed, ..example(Mode::Cos, &["no-response=0.1"]) };
            let attempts = run(plan).0;
            let times: Vec<Ps> = attempts.iter().map(|attempt| attempt.start).collect();
            (times, texts(&attempts))
        };
        assert_eq!(frames(1), frames(1));
        assert_ne!(frames(1).1, frames(2).1);
    }

    #[test]
    fn a_late_capture_begins_when_everybody_works() {
        let plan = Plan { starts_late: true, duration: 2 * S, ..example(Mode::Poll, &[]) };
        let (attempts, fate) = run(plan);
        let opened = fate.opened().unwrap();
        assert!(opened > 4 * S);
        let heard = attempts.iter().filter(|attempt| attempt.start >= opened);
        assert!(heard.clone().all(|attempt| attempt.sending.note.kind != "dup-mac-request"));
        assert!(heard.count() > 300);
    }
}
