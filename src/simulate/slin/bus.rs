//! The bus: a master that asks one address after the other, and what becomes of it.

use super::Traffic;
use super::account::{self, Account, Exchange};
use super::encoder::Encoder;
use super::exchange::{Script, Senders};
use super::fault::{Fault, Order};
use super::inject::{Effect, Scene};
use super::jump::Steps;
use super::line::{Character, Line, Parity};
use super::master::{Asked, Master};
use super::ongoing::Ongoing;
use super::plan::Plan;
use super::tap::Gap;
use super::truth::Told;
use crate::simulate::chance::Chance;
use crate::simulate::time::{MS, Ps};
use serde_json::Value;

/// Streams of the seed.
const MASTER: u64 = 0;
const MASTERS_CLOCK: u64 = 1;
const FAULTS: u64 = 2;

/// What was on the line from one request to the next.
pub struct Turn {
    /// The line.
    pub line: Line,
    /// The next request does not begin before this.
    pub until: Ps,
    /// What the tap missed.
    pub gap: Option<Gap>,
    /// The account of it.
    pub told: Told,
}

/// How the last exchange went.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Last {
    Healthy,
    Unanswered,
    Spoilt,
}

/// The bus and everybody on it.
pub struct Bus {
    plan: Plan,
    master: Master,
    encoders: Vec<Encoder>,
    steps: Vec<Steps>,
    account: Account,
    chance: Chance,
    parity: Parity,
    now: Ps,
    ongoing: Ongoing,
    last: Last,
}

impl Bus {
    /// A bus as it was ordered, on which nothing happened yet.
    pub fn new(plan: Plan) -> Self {
        let clock = plan.some_clock(&mut Chance::new(plan.seed, MASTERS_CLOCK));
        let is_odd = plan.has(Fault::WrongParity);
        Bus {
            master: Master::new(&plan, clock, Chance::new(plan.seed, MASTER)),
            encoders: plan.stations.iter().map(|station| Encoder::of(&plan, *station)).collect(),
            steps: plan.stations.iter().map(|_| Steps::new(plan.bits)).collect(),
            account: Account::new(&plan),
            chance: Chance::new(plan.seed, FAULTS),
            parity: if is_odd { Parity::Odd } else { Parity::Even },
            now: (5 * MS).max(plan.clock().characters(5.0)),
            ongoing: Ongoing::Nothing,
            last: Last::Healthy,
            plan,
        }
    }
}

impl Traffic for Bus {
    fn facts(&self) -> Value {
        account::facts(&self.plan, self.master.clock, &self.encoders)
    }

    /// The next exchange, unless the bus was watched for long enough.
    fn turn(&mut self) -> Option<Turn> {
        let is_at_peace = self.ongoing == Ongoing::Nothing && self.last == Last::Healthy;
        if self.master.is_done(self.now, is_at_peace) {
            return None;
        }
        if let Ongoing::Crossing { encoder, address } = self.ongoing {
            self.master.requests += 1;
            self.ongoing = Ongoing::Nothing;
            return Some(self.ask_nobody(address, Some(encoder)));
        }
        Some(match self.master.ask(self.last != Last::Spoilt, self.now) {
            Asked::Nobody(address) => self.ask_nobody(address, None),
            Asked::Encoder(encoder) => self.ask(encoder),
        })
    }
}

impl Bus {
    /// An address without an encoder is asked. The answer of the encoder that was asked before may
    /// come now.
    fn ask_nobody(&mut self, address: u8, late: Option<usize>) -> Turn {
        let mut script = self.master.script(address);
        if let Some(encoder) = late {
            let encoder = &mut self.encoders[encoder];
            script.delay = encoder.delay(&mut self.chance);
            let position = encoder.shaft.position_at(self.now);
            script.answer = encoder.answer(position).into_iter().map(Character::new).collect();
        }
        let fault = late.map(|_| Fault::LateAnswerCrossing);
        self.last = if fault.is_some() { Last::Spoilt } else { Last::Unanswered };
        self.play(&script, late.unwrap_or(0), fault, Effect::default(), None)
    }

