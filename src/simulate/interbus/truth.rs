//! What an observer who misses nothing must find: the generator's own account of the ring.
//!
//! `--truth` is JSON Lines. The first line is the ring, `{"bus":{…}}`: what was ordered, and
//! `every_cycle`, whether the log has a row for every bus cycle; of a line capture the `profile` of
//! the line as well. Then come, in the order of time, the rows of a log:
//!
//! | key | meaning |
//! |---|---|
//! | `row` | number of the row, from 1 |
//! | `time_ns` | ns since the log's start |
//! | `device` | place in the ring, from 1 |
//! | `out`, `in` | the words |
//! | `kind` | as the rows show it |
//! | `service`, `access`, `data` | of a request (data if it writes) or an acknowledgement |
//! | `position` | where the words mean one |
//! | `preset` | somebody used the external preset input |
//! | `expect` | the codes that must be told on this row if the log has every cycle |
//!
//! or the cycles of a line capture:
//!
//! | key | meaning |
//! |---|---|
//! | `cycle` | number, from 1 |
//! | `time_ns`, `end_ns` | first start bit and last stop bit on DO |
//! | `kind` | `id-cycle`, `data-cycle` |
//! | `do`, `di` | all bytes of the frame, loopback word to control word, as they were sent |
//! | `ids` | the ID words, from the first device on |
//! | `words` | of a data cycle: `device`, `out`, `in` of each device |
//! | `damaged` | a fault makes the frame something else than what the devices meant |
//!
//! Between them stand the faults that were injected:
//!
//! | key | meaning |
//! |---|---|
//! | `fault`, `device` | what, and whose; no device: nobody's in particular |
//! | `code` | the finding that must be told, if the log has every cycle |
//! | `time_ns`, `until_ns` | on a record that begins between these |
//! | `may` | codes that may be told besides because of it |
//! | `open` | it was not over when the capture ended: its code need not be told |

use super::fault::Code;
use super::ring::Struck;
use crate::simulate::order::Orderable;
use crate::simulate::time::{NS, Ps};
use serde::Serialize;
use serde_json::{Value, json};

/// A line about a row.
#[derive(Clone, Default, Debug, Serialize)]
pub struct Told {
    /// Its number.
    pub row: u64,
    /// When, in ns.
    pub time_ns: i64,
    /// The device.
    pub device: u16,
    /// What the master sends.
    pub out: String,
    /// What it receives.
    #[serde(rename = "in")]
    pub input: String,
    /// What kind of a row it is.
    pub kind: &'static str,
    /// The service.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub service: Option<u32>,
    /// Whether it is read or written.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub access: Option<&'static str>,
    /// The data of the service.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub data: Option<u32>,
    /// The position.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position: Option<u32>,
    /// Whether somebody used the external preset input.
    #[serde(rename = "preset", skip_serializing_if = "std::ops::Not::not")]
    pub is_preset: bool,
    /// What must be told.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub expect: Vec<Code>,
}

/// A line about a fault. The capture ends at `end`.
pub fn struck(struck: &Struck, end: Ps, start_ns: i64) -> Value {
    let fault = struck.fault;
    let mut line = json!({
        "fault": fault.name(),
        "code": fault.code(),
        "time_ns": start_ns + struck.from / NS,
        "until_ns": start_ns + struck.until.min(end) / NS,
        "may": fault.may(),
    });
    if struck.device > 0 {
        line["device"] = json!(struck.device);
    }
    if struck.until == Ps::MAX {
        line["open"] = json!(true);
    }
    line
}
