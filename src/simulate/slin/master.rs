//! The master: whom it asks when, and how long it waits.

use super::exchange::Script;
use super::line::Character;
use super::plan::{Length, Plan};
use super::word;
use crate::simulate::chance::Chance;
use crate::simulate::time::{Clock, Ps};

/// How often a round ends with an address that has no encoder.
const SCANS: f64 = 0.25;

/// Longest silence between two words of an answer, in bits.
const UNEVENNESS: f64 = 0.2;

/// Who is asked.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Asked {
    /// An encoder, by its place in the list.
    Encoder(usize),
    /// An address without one.
    Nobody(u8),
}

/// The master of a bus.
pub struct Master {
    /// What it sends by.
    pub clock: Clock,
    /// Requests so far.
    pub requests: u64,
    length: Length,
    encoders: usize,
    scan: Vec<u8>,
    /// The encoder that is asked next, and the place in the list of empty addresses.
    next: usize,
    next_empty: usize,
    nominal: Clock,
    pause: Ps,
    patience: Ps,
    /// About how long an exchange takes.
    exchange: Ps,
    chance: Chance,
}

impl Master {
    /// A master that asked nobody yet.
    pub fn new(plan: &Plan, clock: Clock, chance: Chance) -> Self {
        Master {
            clock,
            requests: 0,
            length: plan.length,
            encoders: plan.stations.len(),
            scan: plan.scan.clone(),
            next: 0,
            next_empty: 0,
            nominal: plan.clock(),
            pause: plan.pause,
            patience: plan.patience(),
            exchange: plan.cycle() / plan.stations.len() as Ps,
            chance,
        }
    }

    /// Whom it asks next. Empty addresses come at the end of a round, if they may come now.
    pub fn ask(&mut self, may_scan: bool, now: Ps) -> Asked {
        self.requests += 1;
        if self.next == self.encoders {
            self.next = 0;
            let scans = self.chance.happens(SCANS);
            if scans && may_scan && !self.scan.is_empty() && self.left(now) > 0 {
                self.next_empty = (self.next_empty + 1) % self.scan.len();
                return Asked::Nobody(self.scan[self.next_empty]);
            }
        }
        self.next += 1;
        Asked::Encoder(self.next - 1)
    }

    /// What it does when it asks an address, and nobody answers.
    pub fn script(&mut self, address: u8) -> Script {
        let rest = if self.pause == 0 {
            self.nominal.bits(self.chance.within(3.0, 6.0))
        } else {
            let half = self.pause / 2;
            self.chance.between(half, self.pause + half).max(self.nominal.bits(3.0))
        };
        Script {
            pause: 0,
            request: Character::new(word::request(address)),
            delay: 0,
            answer: Vec::new(),
            gap: self.nominal.bits(self.chance.within(0.0, UNEVENNESS)),
            extra: None,
            patience: self.chance.between(self.patience, self.patience + self.patience / 10),
            rest,
            missed: None,
        }
    }

    /// Requests that are still to come, about.
    pub fn left(&self, now: Ps) -> u64 {
        match self.length {
            Length::Exchanges(exchanges) => exchanges.saturating_sub(self.requests),
            Length::Duration(end) => u64::try_from((end - now) / self.exchange).unwrap_or(0),
        }
    }

    /// Whether the bus was watched for long enough. A time is only a wish: the end should not tear
    /// anything that goes on.
    pub fn is_done(&self, now: Ps, is_at_peace: bool) -> bool {
        match self.length {
            Length::Exchanges(exchanges) => self.requests >= exchanges,
            Length::Duration(end) => now >= end && is_at_peace,
        }
    }

    /// About how many requests a round has.
    pub fn round(&self) -> u64 {
        self.encoders as u64 + u64::from(!self.scan.is_empty())
    }
}
