//! What an observer who misses nothing must find: the generator's own account of the bus.
//!
//! `--truth` is JSON Lines. The first line is the bus, `{"bus":{…}}`: what was ordered, what chance
//! made of it (serial numbers, clock errors in ppm), and `expect`: the codes that the capture must
//! raise once as a whole. Then come the frames in the order of time, a line an attempt to send one:
//!
//! | key | meaning |
//! |---|---|
//! | `frame` | number among those that the tap hears whole, from 1 |
//! | `time_ns`, `end_ns` | first bit, and end of the end of frame, where logs stamp it: ns since the Unix epoch, or since the capture's start where the form has no date |
//! | `id`, `data` | as candump writes them; `extended`, `remote` only if so |
//! | `bits` | on the wire, with stuff bits and intermission |
//! | `kind`, `source`, `destination`, `station` | what it is, whose, and for whom |
//! | `fragment` | `first`, `middle`, `last`, `ack` |
//! | `service`, `class`, `instance`, `attribute` | of a whole message or its last fragment, in answers those of the request |
//! | `position` | what the I/O data hold |
//! | `destroyed` | the fault that destroyed it: it is sent again |
//! | `missed` | the tap did not hear it |
//!
//! Between them stand the faults that were injected:
//!
//! | key | meaning |
//! |---|---|
//! | `fault`, `station` | what, and to whom |
//! | `code` | the finding that must be told |
//! | `time_ns`, `until_ns` | on a record that begins between these |
//! | `may` | codes that may be told besides because of it |

use super::air::Note;
use super::fate::Struck;
use super::frame::{Frame, Id};
use crate::simulate::order::Orderable;
use crate::simulate::time::{NS, Ps};
use serde::Serialize;

/// A line about a frame.
#[derive(Clone, Debug, Serialize)]
pub struct Sent {
    #[serde(skip_serializing_if = "Option::is_none")]
    frame: Option<u64>,
    time_ns: i64,
    end_ns: i64,
    id: String,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    extended: bool,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    remote: bool,
    data: String,
    bits: usize,
    kind: &'static str,
    source: u8,
    #[serde(skip_serializing_if = "Option::is_none")]
    destination: Option<u8>,
    #[serde(skip_serializing_if = "Option::is_none")]
    station: Option<u8>,
    #[serde(skip_serializing_if = "Option::is_none")]
    fragment: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    service: Option<u8>,
    #[serde(skip_serializing_if = "Option::is_none")]
    class: Option<u8>,
    #[serde(skip_serializing_if = "Option::is_none")]
    instance: Option<u8>,
    #[serde(skip_serializing_if = "Option::is_none")]
    attribute: Option<u8>,
    #[serde(skip_serializing_if = "Option::is_none")]
    position: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    destroyed: Option<String>,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    missed: bool,
}

/// What became of an attempt.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Fortune {
    /// The tap hears it as this number.
    Whole(u64),
    /// The tap misses it.
    Missed,
    /// It was destroyed by this.
    Destroyed(String),
}

impl Sent {
    /// A line about an attempt.
    pub fn new(frame: &Frame, note: &Note, times: (i64, i64), fortune: Fortune) -> Self {
        let (id, extended) = match frame.id {
            Id::Standard(id) => (format!("{id:03X}"), false),
            Id::Extended(id) => (format!("{id:08X}"), true),
        };
        let about = note.about;
        let object = about.and_then(|about| about.object);
        Sent {
            frame: if let Fortune::Whole(number) = fortune { Some(number) } else { None },
            time_ns: times.0,
            end_ns: times.1,
            id,
            extended,
            remote: frame.is_remote,
            data: crate::simulate::hex(frame.bytes().iter().copied()),
            bits: super::bits::length(frame),
            kind: note.kind,
            source: note.source,
            destination: note.destination,
            station: note.station,
            fragment: note.piece.name(),
            service: about.map(|about| about.service),
            class: object.map(|(class, _)| class),
            instance: object.map(|(_, instance)| instance),
            attribute: about.and_then(|about| about.attribute),
            position: note.position,
            missed: fortune == Fortune::Missed,
            destroyed: if let Fortune::Destroyed(fault) = fortune { Some(fault) } else { None },
        }
    }
}

/// A line about a fault. Times are counted from the capture's start, which is at `start_ns`.
pub fn struck(struck: &Struck, opens: Ps, start_ns: i64) -> serde_json::Value {
    let ns = |time: Ps| start_ns + (time - opens) / NS;
    serde_json::json!({
        "fault": struck.fault.name(),
        "station": struck.station,
        "code": struck.code(),
        "time_ns": ns(struck.from),
        "until_ns": ns(struck.until),
        "may": struck.fault.may(),
    })
}
