//! A SLIN bus that exists only here: encoders that turn, a master that asks, and faults on order.
//!
//! ```text
//! plan -> bus (master, encoders, faults) -> line (levels over time) -> tap -> capture
//!                    \-> account -> truth
//! ```
//!
//! It is the other side of the analyzer and shares nothing with it: what is sent is encoded here
//! from the makers' manuals, and what must be found is told by an account of its own. Where the two
//! sides disagree, one of them has misread the manuals.
//!
//! Everything goes over one model of the line. The character forms hold what a receiver hears
//! there, the others its level. So a collision, a glitch or a wrong rate looks as it does on a real
//! bus without a rule of its own.

mod chance;
mod chars;
mod line;
mod pcapng;
mod receiver;
mod samples;
mod sr;
mod tap;
mod time;
mod vcd;
mod word;
