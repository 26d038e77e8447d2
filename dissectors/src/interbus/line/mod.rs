//! The line of a ring: levels of one or two wires in, cycles out, and what was found out on the way.
//!
//! The wire format is known in shape only, so that everything else is found from the traffic, or
//! given, and told with its evidence. Experimental: no capture of a real ring was at hand.

mod account;
mod checksum;
mod crc;
mod cycle;
mod find;
mod frames;
mod identify;
mod locked;
mod loopback;
mod pairs;
mod profile;
mod receiver;
mod ring;
mod select;
mod trouble;
mod wire;

pub use checksum::Crc;
pub use cycle::{Cycle, Frame, Select, Trouble};
pub use profile::{BitOrder, CrcProfile, Flag, Loopback, Profile, RingDevice};
pub use ring::{Direction, Ring};

use crate::bus::Sampling;
use crate::edges::Edges;
use crate::event::{Event, Levels, Silence};
use crate::line::Listener;
use crate::protocol::Conclusion;
use crate::setting::Setting;
use crate::uart::{self, Baud, Format};
use alloc::{boxed::Box, vec::Vec};
use find::{Check, Found, Given};
use identify::Identifier;
use receiver::{Flags, StatusFlag};
use trouble::Watch;
use wire::{Item, Pace, Pair, Wire, hints, next_pair};

/// Cycles that are held back at most until it is said what they are, and for how long, in s.
const HELD: usize = 256;
const HELD_SECONDS: u64 = 2;

/// Bytes of a control word, and silence in ms that resets all devices (Phoenix Contact; others
/// say 20).
const CONTROL_BYTES: u8 = 2;
const SILENCE_MS: u32 = 25;

/// What the first edges of a line say.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Verdict {
    /// It is a ring's.
    Yes,
    /// It is status telegrams so far.
    Perhaps,
    /// It is something else.
    No,
}

/// Whether the first edges of a line are a ring's: periodic status telegrams of 5 bits, and cycles
/// of data telegrams of 13 with their check phase, at one of the two rates there are.
pub(crate) fn recognize(edges: &Edges, sampling: Sampling, inverted: Option<bool>) -> Verdict {
    let given = Given { inverted, ..given(&Profile::default(), None) };
    let is_usual = |found: &Found| [500_000, 2_000_000].contains(&found.bitrate);
    match find::find(edges, sampling, given).filter(is_usual) {
        Some(found) if found.is_convincing() => Verdict::Yes,
        Some(found) if found.is_idle() => Verdict::Perhaps,
        _ => Verdict::No,
    }
}

/// What the profile says about wires.
fn given(profile: &Profile, inverted: Option<bool>) -> Given {
    let place = |flag: Flag| {
        let order = profile.flag_order?;
        (0..3).zip(order).find(|(_, known)| *known == flag).map(|(place, _)| place)
    };
    let may_be = |status: &StatusFlag| {
        place(Flag::Type).is_none_or(|place| place == status.place)
            && profile.status_value.is_none_or(|value| value == status.value)
    };
    let mut status = 0;
    for (number, flag) in StatusFlag::ALL.iter().enumerate() {
        status |= u8::from(may_be(flag)) << number;
    }
    let check = place(Flag::Control).zip(profile.check_value);
    Given {
        bitrate: profile.bitrate,
        inverted: profile.idle_level.map(|level| !level).or(inverted),
        status,
        check: check.map(|(place, value)| Check { place, value }),
        stop_bits: profile.stop_bits_min.unwrap_or(1),
        check_length: 2 + u16::from(profile.cntr_bytes.unwrap_or(CONTROL_BYTES)),
    }
}

/// The line of a ring.
pub(crate) struct Line {
    sampling: Sampling,
    given: Given,
    wires: Vec<Wire>,
    identifier: Box<Identifier>,
    watch: Watch,
    /// `None` once it is said what cycles are.
    held: Option<Vec<Held>>,
    number: u64,
    last_start: Option<u64>,
    times: Times,
    is_ending: bool,
}

