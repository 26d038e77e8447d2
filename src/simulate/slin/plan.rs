//! What bus is to be simulated.

use super::encoder::Profile;
use super::fault::{Fault, Order};
use super::line::Parity;
use super::receiver::Setup;
use super::word::Checksum;
use crate::simulate::chance::Chance;
use crate::simulate::motion::Motion;
use crate::simulate::order::Orderable;
use crate::simulate::time::{Clock, MS, Ps};
use anyhow::{Result, bail, ensure};

/// Bits that four data words can hold.
pub const MAX_BITS: u32 = 28;

/// A bus, as it was ordered.
#[derive(Clone, Debug)]
pub struct Plan {
    /// What every chance follows from.
    pub seed: u64,
    /// How long it is watched.
    pub length: Length,
    /// The encoders.
    pub stations: Vec<Station>,
    /// Addresses without an encoder that are asked now and then.
    pub scan: Vec<u8>,
    /// Bits of a position.
    pub bits: u32,
    /// Rate of the line in Bd.
    pub baud: u32,
    /// How the shafts turn.
    pub motion: Motion,
    /// How fast at most, in steps a second; slow enough for every pause of the master if not
    /// given.
    pub speed: Option<f64>,
    /// Where they begin; anywhere if not given.
    pub position: Option<u32>,
    /// Whether leading zero words are kept.
    pub is_length_fixed: bool,
    /// Whether position 0 is sent as a footer alone.
    pub is_zero_a_footer: bool,
    /// By how many percent a clock may be off.
    pub clock_error: f64,
    /// Typical silence before the next request; as short as can be if 0.
    pub pause: Ps,
    /// What goes wrong.
    pub faults: Vec<Order>,
}

/// How long a bus is watched.
#[derive(Clone, Copy, Debug)]
pub enum Length {
    /// This many requests.
    Exchanges(u64),
    /// This long.
    Duration(Ps),
}

/// An encoder, as it was ordered.
#[derive(Clone, Copy, Debug)]
pub struct Station {
    /// Its address.
    pub address: u8,
    /// Whose it is.
    pub profile: Profile,
    /// How it adds up.
    pub checksum: Checksum,
}

/// An address, 0 to 7.
pub fn address(text: &str) -> Result<u8, String> {
    text.parse().ok().filter(|address| *address < 8).ok_or("an address is 0 to 7".to_owned())
}

impl Plan {
    /// The pause of a master that nobody hurries: 2 ms, or 20 characters where that is longer.
    pub fn usual_pause(baud: u32) -> Ps {
        (2 * MS).max(Clock::exact(baud).characters(20.0))
    }

    /// The rate's own clock.
    pub fn clock(&self) -> Clock {
        Clock::exact(self.baud)
    }

    /// A clock as they come: off by some percent.
    pub fn some_clock(&self, chance: &mut Chance) -> Clock {
        Clock::off_by(self.baud, chance.within(-self.clock_error, self.clock_error))
    }

    /// Whether this fault was ordered.
    pub fn has(&self, fault: Fault) -> bool {
        self.faults.iter().any(|order| order.fault == fault)
    }

    /// The fault that spoils everything, if one was ordered.
    pub fn spoilt_by(&self) -> Option<Fault> {
        self.faults.iter().map(|order| order.fault).find(|fault| fault.spoils_everything())
    }

    /// How a tap on this bus is set up: rightly, unless that is the fault.
    pub fn tap(&self) -> Setup {
        let is_other = self.has(Fault::NotSlin);
        Setup {
            baud: if self.has(Fault::WrongRate) { wrong_rate(self.baud) } else { self.baud },
            parity: if is_other { Parity::None } else { Parity::Even },
            is_swapped: self.has(Fault::SwappedLines),
        }
    }

    /// How long the master waits for an answer: about two limits, and a character to hear it.
    pub fn patience(&self) -> Ps {
        let slowest = self.stations.iter().map(|station| station.profile.latest()).max();
        (2 * MS).max(2 * slowest.unwrap_or(MS)) + self.clock().characters(1.0)
    }

