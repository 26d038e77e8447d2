//! The checksum of a line: searched for, locked, and only then judged by.
//!
//! Before it is locked nothing is said to be good or bad. What is locked may be several forms that
//! gave the same bits so far: a frame is bad if it is so under all of them.

use super::crc::{CCITT, Form};
use super::locked::{Constant, Locked, swap_bits};
use super::pairs::Pairs;
use super::profile::{BitOrder, CrcProfile};
use alloc::{format, string::String, vec::Vec};

/// Forms that are locked at once.
const MOST_LOCKED: usize = 8;

/// What is known of a frame's checksum.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub enum Crc {
    /// It fits.
    Ok,
    /// It does not fit.
    Bad {
        /// What would.
        expected: u16,
        /// What was on the wire, high byte first.
        actual: u16,
    },
    /// It is not known how it is made.
    #[default]
    Unverified,
}

/// What is covered of loopback word and registers.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Coverage {
    /// Both.
    Everything,
    /// The registers, without the loopback word wherever it stands.
    Registers,
    /// All but the first word, while it is not known where the loopback word stands.
    Behind,
    /// All but the last word, likewise.
    Before,
}

impl Coverage {
    const ALL: [Coverage; 4] =
        [Coverage::Everything, Coverage::Registers, Coverage::Behind, Coverage::Before];

    /// The bytes that are left out; `None` where it cannot be said.
    fn left_out(self, length: usize, loopback: Option<usize>) -> Option<usize> {
        match (self, loopback) {
            (Coverage::Everything, _) => Some(length),
            (Coverage::Registers, at) => at,
            (Coverage::Behind, None) => Some(0),
            (Coverage::Before, None) => length.checked_sub(2),
            _ => None,
        }
    }
}

/// A frame as the checksum sees it.
#[derive(Clone, Copy, Debug)]
pub struct Covered<'a> {
    /// Loopback word and registers.
    pub bytes: &'a [u8],
    /// Where the loopback word stands, if that is known.
    pub loopback: Option<usize>,
    /// The checksum on the wire, high byte first.
    pub word: u16,
}

impl<'a> Covered<'a> {
    pub fn by(self, coverage: Coverage) -> Option<impl Iterator<Item = u8> + Clone + use<'a>> {
        let at = coverage.left_out(self.bytes.len(), self.loopback)?;
        let behind = (at + 2).min(self.bytes.len());
        let [before, behind] = [self.bytes.get(..at)?, self.bytes.get(behind..)?];
        Some(before.iter().chain(behind).copied())
    }

    pub fn length(self, coverage: Coverage) -> usize {
        match coverage {
            Coverage::Everything => self.bytes.len(),
            _ => self.bytes.len().saturating_sub(2),
        }
    }
}

/// Searches, locks and judges.
#[derive(Clone, Debug)]
pub struct Checksum {
    given: CrcProfile,
    is_turned: bool,
    trials: [Pairs; 4],
    locked: Vec<Locked>,
    is_given: bool,
    scratch: Vec<u8>,
}

impl Checksum {
    /// Nothing is known but what the user says, of bytes in this order.
    #[must_use]
    pub fn new(given: CrcProfile, order: BitOrder) -> Self {
        let is_turned = order == BitOrder::Lsb;
        let mut checksum = Checksum {
            given,
            is_turned,
            trials: Default::default(),
            locked: Vec::new(),
            is_given: false,
            scratch: Vec::new(),
        };
        if let CrcProfile {
            init: Some(init),
            refin: Some(refin),
            refout: Some(refout),
            xorout: Some(xorout),
            is_low_first: Some(is_low_first),
            covers_loopback: Some(covers_loopback),
        } = given
        {
            let form = Form { polynomial: CCITT, refin, refout, is_low_first };
            let turn = |xorout: u16| swap_bits(xorout, is_turned);
            let coverage = if covers_loopback { Coverage::Everything } else { Coverage::Registers };
            let form = if is_turned { form.turned() } else { form };
            let wire_xor = turn(if is_low_first { xorout.swap_bytes() } else { xorout });
            checksum.locked.push(Locked {
                separated: Some((init, wire_xor)),
                ..Locked::new(coverage, form, 0, 0)
            });
            checksum.is_given = true;
        }
        checksum
    }

    /// Takes a frame without bad stop bits.
    pub fn learn(&mut self, frame: Covered<'_>) {
        if self.locked.is_empty() {
            self.search(frame);
        }
        for locked in &mut self.locked {
            locked.vote(frame);
        }
    }