/// What is told.
enum Held {
    Cycle(Raw),
    Silence(u64, u64),
}

/// A cycle of which nothing was made yet.
struct Raw {
    flags: Flags,
    /// A wire that is missing carried nothing; it was heard.
    is_alone: bool,
    wires: [Option<Frame>; 2],
}

/// How long cycles take.
#[derive(Clone, Copy, Default, Debug)]
struct Times {
    count: u64,
    sum: u64,
    least: u64,
    most: u64,
    /// Characters of those cycles.
    characters: u64,
}

impl Line {
    /// A line on which nothing was heard yet.
    pub fn new(sampling: Sampling, profile: Profile, inverted: Option<bool>) -> Self {
        let mut line = Line {
            sampling,
            given: given(&profile, inverted),
            wires: Vec::new(),
            identifier: Box::new(Identifier::new(profile)),
            watch: Watch::default(),
            held: Some(Vec::new()),
            number: 0,
            last_start: None,
            times: Times::default(),
            is_ending: false,
        };
        line.add_wire(0);
        line
    }

    /// The rate, once it is known.
    pub fn wire(&self) -> Option<uart::Wire> {
        let found = self.found().next()?;
        Some(uart::Wire::new(Baud::new(found.bitrate), Format::FT12))
    }

    /// Whether the first wire idles low.
    pub fn is_inverted(&self) -> bool {
        self.found().next().is_some_and(|found| found.shape.is_inverted)
    }

    fn found(&self) -> impl Iterator<Item = &Found> {
        self.wires.iter().filter_map(|wire| wire.found.as_ref())
    }

    /// Level changes on wires that carry something else.
    pub fn strange(&self) -> u64 {
        self.wires.iter().map(Wire::strange).sum()
    }

    /// What was found out, with the evidence.
    pub fn conclusions(&self) -> Vec<Conclusion> {
        account::conclusions(self)
    }

    /// Every question about the line's format, and its answer.
    pub fn settings(&self) -> Vec<Setting> {
        account::settings(self)
    }

    /// Takes the next piece of a wire.
    pub fn hear(&mut self, wire: usize, levels: &Levels<'_>, listener: &mut impl Listener) {
        // A second wire may appear behind the first of what is heard on this one.
        if wire == 0 || self.wires.len() > 1 {
            self.pass_on(listener);
        }
        let Some(heard) = self.wires.get_mut(wire) else { return };
        let pace = heard.hear(levels, self.sampling.ticks_per_second);
        if pace != Pace::Fine {
            self.find_out(wire, pace);
        }
        if self.wires.len() > 1 {
            self.pass_on(listener);
        }
    }

    /// It has another wire of this number: what comes on either is put together.
    pub fn add_wire(&mut self, number: usize) {
        if self.wires.len() < cycle::WIRES {
            let number = number.min(self.wires.len());
            self.wires.insert(number, Wire::new(self.silence()));
        }
    }

    /// The line is not heard any further, or not for a while.
    pub fn end(&mut self, listener: &mut impl Listener) {
        for wire in 0..self.wires.len() {
            if self.wires[wire].is_finding() {
                self.find_out(wire, Pace::Due);
            }
        }
        self.is_ending = true;
        self.pass_on(listener);
        self.release(listener);
        self.is_ending = false;
        self.wires.iter_mut().for_each(Wire::end);
        self.last_start = None;
        self.watch.forget();
    }

    /// Another capture of the same line begins, after [`Line::end`].
    pub fn go_on(&mut self, sampling: Sampling) {
        let factor =
            sampling.ticks_per_second as f64 / self.sampling.ticks_per_second.max(1) as f64;
        self.sampling = sampling;
        let (silence, check_length) = (self.silence(), self.given.check_length);
        self.wires.iter_mut().for_each(|wire| wire.go_on(factor, silence, check_length));
    }