    /// About how long it takes to ask every encoder once.
    pub fn cycle(&self) -> Ps {
        let words = f64::from(self.bits.div_ceil(7)) + 2.0;
        let exchange = MS / 2 + self.clock().characters(words) + self.pause;
        exchange * self.stations.len() as Ps
    }

    /// How fast a shaft may turn so that no pause of the master makes it look like a jump: what
    /// is tolerated is a difference of 127 steps.
    pub fn calm_speed(&self) -> f64 {
        let longest = self.cycle() + 30 * MS + self.clock().characters(20.0);
        100.0 / (longest as f64 / crate::simulate::time::S as f64)
    }

    /// Binds faults of one encoder to the lowest where no address is given, and refuses what
    /// cannot be.
    ///
    /// # Errors
    /// The bus cannot be simulated.
    pub fn settle(mut self) -> Result<Plan> {
        if self.has(Fault::NotSlin) {
            self.baud = super::other_protocol::BAUD;
        }
        self.stations.sort_by_key(|station| station.address);
        self.add_scanned()?;
        self.check_addresses()?;
        let lowest = self.stations.first().map(|station| station.address);
        for order in &mut self.faults {
            if order.fault.belongs_to_one() {
                order.station = order.station.or(lowest);
            }
        }
        for order in &self.faults {
            self.check_fault(*order)?;
        }
        let spoiling = self.faults.iter().filter(|order| order.fault.spoils_everything());
        ensure!(spoiling.count() <= 1, "only one fault can spoil the whole bus at a time");
        for station in &self.stations {
            let total: f64 = self.orders_for(station.address).map(|order| order.probability).sum();
            ensure!(
                total <= 1.0 + 1e-9,
                "the probabilities of the faults of station {} add up to {total}: at most 1",
                station.address
            );
        }
        Ok(self)
    }

    /// The faults that may strike an exchange with this station.
    pub fn orders_for(&self, address: u8) -> impl Iterator<Item = &Order> {
        self.faults
            .iter()
            .filter(move |order| order.station.is_none_or(|bound| bound == address))
            .filter(|order| !order.fault.is_bus_wide())
    }

    /// Gives `never-answered` an address to ask.
    fn add_scanned(&mut self) -> Result<()> {
        if self.has(Fault::NeverAnswered) && self.scan.is_empty() {
            let taken =
                |address: u8| self.stations.iter().any(|station| station.address == address);
            let Some(free) = (0..8).find(|address| !taken(*address)) else {
                bail!("never-answered needs an address without an encoder: leave one out");
            };
            self.scan.push(free);
        }
        Ok(())
    }

    fn check_addresses(&self) -> Result<()> {
        ensure!(!self.stations.is_empty(), "there is no encoder: name one with --encoders");
        for pair in self.stations.windows(2) {
            let address = pair[0].address;
            ensure!(address != pair[1].address, "--encoders names address {address} twice");
        }
        for address in &self.scan {
            ensure!(
                !self.stations.iter().any(|station| station.address == *address),
                "address {address} is in --encoders and in --scan: it has an encoder or not"
            );
        }
        Ok(())
    }

    /// Refuses faults that could never strike.
    fn check_fault(&self, order: Order) -> Result<()> {
        let fault = order.fault;
        let name = fault.name();
        let stations = self
            .stations
            .iter()
            .filter(|station| order.station.is_none_or(|address| address == station.address));
        let profiles: Vec<Profile> = stations.map(|station| station.profile).collect();
        ensure!(!profiles.is_empty(), "{name}: there is no encoder at the address it names");
        let has_bit3 = |level| profiles.iter().any(|profile| profile.bit3() == level);
        match fault {
            Fault::EarlyResponse => ensure!(
                profiles.iter().any(|profile| self.earliest_fault(*profile).is_some()),
                "early-response: only TR names a lower limit, and a bit must be shorter than it"
            ),
            Fault::LateResponse => ensure!(
                profiles.iter().any(|profile| self.late_fault(*profile).is_some()),
                "late-response: at {} Bd a bit takes longer than the limit",
                self.baud
            ),
            Fault::NotSlin => ensure!(
                self.faults.len() == 1,
                "not-slin: faults of SLIN cannot strike another protocol, order it alone"
            ),
            Fault::NoDataWords => {
                ensure!(has_bit3(true), "no-data-words: bit 3 is low, order ambiguous instead");
            }
            Fault::Ambiguous => {
                ensure!(has_bit3(false), "ambiguous: bit 3 is high, order no-data-words instead");
            }
            Fault::LateAnswerCrossing => ensure!(
                !self.scan.is_empty(),
                "late-answer-crossing: name an address to ask in vain with --scan"
            ),
            _ => {}
        }
        Ok(())
    }

