//! The search for the checksum, from pairs of frames.
//!
//! For two frames of equal length, `CRC(a) xor CRC(b) = CRC0(a xor b)`, with start value and final
//! XOR zero: both cancel. Polynomial, reflection, byte order and coverage can so be tested before
//! anything else is known. A pair tells something new only if its difference is no sum of those
//! before, and chance fits one in 65,536.

use super::crc::Form;
use alloc::{vec, vec::Vec};

/// Independent pairs that have to fit.
pub const ENOUGH: u8 = 3;

/// Independent differences that are kept.
const DIFFERENCES: usize = 12;

/// Lengths of frames of which one is kept.
const LENGTHS: usize = 4;

/// How often it is begun anew with other frames to compare with, before it is given up.
const PATIENCE: u32 = 200;

/// Tests every form of checksum on the frames of one coverage.
#[derive(Clone, Debug, Default)]
pub struct Pairs {
    /// The frames that others are compared with, of different lengths: bytes covered, checksum.
    references: Vec<(Vec<u8>, u16)>,
    /// Differences, reduced so that each begins with a bit that no other has; the end aligned.
    differences: Vec<Vec<u8>>,
    /// How many pairs each form fits.
    fits: Vec<u8>,
    /// How often it was begun.
    begun: u32,
    scratch: [Vec<u8>; 2],
}

impl Pairs {
    /// Takes a frame: what the checksum covers, and the checksum as it was on the wire.
    pub fn hear(&mut self, covered: impl ExactSizeIterator<Item = u8> + Clone, word: u16) {
        if self.begun > PATIENCE {
            return;
        }
        let is_as_long = |(bytes, _): &&(Vec<u8>, u16)| bytes.len() == covered.len();
        let Some((reference, other)) = self.references.iter().find(is_as_long) else {
            if self.references.len() < LENGTHS {
                self.references.push((covered.collect(), word));
            }
            return;
        };
        let [mut difference, mut reduced] = core::mem::take(&mut self.scratch);
        difference.clear();
        difference.extend(covered.zip(reference).map(|(a, b)| a ^ b));
        reduced.clone_from(&difference);
        let change = word ^ other;
        if self.is_new(&mut reduced) {
            self.test(&difference, change);
        }
        self.scratch = [difference, reduced];
    }

    /// How many pairs were tested since it was begun.
    #[must_use]
    pub fn tested(&self) -> usize {
        self.differences.len()
    }

    /// The forms that fit, with the pairs they fit: none if too few pairs were there.
    pub fn found(&self) -> impl Iterator<Item = (Form, u8)> {
        let tested = self.differences.len();
        let fits = self.fits.iter().copied();
        Form::all()
            .zip(fits)
            .filter(move |(_, fits)| *fits >= ENOUGH && usize::from(*fits) * 4 >= tested * 3)
    }

    /// Whether all forms were tried on many frames in vain.
    #[must_use]
    pub fn is_given_up(&self) -> bool {
        self.begun > PATIENCE
    }

    fn test(&mut self, difference: &[u8], change: u16) {
        if self.fits.is_empty() {
            self.fits = vec![0; Form::all().count()];
        }
        // Forms that differ in what comes out share what is in the register.
        let mut last = None;
        for (form, fits) in Form::all().zip(&mut self.fits) {
            let key = (form.polynomial, form.refin);
            let register = match last {
                Some((known, register)) if known == key => register,
                _ => form.divide(0, difference.iter().copied()),
            };
            last = Some((key, register));
            *fits += u8::from(form.word(register) == change);
        }
        if self.differences.len() >= DIFFERENCES && self.found().next().is_none() {
            // The frames that the others are compared with may be damaged themselves.
            *self = Pairs { begun: self.begun + 1, ..Pairs::default() };
        }
    }

