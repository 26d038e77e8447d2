//! What bus is to be simulated.

use super::fault::{Fault, Order};
use crate::simulate::chance::Chance;
use crate::simulate::motion::Motion;
use crate::simulate::order::Orderable;
use crate::simulate::time::{Clock, MS, Ps};
use anyhow::{Result, ensure};
use clap::ValueEnum;

/// The bits of the encoders' own disc: 8192 steps a turn, 65536 turns (manual §4).
pub const STEPS_PER_TURN: u32 = 8_192;
/// Largest total resolution (manual §4).
pub const TOTAL_RESOLUTION: u32 = 1 << 29;

/// A MAC ID, 0 to 63.
///
/// # Errors
/// It is none.
pub fn mac(text: &str) -> Result<u8, String> {
    text.parse().ok().filter(|mac| *mac < 64).ok_or("a MAC ID is 0 to 63".to_owned())
}

/// How the scanner gets a slave's position.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub enum Mode {
    /// It asks for it.
    Poll,
    /// The slave produces it when it changed.
    Cos,
    /// The slave produces it again and again.
    Cyclic,
    /// It asks all of them at once.
    Strobe,
}

impl Mode {
    /// The instance of the connection object (class 5).
    pub fn instance(self) -> u8 {
        match self {
            Mode::Poll => 2,
            Mode::Strobe => 3,
            Mode::Cos | Mode::Cyclic => 4,
        }
    }

    /// Its bit of the allocation choice.
    pub fn choice(self) -> u8 {
        match self {
            Mode::Poll => 0x02,
            Mode::Strobe => 0x04,
            Mode::Cos => 0x10,
            Mode::Cyclic => 0x20,
        }
    }

    /// Whether the slave sends without being asked.
    pub fn is_produced(self) -> bool {
        matches!(self, Mode::Cos | Mode::Cyclic)
    }
}

/// An encoder, as it was ordered.
#[derive(Clone, Copy, Debug)]
pub struct Station {
    /// Its MAC ID.
    pub mac: u8,
    /// How it is scanned.
    pub mode: Mode,
    /// What it sends: assembly 1, the position, or 2, the position and two flags.
    pub assembly: u8,
    /// Steps per turn.
    pub steps: u32,
    /// Steps over all turns.
    pub total: u32,
}

/// A bus, as it was ordered.
#[derive(Clone, Debug)]
pub struct Plan {
    /// What every chance follows from.
    pub seed: u64,
    /// How long the tap listens.
    pub duration: Ps,
    /// The scanner's MAC ID.
    pub master: u8,
    /// The encoders.
    pub stations: Vec<Station>,
    /// Bits a second.
    pub bitrate: u32,
    /// By how many percent a clock may be off.
    pub clock_error: f64,
    /// From one scan to the next.
    pub scan: Ps,
    /// The packet rate that the scanner asks for, in ms.
    pub packet_rate: u16,
    /// The inhibit time that it sets for change of state, in ms.
    pub inhibit: u16,
    /// The change that makes an encoder produce, in steps.
    pub delta: u32,
    /// Whether productions are acknowledged.
    pub is_acknowledged: bool,
    /// From one explicit request in between to the next.
    pub errands: Ps,
    /// Seconds between two heartbeats, 0 for none.
    pub heartbeat: u8,
    /// How the shafts turn.
    pub motion: Motion,
    /// How fast at most, in steps of the disc a second.
    pub speed: f64,
    /// Whether the capture starts when everybody is at work.
    pub starts_late: bool,
    /// What goes wrong.
    pub faults: Vec<Order>,
}

impl Plan {
    /// The rate's own clock.
    pub fn clock(&self) -> Clock {
        Clock::exact(self.bitrate)
    }

    /// A clock as they come: off by some percent.
    pub fn some_clock(&self, chance: &mut Chance) -> Clock {
        Clock::off_by(self.bitrate, chance.within(-self.clock_error, self.clock_error))
    }

    /// Whether this fault was ordered.
    pub fn has(&self, fault: Fault) -> bool {
        self.faults.iter().any(|order| order.fault == fault)
    }

    /// Whether this fault was ordered for this station.
    pub fn has_for(&self, fault: Fault, mac: u8) -> bool {
        let fits = |order: &Order| order.station.is_none_or(|station| station == mac);
        self.faults.iter().any(|order| order.fault == fault && fits(order))
    }