    fn search(&mut self, frame: Covered<'_>) {
        let mut scratch = core::mem::take(&mut self.scratch);
        let mut is_found = false;
        for (coverage, trial) in Coverage::ALL.into_iter().zip(&mut self.trials) {
            let covers = coverage == Coverage::Everything;
            let Some(bytes) = frame.by(coverage) else { continue };
            if self.given.covers_loopback.is_none_or(|given| given == covers) {
                scratch.clear();
                scratch.extend(bytes);
                trial.hear(scratch.iter().copied(), frame.word);
                is_found |= trial.found().next().is_some();
            }
        }
        self.scratch = scratch;
        if is_found {
            self.lock();
        }
    }

    fn lock(&mut self) {
        for (coverage, trial) in Coverage::ALL.into_iter().zip(&self.trials) {
            for (form, fits) in trial.found() {
                let said = if self.is_turned { form.turned() } else { form };
                if self.given.allows(said) && self.locked.len() < MOST_LOCKED {
                    self.locked.push(Locked::new(coverage, form, fits, trial.tested()));
                }
            }
        }
        // Those that fit most pairs, and of these the expected polynomial and coverage first.
        self.locked.sort_by_key(|it| core::cmp::Reverse(it.fits));
    }

    /// Judges a frame. Forms under which it is bad while it is good under another are dropped.
    pub fn judge(&mut self, frame: Covered<'_>) -> Crc {
        let mut bad = None;
        let (mut is_good, mut is_open) = (false, self.locked.is_empty());
        for locked in &self.locked {
            match locked.expected(frame) {
                None => is_open = true,
                Some(expected) if expected == frame.word => is_good = true,
                Some(expected) => bad = bad.or(Some(expected)),
            }
        }
        if is_good && bad.is_some() {
            let is_kept =
                |locked: &Locked| locked.expected(frame).is_none_or(|it| it == frame.word);
            self.locked.retain(is_kept);
        }
        match bad {
            _ if is_good => Crc::Ok,
            Some(expected) if !is_open => Crc::Bad { expected, actual: frame.word },
            _ => Crc::Unverified,
        }
    }

    /// What is told of it, bytes read in this order: form, how many pairs fit, and whether other
    /// forms would give the same bits.
    #[must_use]
    pub fn account(&self, order: BitOrder) -> Option<Account> {
        let best = self.locked.first()?;
        let is_turned = order == BitOrder::Lsb;
        let form = if is_turned { best.divider.form.turned() } else { best.divider.form };
        let others = &self.locked[1..];
        let is_same = |same: fn(&Locked, &Locked) -> bool| others.iter().all(|it| same(it, best));
        let evidence = if self.is_given {
            String::from("as given")
        } else {
            format!("{} of {} independent pairs of frames fit", best.fits, best.tested)
        };
        let unturn = |wire: u16| {
            let wire = swap_bits(wire, is_turned);
            if form.is_low_first { wire.swap_bytes() } else { wire }
        };
        let of = |constant: &Constant| (constant.length, unturn(constant.value));
        let constants = best.constants.iter().filter(|it| it.is_firm()).map(of).collect();
        Some(Account {
            form,
            covers_loopback: (best.coverage == Coverage::Everything),
            is_given: self.is_given,
            is_form_sure: is_same(|a, b| a.divider.form == b.divider.form),
            is_coverage_sure: is_same(|a, b| {
                (a.coverage == Coverage::Everything) == (b.coverage == Coverage::Everything)
            }),
            separated: best.separated.map(|(init, xorout)| (init, unturn(xorout))),
            named: best.named(),
            constants,
            evidence,
        })
    }

    /// Independent pairs that were tested, while nothing fits.
    #[must_use]
    pub fn tested(&self) -> usize {
        self.trials.iter().map(Pairs::tested).max().unwrap_or(0)
    }

    /// Whether every form was tried on many frames in vain.
    #[must_use]
    pub fn is_given_up(&self) -> bool {
        self.trials.iter().any(Pairs::is_given_up)
    }
}

