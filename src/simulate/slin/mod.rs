//! A SLIN bus: encoders on RS485, and a master that asks one after the other.
//!
//! Everything goes over one model of the line. The character forms hold what a receiver hears
//! there, the others its level. So a collision, a glitch or a wrong rate looks as it does on a real
//! bus without a rule of its own.

mod account;
mod bus;
mod chars;
mod encoder;
mod exchange;
mod fault;
mod inject;
mod jump;
mod line;
mod master;
mod memory;
mod ongoing;
mod other_protocol;
mod pcapng;
mod plan;
mod receiver;
mod tap;
mod truth;
mod word;

pub use chars::Chars;
pub use encoder::Profile;
pub use fault::{Fault, Order};
pub use pcapng::Pcapng;
pub use plan::{Length, MAX_BITS, Plan, Station, address};
pub use tap::{Tap, Uart};
pub use word::Checksum;

use crate::simulate::time::{MS, Ps};
use anyhow::{Context, Result};
use bus::{Bus, Turn};
use other_protocol::OtherBus;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::Write;
use tap::Stretch;

/// How long the line is watched after the last exchange: until nobody waits for anything.
const QUIET: Ps = 25 * MS;

/// Something that talks on a line.
trait Traffic {
    /// What there is to tell of it beforehand.
    fn facts(&self) -> Value;

    /// The next exchange, or `None` when it is over.
    fn turn(&mut self) -> Option<Turn>;
}

/// What took place.
#[derive(Default, Debug)]
pub struct Summary {
    /// Requests.
    pub exchanges: u64,
    /// How long it took.
    pub duration: Ps,
    /// How often each fault struck.
    pub faults: BTreeMap<String, u64>,
}

/// Lets the bus run, and writes what the tap hears of it and what is true. Times of the truth are
/// counted from `start_ns`.
///
/// # Errors
/// The capture or the truth cannot be written.
pub fn run(
    plan: Plan,
    mut tap: Box<dyn Tap>,
    mut truth: Option<Box<dyn Write>>,
    start_ns: i64,
) -> Result<Summary> {
    let mut traffic: Box<dyn Traffic> = if plan.has(Fault::NotSlin) {
        Box::new(OtherBus::new(plan))
    } else {
        Box::new(Bus::new(plan))
    };
    let mut summary = Summary::default();
    if let Some(truth) = &mut truth {
        writeln!(truth, "{}", json!({ "bus": traffic.facts() })).context(TRUTH)?;
    }
    while let Some(Turn { line, until, gap, mut told }) = traffic.turn() {
        tap.hear(&Stretch { spans: &line.spans(), until, gap })?;
        summary.exchanges += 1;
        summary.duration = until;
        if let Some(fault) = &told.fault {
            *summary.faults.entry(fault.clone()).or_default() += 1;
        }
        if let Some(truth) = &mut truth {
            told.time_ns += start_ns;
            told.end_ns += start_ns;
            serde_json::to_writer(&mut *truth, &told).context(TRUTH)?;
            writeln!(truth).context(TRUTH)?;
        }
    }
    summary.duration += QUIET;
    tap.end(summary.duration)?;
    if let Some(mut truth) = truth {
        truth.flush().context(TRUTH)?;
    }
    Ok(summary)
}

const TRUTH: &str = "cannot write the truth";
