//! What can be tapped on this machine, and how good it is.
//!
//! All of it is read from what the kernel publishes (sysfs, procfs, netlink). No port is opened:
//! that alone raises DTR and RTS, and takes characters from whoever listens already.

#![cfg_attr(not(target_os = "linux"), allow(dead_code, unused_imports))]

mod can;
mod driver;
mod holder;
mod rate;
mod serial;
mod tree;
mod usable;

pub use can::{CanPort, Link, USUAL_RATE};
pub use driver::{Counters, Driver, Granularity, PROOF, UNPROVEN, is_unproven};
pub use holder::holders;
pub use serial::SerialPort;
pub use usable::Obstacle;

use serde::Serialize;
use std::path::{Path, PathBuf};

/// Where to look, so that tests can look into trees of their own.
pub struct Machine {
    /// Stands for `/`: `sys`, `dev`, `proc` and `etc` are below it.
    root: PathBuf,
    /// Whether the user may read from and write to what is at this path.
    may_use: fn(&Path) -> bool,
    /// What the kernel says of a CAN interface beyond sysfs, by name.
    link: fn(&str) -> Option<Link>,
    /// Whether to look through all processes for those that hold a port.
    asks_who_holds: bool,
}

/// What can be tapped.
#[derive(Serialize, Clone, PartialEq, Debug)]
pub struct Ports {
    /// Serial ports, by name.
    pub serial: Vec<SerialPort>,
    /// CAN interfaces, by name.
    pub can: Vec<CanPort>,
}

impl Machine {
    /// This one.
    pub fn this() -> Self {
        Machine {
            root: PathBuf::from("/"),
            may_use: usable::may_use,
            link: can::link,
            asks_who_holds: true,
        }
    }

    /// This one, but neither who holds a port nor what only netlink tells: for who asks often.
    pub fn at_a_glance() -> Self {
        Machine { asks_who_holds: false, link: |_| None, ..Machine::this() }
    }

    /// Lists what can be tapped; `rates` in Bd are those that the real rate is told of.
    #[cfg(target_os = "linux")]
    pub fn ports(&self, rates: &[u32]) -> Ports {
        Ports { serial: serial::ports(self, rates), can: can::ports(self) }
    }

    /// Lists what can be tapped. Other systems than Linux tell little more than names.
    #[cfg(not(target_os = "linux"))]
    pub fn ports(&self, _rates: &[u32]) -> Ports {
        Ports { serial: serial::ports_of_others(), can: Vec::new() }
    }

    fn path(&self, below: &str) -> PathBuf {
        self.root.join(below)
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests;
