//! The search for the loopback word: the first word that a cycle sends, and the last that comes
//! back. Its value is nowhere to be read.
//!
//! Behind device k the forward line carries `IN_k … IN_1, LBW, OUT_n … OUT_k+1`, and the return line
//! `IN_n … IN_1, LBW`. So the word that ends every cycle of one wire stands somewhere in the cycle of
//! the other, and where it stands tells the place of the tap.

use super::profile::Loopback;
use alloc::vec::Vec;

/// Cycles of equal length that it takes.
pub const ENOUGH: u32 = 20;

/// Cycles after which it is begun anew.
const MOST: u32 = 1 << 16;

/// Most places that are told where it may be.
pub const MOST_TOLD: usize = 8;

/// What is known of where the word stands, in bytes from the start, on either wire.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Place {
    /// Too few cycles were seen.
    Unknown,
    /// Here, by so many cycles.
    Found {
        /// On the first wire; behind all registers on the last.
        offset: usize,
        /// The wire that it ends.
        returning: usize,
        /// So many cycles.
        cycles: u32,
    },
    /// It may stand in any of these places (the first of them are listed).
    Ambiguous(Vec<usize>, u32),
}

/// Watches one group of cycles: those of equal length and flags.
#[derive(Clone, Debug, Default)]
pub struct Search {
    flags: u8,
    /// Bytes of loopback word and registers.
    length: usize,
    cycles: u32,
    /// Cycles in which the word that ends one wire is not at this place of the other, either way.
    misses: [Vec<u32>; 2],
    /// One wire: what each byte did.
    bytes: Vec<Course>,
    /// The bytes of the cycle before.
    last: Vec<u8>,
}

/// What a byte did from cycle to cycle.
#[derive(Clone, Copy, Default, Debug)]
struct Course {
    changes: u32,
    /// It changed by counting on in one nibble: the high or low one, read from either end.
    counts: [u32; 4],
}

impl Course {
    fn follow(&mut self, before: u8, now: u8) {
        if before == now {
            return;
        }
        self.changes += 1;
        for (turned, [before, now]) in
            [[before, now], [before, now].map(u8::reverse_bits)].into_iter().enumerate()
        {
            let counts = |shift: u8| {
                let next = (before >> shift).wrapping_add(1) & 0xF;
                now == before & !(0xF << shift) | next << shift
            };
            self.counts[2 * turned] += u32::from(counts(0));
            self.counts[2 * turned + 1] += u32::from(counts(4));
        }
    }

    /// Whether it stays as it is, but for damage.
    fn is_constant(&self, steps: u32) -> bool {
        self.changes * 20 <= steps
    }

    fn is_counting(&self, steps: u32) -> bool {
        self.counts.iter().any(|count| count * 10 >= steps * 9)
    }

    /// Whether it counts if bytes are read from this end, and not if from the other.
    fn counts_only(&self, is_turned: bool, steps: u32) -> bool {
        let [this, other] = if is_turned { [2, 0] } else { [0, 2] };
        let best = |from: usize| self.counts[from].max(self.counts[from + 1]);
        best(this) * 10 >= steps * 9 && best(other) * 2 < steps
    }
}

impl Search {
    /// For cycles with so many bytes of loopback word and registers.
    #[must_use]
    pub fn new(length: usize) -> Self {
        Search { length, ..Search::default() }
    }

    /// The bytes that its cycles have.
    #[must_use]
    pub fn length(&self) -> usize {
        self.length
    }

    /// So many cycles were seen.
    #[must_use]
    pub fn cycles(&self) -> u32 {
        self.cycles
    }

    /// Takes the loopback word and registers of a cycle: of both wires, or of the one there is.
    pub fn hear(&mut self, first: &[u8], second: Option<&[u8]>) {
        let is_fitting = |bytes: &[u8]| bytes.len() == self.length && self.length >= 2;
        if !is_fitting(first) || !second.is_none_or(is_fitting) {
            return;
        }
        let is_other = self.cycles > 0 && second.is_some() == self.misses[0].is_empty();
        if is_other || self.cycles >= MOST {
            // A wire came to the other, or is gone; or what was ambiguous for long is so still.
            *self = Search { flags: self.flags, ..Search::new(self.length) };
        }
        self.cycles += 1;
        if let Some(second) = second {
            let ways = [(first, second), (second, first)];
            for (misses, (forward, back)) in self.misses.iter_mut().zip(ways) {
                misses.resize(self.length - 1, 0);
                let tail = &back[self.length - 2..];
                for (miss, word) in misses.iter_mut().zip(forward.windows(2)) {
                    *miss += u32::from(word != tail);
                }
            }
        }
        let watched = second.unwrap_or(first);
        self.bytes.resize(self.length, Course::default());
        if self.last.len() == self.length {
            for (course, (before, now)) in self.bytes.iter_mut().zip(self.last.iter().zip(watched))
            {
                course.follow(*before, *now);
            }
        }
        self.last.clear();
        self.last.extend_from_slice(watched);
    }

