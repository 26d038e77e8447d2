//! ID cycles and data cycles: which flag tells them, and which of its values means which.

use super::cycle::WIRES;
use super::receiver::{Flags, bit};
use alloc::vec::Vec;

/// What was seen of cycles with the same flags in their data phase.
#[derive(Clone, Default, Debug)]
struct Group {
    cycles: u32,
    /// Of these the first behind a reset of the ring.
    after_reset: u32,
    /// Loopback word and registers of the last of them, on each wire.
    last: [Vec<u8>; WIRES],
}

/// Watches the flags of cycles.
#[derive(Clone, Default, Debug)]
pub struct Selects {
    groups: [Group; 8],
    is_reset: bool,
}

/// What tells ID cycles, and why it is believed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Chosen {
    /// The place of the flag.
    pub place: u8,
    /// Its value in ID cycles.
    pub id_value: bool,
    /// Why.
    pub reason: Reason,
}

/// Why a value is believed to mean ID cycles.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Reason {
    /// The user says so.
    Given,
    /// The lengths in its ID words add up to those of the other cycles.
    Lengths,
    /// It came first after a reset, so many times.
    AfterReset(u32),
    /// Nothing tells: it is rarer.
    Rarer,
}

impl Selects {
    /// The ring was reset.
    pub fn reset(&mut self) {
        self.is_reset = true;
    }

    /// Takes a good cycle: its flags, and what its wires carried.
    pub fn hear(&mut self, flags: Flags, wires: [Option<&[u8]>; WIRES]) {
        let group = &mut self.groups[usize::from(flags & 7)];
        group.cycles = group.cycles.saturating_add(1);
        group.after_reset += u32::from(core::mem::take(&mut self.is_reset));
        for (last, bytes) in group.last.iter_mut().zip(wires) {
            last.clear();
            last.extend_from_slice(bytes.unwrap_or_default());
        }
    }

    /// The flag, if one of the `places` and no other was seen with both values.
    #[must_use]
    pub fn place(&self, places: u8) -> Option<u8> {
        let both = |place: &u8| {
            let seen = |value| self.count(*place, value) > 0;
            places >> place & 1 == 1 && seen(false) && seen(true)
        };
        let mut varying = (0..3).filter(both);
        varying.next().filter(|_| varying.next().is_none())
    }

    /// Which value of the flag at a place means ID cycles. `fits` says whether the one group's
    /// bytes on the wire that comes back are ID words of a ring that the other's fit.
    #[must_use]
    pub fn choose(
        &self,
        (place, back): (u8, usize),
        given: Option<bool>,
        fits: impl Fn(&[u8], &[u8]) -> bool,
    ) -> Chosen {
        let chosen = |id_value, reason| Chosen { place, id_value, reason };
        if let Some(value) = given {
            return chosen(value, Reason::Given);
        }
        let last = |value| self.last(place, value, back);
        let says = [false, true].map(|value| fits(last(value), last(!value)));
        match says {
            [true, false] => return chosen(false, Reason::Lengths),
            [false, true] => return chosen(true, Reason::Lengths),
            _ => {}
        }
        let after = [false, true].map(|value| {
            let groups = self.with(place, value);
            groups.map(|group| group.after_reset).sum::<u32>()
        });
        match after {
            [0, count] if count > 0 => chosen(true, Reason::AfterReset(count)),
            [count, 0] if count > 0 => chosen(false, Reason::AfterReset(count)),
            _ => chosen(self.count(place, true) <= self.count(place, false), Reason::Rarer),
        }
    }

    /// The last cycle with a value of the flag: loopback word and registers on a wire.
    #[must_use]
    pub fn last(&self, place: u8, value: bool, wire: usize) -> &[u8] {
        let most = self.with(place, value).max_by_key(|group| group.cycles);
        most.map_or(&[], |group| &group.last[wire])
    }

    /// How many cycles had that value.
    #[must_use]
    pub fn count(&self, place: u8, value: bool) -> u32 {
        self.with(place, value).map(|group| group.cycles).sum()
    }

    fn with(&self, place: u8, value: bool) -> impl Iterator<Item = &Group> {
        let groups = (0..8).zip(&self.groups);
        groups.filter(move |(flags, _)| bit(*flags, place) == value).map(|(_, group)| group)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_flag_that_differs_is_the_one() {
        let mut selects = Selects::default();
        selects.hear(0b101, [Some(&[1]), None]);
        assert_eq!(selects.place(0b111), None);
        selects.hear(0b001, [Some(&[2]), None]);
        // Flags are numbered in the order they are sent: the first is the highest bit.
        assert_eq!(selects.place(0b111), Some(0));
        selects.hear(0b000, [Some(&[3]), None]);
        assert_eq!(selects.place(0b111), None, "two vary");
        assert_eq!(selects.place(0b011), Some(0), "the other is something else");
    }

    #[test]
    fn lengths_decide_then_what_follows_a_reset_then_nothing() {
        let mut selects = Selects::default();
        let never = |_: &[u8], _: &[u8]| false;
        (0..3).for_each(|_| selects.hear(0b101, [Some(&[1]), None]));
        selects.hear(0b001, [Some(&[2]), None]);
        assert_eq!(selects.choose((0, 0), None, never).reason, Reason::Rarer);
        assert!(!selects.choose((0, 0), None, never).id_value);
        selects.reset();
        selects.hear(0b101, [Some(&[1]), None]);
        selects.hear(0b001, [Some(&[2]), None]);
        let chosen = selects.choose((0, 0), None, never);
        assert_eq!((chosen.id_value, chosen.reason), (true, Reason::AfterReset(1)));
        let chosen = selects.choose((0, 0), None, |ids, data| (ids, data) == (&[2], &[1]));
        assert_eq!((chosen.id_value, chosen.reason), (false, Reason::Lengths));
        assert_eq!(selects.choose((0, 0), Some(true), never).reason, Reason::Given);
    }
}
