//! The encoders: whose they are, and how they answer.

use super::plan::{Plan, Station};
use super::word::{self, Checksum};
use crate::simulate::chance::Chance;
use crate::simulate::motion::{Drive, Motion, Shaft};
use crate::simulate::time::{Clock, MS, Ps, US};
use clap::ValueEnum;

/// Whose encoder it is.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub enum Profile {
    /// Baumer SLIN: footer bit 3 high, plain additions, answer within 1 ms.
    Baumer,
    /// TR SLIN with the reserved bit 3 low: additions with carry, answer after 0.1 to 0.4 ms.
    Tr,
    /// TR SLIN with bit 3 high.
    TrReserveHigh,
}

impl Profile {
    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Profile::Baumer => "baumer",
            Profile::Tr => "tr",
            Profile::TrReserveHigh => "tr-reserve-high",
        }
    }

    /// Bit 3 of its footers (Baumer SLIN §3.2: high; TR SLIN §6: reserved).
    pub fn bit3(self) -> bool {
        self != Profile::Tr
    }

    /// How it adds up (Baumer SLIN §3.3, TR SLIN §7).
    pub fn checksum(self) -> Checksum {
        if self == Profile::Baumer { Checksum::Add } else { Checksum::Addc }
    }

    /// When an answer may begin, counted from the end of the request (TR SLIN §6). Baumer names no
    /// lower limit.
    pub fn earliest(self) -> Option<Ps> {
        (self != Profile::Baumer).then_some(100 * US)
    }

    /// When an answer must have begun (Baumer SLIN §3.2, TR SLIN §6).
    pub fn latest(self) -> Ps {
        if self == Profile::Baumer { MS } else { 400 * US }
    }

    /// When a healthy encoder begins: well within the limits.
    pub fn healthy(self) -> (Ps, Ps) {
        if self == Profile::Baumer { (50 * US, 900 * US) } else { (130 * US, 370 * US) }
    }
}

/// An encoder on the bus.
pub struct Encoder {
    /// Its address, 0 to 7.
    pub address: u8,
    /// Whose it is.
    pub profile: Profile,
    /// How it adds up.
    pub checksum: Checksum,
    /// Bits of a position.
    pub bits: u32,
    /// Whether it keeps leading zero words.
    pub is_length_fixed: bool,
    /// Whether it sends position 0 as a footer alone.
    pub is_zero_a_footer: bool,
    /// What it sends by.
    pub clock: Clock,
    /// What it measures.
    pub shaft: Shaft,
    /// A second encoder with the same address, which has its own clock and shaft.
    pub twin: Option<Box<Encoder>>,
}

impl Encoder {
    /// Its answer: data words and footer.
    pub fn answer(&self, position: u32) -> Vec<u8> {
        if self.is_zero_a_footer && position == 0 {
            return vec![self.footer(&[])];
        }
        let mut words = word::data(position, self.bits, self.is_length_fixed);
        words.push(self.footer(&words));
        words
    }

    /// The footer that goes with these data words.
    pub fn footer(&self, words: &[u8]) -> u8 {
        word::footer(self.address, self.profile.bit3(), self.checksum.of(words))
    }

    /// How long it takes this time to begin its answer.
    pub fn delay(&self, chance: &mut Chance) -> Ps {
        let (earliest, latest) = self.profile.healthy();
        chance.between(earliest, latest)
    }
}

/// Streams of the seed: what is drawn for one encoder changes nothing for another.
const CLOCKS: u64 = 16;
const SHAFTS: u64 = 32;

/// How far the streams of second encoders lie behind those of the first.
const TWINS: u64 = 8;

impl Encoder {
    /// The encoder of a station, with a second one in reserve that has the same address.
    pub fn of(plan: &Plan, station: Station) -> Encoder {
        let twin = Encoder::drawn(plan, station, TWINS);
        Encoder { twin: Some(Box::new(twin)), ..Encoder::drawn(plan, station, 0) }
    }

    fn drawn(plan: &Plan, station: Station, stream: u64) -> Encoder {
        let stream = stream + u64::from(station.address);
        Encoder {
            address: station.address,
            profile: station.profile,
            checksum: station.checksum,
            bits: plan.bits,
            is_length_fixed: plan.is_length_fixed,
            is_zero_a_footer: plan.is_zero_a_footer,
            clock: plan.some_clock(&mut Chance::new(plan.seed, CLOCKS + stream)),
            shaft: shaft(plan, station.address, Chance::new(plan.seed, SHAFTS + stream)),
            twin: None,
        }
    }
}

fn shaft(plan: &Plan, address: u8, mut chance: Chance) -> Shaft {
    let start = chance.below(1 << plan.bits) as u32;
    let speed = plan.speed.unwrap_or(plan.calm_speed());
    let drive = Drive { motion: plan.motion, speed, cycle: plan.cycle() };
    if plan.orders_for(address).any(|order| order.fault.is_at_zero()) {
        let drive = Drive { motion: Motion::Still, ..drive };
        return Shaft::new(1 << plan.bits, 0, drive, chance);
    }
    Shaft::new(1 << plan.bits, plan.position.unwrap_or(start), drive, chance)
}