    /// Where the word stands, as far as the cycles so far tell.
    #[must_use]
    pub fn place(&self, given: Option<Loopback>, is_turned: bool) -> Place {
        if self.cycles < ENOUGH {
            return Place::Unknown;
        }
        if self.misses[0].is_empty() { self.on_one(given, is_turned) } else { self.on_both() }
    }

    fn on_both(&self) -> Place {
        // A damaged cycle speaks against every place.
        let fits = |misses: &Vec<u32>| -> Vec<usize> {
            let fit = |(_, misses): &(usize, &u32)| **misses * 20 <= self.cycles;
            misses.iter().enumerate().filter(fit).map(|(place, _)| place).collect()
        };
        let nearly =
            |misses: &Vec<u32>| misses.iter().filter(|misses| **misses * 5 <= self.cycles).count();
        let cycles = self.cycles;
        for (way, returning) in [(0, 1), (1, 0)] {
            let places = fits(&self.misses[way]);
            match places[..] {
                [] => {}
                // Where the word of either wire's end is the other's, both ways fit.
                [offset] if nearly(&self.misses[way]) == 1 => {
                    return Place::Found { offset, returning, cycles };
                }
                _ => return Place::Ambiguous(told(places), cycles),
            }
        }
        Place::Ambiguous(Vec::new(), cycles)
    }

    fn on_one(&self, given: Option<Loopback>, is_turned: bool) -> Place {
        let steps = self.cycles - 1;
        let is_steady = |course: &Course| course.is_constant(steps);
        let places: Vec<usize> = (0..self.length - 1)
            .filter(|place| {
                let [high, low] = [&self.bytes[*place], &self.bytes[place + 1]];
                let is_word = is_steady(high) && (is_steady(low) || low.is_counting(steps))
                    || is_steady(low) && high.is_counting(steps);
                is_word && given.is_none_or(|given| given.fits(self.word(*place, is_turned)))
            })
            .collect();
        match places[..] {
            // Which wire it is shows where the word stands: at its end, or before.
            [offset] => Place::Found { offset, returning: 0, cycles: self.cycles },
            _ => Place::Ambiguous(told(places), self.cycles),
        }
    }

    /// The word that stood there last.
    fn word(&self, place: usize, is_turned: bool) -> u16 {
        let byte = |place: usize| self.last.get(place).copied().unwrap_or(0);
        let word = [byte(place), byte(place + 1)];
        u16::from_be_bytes(if is_turned { word.map(u8::reverse_bits) } else { word })
    }

    /// The word on the wire that was watched, and which of its bits stay as they are.
    #[must_use]
    pub fn value(&self, offset: usize, is_turned: bool) -> Loopback {
        let steps = self.cycles.saturating_sub(1);
        let mut mask = 0xFFFF_u16;
        for (place, shift) in [(offset, 8), (offset + 1, 0)] {
            let Some(course) = self.bytes.get(place).filter(|it| !it.is_constant(steps)) else {
                continue;
            };
            let nibble = |from: usize| (course.counts[from], course.counts[from + 1]);
            let (low, high) = nibble(if is_turned { 2 } else { 0 });
            let changing = match () {
                () if low * 10 >= steps * 9 => 0x0F,
                () if high * 10 >= steps * 9 => 0xF0,
                () => 0xFF,
            };
            mask &= !(changing << shift);
        }
        Loopback { value: self.word(offset, is_turned) & mask, mask }
    }

    /// From which end bytes are read, if the word counts when read from one end only.
    #[must_use]
    pub fn direction(&self, offset: usize) -> Option<bool> {
        let steps = self.cycles.saturating_sub(1);
        let counts = |is_turned: bool| {
            let course = |place: usize| self.bytes.get(place);
            let is_it = |course: &Course| course.counts_only(is_turned, steps);
            course(offset).is_some_and(is_it) || course(offset + 1).is_some_and(is_it)
        };
        match (counts(false), counts(true)) {
            (true, false) => Some(false),
            (false, true) => Some(true),
            _ => None,
        }
    }
}

fn told(mut places: Vec<usize>) -> Vec<usize> {
    places.truncate(MOST_TOLD + 1);
    places
}

/// A search for each of the lengths that cycles have.
#[derive(Clone, Debug, Default)]
pub struct Searches {
    all: Vec<Search>,
}

impl Searches {
    /// Lengths that are watched at once.
    const LENGTHS: usize = 4;