    /// When an answer begins that is late beyond doubt, and of which nobody says that it does not
    /// come: by more than a bit and what clocks may be off, and well before ten limits are over.
    pub fn late_fault(&self, profile: Profile) -> Option<(Ps, Ps)> {
        let latest = profile.latest();
        let least = latest + self.clock().bits(3.0) + self.clock().characters(0.02) + latest / 10;
        let most = (5 * latest).min(self.patience() - self.clock().characters(1.0));
        (least < 5 * latest).then_some((least, most.max(least)))
    }

    /// The latest begin of an answer that is too early beyond doubt: by more than a bit, what a
    /// receiver may err and what the master's clock may be off.
    pub fn earliest_fault(&self, profile: Profile) -> Option<Ps> {
        let latest = profile.earliest()? - self.clock().bits(1.5) - self.clock().characters(0.02);
        (latest > 8 * crate::simulate::time::US)
            .then_some(latest.min(25 * crate::simulate::time::US))
    }
}

/// A rate of the manuals that is not the line's: the next lower one, or half of the line's.
fn wrong_rate(baud: u32) -> u32 {
    match baud {
        345_594 => 115_200,
        115_200 => 19_200,
        19_200 => 9_600,
        9_600 => 19_200,
        other => other.div_ceil(2),
    }
}

/// A bus of two TR encoders, for tests.
#[cfg(test)]
pub fn example(faults: &[&str]) -> Plan {
    let station = |address| Station { address, profile: Profile::Tr, checksum: Checksum::Addc };
    Plan {
        seed: 1,
        length: Length::Exchanges(400),
        stations: vec![station(3), station(0)],
        scan: Vec::new(),
        bits: 25,
        baud: 115_200,
        motion: Motion::StopAndGo,
        speed: None,
        position: None,
        is_length_fixed: false,
        is_zero_a_footer: false,
        clock_error: 1.0,
        pause: Plan::usual_pause(115_200),
        faults: faults.iter().map(|text| text.parse().unwrap()).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_of_one_encoder_strike_the_lowest() {
        let settled = example(&["duplicate-address", "collision@3", "parity"]).settle().unwrap();
        let addresses: Vec<_> = settled.faults.iter().map(|order| order.station).collect();
        assert_eq!(addresses, [Some(0), Some(3), None]);
        assert_eq!(example(&["never-answered"]).settle().unwrap().scan, [1]);
    }

    #[test]
    fn what_can_never_strike_is_refused() {
        for faults in [
            &["no-data-words"][..],
            &["parity@5"],
            &["late-answer-crossing"],
            &["wrong-rate", "wrong-parity"],
            &["not-slin", "parity"],
            &["parity=0.6", "checksum=0.6"],
        ] {
            assert!(example(faults).settle().is_err(), "{faults:?}");
        }
        let slow = Plan { baud: 300, ..example(&["late-response"]) };
        assert!(slow.settle().is_err(), "a bit lasts 3.3 ms, the limit is 0.4 ms");
        let slow = Plan { baud: 9_600, ..example(&["early-response"]) };
        assert!(slow.settle().is_err(), "a bit lasts 104 µs, the limit is 100 µs");
        let scanned = Plan { scan: vec![3], ..example(&[]) };
        assert!(scanned.settle().is_err());
    }
}