    /// Whether there is nobody but one encoder.
    pub fn is_lone(&self) -> bool {
        self.has(Fault::NotAcknowledged)
    }

    /// Gives faults what they need to be seen, and refuses what cannot be.
    ///
    /// # Errors
    /// The bus cannot be simulated.
    pub fn settle(mut self) -> Result<Plan> {
        ensure!(!self.stations.is_empty(), "there is no encoder: name one with --encoders");
        for (number, station) in self.stations.iter().enumerate() {
            let before = &self.stations[..number];
            let mac = station.mac;
            ensure!(
                before.iter().all(|other| other.mac != mac),
                "--encoders names MAC ID {mac} twice"
            );
            ensure!(mac != self.master, "MAC ID {mac} is the scanner's: name another --master");
            ensure!(
                (1..=TOTAL_RESOLUTION).contains(&station.total) && station.total >= station.steps,
                "the total resolution is the steps per turn at least, {TOTAL_RESOLUTION} at most"
            );
        }
        if self.is_lone() {
            ensure!(
                self.stations.len() == 1,
                "not-acknowledged: name one encoder, alone on the bus"
            );
        }
        self.prepare();
        self.check_room()?;
        for order in &self.faults {
            self.check_fault(*order)?;
        }
        Ok(self)
    }

    /// Refuses more frames than the bus can carry: without stuff bits one takes 47 bits and its
    /// data, the space behind it included (CAN 2.0, part A §3.1.1).
    fn check_room(&self) -> Result<()> {
        let bits = |bytes: u8| 47.0 + 8.0 * f64::from(bytes);
        let data = |station: &Station| if station.assembly == 2 { 5 } else { 4 };
        let (mut scanned, mut produced) = (0.0, 0.0);
        for station in &self.stations {
            let answer = bits(data(station));
            match station.mode {
                Mode::Poll => scanned += bits(0) + answer,
                Mode::Strobe => scanned += answer,
                Mode::Cos | Mode::Cyclic if self.is_acknowledged => produced += answer + bits(0),
                Mode::Cos | Mode::Cyclic => produced += answer,
            }
        }
        let has_strobe = self.stations.iter().any(|station| station.mode == Mode::Strobe);
        scanned += if has_strobe { bits(8) } else { 0.0 };
        let share = |bits: f64, time: Ps| match time {
            // In a hurry: a scan begins when the last answer is there.
            0 => 0.0,
            time => self.clock().bits(bits) as f64 / time as f64,
        };
        // Encoders round it up to 10 ms.
        let packet_rate = Ps::from(self.packet_rate.div_ceil(10)) * 10 * MS;
        let load = share(scanned, self.scan) + share(produced, packet_rate);
        ensure!(
            load <= 1.0,
            "--scan, --packet-rate: these encoders would send {:.0} % of what {} kbit/s carry: take \
             longer times, fewer --encoders or a higher --bitrate",
            load * 100.0,
            self.bitrate / 1_000
        );
        Ok(())
    }

    fn prepare(&mut self) {
        if self.has(Fault::DeviceFault) && self.heartbeat == 0 {
            self.heartbeat = 1;
        }
        if self.has(Fault::HighLoad) {
            self.scan = 0;
        }
        for index in 0..self.stations.len() {
            let mac = self.stations[index].mac;
            if self.has_for(Fault::TurnsNotPowerOfTwo, mac) {
                // 100 turns.
                let station = &mut self.stations[index];
                station.steps = station.steps.min(3_600);
                station.total = station.steps * 100;
            }
            if self.has_for(Fault::IoFlood, mac) {
                self.stations[index].mode = Mode::Cos;
            }
        }
    }

