//! What the cycles of a line tell about its format, gathered cycle by cycle.

use super::checksum::{Checksum, Covered, Crc};
use super::cycle::{Cycle, Frame, Select};
use super::loopback::{Place, Search, Searches};
use super::profile::{BitOrder, Flag, Loopback, Profile};
use super::receiver::{Flags, StatusFlag};
use super::ring::Ring;
use super::select::{Chosen, Reason, Selects};
use crate::setting::Origin;
use alloc::sync::Arc;

/// How often what is still open is looked at again, in cycles.
const AGAIN: u32 = 16;

/// Everything that was found out from cycles.
#[derive(Debug)]
pub struct Identifier {
    pub given: Profile,
    pub searches: Searches,
    pub selects: Selects,
    pub checksum: Checksum,
    /// What may tell ID cycles: places of flags, by bit.
    pub places: u8,
    pub place: Place,
    /// The bytes of loopback word and registers of the cycles by which it was found.
    usual: usize,
    pub loopback: Option<Loopback>,
    pub order: (BitOrder, Origin, &'static str),
    pub chosen: Option<Chosen>,
    pub ring: Option<Arc<Ring>>,
    /// The ring is that which the user described.
    pub is_ring_given: bool,
    /// Wires of which cycles were heard.
    pub wires: usize,
    unlooked: u32,
}

impl Identifier {
    /// Nothing is known but what the user says.
    pub fn new(given: Profile) -> Self {
        let order = match given.data_bit_order {
            Some(order) => (order, Origin::Given, ""),
            None => (BitOrder::Msb, Origin::Default, "either order gives the same bits"),
        };
        let ring = Ring::given(&given.ring).map(Arc::new);
        Identifier {
            checksum: Checksum::new(given.crc, order.0),
            searches: Searches::default(),
            selects: Selects::default(),
            places: 0b111,
            place: Place::Unknown,
            usual: 0,
            loopback: given.loopback,
            order,
            chosen: None,
            is_ring_given: ring.is_some(),
            ring,
            wires: 1,
            unlooked: 0,
            given,
        }
    }

    pub fn is_turned(&self) -> bool {
        self.order.0 == BitOrder::Lsb
    }

    /// Takes a cycle before anything is made of it.
    pub fn hear(&mut self, flags: Flags, wires: &[Option<Frame>; 2]) {
        let is_good = |frame: &&Frame| frame.is_sound();
        let [first, second] = [0, 1].map(|wire| wires[wire].as_ref().filter(is_good));
        self.wires = self.wires.max(if wires[1].is_some() { 2 } else { 1 });
        match (first, second) {
            (Some(first), Some(second)) => {
                self.searches.hear(flags, first.registers(), Some(second.registers()));
            }
            (Some(only), None) if self.wires == 1 => {
                self.searches.hear(flags, only.registers(), None);
            }
            _ => return,
        }
        self.selects.hear(flags, [first, second].map(|frame| frame.map(Frame::registers)));
        self.unlooked += 1;
        if self.unlooked >= AGAIN && !self.is_place_known() {
            self.conclude();
        }
    }

    /// The wire that comes back to the master.
    fn returning(&self) -> usize {
        match self.place {
            Place::Found { returning, .. } => returning,
            _ => self.wires - 1,
        }
    }

    pub fn is_place_known(&self) -> bool {
        matches!(self.place, Place::Found { .. })
    }

    /// Draws conclusions from the cycles so far.
    pub fn conclude(&mut self) {
        self.unlooked = 0;
        let is_open = !self.is_place_known();
        if let Some(search) = self.searches.most().filter(|_| is_open) {
            self.place = search.place(self.given.loopback, self.is_turned());
            self.usual = search.length();
        }
        self.choose();
        self.find_order();
        self.choose();
        if let (Place::Found { offset, .. }, Some(search)) = (&self.place, self.searches.most()) {
            let value = search.value(self.watched_offset(*offset, search), self.is_turned());
            self.loopback = self.given.loopback.or(Some(value));
        }
        self.learn_ring_of_last();
    }