    fn ask(&mut self, encoder: usize) -> Turn {
        let position = self.encoders[encoder].shaft.position_at(self.now);
        let mut script = self.master.script(self.encoders[encoder].address);
        script.delay = self.encoders[encoder].delay(&mut self.chance);
        let ordered = self.strikes(encoder);
        let spike = match ordered {
            Some(Fault::PositionJump) => self.steps[encoder].spike(position, &mut self.chance),
            _ => None,
        };
        let shown = spike.unwrap_or(position);
        let answer = self.encoders[encoder].answer(shown);
        script.answer = answer.into_iter().map(Character::new).collect();
        let effect = match (ordered, spike) {
            (_, Some(_)) => Some(Effect::default()),
            (Some(fault), None) => self.inject(fault, encoder, position, &mut script),
            (None, None) => None,
        };
        let fault = ordered.filter(|_| effect.is_some());
        let jump = self.ongoing.jump_shown_by(encoder);
        self.remember(encoder, shown, fault);
        self.play(&script, encoder, fault, effect.unwrap_or_default(), jump)
    }

    fn inject(
        &mut self,
        fault: Fault,
        encoder: usize,
        position: u32,
        script: &mut Script,
    ) -> Option<Effect> {
        let is_footer_alone = script.answer.len() == 1;
        if is_footer_alone && fault != Fault::NoResponse {
            return None;
        }
        let senders = self.senders(encoder);
        let addresses: Vec<u8> = self.encoders.iter().map(|encoder| encoder.address).collect();
        let asked = addresses[encoder];
        let other_address = self.account.other_address(asked, &addresses, &mut self.chance);
        let mut scene = Scene {
            script,
            encoder: &mut self.encoders[encoder],
            position,
            now: self.now,
            senders,
            other_address,
            plan: &self.plan,
            chance: &mut self.chance,
        };
        scene.inject(fault)
    }

    /// The fault that strikes the next exchange with this encoder, if one does.
    fn strikes(&mut self, encoder: usize) -> Option<Fault> {
        let address = self.encoders[encoder].address;
        let fate = self.chance.fraction();
        if self.ongoing.silences(encoder) {
            return Some(Fault::NoResponse);
        }
        if self.ongoing != Ongoing::Nothing || !self.account.answered_last(address) {
            return None;
        }
        let is_free = |order: &&Order| self.last != Last::Spoilt || order.probability >= 1.0;
        let mut threshold = 0.0;
        let order = self.plan.orders_for(address).filter(is_free).find(|order| {
            threshold += order.probability;
            fate < threshold
        })?;
        let fault = order.fault;
        self.has_room_for(fault).then_some(fault)
    }

    /// Whether the capture goes on for long enough to tell this fault.
    fn has_room_for(&self, fault: Fault) -> bool {
        let left = self.master.left(self.now);
        match fault {
            Fault::PositionJump | Fault::NoResponse => left > 3 * self.master.round(),
            Fault::LateAnswerCrossing => {
                left > 3 && self.account.told_unheard(&self.plan.scan).is_some()
            }
            _ => left > 1,
        }
    }

    /// What the next exchanges have to know of this one.
    fn remember(&mut self, encoder: usize, shown: u32, fault: Option<Fault>) {
        self.last = if fault.is_some() { Last::Spoilt } else { Last::Healthy };
        match fault {
            None => self.steps[encoder].add(shown),
            Some(Fault::Break | Fault::Overrun | Fault::Lost) => {
                self.steps.iter_mut().for_each(Steps::interrupt);
            }
            Some(_) => self.steps[encoder].interrupt(),
        }
        self.ongoing = match (self.ongoing, fault) {
            (Ongoing::Nothing, Some(fault)) => self.begins(fault, encoder),
            (ongoing, _) => ongoing.after(encoder),
        };
    }

    /// What goes on beyond the exchange that a fault strikes first.
    fn begins(&mut self, fault: Fault, encoder: usize) -> Ongoing {
        match fault {
            Fault::NoResponse => Ongoing::silence(encoder, self.some_silence()),
            Fault::LateAnswerCrossing => self.be_crossed(encoder),
            Fault::PositionJump => Ongoing::jump(encoder, self.master.requests),
            _ => Ongoing::Nothing,
        }
    }

    /// How many more times an encoder is silent: half of the time none, and sometimes so many that
    /// it is a state.
    fn some_silence(&mut self) -> u64 {
        let wanted = if self.chance.happens(0.5) { 0 } else { self.chance.below(6) };
        let room = self.master.left(self.now) / self.master.round();
        wanted.min(room.saturating_sub(2))
    }

    fn be_crossed(&self, encoder: usize) -> Ongoing {
        let empty = self.account.told_unheard(&self.plan.scan);
        empty.map_or(Ongoing::Nothing, |address| Ongoing::Crossing { encoder, address })
    }

    fn senders(&self, encoder: usize) -> Senders {
        let encoder = self.encoders[encoder].clock;
        Senders { master: self.master.clock, encoder, parity: self.parity }
    }