    /// Takes a cycle with these flags: ID cycles may be as long as data cycles.
    pub fn hear(&mut self, flags: u8, first: &[u8], second: Option<&[u8]>) {
        let is_it = |search: &Search| search.length() == first.len() && search.flags == flags;
        let index = match self.all.iter().position(is_it) {
            Some(index) => index,
            None if self.all.len() < Self::LENGTHS => {
                self.all.push(Search { flags, ..Search::new(first.len()) });
                self.all.len() - 1
            }
            // The one that was seen least makes room.
            None => {
                let least = (0..self.all.len()).min_by_key(|index| self.all[*index].cycles());
                let index = least.unwrap_or(0);
                self.all[index] = Search { flags, ..Search::new(first.len()) };
                index
            }
        };
        self.all[index].hear(first, second);
    }

    /// That of the length seen most.
    #[must_use]
    pub fn most(&self) -> Option<&Search> {
        self.all.iter().max_by_key(|search| search.cycles())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec;

    const RING: usize = 8;

    /// The ring of 16, 32 and 16 bits, its IN data counting up.
    fn heard(taps: [&str; 2], cycles: u8, is_standing: bool) -> Search {
        let mut search = Search::new(RING + 2);
        for cycle in 0..cycles {
            let cycle = if is_standing { 0 } else { cycle };
            let input = |device: u8, length: usize| {
                vec![device.wrapping_mul(0x11) ^ cycle.wrapping_mul(7 + 2 * device); length]
            };
            let [one, two, three] = [input(1, 2), input(2, 4), input(3, 2)];
            let out = |device: u8, length: usize| vec![(0x99 + 0x11 * device) ^ cycle; length];
            let frame = |tap: &str| match tap {
                "DO" => [vec![0xB5, 0xE3], out(3, 2), out(2, 4), out(1, 2)].concat(),
                "after 1" => [one.clone(), vec![0xB5, 0xE3], out(3, 2), out(2, 4)].concat(),
                _ => [three.clone(), two.clone(), one.clone(), vec![0xB5, 0xE3]].concat(),
            };
            search.hear(&frame(taps[0]), (!taps[1].is_empty()).then(|| frame(taps[1])).as_deref());
        }
        search
    }

    fn found(offset: usize, returning: usize) -> Place {
        Place::Found { offset, returning, cycles: 20 }
    }

    #[test]
    fn it_leads_one_wire_and_ends_the_other() {
        let place = |taps| heard(taps, 20, false).place(None, false);
        assert_eq!(place(["DO", "DI"]), found(0, 1));
        // Sixteen bits are upstream of a tap behind the first device.
        assert_eq!(place(["after 1", "DI"]), found(2, 1));
        assert_eq!(place(["DI", "DO"]), found(0, 0), "the wires are swapped");
        assert_eq!(heard(["DO", "DI"], 19, false).place(None, false), Place::Unknown);
    }

    #[test]
    fn both_wires_tell_it_on_a_standing_machine_too() {
        assert_eq!(heard(["DO", "DI"], 20, true).place(None, false), found(0, 1));
    }

    #[test]
    fn one_wire_tells_it_while_the_others_move() {
        assert_eq!(heard(["DO", ""], 20, false).place(None, false), found(0, 0));
        assert_eq!(heard(["DI", ""], 20, false).place(None, false), found(8, 0));
        let search = heard(["DI", ""], 20, false);
        assert_eq!(search.value(8, false), Loopback { value: 0xB5E3, mask: 0xFFFF });
        assert_eq!(search.value(8, true), Loopback { value: 0xADC7, mask: 0xFFFF });
        assert!(matches!(heard(["DI", ""], 20, true).place(None, false), Place::Ambiguous(..)));
        let given = Some(Loopback { value: 0xB5E3, mask: 0xFFFF });
        assert_eq!(heard(["DI", ""], 20, true).place(given, false), found(8, 0));
    }

    #[test]
    fn a_counting_nibble_tells_from_which_end_bytes_are_read() {
        for is_turned in [false, true] {
            let mut search = Search::new(4);
            for cycle in 0..40_u8 {
                let word = [0xB5, 0xE0 | (cycle % 16)];
                let word = if is_turned { word.map(u8::reverse_bits) } else { word };
                let data = [cycle.wrapping_mul(29), cycle.wrapping_mul(71)];
                search.hear(&[data, word].concat(), None);
            }
            let expected = Place::Found { offset: 2, returning: 0, cycles: 40 };
            assert_eq!(search.place(None, is_turned), expected);
            assert_eq!(search.direction(2), Some(is_turned));
            let value = Loopback { value: 0xB5E0, mask: 0xFFF0 };
            assert_eq!(search.value(2, is_turned), value);
        }
    }
}
