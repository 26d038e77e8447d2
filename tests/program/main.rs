//! What a user would try, through the built program.

mod can;
mod captures;
mod conversions;
mod endings;
mod harness;
#[cfg(target_os = "linux")]
mod line;
mod live;
#[cfg(target_os = "linux")]
mod live_can;
#[cfg(target_os = "linux")]
mod passive;
mod peers;
mod real_captures;
mod record;
mod selection;
#[cfg(target_os = "linux")]
mod serial;
mod set_ups;
mod simulate;
mod snapshots;
#[cfg(target_os = "linux")]
mod soak;
mod streams;
mod telegrams;
mod truth;
