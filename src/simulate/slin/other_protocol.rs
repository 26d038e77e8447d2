//! Baumer's other RS485 protocol, of the same encoders without SLIN: what a tap on the wrong bus
//! hears.
//!
//! Data sheet of the GXM7W with RS485: 38.4 kBd, no parity, addresses 02h to 05h.
//!
//! ```text
//! master   SOH 80h ADR 80h EOT
//! encoder  SOH EAD MT_H MT_L ST_H ST_L LRC EOT     LRC: the five before it, XORed
//! ```

use super::Traffic;
use super::bus::Turn;
use super::line::{Character, Line, Parity};
use super::plan::{Length, Plan};
use super::truth::{May, Told};
use crate::simulate::chance::Chance;
use crate::simulate::hex;
use crate::simulate::motion::{Drive, Shaft};
use crate::simulate::time::{Clock, MS, NS, Ps};
use serde_json::{Value, json};

/// The rate of the data sheet.
pub const BAUD: u32 = 38_400;

const SOH: u8 = 0x01;
const EOT: u8 = 0x04;
const LOWEST_ADDRESS: u8 = 0x02;
const ADDRESSES: usize = 4;

/// Steps of a revolution: 13 bits single-turn.
const STEPS: u32 = 1 << 13;

/// Bits of a position: 13 bits single-turn and 12 bits multi-turn.
const BITS: u32 = 25;

/// A bus of such encoders.
pub struct OtherBus {
    plan: Plan,
    shafts: Vec<Shaft>,
    clock: Clock,
    chance: Chance,
    now: Ps,
    exchanges: u64,
}

impl OtherBus {
    /// A bus with as many encoders as were ordered, four at most.
    pub fn new(plan: Plan) -> Self {
        let mut chance = Chance::new(plan.seed, 0);
        let drive = Drive { motion: plan.motion, speed: plan.calm_speed(), cycle: plan.cycle() };
        let shafts = (0..plan.stations.len().min(ADDRESSES))
            .map(|number| {
                let start = chance.below(1 << BITS) as u32;
                Shaft::new(1 << BITS, start, drive, Chance::new(plan.seed, 1 + number as u64))
            })
            .collect();
        let clock = Clock::exact(BAUD);
        OtherBus { plan, shafts, clock, chance, now: 5 * MS, exchanges: 0 }
    }

    fn send(&self, line: &mut Line, bytes: &[u8], at: Ps) -> Ps {
        bytes
            .iter()
            .fold(at, |time, byte| line.send(Character::new(*byte), time, self.clock, Parity::None))
    }
}

impl Traffic for OtherBus {
    fn facts(&self) -> Value {
        json!({
            "protocol": "baumer-rs485",
            "seed": self.plan.seed,
            "baud": BAUD,
            "encoders": self.shafts.len(),
            "expect": ["slin.not-slin"],
        })
    }

    fn turn(&mut self) -> Option<Turn> {
        let is_done = match self.plan.length {
            Length::Exchanges(exchanges) => self.exchanges >= exchanges,
            Length::Duration(end) => self.now >= end,
        };
        if is_done {
            return None;
        }
        let number = (self.exchanges % self.shafts.len() as u64) as usize;
        let address = LOWEST_ADDRESS + number as u8;
        self.exchanges += 1;
        let position = self.shafts[number].position_at(self.now);
        let mut line = Line::default();
        let begin = self.now;
        let asked = self.send(&mut line, &request(address), begin);
        let answered = asked + self.chance.between(MS, 2 * MS);
        let end = self.send(&mut line, &reply(address, position), answered);
        let pause = self.plan.pause.max(self.clock.bits(3.0));
        self.now = end + self.chance.between(pause / 2, pause + pause / 2);
        let bytes = request(address).into_iter().chain(reply(address, position));
        let told = Told {
            exchange: self.exchanges,
            time_ns: begin / NS,
            end_ns: end / NS,
            asked: address,
            address: Some(address),
            position: Some(position),
            bytes: hex(bytes),
            may: May::ANY,
            ..Told::default()
        };
        Some(Turn { line, until: self.now, gap: None, told })
    }
}

fn request(address: u8) -> [u8; 5] {
    [SOH, 0x80, address, 0x80, EOT]
}

fn reply(address: u8, position: u32) -> [u8; 8] {
    let [turns_high, turns_low] = ((position / STEPS) as u16).to_be_bytes();
    let [steps_high, steps_low] = ((position % STEPS) as u16).to_be_bytes();
    let check = address ^ turns_high ^ turns_low ^ steps_high ^ steps_low;
    [SOH, address, turns_high, turns_low, steps_high, steps_low, check, EOT]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reply_of_the_data_sheet() {
        // 3 turns and 4660 (1234h) steps: 02h ^ 00h ^ 03h ^ 12h ^ 34h = 27h.
        let position = 3 * STEPS + 4_660;
        assert_eq!(reply(2, position), [0x01, 0x02, 0, 3, 0x12, 0x34, 0x27, 0x04]);
        assert_eq!(request(5), [0x01, 0x80, 0x05, 0x80, 0x04]);
    }
}
