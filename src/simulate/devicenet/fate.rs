//! Decides when faults strike, and keeps the account of them.

use super::fault::{Code, Fault, Order};
use super::plan::Plan;
use crate::simulate::chance::Chance;
use crate::simulate::order::Orderable;
use crate::simulate::time::{MS, Ps};
use std::collections::BTreeMap;

/// The stream of the seed.
const FAULTS: u64 = 2;

/// A fault that struck, and where it must be found.
#[derive(Clone, Copy, Debug)]
pub struct Struck {
    /// Which.
    pub fault: Fault,
    /// Whom.
    pub station: u8,
    /// When.
    pub from: Ps,
    /// Its code must be told up to here.
    pub until: Ps,
}

impl Struck {
    /// What must be told.
    pub fn code(&self) -> Code {
        self.fault.code()
    }
}

/// Whether faults strike.
pub struct Fate {
    orders: Vec<Order>,
    chance: Chance,
    /// No fault strikes a station before this.
    quiet: [Ps; 64],
    /// From when on faults may strike; the tap hears from here on.
    opens: Option<Ps>,
    duration: Ps,
    struck: Vec<Struck>,
    /// How often each struck.
    pub counts: BTreeMap<Fault, u64>,
    /// Encoders that are to be switched off and on.
    pub power_cycles: Vec<(u8, Ps)>,
}

impl Fate {
    /// Nothing struck yet, and nothing can before the tap listens.
    pub fn new(plan: &Plan) -> Self {
        Fate {
            orders: plan.faults.clone(),
            chance: Chance::new(plan.seed, FAULTS),
            quiet: [0; 64],
            opens: None,
            duration: plan.duration,
            struck: Vec::new(),
            counts: BTreeMap::new(),
            power_cycles: Vec::new(),
        }
    }

    /// The tap listens from here on.
    pub fn open(&mut self, now: Ps) {
        self.opens = self.opens.or(Some(now));
    }

    /// Every slave works. Who begins late begins some moment later.
    pub fn all_at_work(&mut self, now: Ps) {
        if self.opens.is_none() {
            self.opens = Some(now + self.chance.between(50 * MS, 950 * MS));
        }
    }

    /// When the capture ends, if it began.
    pub fn end(&self) -> Option<Ps> {
        self.opens.map(|opens| opens + self.duration)
    }

    /// When it began.
    pub fn opened(&self) -> Option<Ps> {
        self.opens
    }

    /// Whether this fault strikes this station now. If so, that is in the account.
    pub fn strikes(&mut self, fault: Fault, station: u8, now: Ps) -> bool {
        let may = self.could_strike(fault, station, now);
        may && self.falls(fault, station) && {
            self.strike(fault, station, now);
            true
        }
    }

    /// Whether it was ordered, has room before the capture's end, and comes alone.
    fn could_strike(&self, fault: Fault, station: u8, now: Ps) -> bool {
        let (Some(opens), Some(end)) = (self.opens, self.end()) else { return false };
        now >= opens
            && now >= self.quiet[usize::from(station & 63)]
            && now + fault.told_within() < end
            && self.order(fault, station).is_some()
    }

    fn order(&self, fault: Fault, station: u8) -> Option<&Order> {
        let fits = |order: &&Order| {
            order.fault == fault && order.station.is_none_or(|bound| bound == station)
        };
        self.orders.iter().find(fits)
    }

    fn falls(&mut self, fault: Fault, station: u8) -> bool {
        let probability = self.order(fault, station).map_or(0.0, |order| order.probability);
        self.chance.happens(probability)
    }

    /// It strikes now.
    pub fn strike(&mut self, fault: Fault, station: u8, now: Ps) {
        let until = now + fault.told_within();
        self.struck.push(Struck { fault, station, from: now, until });
        *self.counts.entry(fault).or_default() += 1;
        let quiet = &mut self.quiet[usize::from(station & 63)];
        *quiet = (*quiet).max(now + fault.rest());
    }

    /// What struck last may be told as early as then.
    pub fn since(&mut self, from: Ps) {
        if let Some(struck) = self.struck.last_mut() {
            struck.from = struck.from.min(from);
        }
    }

    /// What struck since this was asked for last.
    pub fn take(&mut self) -> Vec<Struck> {
        std::mem::take(&mut self.struck)
    }

    /// Names of those that were ordered and never struck.
    pub fn missing(&self) -> Vec<String> {
        let never =
            |order: &&Order| !order.fault.is_nature() && !self.counts.contains_key(&order.fault);
        self.orders.iter().filter(never).map(|order| order.fault.name()).collect()
    }

    /// How a fault looks where it can look different ways.
    pub fn chance(&mut self) -> &mut Chance {
        &mut self.chance
    }
}
