//! SLIN: absolute encoders on RS485 (Baumer, TR-Electronic).
//!
//! ```text
//! master    1 0 0 0 0 a a a      request: control word for encoder a
//! encoder   0 d d d d d d d      data words, the lowest seven bits of the position first
//! encoder   1 c c c ? a a a      footer: control word with the checksum c
//! ```
//!
//! [`word`] parses telegrams, [`checksum`] knows the readings of the manuals, [`profile`] what is
//! expected and learned. [`Slin`] puts characters into exchanges, by the rules of `grammar`; the
//! `ledger` judges them (`judge`, `station`) and tells them as records (`telegram`).

pub mod checksum;
pub mod codes;
mod dissector;
mod exchange;
mod grammar;
mod judge;
mod ledger;
mod outlet;
pub mod profile;
mod signature;
mod station;
mod telegram;
pub mod word;

pub use dissector::Slin;
pub use profile::{ChecksumChoice, Profile, Settings};

use crate::field::Roles;
use crate::protocol::{Beginning, Dissector, Medium, Protocol, Speaks};
use crate::record::{Output, Record, Sink};
use alloc::{boxed::Box, format, string::String};

/// SLIN in the list of protocols.
pub static PROTOCOL: Protocol = Protocol {
    name: "slin",
    title: "SLIN on RS485",
    kinds: &telegram::KINDS,
    fields: telegram::FIELDS,
    roles: Roles::of(telegram::FIELDS),
    codes: &codes::CODES,
    limits: &[],
    medium: Medium::Serial,
    wires: &[],
    speaks,
    dissector: |wire, settings| Box::new(Slin::new(wire, settings)),
};

/// Reads the first characters as SLIN and looks how much of them makes sense.
fn speaks(beginning: &Beginning<'_>) -> Speaks {
    let Beginning { bus, wire, characters, settings, .. } = *beginning;
    struct Nobody;
    impl Sink for Nobody {
        fn record(&mut self, _: &Record<'_>) {}
    }
    if settings.slin.speak_for_slin() {
        return Speaks::Yes(String::from("its profile or checksum rule was given"));
    }
    let (mut slin, mut number, mut nobody) = (Slin::new(wire, settings), 0, Nobody);
    let mut out = Output::new(&mut number, &mut nobody);
    slin.hear(bus, crate::event::Event::Characters(characters), &mut out);
    slin.finish(bus, crate::event::Moment::UNKNOWN, &mut out);
    let signature = slin.signature();
    let other = signature.other_protocol().and_then(|_| signature.verdict(true));
    match (signature.speaks_for_slin(), other) {
        (Some(complete), _) => Speaks::Yes(format!(
            "{complete} complete exchanges in the first {} characters",
            characters.len()
        )),
        (None, Some(other)) => Speaks::NoBut(other),
        (None, None) => Speaks::No,
    }
}
