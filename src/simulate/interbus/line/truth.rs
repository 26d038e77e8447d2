//! The account of a line: see the truth of the ring.

use super::frame::Frame;
use crate::simulate::hex;
use crate::simulate::interbus::ring::Data;
use serde::Serialize;
use serde_json::{Value, json};

/// A line about a cycle.
#[derive(Clone, Debug, Serialize)]
pub struct Cycle {
    /// Its number.
    pub cycle: u64,
    /// Start of the first start bit on DO, in ns.
    pub time_ns: i64,
    /// End of the last stop bit on DO.
    pub end_ns: i64,
    kind: &'static str,
    r#do: String,
    di: String,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    ids: Vec<String>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    words: Vec<Value>,
    /// Whether a fault made it something else than it was meant to be.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub damaged: bool,
}

/// What a cycle is for.
pub enum Purpose<'a> {
    /// To learn these ID words.
    Identify(&'a [u16]),
    /// To exchange these data.
    Exchange(&'a [Data]),
}

impl Cycle {
    /// A line about a cycle that goes over the wires like this.
    pub fn new(cycle: u64, times: (i64, i64), purpose: &Purpose<'_>, frame: &Frame) -> Self {
        let text = |bytes: &[u8]| hex(bytes.iter().copied());
        let words = |data: &Data| json!({ "device": data.device, "out": text(&data.out), "in": text(&data.input) });
        let (kind, ids, words) = match purpose {
            Purpose::Identify(ids) => {
                ("id-cycle", ids.iter().map(|id| format!("{id:04X}")).collect(), Vec::new())
            }
            Purpose::Exchange(data) => ("data-cycle", Vec::new(), data.iter().map(words).collect()),
        };
        Cycle {
            cycle,
            time_ns: times.0,
            end_ns: times.1,
            kind,
            r#do: text(&frame.out),
            di: text(&frame.input),
            ids,
            words,
            damaged: false,
        }
    }
}
