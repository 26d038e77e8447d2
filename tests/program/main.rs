//! What a user would try, through the built program.

// What rings of tests are made by is shared with the tests of the dissectors, which know them as this.
extern crate dissectors as fieldtap_dissectors;

mod account;
mod can;
mod captures;
mod channels;
mod conversions;
mod devicenet;
mod devices;
mod endings;
mod extcap;
mod harness;
mod healthy;
#[cfg(target_os = "linux")]
mod line;
mod lines;
mod live;
#[cfg(target_os = "linux")]
mod live_can;
mod mistakes;
#[cfg(target_os = "linux")]
mod passive;
mod peers;
mod process_words;
mod real_captures;
mod record;
#[path = "../../dissectors/tests/ring/mod.rs"]
mod ring;
mod ring_lines;
mod ring_logs;
mod rings;
mod selection;
#[cfg(target_os = "linux")]
mod serial;
mod set_ups;
mod simulate;
mod snapshots;
#[cfg(target_os = "linux")]
mod soak;
mod stats;
mod streams;
mod telegrams;
#[cfg(target_os = "linux")]
mod terminal;
mod truth;
mod wireshark;
