//! fieldtap: protocol analyzer and passive bus sniffer for encoder field buses.
//!
//! This is the program as a library, for its own benchmarks and fuzz targets. What others build on
//! is the crate `fieldtap-dissectors`.

// Where the kernel can be asked in no other way, a room of its own allows it, and says why it is
// sound.
#![deny(unsafe_code)]

pub mod cli;
pub mod clock;
pub mod commands;
mod config;
pub mod decode;
pub mod export;
pub mod extcap;
pub mod interrupt;
pub mod output;
pub mod pipeline;
mod ports;
pub mod record;
mod simulate;
pub mod source;
pub mod stations;
mod stdout;
pub mod tally;
pub mod terminal;
pub mod verdict;