    /// Silence that resets all devices, in ticks.
    fn silence(&self) -> u64 {
        let ms = self.identifier.given.silence_reset_ms.unwrap_or(SILENCE_MS);
        self.sampling.ticks_per_second.saturating_mul(u64::from(ms)) / 1_000
    }

    fn find_out(&mut self, wire: usize, pace: Pace) {
        let given = hints(self.given, &self.wires);
        self.wires[wire].find_out(self.sampling, given, pace);
    }

    /// Makes cycles of the frames that wait.
    fn pass_on(&mut self, listener: &mut impl Listener) {
        while let Some(Pair { items, is_known }) = next_pair(&mut self.wires, self.is_ending) {
            let held = match items {
                [Some(Item::Silence(start, deadline)), _] => Held::Silence(start, deadline),
                // What is sent resets, not what comes back.
                [None, Some(Item::Silence(..))] => continue,
                [first, second] => Held::Cycle(self.raw([first, second], is_known)),
            };
            let is_late = |waiting: &Vec<Held>| self.is_time(waiting, held.start());
            if self.held.as_ref().is_some_and(is_late) {
                self.release(listener);
            }
            match &held {
                Held::Silence(..) => self.identifier.selects.reset(),
                Held::Cycle(raw) => self.learn(raw),
            }
            match &mut self.held {
                Some(waiting) => waiting.push(held),
                None => self.tell(held, listener),
            }
        }
        let now = self.wires.iter().map(Wire::known).min().unwrap_or(0);
        if self.held.as_ref().is_some_and(|held| self.is_time(held, now)) {
            self.release(listener);
        }
    }

    /// Whether what is held is enough, or was held for long enough.
    fn is_time(&self, held: &[Held], now: u64) -> bool {
        let Some(first) = held.first() else { return false };
        let time = now.saturating_sub(first.start()) / self.sampling.ticks_per_second.max(1);
        held.len() >= HELD || time >= HELD_SECONDS
    }

    fn raw(&self, items: [Option<Item>; 2], is_alone: bool) -> Raw {
        let tail = usize::from(self.given.check_length);
        let wires = items.map(|item| match item {
            Some(Item::Frame(raw)) => Some(Frame { raw, tail, ..Frame::default() }),
            _ => None,
        });
        let flags = wires.iter().flatten().map(|frame| frame.raw.flags).next().unwrap_or(0);
        Raw { flags, wires, is_alone }
    }

    fn learn(&mut self, raw: &Raw) {
        self.identifier.places = self.select_places();
        let order = self.identifier.order.0;
        self.identifier.hear(raw.flags, &raw.wires);
        if self.identifier.order.0 != order {
            // From now on bytes are read from their other end.
            self.watch = Watch::default();
        }
    }

    /// Which flags may tell ID cycles: not the others, once they are known.
    fn select_places(&self) -> u8 {
        let check = self.check().map_or(0, |check| 1 << check.place);
        let status = self.status();
        let mut types = (0..3_u8).filter(|place| {
            let mut flags = StatusFlag::ALL.iter().enumerate();
            flags.any(|(number, flag)| status >> number & 1 == 1 && flag.place == *place)
        });
        let only = types.next().filter(|_| types.next().is_none());
        0b111 & !check & !only.map_or(0, |place| 1 << place)
    }

    /// What may tell status telegrams.
    fn status(&self) -> u8 {
        let known = self.wires.iter().filter_map(Wire::status);
        let all = known.fold(self.given.status, |all, status| all & status);
        if all == 0 { self.given.status } else { all }
    }

    fn check(&self) -> Option<Check> {
        self.found().find_map(|found| found.check).or(self.given.check)
    }

