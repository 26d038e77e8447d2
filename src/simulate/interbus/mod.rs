//! An INTERBUS ring: a master with a PLC behind it, LA-66 linear encoders, and other devices.
//!
//! ```text
//! plan -> ring (PLC tasks, encoders, faults) -> cycles -> log
//!                                                 \-> line (frames, telegrams) -> two wires
//!                    \-> account -> truth
//! ```
//!
//! The PLC and the encoders each see what the other sent in the bus cycle before, and act on it as
//! the manual of the LA-66 has it. A log shows the words of every cycle or of some; a capture of the
//! line has the same words in the frames of a ring.

mod account;
mod carriage;
mod encoder;
mod fault;
mod line;
mod log;
mod master;
mod plan;
mod ring;
mod script;
mod truth;
mod word;

pub use fault::{Fault, Order};
pub use line::{Profile, random_ring, run as run_line};
pub use log::{Columns, Log};
pub use plan::{Member, Plan};

use crate::simulate::time::{NS, Ps};
use account::Account;
use anyhow::{Context, Result};
use ring::Ring;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::Write;

const TRUTH: &str = "cannot write the truth";

/// What took place.
#[derive(Default, Debug)]
pub struct Summary {
    /// Rows of a log, or cycles on the line.
    pub count: u64,
    /// How long it took.
    pub duration: Ps,
    /// How often each fault struck.
    pub faults: BTreeMap<String, u64>,
}

/// Where the truth goes, if anybody wants to know. Times are counted from `start_ns`.
pub struct Truth {
    out: Option<Box<dyn Write>>,
    start_ns: i64,
}

impl Truth {
    /// The truth goes here.
    pub fn new(out: Option<Box<dyn Write>>, start_ns: i64) -> Self {
        Truth { out, start_ns }
    }

    fn ns(&self, at: Ps) -> i64 {
        self.start_ns + at / NS
    }

    fn tell(&mut self, line: &impl serde::Serialize) -> Result<()> {
        if let Some(out) = &mut self.out {
            serde_json::to_writer(&mut *out, line).context(TRUTH)?;
            writeln!(out).context(TRUTH)?;
        }
        Ok(())
    }

    fn tell_struck(&mut self, struck: &[ring::Struck], end: Ps) -> Result<()> {
        for struck in struck {
            self.tell(&truth::struck(struck, end, self.start_ns))?;
        }
        Ok(())
    }

    fn end(mut self) -> Result<()> {
        self.out.as_mut().map(Write::flush).transpose().context(TRUTH)?;
        Ok(())
    }
}

/// The ring as it was ordered.
fn facts(plan: &Plan) -> Value {
    let ring: Vec<Value> = plan
        .ring
        .iter()
        .map(|member| {
            let device = if member.is_encoder { "la66" } else { "other" };
            json!({ "device": device, "id": format!("{:04X}", member.id), "bytes": member.bytes() })
        })
        .collect();
    json!({
        "protocol": "interbus",
        "seed": plan.seed,
        "ring": ring,
        "cycle_ns": plan.cycle / NS,
        "plc_ns": plan.scan / NS,
        "rod_mm": plan.rod,
        "faults": plan.faults.iter().map(ToString::to_string).collect::<Vec<_>>(),
    })
}

/// Lets the ring run, and writes a log of its encoders and what is true: a row each for every bus
/// cycle, or as seldom as `rows` says.
///
/// # Errors
/// The log or the truth cannot be written.
pub fn run<W: Write>(
    plan: &Plan,
    rows: Option<Ps>,
    mut log: Log<W>,
    mut truth: Truth,
) -> Result<Summary> {
    let mut facts = facts(plan);
    facts["every_cycle"] = json!(rows.is_none_or(|rows| rows <= plan.cycle));
    truth.tell(&json!({ "bus": facts }))?;
    let mut ring = Ring::new(plan);
    let mut accounts = vec![Account::default(); plan.ring.len() + 1];
    let mut summary = Summary::default();
    let (mut now, mut next_row) = (0, 0);
    while now < plan.duration {
        let data = ring.cycle(now);
        truth.tell_struck(&ring.take_struck(), plan.duration)?;
        if now >= next_row {
            next_row += rows.unwrap_or(plan.cycle).max(1);
            for data in data.iter().filter(|data| data.is_encoder) {
                log.row(now, data)?;
                summary.count += 1;
                let mut told = accounts[usize::from(data.device)].tell(data);
                (told.row, told.time_ns) = (summary.count, truth.ns(now));
                truth.tell(&told)?;
            }
        }
        now += plan.cycle;
    }
    truth.tell_struck(&ring.open(), plan.duration)?;
    log.end()?;
    truth.end()?;
    Ok(Summary { duration: plan.duration, faults: ring.counts, ..summary })
}
