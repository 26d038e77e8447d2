//! A form of checksum that fits, and what is still open of it: start value and final XOR, which are
//! one constant for each length of frame.

use super::checksum::{Coverage, Covered};
use super::crc::{CCITT, Divider, Form, NAMED, separate};
use alloc::vec::Vec;

/// Frames of a length, with different content, that agree in their constant.
const AGREEING: u8 = 3;

/// Lengths whose constants are kept.
const LENGTHS: usize = 16;

/// A form that fits.
#[derive(Clone, Debug)]
pub struct Locked {
    pub coverage: Coverage,
    pub divider: Divider,
    pub fits: u8,
    pub tested: usize,
    pub constants: Vec<Constant>,
    /// Start value and final XOR.
    pub separated: Option<(u16, u16)>,
}

/// What the checksums of one length are beyond those with start value and final XOR zero.
#[derive(Clone, Copy, Debug)]
pub struct Constant {
    pub length: usize,
    pub value: u16,
    pub votes: u8,
    pub register: u16,
}

/// A word whose bytes are read from their other end.
pub fn swap_bits(word: u16, is_turned: bool) -> u16 {
    let bytes = word.to_be_bytes();
    u16::from_be_bytes(if is_turned { bytes.map(u8::reverse_bits) } else { bytes })
}

impl Constant {
    pub const fn is_firm(&self) -> bool {
        self.votes >= AGREEING
    }
}

impl Locked {
    pub fn new(coverage: Coverage, form: Form, fits: u8, tested: usize) -> Self {
        let divider = Divider::new(form);
        Locked { coverage, divider, fits, tested, constants: Vec::new(), separated: None }
    }

    pub fn register(&self, frame: Covered<'_>) -> Option<u16> {
        // The place of the loopback word may have been found since.
        let coverage = match (self.coverage, frame.loopback) {
            (Coverage::Behind | Coverage::Before, Some(_)) => Coverage::Registers,
            (coverage, _) => coverage,
        };
        frame.by(coverage).map(|bytes| self.divider.divide(bytes))
    }

    /// Takes a frame's word for the constant of its length.
    pub fn vote(&mut self, frame: Covered<'_>) {
        let length = frame.length(self.coverage);
        let known = self.constants.iter().position(|constant| constant.length == length);
        if known.is_some_and(|index| self.constants[index].is_firm()) {
            return;
        }
        let Some(register) = self.register(frame) else { return };
        let value = frame.word ^ self.divider.form.word(register);
        let new = Constant { length, value, votes: 1, register };
        match known {
            None if self.constants.len() < LENGTHS => self.constants.push(new),
            None => {}
            Some(index) => {
                let constant = &mut self.constants[index];
                if constant.value != value {
                    constant.votes -= 1;
                    if constant.votes == 0 {
                        *constant = new;
                    }
                } else if constant.register != register {
                    constant.votes += 1;
                    constant.register = register;
                    if constant.is_firm() {
                        self.separate();
                    }
                }
            }
        }
    }

    fn separate(&mut self) {
        let mut firm = self.constants.iter().filter(|constant| constant.is_firm());
        let (Some(a), Some(b)) = (firm.next(), firm.next()) else { return };
        let form = self.divider.form;
        let found = separate(form, (a.length, a.value), (b.length, b.value));
        let is_right = |(init, xorout): &(u16, u16)| {
            let mut firm = self.constants.iter().filter(|constant| constant.is_firm());
            firm.all(|it| constant_of(form, it.length, *init, *xorout) == it.value)
        };
        self.separated = found.filter(is_right);
    }

    /// The checksum that a frame should have, if that is known.
    pub fn expected(&self, frame: Covered<'_>) -> Option<u16> {
        let length = frame.length(self.coverage);
        let form = self.divider.form;
        let is_it = |constant: &&Constant| constant.length == length && constant.is_firm();
        let constant = match (self.constants.iter().find(is_it), self.separated) {
            (Some(constant), _) => constant.value,
            (None, Some((init, xorout))) => constant_of(form, length, init, xorout),
            (None, None) => return None,
        };
        Some(form.word(self.register(frame)?) ^ constant)
    }

    /// The usual checksum that gives all constants: name, start value, final XOR.
    pub fn named(&self) -> Option<(&'static str, u16, u16)> {
        let is_plain = |form: Form| {
            form.polynomial == CCITT && form.refin == form.refout && !form.is_low_first
        };
        let own = self.divider.form;
        let form = [own, own.turned()].into_iter().find(|form| is_plain(*form))?;
        let is_turned = form != own;
        let mut firm = self.constants.iter().filter(|constant| constant.is_firm()).peekable();
        firm.peek()?;
        let firm: Vec<&Constant> = firm.collect();
        let named = NAMED.iter().filter(|named| named.is_reflected == form.refin);
        let mut fitting = named.filter(|named| {
            let fits = |constant: &&Constant| {
                let value = constant_of(form, constant.length, named.init, named.xorout);
                swap_bits(value, is_turned) == constant.value
            };
            firm.iter().all(fits)
        });
        fitting.next().map(|named| (named.name, named.init, named.xorout))
    }
}

/// The constant of a length, as a word on the wire.
fn constant_of(form: Form, length: usize, init: u16, xorout: u16) -> u16 {
    form.word(form.divide(init, core::iter::repeat_n(0, length))) ^ xorout
}