    /// Where the word stands on the wire whose bytes were watched: of two, the second.
    fn watched_offset(&self, offset: usize, search: &Search) -> usize {
        if self.wires == 2 && self.returning() == 1 { search.length() - 2 } else { offset }
    }

    /// Which flag tells ID cycles, and how.
    fn choose(&mut self) {
        let place = match self.given.flag_order {
            Some(order) => {
                (0..3).zip(order).find(|(_, flag)| *flag == Flag::Select).map(|(p, _)| p)
            }
            None => self.selects.place(self.places),
        };
        let Some(place) = place else { return };
        let orders = match self.order.1 {
            Origin::Default => &[false, true][..],
            _ if self.is_turned() => &[true],
            _ => &[false],
        };
        let fits = |ids: &[u8], data: &[u8]| {
            orders.iter().any(|is_turned| self.is_ring_of(ids, data, *is_turned))
        };
        self.chosen =
            Some(self.selects.choose((place, self.returning()), self.given.id_value, fits));
    }

    /// Whether these are ID words of a ring whose registers are those of a data cycle. Both end
    /// with the loopback word.
    fn is_ring_of(&self, ids: &[u8], data: &[u8], is_turned: bool) -> bool {
        let Some(words) = self.before_loopback(ids) else { return false };
        let ring = Ring::of_identification(words, is_turned);
        ring.is_some_and(|ring| data.len() >= 2 && ring.fits(data.len() - 2))
    }

