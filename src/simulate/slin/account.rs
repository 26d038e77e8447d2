//! Takes account of the bus: what each exchange was, and what must be told of it.

use super::encoder::Encoder;
use super::exchange::{Disturbance, Script, Times};
use super::fault::Fault;
use super::inject::Effect;
use super::line::Character;
use super::memory::Memory;
use super::plan::Plan;
use super::truth::{May, Told};
use super::word::{self, MAX_DATA_WORDS};
use crate::simulate::chance::Chance;
use crate::simulate::hex;
use crate::simulate::order::Orderable;
use crate::simulate::time::{Clock, NS};
use serde_json::{Value, json};

/// An exchange that took place.
pub struct Exchange<'a> {
    /// Its number, from 1.
    pub number: u64,
    /// What happened.
    pub script: &'a Script,
    /// When.
    pub times: Times,
    /// What was injected.
    pub fault: Option<Fault>,
    /// What that does besides.
    pub effect: Effect,
    /// The exchange whose jump shows now.
    pub jump: Option<u64>,
}

/// What is known of the bus.
pub struct Account {
    memory: [Memory; 8],
    /// Whether nothing can be read as it was sent.
    is_spoilt: bool,
    /// Whether the shafts turn so fast that an unusual pause looks like a jump.
    is_fast: bool,
}

impl Account {
    /// A bus on which nothing happened yet.
    pub fn new(plan: &Plan) -> Self {
        Account {
            memory: Default::default(),
            is_spoilt: plan.spoilt_by().is_some(),
            is_fast: plan.speed.is_some_and(|speed| speed > plan.calm_speed()),
        }
    }

    /// Whether this address answered when it was asked last.
    pub fn answered_last(&self, address: u8) -> bool {
        let memory = &self.memory[usize::from(address)];
        memory.is_heard && memory.silent == 0
    }

    /// One of these addresses that was asked in vain before, as everybody knows.
    pub fn told_unheard(&self, scanned: &[u8]) -> Option<u8> {
        let is_told = |address: &u8| self.memory[usize::from(*address)].is_told_unheard;
        scanned.iter().copied().find(is_told)
    }

    /// An address that an encoder can name in place of its own without being taken for one that
    /// answers late: of another encoder if there is one, else of nobody who was ever asked.
    pub fn other_address(&self, own: u8, encoders: &[u8], chance: &mut Chance) -> Option<u8> {
        let could_be_late = |address: u8| self.memory[usize::from(address)].silent > 0;
        let others = (0..8).filter(|address| *address != own && !could_be_late(*address));
        let (taken, free): (Vec<u8>, Vec<u8>) =
            others.partition(|address| encoders.contains(address) && self.answered_last(*address));
        chance.one_of(if taken.is_empty() { &free } else { &taken })
    }

    /// Takes account of an exchange.
    pub fn tell(&mut self, exchange: Exchange<'_>) -> Told {
        let Exchange { number, script, times, fault, effect, jump } = exchange;
        let asked = script.request.byte & 0x07;
        let footer = script.answer.last().map(|last| last.byte).filter(|byte| byte & 0x80 != 0);
        let is_late = matches!(fault, Some(Fault::LateAnswer | Fault::LateAnswerCrossing));
        let has_time = !is_late && !effect.is_unreadable;
        let begin = times.answer.map(|(begin, _)| begin).filter(|_| has_time);
        let mut told = Told {
            exchange: number,
            time_ns: times.request.0 / NS,
            end_ns: times.end / NS,
            asked,
            address: footer.map(|footer| footer & 0x07),
            position: shown(&script.answer).filter(|_| !effect.is_unreadable),
            bytes: bytes([&[script.request], &script.answer[..]].concat()),
            stray: stray(script),
            response_time_ns: begin.map(|begin| (begin - times.request.1) / NS),
            fault: fault.map(Fault::name),
            about: jump,
            may: effect.may,
            ..Told::default()
        };
        self.expect(&mut told, script, fault);
        if jump.is_some() {
            told.expect("slin.position-jump");
        }
        if self.is_spoilt {
            told.expect.clear();
            told.may = May::ANY;
        } else if self.is_fast {
            told.may.add("slin.position-jump");
        }
        told
    }

