//! The list of protocols, and what each of them has to offer.

use crate::can::{Frame, Load};
use crate::device::Devices;
use crate::devicenet::eds::Eds;
use crate::event::{Event, Moment};
use crate::field::{Field, Roles};
use crate::finding::{Code, Finding};
use crate::limit::Limit;
use crate::measure::Measurement;
use crate::record::{BusInfo, Output};
use crate::station::Stations;
use crate::uart::{Character, Wire};
use crate::{can, devicenet, interbus, slin, uart};
use alloc::{boxed::Box, string::String, sync::Arc, vec::Vec};

/// Every protocol that can be spoken on a bus, the most particular first: `auto` takes the first
/// that the traffic speaks for. A new one is added here and nowhere else.
pub static PROTOCOLS: [&Protocol; 5] =
    [&slin::PROTOCOL, &devicenet::PROTOCOL, &interbus::PROTOCOL, &can::PROTOCOL, &uart::PROTOCOL];

/// One protocol: its tables, and how to make a dissector for it.
pub struct Protocol {
    /// Its name on the command line and in records.
    pub name: &'static str,
    /// Its name for people.
    pub title: &'static str,
    /// The kinds its records can have.
    pub kinds: &'static [&'static str],
    /// Its fields. A [`FieldId`] is an index here.
    pub fields: &'static [Field],
    /// Which of its fields play the roles: statistics ask for them with every record.
    pub roles: Roles,
    /// Its finding codes.
    pub codes: &'static [&'static Code],
    /// The limits of its judgement that the user can set.
    pub limits: &'static [Limit],
    /// What it travels on.
    pub medium: Medium,
    /// The wires of one bus that a tap hears side by side, as they are marked: none where there is
    /// one, which has no name.
    pub wires: &'static [&'static str],
    /// Whether the beginning of a bus of its medium speaks for it.
    pub speaks: fn(&Beginning<'_>) -> Speaks,
    /// Makes a dissector for one bus.
    pub dissector: fn(Wire, &Settings) -> Box<dyn Dissector>,
}

impl Protocol {
    /// The protocol of that name.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Protocol> {
        PROTOCOLS.into_iter().find(|protocol| protocol.name == name)
    }

    /// Whether its records may carry a finding of this code: its own, or of what all protocols of
    /// its medium have in common.
    #[must_use]
    pub fn may_find(&self, code: &'static Code) -> bool {
        let common = match self.medium {
            Medium::Serial => Protocol::named("uart"),
            Medium::Can => Protocol::named("can"),
            Medium::Words => None,
        };
        let has = |protocol: &Protocol| protocol.codes.contains(&code);
        has(self) || common.is_some_and(has)
    }
}

impl PartialEq for Protocol {
    fn eq(&self, other: &Self) -> bool {
        core::ptr::eq(self, other)
    }
}

impl core::fmt::Debug for Protocol {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.name)
    }
}

/// Every finding code of every protocol, in the order of the list.
pub fn codes() -> impl Iterator<Item = &'static Code> {
    PROTOCOLS.into_iter().flat_map(|protocol| protocol.codes.iter().copied())
}

/// The codes that this may mean: the one of this name, or else those of which it is what stands
/// behind the point.
#[must_use]
pub fn codes_named(name: &str) -> Vec<&'static Code> {
    match codes().find(|code| code.name == name) {
        Some(code) => Vec::from([code]),
        None => codes().filter(|code| code.name.rsplit('.').next() == Some(name)).collect(),
    }
}

impl Medium {
    /// What it carries, in words.
    #[must_use]
    pub const fn carries(self) -> &'static str {
        match self {
            Medium::Serial => "characters",
            Medium::Can => "CAN frames",
            Medium::Words => "process words",
        }
    }
}

/// What the user decided; everything else is found out.
#[derive(Clone, Default, Debug)]
pub struct Settings {
    /// The protocol, or `None` to find out.
    pub protocol: Option<&'static Protocol>,
    /// Rate, format and polarity of serial lines.
    pub line: uart::LineSettings,
    /// The bit rate of CAN lines.
    pub can: can::Settings,
    /// What is known of SLIN encoders.
    pub slin: slin::Settings,
    /// The limits that DeviceNet traffic is judged by.
    pub devicenet: devicenet::Settings,
    /// What INTERBUS traffic is read and judged by.
    pub interbus: interbus::Settings,
    /// Stations whose device profile is known.
    pub devices: Devices,
    /// The makers' descriptions of DeviceNet devices.
    pub eds: Arc<[Eds]>,
    /// Names and resolutions of stations.
    pub stations: Stations,
}

/// What carries a protocol.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Medium {
    /// Characters of a serial line.
    Serial,
    /// CAN frames.
    Can,
    /// Words of process data, as a controller logs them or a ring carries them.
    Words,
}

/// What was heard first on a bus: some hundred characters or frames.
#[derive(Clone, Copy)]
pub struct Beginning<'a> {
    /// Name and clock.
    pub bus: &'a BusInfo,
    /// Rate and format, as far as they are known.
    pub wire: Wire,
    /// The first characters.
    pub characters: &'a [Character],
    /// The first frames.
    pub frames: &'a [Frame],
    /// What the user decided.
    pub settings: &'a Settings,
}

/// Whether traffic speaks for a protocol.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Speaks {
    /// It does, for this reason.
    Yes(String),
    /// It does not.
    No,
    /// It does not, and this is to be told at the end of the capture.
    NoBut(Finding),
}

/// A dissector: events of one bus in, records out. It is a state machine without a clock: time
/// passes for it only by the events it is given.
pub trait Dissector: Send {
    /// Takes the next event.
    fn hear(&mut self, bus: &BusInfo, event: Event<'_>, out: &mut Output<'_>);

    /// The capture ended at `end`. What could not be finished by then is told, but not judged.
    fn finish(&mut self, bus: &BusInfo, end: Moment, out: &mut Output<'_>);

    /// When silence would mean something: an [`Event::Advance`] to later than this brings records.
    fn deadline(&self) -> Moment;

    /// Takes a finding about the bus as a whole, to be told as an event at the end.
    fn note(&mut self, finding: Finding);

    /// What it found out on its own, with the evidence.
    fn conclusions(&self) -> Vec<Conclusion>;

    /// How busy the bus was, where frames tell.
    fn load(&self) -> Option<Load> {
        None
    }

    /// The rate of the bus was found out: it holds from the next event on.
    fn learn_rate(&mut self, _wire: Wire) {}

    /// What it measured of each station besides response times: for statistics.
    fn measurements(&self) -> Vec<Measurement> {
        Vec::new()
    }
}

/// Something that was found out instead of being told, and why it is believed.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Conclusion {
    /// What it is about, such as `checksum`.
    pub subject: &'static str,
    /// The station it holds for, or the whole bus.
    pub station: Option<u16>,
    /// What was concluded; `None` while undecided.
    pub value: Option<String>,
    /// From what, with the counts.
    pub evidence: String,
}
