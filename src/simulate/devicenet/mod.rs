//! A DeviceNet bus: a scanner with a scan list, and encoders that are Group 2 only servers.
//!
//! ```text
//! plan -> nodes (scanner, encoders) -> arbitration -> wire -> tap -> capture
//!            \-> fate (faults) ---------------------------------> truth
//! ```
//!
//! Nobody here follows a script: the scanner allocates, asks and polls, the encoders answer what
//! they were asked, and each acts on what it hears. So a frame that is destroyed, a slave that
//! restarts or a scanner that looks away have the consequences that they have on a real bus. What
//! is sent is encoded from the manual, the DeviceNet and CAN specifications; frames are as long as
//! their bits.

mod agenda;
mod air;
mod bits;
mod bus;
mod candump;
mod connection;
mod encoder;
mod explicit;
mod fate;
mod fault;
mod frame;
mod incident;
mod job;
mod link;
mod listen;
mod object;
mod pcapng;
mod plan;
mod produce;
mod scanner;
mod serve;
mod tap;
mod truth;
mod wire;

pub use candump::Candump;
pub use fault::{Fault, Order};
pub use pcapng::Pcapng;
pub use plan::{Mode, Plan, STEPS_PER_TURN, Station, TOTAL_RESOLUTION, mac};
pub use tap::Tap;

use crate::simulate::order::Orderable;
use crate::simulate::time::{NS, Ps};
use anyhow::{Context, Result};
use bus::{Attempt, Bus};
use fate::Struck;
use listen::Listener;
use serde_json::json;
use std::collections::BTreeMap;
use std::io::Write;
use tap::Heard;
use truth::Sent;

const TRUTH: &str = "cannot write the truth";

/// What took place.
#[derive(Default, Debug)]
pub struct Summary {
    /// Frames that the tap heard whole.
    pub frames: u64,
    /// How long it listened.
    pub duration: Ps,
    /// How often each fault struck.
    pub faults: BTreeMap<String, u64>,
    /// Faults that were ordered and never struck.
    pub missing: Vec<String>,
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
    let mut listener = Listener::new(&plan);
    let duration = plan.duration;
    let mut bus = Bus::new(plan);
    if let Some(truth) = &mut truth {
        writeln!(truth, "{}", json!({ "bus": bus.facts() })).context(TRUTH)?;
    }
    let mut end = duration;
    while let Some(attempt) = bus.next() {
        let Some(opens) = bus.air.fate.opened().filter(|opens| attempt.free > *opens) else {
            continue;
        };
        let (before, mut during): (Vec<_>, Vec<_>) =
            bus.air.fate.take().into_iter().partition(|struck| struck.from < attempt.start);
        tell_struck(&before, opens, start_ns, &mut truth)?;
        hear(&attempt, opens, start_ns, &mut bus, &mut listener, &mut *tap, &mut truth)?;
        during.extend(bus.air.fate.take());
        tell_struck(&during, opens, start_ns, &mut truth)?;
        end = end.max(attempt.free - opens);
    }
    tap.end(end)?;
    if let Some(mut truth) = truth {
        truth.flush().context(TRUTH)?;
    }
    let counts = &bus.air.fate.counts;
    Ok(Summary {
        frames: listener.frames,
        duration: end,
        faults: counts.iter().map(|(fault, times)| (fault.name(), *times)).collect(),
        missing: bus.air.fate.missing(),
    })
}

/// The tap hears an attempt, and the truth tells of it. A controller hears no frame whose beginning
/// it missed; a tap on the line sees the rest of it.
fn hear(
    attempt: &Attempt,
    opens: Ps,
    start_ns: i64,
    bus: &mut Bus,
    listener: &mut Listener,
    tap: &mut dyn Tap,
    truth: &mut Option<Box<dyn Write>>,
) -> Result<()> {
    let spans = attempt.course.spans(attempt.start - opens, attempt.sending.clock);
    let is_heard = attempt.start >= opens;
    let (what, fortune) = if is_heard {
        listener.hear(attempt, &mut bus.air.fate)
    } else {
        (Vec::new(), truth::Fortune::Missed)
    };
    let (until, at) = (attempt.free - opens, attempt.end - opens);
    tap.hear(&Heard { spans: &spans, until, at, what })?;
    if let Some(truth) = truth.as_mut().filter(|_| is_heard) {
        let times = [attempt.start, attempt.end].map(|time| start_ns + (time - opens) / NS);
        let sending = &attempt.sending;
        let sent = Sent::new(&sending.frame, &sending.note, (times[0], times[1]), fortune);
        serde_json::to_writer(&mut *truth, &sent).context(TRUTH)?;
        writeln!(truth).context(TRUTH)?;
    }
    Ok(())
}

/// The truth tells of faults.
fn tell_struck(
    struck: &[Struck],
    opens: Ps,
    start_ns: i64,
    truth: &mut Option<Box<dyn Write>>,
) -> Result<()> {
    let Some(truth) = truth else { return Ok(()) };
    for struck in struck {
        writeln!(truth, "{}", truth::struck(struck, opens, start_ns)).context(TRUTH)?;
    }
    Ok(())
}