    /// The registers in front of the loopback word of a cycle that came back.
    fn before_loopback<'a>(&self, back: &'a [u8]) -> Option<&'a [u8]> {
        let Place::Found { offset, .. } = self.place else { return None };
        let at = back.len().checked_sub(2)?;
        // Of one wire alone, it has to be the one that comes back.
        let comes_back = self.wires == 2 || offset > 0 && offset + 2 == self.usual;
        comes_back.then(|| &back[..at])
    }

    /// From which end bytes are read: where the loopback word counts, or ID words fit, from one
    /// end only.
    fn find_order(&mut self) {
        let Place::Found { offset, .. } = self.place else { return };
        if self.order.1 != Origin::Default {
            return;
        }
        let search = self.searches.most();
        let counting =
            search.and_then(|search| search.direction(self.watched_offset(offset, search)));
        let by_ids = self.chosen.and_then(|chosen| {
            let last = |value| self.selects.last(chosen.place, value, self.returning());
            let (ids, data) = (last(chosen.id_value), last(!chosen.id_value));
            match [false, true].map(|is_turned| self.is_ring_of(ids, data, is_turned)) {
                [true, false] => Some(false),
                [false, true] => Some(true),
                _ => None,
            }
        });
        let order = |is_turned| if is_turned { BitOrder::Lsb } else { BitOrder::Msb };
        self.order = match (by_ids, counting) {
            (Some(a), Some(b)) if a != b => return,
            (Some(is_turned), _) => (
                order(is_turned),
                Origin::Found,
                "the lengths in the ID words add up to that of data cycles in this order only",
            ),
            (None, Some(is_turned)) => {
                (order(is_turned), Origin::Found, "the loopback word counts in this order only")
            }
            (None, None) => return,
        };
    }

    /// What a cycle with these flags is.
    pub fn select(&self, flags: Flags) -> Select {
        let is_id = |chosen: &Chosen| {
            let flag = StatusFlag { place: chosen.place, value: chosen.id_value };
            flag.is_status(flags)
        };
        // What nothing tells is not told.
        let is_known = |chosen: &&Chosen| chosen.reason != Reason::Rarer && is_id(chosen);
        match self.chosen.as_ref().filter(is_known) {
            Some(_) => Select::Identification,
            None => Select::Data,
        }
    }

    /// Where the loopback word stands on a wire, in such a cycle with so many bytes before the
    /// checksum.
    fn loopback_at(&self, wire: usize, length: usize, select: Select) -> Option<usize> {
        let Place::Found { offset, returning, .. } = self.place else { return None };
        let end = length.checked_sub(2)?;
        match () {
            () if self.wires == 2 && wire == returning => Some(end),
            () if offset == 0 => Some(0),
            () if self.wires == 1 && offset + 2 == self.usual => Some(end),
            // The registers upstream are ID registers.
            () if select == Select::Identification => {
                self.ring.as_deref()?.upstream(offset).map(|devices| 2 * devices)
            }
            () if length == self.usual => Some(offset),
            () => None,
        }
    }

    /// Says where the loopback word stands.
    pub fn place_loopback(&self, flags: Flags, wires: &mut [Option<Frame>; 2]) {
        let select = self.select(flags);
        for (wire, frame) in wires.iter_mut().enumerate() {
            let Some(frame) = frame else { continue };
            frame.loopback = self.loopback_at(wire, frame.registers().len(), select);
        }
    }

    /// Takes a cycle's checksums.
    pub fn learn_checksum(&mut self, wires: &[Option<Frame>; 2]) {
        for frame in wires.iter().flatten().filter(|frame| frame.is_sound()) {
            if let Some(covered) = covered(frame) {
                self.checksum.learn(covered);
            }
        }
    }

    /// Judges a cycle's checksums.
    pub fn judge(&mut self, wires: &mut [Option<Frame>; 2]) {
        for frame in wires.iter_mut().flatten() {
            let judged = covered(frame).filter(|_| !frame.raw.is_doubtful);
            let crc = judged.map(|covered| self.checksum.judge(covered));
            frame.crc = crc.unwrap_or(Crc::Unverified);
        }
    }

    /// Takes the ring that an ID cycle shows.
    pub fn learn_ring(&mut self, cycle: &Cycle) {
        let is_sound = cycle.trouble.is_none() && !matches!(cycle.crc(), Crc::Bad { .. });
        if cycle.select != Select::Identification || !is_sound {
            return;
        }
        let back = cycle.wires[self.returning()].as_ref();
        let Some(back) = back.map(Frame::registers) else { return };
        let Some(words) = self.before_loopback(back) else { return };
        // Bytes are in the order they are read by now.
        if self.order.1 != Origin::Default {
            self.set_ring(Ring::of_identification(words, false));
        }
    }

    fn learn_ring_of_last(&mut self) {
        let Some(chosen) = self.chosen.filter(|it| it.reason != Reason::Rarer) else { return };
        if self.ring.is_none()
            && self.order.1 != Origin::Default
            && let back = self.selects.last(chosen.place, chosen.id_value, self.returning())
            && let Some(words) = self.before_loopback(back)
        {
            self.set_ring(Ring::of_identification(words, self.is_turned()));
        }
    }

    fn set_ring(&mut self, ring: Option<Ring>) {
        let is_new = |ring: &Ring| self.ring.as_deref() != Some(ring);
        if !self.is_ring_given
            && let Some(ring) = ring.filter(is_new)
        {
            self.ring = Some(Arc::new(ring));
        }
    }

    /// The ring, if so many bytes of registers are those of its devices.
    pub fn ring_of(&self, bytes: usize) -> Option<Arc<Ring>> {
        self.ring.as_ref().filter(|ring| ring.fits(bytes)).cloned()
    }

    /// Cycles of the length seen most.
    pub fn cycles(&self) -> u32 {
        self.searches.most().map_or(0, Search::cycles)
    }
}

fn covered(frame: &Frame) -> Option<Covered<'_>> {
    let word = frame.checksum()?;
    let registers = frame.registers();
    (registers.len() >= 2).then_some(Covered { bytes: registers, loopback: frame.loopback, word })
}