    /// It is said what cycles are: those that were held are told.
    fn release(&mut self, listener: &mut impl Listener) {
        let Some(held) = self.held.take() else { return };
        if held.is_empty() {
            self.held = Some(held);
            return;
        }
        self.identifier.conclude();
        let mut held = held;
        for item in &mut held {
            if let Held::Cycle(raw) = item {
                self.identifier.place_loopback(raw.flags, &mut raw.wires);
                self.identifier.learn_checksum(&raw.wires);
            }
        }
        // The first frames could not vote before a form was locked.
        for item in &held {
            if let Held::Cycle(raw) = item {
                self.identifier.learn_checksum(&raw.wires);
            }
        }
        for item in held {
            self.tell(item, listener);
        }
    }

    fn tell(&mut self, held: Held, listener: &mut impl Listener) {
        let Some(wire) = self.wire() else { return };
        match held {
            Held::Silence(start, deadline) => {
                let silence = Silence {
                    start: self.sampling.moment(start),
                    deadline: self.sampling.moment(deadline),
                    uncertainty: self.sampling.uncertainty,
                };
                self.last_start = None;
                listener.hear(wire, Event::Silence(silence));
            }
            Held::Cycle(raw) => {
                let cycle = self.cycle(raw);
                listener.hear(wire, Event::Cycle(&cycle));
                for (wire, frame) in self.wires.iter_mut().zip(cycle.wires) {
                    frame.into_iter().for_each(|frame| wire.reuse(frame.raw));
                }
            }
        }
    }

    /// Everything that is known of a cycle.
    fn cycle(&mut self, mut raw: Raw) -> Cycle {
        let identifier = &mut *self.identifier;
        identifier.place_loopback(raw.flags, &mut raw.wires);
        identifier.learn_checksum(&raw.wires);
        identifier.judge(&mut raw.wires);
        let (start, end) = (raw.start(), raw.end());
        let select = identifier.select(raw.flags);
        if identifier.is_turned() {
            for byte in raw.wires.iter_mut().flatten().flat_map(|frame| &mut frame.raw.bytes) {
                *byte = byte.reverse_bits();
            }
        }
        self.number += 1;
        let cycle_time = self.last_start.map(|last| start.saturating_sub(last));
        self.last_start = Some(start);
        let mut cycle = Cycle {
            number: self.number,
            start: self.sampling.moment(start),
            uncertainty: self.sampling.uncertainty,
            duration: self.ns(end.saturating_sub(start)),
            cycle_time: cycle_time.map(|ticks| self.ns(ticks)),
            select,
            wires: raw.wires,
            ring: None,
            trouble: None,
        };
        let has_partner = self.identifier.wires == 2 && raw.is_alone;
        cycle.trouble = self.watch.judge(&cycle, has_partner);
        self.identifier.learn_ring(&cycle);
        if select == Select::Data {
            let longest = cycle.frames().map(|frame| frame.registers().len()).max();
            cycle.ring = longest.and_then(|bytes| self.identifier.ring_of(bytes.checked_sub(2)?));
            if let (Some(time), Some(longest)) = (cycle.cycle_time, longest) {
                self.times.add(time, longest + usize::from(self.given.check_length));
            }
        }
        cycle
    }

    fn ns(&self, ticks: u64) -> u64 {
        let rate = self.sampling.ticks_per_second.max(1);
        let ns = u128::from(ticks) * 1_000_000_000 / u128::from(rate);
        u64::try_from(ns).unwrap_or(u64::MAX)
    }
}

impl Held {
    fn start(&self) -> u64 {
        match self {
            Held::Cycle(raw) => raw.start(),
            Held::Silence(start, _) => *start,
        }
    }
}

impl Raw {
    fn start(&self) -> u64 {
        self.wires.iter().flatten().map(|frame| frame.raw.start).min().unwrap_or(0)
    }

    fn end(&self) -> u64 {
        self.wires.iter().flatten().map(|frame| frame.raw.end).max().unwrap_or(0)
    }
}

impl Times {
    fn add(&mut self, time: u64, characters: usize) {
        self.least = if self.count == 0 { time } else { self.least.min(time) };
        self.most = self.most.max(time);
        self.count += 1;
        self.sum = self.sum.saturating_add(time);
        self.characters = self.characters.saturating_add(characters as u64);
    }
}