    /// Puts the exchange on the line and takes account of it.
    fn play(
        &mut self,
        script: &Script,
        encoder: usize,
        fault: Option<Fault>,
        effect: Effect,
        jump: Option<u64>,
    ) -> Turn {
        let mut line = Line::default();
        let times = script.play(&mut line, self.now, self.senders(encoder));
        self.now = times.next;
        let told = self.account.tell(Exchange {
            number: self.master.requests,
            script,
            times,
            fault,
            effect,
            jump,
        });
        Turn { line, until: times.next, gap: times.gap, told }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::hex;
    use crate::simulate::order::Orderable;
    use crate::simulate::slin::encoder::Profile;
    use crate::simulate::slin::plan::{Length, example};
    use crate::simulate::slin::receiver::{Heard, Receiver};
    use clap::ValueEnum;

    fn run(plan: Plan) -> Vec<Turn> {
        let mut bus = Bus::new(plan);
        std::iter::from_fn(|| bus.turn()).collect()
    }

    fn with_fault(profile: Profile, order: &str) -> Plan {
        let mut plan = example(&[order]);
        plan.stations.iter_mut().for_each(|station| station.profile = profile);
        Plan { scan: vec![6], ..plan }.settle().unwrap()
    }

    #[test]
    fn a_healthy_bus_tells_nothing_but_the_empty_address() {
        let plan = Plan { scan: vec![6], ..example(&[]) };
        let told: Vec<Told> = run(plan).into_iter().map(|turn| turn.told).collect();
        assert_eq!(told.len(), 400);
        let expected: Vec<_> = told.iter().flat_map(|told| told.expect.clone()).collect();
        assert_eq!(expected, ["slin.never-answered"]);
        assert!(told.iter().filter(|told| told.asked == 6).count() > 5);
        assert!(told.iter().all(|told| told.asked == 6 || told.position.is_some()));
    }

    #[test]
    fn exchanges_do_not_overlap() {
        for order in ["stray-data=0.3", "break=0.3", "late-answer=0.3", "collision=1"] {
            let mut free = 0;
            for turn in run(Plan { pause: 0, ..with_fault(Profile::Tr, order) }) {
                let spans = turn.line.spans();
                assert!(spans.iter().all(|low| low.from >= free && low.to < turn.until));
                free = turn.until;
            }
        }
    }

    #[test]
    fn what_is_told_is_what_is_heard() {
        let plan = with_fault(Profile::Baumer, "parity=0.3");
        let mut receiver = Receiver::new(plan.tap());
        for turn in run(plan) {
            let mut heard: Vec<Heard> = Vec::new();
            receiver.listen(&turn.line.spans(), turn.until, &mut heard);
            assert_eq!(hex(heard.iter().map(|heard| heard.byte)), turn.told.bytes);
            let damaged = heard.iter().filter(|heard| !heard.state.is_good()).count();
            assert_eq!(damaged, usize::from(turn.told.fault.is_some()));
            assert_eq!(turn.told.expect.contains(&"slin.parity"), damaged == 1);
        }
    }

    #[test]
    fn every_fault_strikes_and_must_be_found() {
        for fault in Fault::value_variants().iter().filter(|fault| !fault.is_bus_wide()) {
            let profile = if *fault == Fault::NoDataWords { Profile::Baumer } else { Profile::Tr };
            let turns = run(with_fault(profile, &format!("{}=0.5", fault.name())));
            let struck = turns.iter().filter(|turn| turn.told.fault == Some(fault.name())).count();
            assert!(struck > 5, "{} struck {struck} times", fault.name());
            let found =
                turns.iter().filter(|turn| turn.told.expect.contains(&fault.code())).count();
            assert!(found > 0, "{} is never told", fault.name());
        }
    }

    #[test]
    fn the_same_seed_makes_the_same_line() {
        let spans = |seed| -> Vec<_> {
            let plan = Plan { seed, ..with_fault(Profile::Tr, "parity=0.1") };
            run(plan).into_iter().flat_map(|turn| turn.line.spans()).collect()
        };
        assert_eq!(spans(1), spans(1));
        assert_ne!(spans(1), spans(2));
    }

    #[test]
    fn a_bus_is_watched_for_as_long_as_ordered() {
        let length = Length::Duration(500 * MS);
        let turns = run(Plan { length, ..with_fault(Profile::Tr, "no-response=0.3") });
        let end = turns.last().map(|turn| turn.until).unwrap();
        assert!((500 * MS..600 * MS).contains(&end));
        assert!(turns.last().unwrap().told.fault.is_none());
    }
}