    /// What must be told of an exchange.
    fn expect(&mut self, told: &mut Told, script: &Script, fault: Option<Fault>) {
        let asked = &mut self.memory[usize::from(told.asked)];
        let is_footer_alone = script.answer.len() == 1 && script.answer[0].byte & 0x80 != 0;
        match (fault, &script.answer[..]) {
            (Some(Fault::LateAnswer), _) => {
                told.expect_silence(asked.miss());
                asked.hear();
            }
            // Who was asked before answers now; who is asked now was never there.
            (Some(Fault::LateAnswerCrossing), [.., footer]) => {
                self.memory[usize::from(footer.byte & 0x07)].hear();
            }
            (_, []) => told.expect_silence(asked.miss()),
            (_, [footer]) if is_footer_alone && footer.byte & 0x08 == 0 => {
                told.expect("slin.ambiguous");
            }
            (_, [_]) if is_footer_alone => {
                told.expect_silence(asked.hear());
                told.expect("slin.no-data-words");
            }
            (_, [..]) => told.expect_silence(asked.hear()),
        }
        let asked = &mut self.memory[usize::from(told.asked)];
        let is_collision = fault == Some(Fault::Collision);
        if !script.answer.is_empty() && asked.remember_torn(is_collision) {
            told.expect("slin.duplicate-address");
        }
        match fault {
            // Told above, or with the next telegram.
            None | Some(Fault::NoResponse | Fault::Collision | Fault::PositionJump) => {}
            Some(Fault::LateAnswerCrossing) if script.answer.is_empty() => {}
            Some(Fault::DuplicateAddress) => told.expect(asked.answer_twice()),
            Some(fault) => told.expect(fault.code()),
        }
    }
}

/// The position that an answer shows: with a footer, and up to four data words. With none it is
/// 0, if bit 3 tells the footer from a request.
fn shown(answer: &[Character]) -> Option<u32> {
    let (footer, data) = answer.split_last()?;
    let is_answer = footer.byte & 0x80 != 0 && data.len() <= MAX_DATA_WORDS;
    let is_told = !data.is_empty() || footer.byte & 0x08 != 0;
    let words: Vec<u8> = data.iter().map(|word| word.arriving()).collect();
    (is_answer && is_told).then(|| word::position(&words))
}

fn stray(script: &Script) -> Option<String> {
    match &script.extra.as_ref()?.what {
        Disturbance::Low(_) => None,
        Disturbance::Sender(characters, _) => Some(bytes(characters.clone())),
    }
}

fn bytes(characters: Vec<Character>) -> String {
    hex(characters.into_iter().map(Character::arriving))
}

/// The bus as it was ordered, and what chance made of it.
pub fn facts(plan: &Plan, master: Clock, encoders: &[Encoder]) -> Value {
    let encoders: Vec<Value> = encoders
        .iter()
        .map(|encoder| {
            json!({
                "address": encoder.address,
                "profile": encoder.profile.name(),
                "checksum": encoder.checksum.name(),
                "clock_ppm": encoder.clock.ppm(plan.baud),
            })
        })
        .collect();
    let mut facts = json!({
        "protocol": "slin",
        "seed": plan.seed,
        "baud": plan.baud,
        "bits": plan.bits,
        "encoders": encoders,
        "scan": plan.scan,
        "master_clock_ppm": master.ppm(plan.baud),
        "pause_ns": plan.pause / NS,
        "fixed_length": plan.is_length_fixed,
        "zero_as_footer": plan.is_zero_a_footer,
        "faults": plan.faults.iter().map(ToString::to_string).collect::<Vec<_>>(),
        "expect": plan.spoilt_by().map(Fault::code).into_iter().collect::<Vec<_>>(),
    });
    if let Value::Object(facts) = &mut facts {
        facts.retain(|_, value| *value != json!(false));
    }
    facts
}