    /// Whether a difference is no sum of those before; then it is kept.
    fn is_new(&mut self, difference: &mut Vec<u8>) -> bool {
        if self.differences.len() >= DIFFERENCES {
            return false;
        }
        let start = difference.iter().position(|byte| *byte != 0);
        let Some(start) = start else { return false };
        difference.drain(..start);
        for known in &self.differences {
            let Some(first) = known.first() else { continue };
            let Some(from) = difference.len().checked_sub(known.len()) else { continue };
            let bit = 0x80 >> first.leading_zeros();
            if difference[from] & bit != 0 {
                difference[from..].iter_mut().zip(known).for_each(|(byte, known)| *byte ^= known);
            }
        }
        let Some(start) = difference.iter().position(|byte| *byte != 0) else { return false };
        difference.drain(..start);
        // Longest first, and of equal length the one with the highest bit, so that one pass reduces.
        let rank = |bytes: &[u8]| (bytes.len(), bytes.first().copied().unwrap_or(0));
        let place = self.differences.partition_point(|known| rank(known) > rank(difference));
        self.differences.insert(place, difference.clone());
        true
    }
}

#[cfg(test)]
mod tests {
    use super::super::crc::CCITT;
    use super::*;

    /// A payload without a pattern.
    fn payload(seed: u32, length: usize) -> Vec<u8> {
        let mut x = seed;
        let mut next = || {
            x = x.wrapping_mul(0x9E37_79B1).wrapping_add(0x7F4A_7C15);
            (x >> 24) as u8
        };
        (0..length).map(|_| next()).collect()
    }

    fn checksum(form: Form, bytes: &[u8]) -> u16 {
        form.word(form.divide(0x5A5A, bytes.iter().copied())) ^ 0x0F0F
    }

    /// With a hidden start value 5A5A and final XOR 0F0F, "1021 reflected" alone fits.
    #[test]
    fn the_one_form_fits_and_no_control_does() {
        let reflected = Form { polynomial: CCITT, refin: true, refout: true, is_low_first: false };
        let mut pairs = Pairs::default();
        for seed in 0..6 {
            let bytes = payload(seed, 10);
            pairs.hear(bytes.iter().copied(), checksum(reflected, &bytes));
        }
        assert_eq!(pairs.tested(), 5);
        assert_eq!(pairs.found().collect::<Vec<_>>(), [(reflected, 5)]);
        let zeros = core::iter::repeat_n(0, 10);
        assert_eq!(
            checksum(reflected, &[0; 10]),
            reflected.word(reflected.divide(0x5A5A, zeros)) ^ 0x0F0F
        );
    }

    #[test]
    fn every_form_is_told_from_every_other() {
        for form in Form::all() {
            let mut pairs = Pairs::default();
            for seed in 0..6 {
                let bytes = payload(seed, 8);
                pairs.hear(bytes.iter().copied(), checksum(form, &bytes));
            }
            assert_eq!(pairs.found().collect::<Vec<_>>(), [(form, 5)]);
        }
    }

    #[test]
    fn what_is_always_the_same_proves_nothing() {
        let form = Form::all().next().unwrap();
        let hear = |pairs: &mut Pairs, bytes: &[u8]| {
            pairs.hear(bytes.iter().copied(), checksum(form, bytes));
        };
        let mut pairs = Pairs::default();
        (0..1_000).for_each(|_| hear(&mut pairs, &[1, 2, 3, 4]));
        assert_eq!((pairs.tested(), pairs.found().count()), (0, 0));
        // Two values, and three with a difference that is the sum of two others.
        for n in 0..1_000 {
            hear(&mut pairs, if n % 2 == 0 { &[1, 2, 3, 4] } else { &[1, 2, 3, 5] });
        }
        assert_eq!((pairs.tested(), pairs.found().count()), (1, 0));
        for _ in 0..1_000 {
            hear(&mut pairs, &[1, 2, 3, 0x14]);
            hear(&mut pairs, &[1, 2, 3, 0x15]);
        }
        assert_eq!((pairs.tested(), pairs.found().count()), (2, 0));
    }

    #[test]
    fn damaged_frames_do_not_keep_it_from_being_found() {
        let form = Form::all().nth(3).unwrap();
        let mut pairs = Pairs::default();
        for seed in 0..200 {
            let bytes = payload(seed, 12);
            let damage = if seed % 20 == 0 { 0x40 } else { 0 };
            pairs.hear(bytes.iter().copied(), checksum(form, &bytes) ^ damage);
        }
        assert_eq!(pairs.found().map(|(form, _)| form).collect::<Vec<_>>(), [form]);
    }
}
