//! What ring is to be simulated.

use super::fault::{Fault, Order};
use crate::simulate::motion::Motion;
use crate::simulate::order::Orderable;
use crate::simulate::time::{MS, Ps, S, US};
use anyhow::{Result, ensure};
use std::str::FromStr;

/// Most devices of a ring here. Real ones have 512 at most.
const MOST_DEVICES: usize = 64;

/// A cycle of one device with two words takes 130 bits of 2 µs (Beckhoff: 13·(6+N) bits), and gaps.
const SHORTEST_CYCLE: Ps = 250 * US;

/// The ID word of an LA-66: ident number 51, two words in and out (manual §1).
const LA66: u16 = 0x0233;

/// A device of the ring.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Member {
    /// Whether it is an LA-66.
    pub is_encoder: bool,
    /// Its ID word.
    pub id: u16,
}

impl Member {
    /// An LA-66.
    pub const ENCODER: Member = Member { is_encoder: true, id: LA66 };

    /// Bytes of its register, by the length code of its ID word (Phoenix SUPI 3 manual, tables 3-11
    /// and 3-12). None for codes of less than a byte, and for reserved ones.
    pub fn bytes(self) -> Option<usize> {
        let words = |words: usize| Some(2 * words);
        match self.id >> 8 & 0x1F {
            code @ 0x00..=0x05 => words(usize::from(code)),
            0x06 => words(8),
            0x07 => words(9),
            0x09 => Some(1),
            0x0B => Some(3),
            0x0E => words(6),
            0x0F => words(7),
            0x11 => words(26),
            0x12 => words(16),
            0x13 => words(24),
            0x14 => words(32),
            0x15 => words(10),
            0x16 => words(12),
            0x17 => words(14),
            _ => None,
        }
    }

    /// Whether it takes data from the master, and whether it has some for it: the lowest bits of
    /// its ID word.
    pub fn has(self) -> (bool, bool) {
        (self.id & 0b01 != 0, self.id & 0b10 != 0)
    }
}

impl FromStr for Member {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "la66" {
            return Ok(Member::ENCODER);
        }
        let is_word = text.len() == 4 && text.bytes().all(|digit| digit.is_ascii_hexdigit());
        let id = u16::from_str_radix(text, 16).ok().filter(|_| is_word);
        let member = id.map(|id| Member { is_encoder: false, id });
        member
            .filter(|member| member.bytes().is_some())
            .ok_or("a device is la66, or an ID word of whole bytes such as 0132".to_owned())
    }
}

/// A ring, as it was ordered.
#[derive(Clone, Debug)]
pub struct Plan {
    /// What every chance follows from.
    pub seed: u64,
    /// How long it is watched.
    pub duration: Ps,
    /// The devices, from the master on.
    pub ring: Vec<Member>,
    /// From one bus cycle to the next.
    pub cycle: Ps,
    /// From one look of the PLC at the encoders to the next.
    pub scan: Ps,
    /// Typical time from one service to the next.
    pub pause: Ps,
    /// Measuring length of the rods in mm.
    pub rod: f64,
    /// How the carriages go.
    pub motion: Motion,
    /// How fast on average, in mm a second.
    pub speed: f64,
    /// Whether somebody uses the external preset inputs.
    pub has_external_presets: bool,
    /// What goes wrong.
    pub faults: Vec<Order>,
}

impl Plan {
    /// Bus cycles from one look of the PLC to the next, one at least.
    pub fn scan_cycles(&self) -> u64 {
        u64::try_from(self.scan / self.cycle).unwrap_or(1).max(1)
    }

    /// Bus cycles in a millisecond.
    pub fn cycles_per_ms(&self) -> f64 {
        MS as f64 / self.cycle as f64
    }

    /// Refuses what cannot be.
    ///
    /// # Errors
    /// The reason, in words.
    pub fn settle(self, is_line: bool) -> Result<Plan> {
        let encoders: Vec<usize> =
            (1..).zip(&self.ring).filter(|(_, it)| it.is_encoder).map(|(n, _)| n).collect();
        let most = MOST_DEVICES;
        ensure!((1..=most).contains(&self.ring.len()), "--ring: one to {most} devices");
        ensure!(is_line || !encoders.is_empty(), "--ring: a log is about encoders, name an la66");
        ensure!(
            self.cycle >= SHORTEST_CYCLE,
            "--cycle: 0.25 ms at least, which a ring of one device takes at 500 kbit/s"
        );
        ensure!(self.rod > 0.0, "--rod: longer than nothing");
        ensure!(self.scan < S && self.cycle < S, "--cycle, --plc: less than a second");
        for order in &self.faults {
            let name = order.fault.name();
            ensure!(
                is_line || !order.fault.is_on_the_line(),
                "{name}: only line levels show it, write .sr or .vcd"
            );
            let fits = |number: &usize| order.station.is_none_or(|it| usize::from(it) == *number);
            ensure!(
                order.fault.is_on_the_line() || encoders.iter().any(fits),
                "{name}: there is no encoder at the place that it names"
            );
            ensure!(
                order.fault != Fault::Reconfiguration || self.ring.len() > 1,
                "{name}: the only device cannot leave the ring"
            );
        }
        Ok(self)
    }

    /// Faults of process data that were ordered for this device.
    pub fn orders_for(&self, device: u16) -> impl Iterator<Item = &Order> {
        self.faults.iter().filter(move |order| {
            !order.fault.is_on_the_line()
                && order.station.is_none_or(|station| u16::from(station) == device)
        })
    }
}

/// A ring of LA-66s, for tests.
#[cfg(test)]
pub fn example(ring: &[&str], faults: &[&str]) -> Plan {
    Plan {
        seed: 1,
        duration: 20 * S,
        ring: ring.iter().map(|text| text.parse().unwrap()).collect(),
        cycle: 2 * MS,
        scan: 4 * MS,
        pause: 20 * MS,
        rod: 500.0,
        motion: Motion::StopAndGo,
        speed: 200.0,
        has_external_presets: false,
        faults: faults.iter().map(|text| text.parse().unwrap()).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_length_of_a_register_is_in_the_id_word() {
        // Phoenix Contact IBS SUPI 3, p. 3-22: 02 two words, 01 one word, 06 eight words (not six), 09 a byte, 0B three.
        for (id, bytes) in [("0233", 4), ("0132", 2), ("0633", 16), ("0901", 1), ("0B03", 3)] {
            assert_eq!(id.parse::<Member>().unwrap().bytes(), Some(bytes), "{id}");
        }
        assert_eq!("la66".parse::<Member>().unwrap().bytes(), Some(4));
        for wrong in ["0833", "0D33", "33", "xyz", "+233"] {
            assert!(wrong.parse::<Member>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn what_can_never_strike_is_refused() {
        for (ring, fault, is_line) in [
            (&["la66"][..], "crc", false),
            (&["la66"], "withdrawn@2", false),
            (&["0132"], "withdrawn", true),
            (&["la66"], "reconfiguration", true),
        ] {
            assert!(example(ring, &[fault]).settle(is_line).is_err(), "{fault}");
        }
        assert!(example(&["0132", "la66"], &["withdrawn@2"]).settle(false).is_ok());
    }
}
