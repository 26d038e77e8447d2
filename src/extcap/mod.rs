//! fieldtap as a capture source of Wireshark ("extcap").
//!
//! Wireshark starts every program in its extcap folders with options of its own, and reads
//! sentences from standard output or packets from a pipe. What it asks for and how it behaves was
//! observed with tshark 4.0:
//!
//! * each listing asks every interface for its options too, so that both must be fast and must not
//!   open a port;
//! * a pipe that is never opened hangs it: the pipe is opened before anything can fail;
//! * whatever is on standard error is shown as an error, even after a good capture: warnings go to
//!   the log of the toolbar, or else into comments;
//! * it stops us with SIGTERM, sometimes SIGPIPE, and waits until we end.

mod call;
mod capture;
mod control;
mod fifo;
pub mod place;
mod sentences;
mod tap;

pub use call::Call;

use call::Verb;
use std::io::{self, Write};
use std::process::ExitCode;

/// Does what Wireshark asked for.
pub fn answer(call: &Call) -> ExitCode {
    let sentences = match call.verb {
        Verb::Interfaces => sentences::interfaces(),
        Verb::Dlts => sentences::link_types(call.interface()),
        Verb::Config if call.asks_for_ports_anew() => sentences::ports_now(),
        Verb::Config => sentences::options(call.interface()),
        Verb::Capture => return capture::capture(call),
        Verb::Other => String::new(),
    };
    // Where nobody reads it to the end, that is no fault.
    let _ = io::stdout().write_all(sentences.as_bytes());
    ExitCode::SUCCESS
}
