//! The rate of a line, found from how its characters follow each other.

use super::{Baud, Character, Format};
use alloc::{format, string::String, vec::Vec};
use core::cmp::Reverse;

/// Rates worth trying, those of SLIN first (Baumer SLIN §3.1, TR SLIN §1).
pub(super) const RATES: [u32; 20] = [
    115_200, 19_200, 9_600, 345_594, 38_400, 57_600, 230_400, 4_800, 2_400, 1_200, 300, 600,
    14_400, 28_800, 76_800, 460_800, 500_000, 921_600, 250_000, 1_000_000,
];

/// Characters that follow each other this slowly, in ns, tell no rate.
const LONGEST_NS: i64 = 1_000_000_000;

/// The rates of SLIN, which take less evidence than others.
const SLIN_RATES: [u32; 4] = [115_200, 19_200, 9_600, 345_594];

/// How far a spacing may be off a rate's, in percent: clocks differ by 1 % and more.
const TOLERANCE: i64 = 2;

/// The rate at which characters of this format follow each other without a pause, with the
/// evidence. `None` where no two do, or the clock is too coarse to tell.
pub(crate) fn baud_from_spacing(
    characters: &[Character],
    format: Format,
) -> Option<(Baud, String)> {
    let pairs: Vec<Pair> = characters.windows(2).filter_map(Pair::of).collect();
    let clear: Vec<&Pair> = pairs.iter().filter(|pair| pair.is_clear()).collect();
    // A coarse stamp or two tell nothing; a coarse clock hides the closest characters.
    if (pairs.len() - clear.len()) * 10 > pairs.len() {
        return None;
    }
    let coarse = clear.iter().map(|pair| pair.uncertainty).max()?;
    let spacings: Vec<i64> = clear.iter().map(|pair| pair.ns).collect();
    let smallest = spacings.iter().copied().min()?;
    let near = |target: i64| {
        let off = target * TOLERANCE / 100 + coarse;
        move |ns: &&i64| (**ns - target).abs() <= off
    };
    let fits = |rate: &u32| {
        let baud = Baud::new(*rate)?;
        let target = baud.bits_ns(format.bits()).cast_signed();
        let count = spacings.iter().filter(near(target)).count();
        let overlapping = spacings.iter().filter(|ns| **ns < target * 95 / 100).count();
        let share = if SLIN_RATES.contains(rate) { 10 } else { 4 };
        let is_common = count > 0 && count * share >= spacings.len();
        (is_common && overlapping * 20 <= spacings.len()).then_some((baud, count))
    };
    let standard = RATES.iter().filter_map(fits).min_by_key(|(_, count)| Reverse(*count));
    let (baud, count) = standard.or_else(|| {
        let closest: Vec<i64> = spacings.iter().filter(near(smallest)).copied().collect();
        let mean = closest.iter().sum::<i64>() / i64::try_from(closest.len()).ok()?;
        let rate = i64::from(format.bits()) * 1_000_000_000 / mean.max(1);
        // Requests that nobody answers come at any pace, which is not the rate.
        let is_data = clear.iter().any(|pair| pair.has_data && near(smallest)(&&pair.ns));
        let is_common = is_data && closest.len() >= 3 && closest.len() * 5 >= spacings.len();
        is_common.then_some((Baud::new(u32::try_from(rate).ok()?)?, closest.len()))
    })?;
    let all = spacings.len();
    Some((baud, format!("{count} of {all} characters follow the one before without a pause")))
}

/// Two characters, one after the other.
struct Pair {
    /// From start to start.
    ns: i64,
    /// ± of that.
    uncertainty: i64,
    /// One of them is no control word.
    has_data: bool,
}

impl Pair {
    fn of(characters: &[Character]) -> Option<Pair> {
        let [first, second] = characters else { return None };
        let ns = second.start.since(first.start)?;
        let uncertainty = i64::from(first.uncertainty) + i64::from(second.uncertainty);
        let has_data = first.byte() < 0x80 || second.byte() < 0x80;
        (1..LONGEST_NS).contains(&ns).then_some(Pair { ns, uncertainty, has_data })
    }

    /// Whether the clock is fine enough to tell how far apart they are.
    fn is_clear(&self) -> bool {
        self.uncertainty <= self.ns / 10
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::Moment;
    use crate::uart::Parity;

    fn found(starts: &[i64], uncertainty: u32) -> Option<u32> {
        let characters: Vec<Character> = starts
            .iter()
            .map(|ns| Character::new(Moment::from_ns(*ns), uncertainty, 0, Parity::Ok))
            .collect();
        baud_from_spacing(&characters, Format::FT12).map(|(baud, _)| baud.get())
    }

    #[test]
    fn characters_without_a_pause_tell_the_rate() {
        // 80h, a pause of 250 µs, then 3A B8h: 11 bits at 115200 Bd are 95.486 µs.
        assert_eq!(found(&[0, 345_486, 440_972], 1), Some(115_200));
        // The same with a clock 1 % fast, stamped in µs.
        assert_eq!(found(&[0, 344_000, 438_500], 500), Some(115_200));
        // 345594 Bd: 31.829 µs; 9600 Bd: 1145.833 µs.
        assert_eq!(found(&[0, 281_829, 313_658, 345_487], 1), Some(345_594));
        assert_eq!(found(&[0, 1_400_000, 2_545_833], 100), Some(9_600));
    }

    #[test]
    fn other_rates_take_more_evidence() {
        // 11 bits at 31250 Bd: 352 µs.
        let starts: Vec<i64> = (0..5).map(|n| n * 352_000).collect();
        assert_eq!(found(&starts, 1), Some(31_250));
        assert_eq!(found(&starts[..3], 1), None);
    }

    #[test]
    fn a_pause_that_happens_to_fit_a_rate_is_no_evidence() {
        // Footers without data words, 50 to 900 µs after their requests, which come every 3 ms.
        let mut starts = Vec::new();
        for n in 0..40 {
            starts.extend([n * 3_000_000, n * 3_000_000 + 145_000 + n * 21_000]);
        }
        assert_eq!(found(&starts, 1), None);
    }

    #[test]
    fn requests_that_nobody_answers_tell_no_rate() {
        let requests =
            |n: i64| Character::new(Moment::from_ns(n * 10_000_000), 1, 0x80, Parity::Ok);
        let characters: Vec<Character> = (0..40).map(requests).collect();
        assert_eq!(baud_from_spacing(&characters, Format::FT12), None);
    }

    #[test]
    fn one_coarse_stamp_does_not_hide_the_rate() {
        // The first stamp has no decimals; the others follow at 115200 Bd.
        let character = |n: i64| {
            let coarse = if n == 0 { 1_000_000_000 } else { 1 };
            Character::new(Moment::from_ns(n * 95_486), coarse, 0x1A, Parity::Ok)
        };
        let characters: Vec<Character> = (0..20).map(character).collect();
        let found = baud_from_spacing(&characters, Format::FT12);
        assert_eq!(found.map(|(baud, _)| baud.get()), Some(115_200));
    }

    #[test]
    fn pauses_or_coarse_clocks_tell_nothing() {
        assert_eq!(found(&[0, 345_486], 1), None);
        assert_eq!(found(&[0, 0, 0, 16_000_000], 8_000_000), None);
        assert_eq!(found(&[], 0), None);
    }
}