    /// Refuses faults that could never strike.
    fn check_fault(&self, order: Order) -> Result<()> {
        use Fault::*;
        let name = order.fault.name();
        let fits = |station: &&Station| order.station.is_none_or(|mac| mac == station.mac);
        let stations: Vec<&Station> = self.stations.iter().filter(fits).collect();
        ensure!(!stations.is_empty(), "{name}: there is no encoder with the MAC ID it names");
        let has = |modes: &[Mode]| stations.iter().any(|station| modes.contains(&station.mode));
        match order.fault {
            NotAllocated => ensure!(
                has(&[Mode::Poll, Mode::Cos, Mode::Cyclic]),
                "{name}: needs --mode poll, cos or cyclic"
            ),
            NoPollResponse => ensure!(has(&[Mode::Poll]), "{name}: needs --mode poll"),
            NoStrobeResponse => ensure!(has(&[Mode::Strobe]), "{name}: needs --mode strobe"),
            HighLoad => ensure!(has(&[Mode::Poll, Mode::Strobe]), "{name}: needs --mode poll"),
            ConnectionTimeout => {
                ensure!(has(&[Mode::Poll, Mode::Strobe]), "{name}: needs --mode poll or strobe");
            }
            InhibitViolated => {
                ensure!(has(&[Mode::Cos]), "{name}: needs --mode cos");
                ensure!(self.inhibit > 4, "{name}: needs --inhibit, 5 ms at least");
            }
            DeltaIgnored => {
                ensure!(has(&[Mode::Cos]), "{name}: needs --mode cos");
                ensure!(self.delta > 3, "{name}: needs --delta, 4 steps at least");
            }
            LateProduction | IoUnacknowledged | UnexpectedAck => {
                ensure!(has(&[Mode::Cos, Mode::Cyclic]), "{name}: needs --mode cos or cyclic");
                ensure!(
                    (order.fault == UnexpectedAck) != self.is_acknowledged
                        || order.fault == LateProduction,
                    "{name}: --no-acknowledge is {}",
                    if self.is_acknowledged { "needed" } else { "in the way" }
                );
            }
            Alarm | Warning => ensure!(
                stations.iter().any(|station| station.assembly == 2),
                "{name}: assembly 1 has no flags, order --assembly 2"
            ),
            PositionOutOfRange => ensure!(
                stations.iter().all(|station| station.total < u32::MAX / 2),
                "{name}: there is no position beyond the total resolution"
            ),
            _ => {}
        }
        Ok(())
    }

    /// The acknowledge timer of the encoders (class 2Bh attribute 1; Hitachi and ABB: 16 ms).
    pub const ACKNOWLEDGE_TIMER: Ps = 16 * MS;
}

/// A bus of three encoders, for tests.
#[cfg(test)]
pub fn example(mode: Mode, faults: &[&str]) -> Plan {
    use crate::simulate::time::S;
    let station =
        |mac| Station { mac, mode, assembly: 2, steps: STEPS_PER_TURN, total: TOTAL_RESOLUTION };
    Plan {
        seed: 1,
        duration: 20 * S,
        master: 0,
        stations: vec![station(5), station(7), station(23)],
        bitrate: 125_000,
        clock_error: 0.02,
        scan: 25 * MS,
        packet_rate: 75,
        inhibit: 20,
        delta: 100,
        is_acknowledged: true,
        errands: 400 * MS,
        heartbeat: 0,
        motion: Motion::StopAndGo,
        speed: 4_000.0,
        starts_late: false,
        faults: faults.iter().map(|text| text.parse().unwrap()).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_can_never_strike_is_refused() {
        for (mode, fault) in [
            (Mode::Poll, "no-strobe-response"),
            (Mode::Cos, "no-poll-response"),
            (Mode::Poll, "inhibit-violated"),
            (Mode::Cos, "unexpected-ack"),
            (Mode::Poll, "alarm@6"),
            (Mode::Poll, "not-acknowledged"),
        ] {
            assert!(example(mode, &[fault]).settle().is_err(), "{fault}");
        }
        assert!(example(Mode::Cyclic, &["io-unacknowledged"]).settle().is_ok());
        // A poll and its answer of 5 bytes: 47 + 47 + 40 bits, of three encoders 402; 3.2 ms at
        // 125 kbit/s, 0.8 ms at 500 kbit/s.
        let every = |scan| Plan { scan, ..example(Mode::Poll, &[]) };
        assert!(every(3 * MS).settle().unwrap_err().to_string().contains("107 % of what 125"));
        assert!(every(4 * MS).settle().is_ok() && every(0).settle().is_ok());
        assert!(Plan { bitrate: 500_000, ..every(MS) }.settle().is_ok());
        assert!(Plan { master: 7, ..example(Mode::Poll, &[]) }.settle().is_err());
    }
}