/// What is told of a locked checksum.
pub struct Account {
    /// The form.
    pub form: Form,
    /// The loopback word is covered.
    pub covers_loopback: bool,
    /// The user said it all.
    pub is_given: bool,
    /// No other form gives the same bits.
    pub is_form_sure: bool,
    /// No other coverage does.
    pub is_coverage_sure: bool,
    /// Start value and final XOR, if two lengths separate them.
    pub separated: Option<(u16, u16)>,
    /// The usual checksum that gives the same bits.
    pub named: Option<(&'static str, u16, u16)>,
    /// The constant of each length, in bytes covered.
    pub constants: Vec<(usize, u16)>,
    /// From what.
    pub evidence: String,
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOW: Form = Form { polynomial: CCITT, refin: true, refout: true, is_low_first: true };

    fn frame(counter: u8, length: usize) -> Vec<u8> {
        (0..length as u8).map(|n| n.wrapping_mul(31) ^ counter.wrapping_mul(n | 1)).collect()
    }

    fn word(form: Form, bytes: &[u8]) -> u16 {
        form.word(form.divide(0x1D0F, bytes.iter().copied())) ^ 0x00FF
    }

    fn covered(bytes: &[u8], word: u16) -> Covered<'_> {
        Covered { bytes, loopback: Some(0), word }
    }

    #[test]
    fn nothing_is_judged_before_it_is_locked() {
        let mut checksum = Checksum::new(CrcProfile::default(), BitOrder::Msb);
        for counter in 0..40 {
            let bytes = frame(counter, 8);
            let good = covered(&bytes, word(LOW, &bytes));
            if checksum.locked.is_empty() {
                assert_eq!(checksum.judge(good), Crc::Unverified);
            }
            checksum.learn(good);
        }
        let bytes = frame(99, 8);
        let good = word(LOW, &bytes);
        assert_eq!(checksum.judge(covered(&bytes, good)), Crc::Ok);
        let bad = Crc::Bad { expected: good, actual: good ^ 1 };
        assert_eq!(checksum.judge(covered(&bytes, good ^ 1)), bad);
        let other = frame(1, 12);
        assert_eq!(checksum.judge(covered(&other, 0)), Crc::Unverified, "another length");
        let account = checksum.account(BitOrder::Msb).unwrap();
        assert_eq!((account.form, account.separated), (LOW, None));
    }

    #[test]
    fn two_lengths_tell_the_start_value_and_so_every_other_length() {
        let mut checksum = Checksum::new(CrcProfile::default(), BitOrder::Msb);
        for counter in 0..40 {
            for length in [8, 12] {
                let bytes = frame(counter, length);
                checksum.learn(covered(&bytes, word(LOW, &bytes)));
            }
        }
        let account = checksum.account(BitOrder::Msb).unwrap();
        let (init, xorout) = account.separated.unwrap();
        let number = |init: u16, xorout: u16| {
            LOW.divide(init, frame(1, 30).into_iter()).reverse_bits() ^ xorout
        };
        // The final XOR 00FF of the wire is FF00 as a number: the low byte is sent first.
        assert_eq!(number(init, xorout), number(0x1D0F, 0xFF00));
        let bytes = frame(7, 20);
        assert_eq!(checksum.judge(covered(&bytes, word(LOW, &bytes))), Crc::Ok);
    }

    #[test]
    fn what_is_given_is_judged_by_at_once() {
        for order in [BitOrder::Msb, BitOrder::Lsb] {
            let given = CrcProfile {
                init: Some(0xFFFF),
                refin: Some(true),
                refout: Some(true),
                xorout: Some(0x1234),
                is_low_first: Some(true),
                covers_loopback: Some(true),
            };
            let mut checksum = Checksum::new(given, order);
            let sent = frame(3, 8);
            let sum = LOW.divide(0xFFFF, sent.iter().copied()).reverse_bits() ^ 0x1234;
            let turn = |byte: u8| if order == BitOrder::Lsb { byte.reverse_bits() } else { byte };
            let bytes: Vec<u8> = sent.iter().copied().map(turn).collect();
            let word = u16::from_be_bytes(sum.to_le_bytes().map(turn));
            assert_eq!(checksum.judge(covered(&bytes, word)), Crc::Ok, "{order:?}");
            let account = checksum.account(order).unwrap();
            assert_eq!((account.form, account.separated), (LOW, Some((0xFFFF, 0x1234))));
        }
    }

    #[test]
    fn a_usual_checksum_is_named() {
        let mut checksum = Checksum::new(CrcProfile::default(), BitOrder::Msb);
        let form = Form { is_low_first: false, ..LOW };
        for counter in 0..40 {
            let bytes = frame(counter, 8);
            let word = form.word(form.divide(0xFFFF, bytes.iter().copied())) ^ 0xFFFF;
            checksum.learn(covered(&bytes, word));
        }
        let named = checksum.account(BitOrder::Msb).unwrap().named;
        assert_eq!(named, Some(("IBM-SDLC", 0xFFFF, 0xFFFF)));
    }
}
