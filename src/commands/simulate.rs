//! `simulate`: write a bus with chosen faults as a capture.

use clap::{Args, Subcommand};
use std::process::ExitCode;

/// Which bus to simulate.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Which bus.
    #[command(subcommand)]
    pub bus: Bus,
}

/// The buses that can be simulated.
#[derive(Subcommand, Debug)]
pub enum Bus {
    /// Absolute encoders on RS485.
    Slin,
}

/// Writes the capture.
pub fn run(_: &Arguments) -> ExitCode {
    ExitCode::from(2)
}
