//! The 16-bit checksum of a cycle, with everything about it that is not known.
//!
//! The polynomial is that of CCITT, x^16 + x^12 + x^5 + 1 (ACURO's manual). Start value, reflection,
//! final XOR, byte order and what is covered are nowhere to be read.

/// The polynomial that is expected.
pub const CCITT: u16 = 0x1021;

/// Polynomials that are tried: the expected one, and controls that should never fit.
pub const POLYNOMIALS: [u16; 4] = [CCITT, 0x8005, 0x3D65, 0x1DCF];

/// How bytes become a checksum, but for start value and final XOR.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Form {
    /// The polynomial, without its highest term.
    pub polynomial: u16,
    /// Every byte goes in with its last bit first.
    pub refin: bool,
    /// The checksum comes out with its last bit first.
    pub refout: bool,
    /// Its low byte is sent first.
    pub is_low_first: bool,
}

impl Form {
    /// All that are tried, the likeliest first.
    pub fn all() -> impl Iterator<Item = Form> {
        let bools = || [false, true].into_iter();
        POLYNOMIALS.into_iter().flat_map(move |polynomial| {
            // Most checksums are reflected on both sides or on none.
            bools().flat_map(move |is_mixed| {
                bools().flat_map(move |refin| {
                    bools().map(move |is_low_first| Form {
                        polynomial,
                        refin,
                        refout: refin != is_mixed,
                        is_low_first,
                    })
                })
            })
        })
    }

    /// The word on the wire, high byte first, for what is in the register at the end.
    #[must_use]
    pub const fn word(self, register: u16) -> u16 {
        let out = if self.refout { register.reverse_bits() } else { register };
        if self.is_low_first { out.swap_bytes() } else { out }
    }

    /// The register that a word on the wire stands for.
    #[must_use]
    pub const fn register(self, word: u16) -> u16 {
        let out = if self.is_low_first { word.swap_bytes() } else { word };
        if self.refout { out.reverse_bits() } else { out }
    }

    /// What is in the register behind these bytes, bit by bit.
    #[must_use]
    pub fn divide(self, start: u16, bytes: impl Iterator<Item = u8>) -> u16 {
        bytes.fold(start, |register, byte| self.step(register, byte))
    }

    fn step(self, register: u16, byte: u8) -> u16 {
        let byte = if self.refin { byte.reverse_bits() } else { byte };
        let register = register ^ u16::from(byte) << 8;
        (0..8).fold(register, |register, _| {
            register << 1 ^ if register & 0x8000 != 0 { self.polynomial } else { 0 }
        })
    }

    /// The same checksum, where bytes are read with their other end first: on the wire nothing
    /// differs.
    #[must_use]
    pub const fn turned(self) -> Form {
        Form { refin: !self.refin, refout: !self.refout, is_low_first: !self.is_low_first, ..self }
    }
}

/// A form with a table for its bytes.
#[derive(Clone, Debug)]
pub struct Divider {
    /// The form.
    pub form: Form,
    table: [u16; 256],
}

impl Divider {
    /// A divider of that form.
    #[must_use]
    pub fn new(form: Form) -> Self {
        let mut table = [0; 256];
        for (byte, entry) in (0..=255).zip(&mut table) {
            *entry = form.step(0, byte);
        }
        Divider { form, table }
    }

    /// What is in the register behind these bytes, from zero.
    #[must_use]
    pub fn divide(&self, bytes: impl Iterator<Item = u8>) -> u16 {
        let refin = self.form.refin;
        bytes.fold(0, |register, byte| {
            // The table has its bytes reflected; what is in the register is not.
            let high = (register >> 8) as u8;
            let index = byte ^ if refin { high.reverse_bits() } else { high };
            register << 8 ^ self.table[usize::from(index)]
        })
    }
}

/// Checksums with a name.
pub struct Named {
    /// The name in the catalogue of parametrised CRC algorithms.
    pub name: &'static str,
    /// Reflected on both sides.
    pub is_reflected: bool,
    /// The start value.
    pub init: u16,
    /// The final XOR.
    pub xorout: u16,
}

const fn named(name: &'static str, is_reflected: bool, init: u16, xorout: u16) -> Named {
    Named { name, is_reflected, init, xorout }
}

/// The usual ones of this polynomial.
pub const NAMED: [Named; 7] = [
    named("XMODEM", false, 0, 0),
    named("IBM-3740", false, 0xFFFF, 0),
    named("GENIBUS", false, 0xFFFF, 0xFFFF),
    named("GSM", false, 0, 0xFFFF),
    named("KERMIT", true, 0, 0),
    named("MCRF4XX", true, 0xFFFF, 0),
    named("IBM-SDLC", true, 0xFFFF, 0xFFFF),
];

/// Start value and final XOR, from the constants that two lengths have: what a checksum is beyond
/// that of zeros. `None` if they do not determine it.
///
/// A polynomial with the factor x + 1, as that of CCITT, has two such pairs, which give the same
/// checksums at every length: of these the more usual one.
#[must_use]
pub fn separate(form: Form, first: (usize, u16), second: (usize, u16)) -> Option<(u16, u16)> {
    let zeros = |start: u16, length: usize| form.divide(start, core::iter::repeat_n(0, length));
    let difference = form.register(first.1) ^ form.register(second.1);
    // One equation a bit of the register: which bits of the start value change it.
    let mut rows = [(0_u16, false); 16];
    for bit in 0..16 {
        let column = zeros(1 << bit, first.0) ^ zeros(1 << bit, second.0);
        for (place, row) in rows.iter_mut().enumerate() {
            row.0 |= (column >> place & 1) << bit;
        }
    }
    for (place, row) in rows.iter_mut().enumerate() {
        row.1 = difference >> place & 1 == 1;
    }
    let (init, free) = solve(&mut rows)?;
    let with = |init: u16| (init, first.1 ^ form.word(zeros(init, first.0)));
    let Some(free) = free else { return Some(with(init)) };
    // What a byte of zeros leaves as it is differs in the final XOR alone.
    let is_lasting = zeros(free, 1) == free;
    let is_usual = |value: u16| [0, 0xFFFF].contains(&value);
    let rank = |(init, xorout): &(u16, u16)| (!is_usual(*init), !is_usual(*xorout), *init);
    is_lasting.then(|| with(init).min_by(with(init ^ free), rank))
}

/// The smaller of two by a key.
trait MinBy: Sized {
    fn min_by<K: Ord>(self, other: Self, key: impl Fn(&Self) -> K) -> Self {
        if key(&other) < key(&self) { other } else { self }
    }
}

impl MinBy for (u16, u16) {}

/// The solution of 16 equations over the bits of a word, and what may be added to it, if that is
/// one word only.
fn solve(rows: &mut [(u16, bool); 16]) -> Option<(u16, Option<u16>)> {
    let mut pivots = [None; 16];
    let mut used = 0;
    for (bit, solved) in pivots.iter_mut().enumerate() {
        let Some(pivot) = (used..16).find(|row| rows[*row].0 >> bit & 1 == 1) else { continue };
        rows.swap(used, pivot);
        let (mask, value) = rows[used];
        for (place, row) in rows.iter_mut().enumerate() {
            if place != used && row.0 >> bit & 1 == 1 {
                *row = (row.0 ^ mask, row.1 != value);
            }
        }
        *solved = Some(used);
        used += 1;
    }
    // What is left of the equations must be 0 = 0.
    if used < 15 || rows[used..].iter().any(|row| row.1) {
        return None;
    }
    let open = (0..16).find(|bit| pivots[*bit].is_none());
    let of = |value: &dyn Fn(usize) -> bool| {
        let solved = pivots.iter().enumerate().filter_map(|(bit, row)| Some((bit, (*row)?)));
        solved.fold(0_u16, |word, (bit, row)| word | u16::from(value(row)) << bit)
    };
    let init = of(&|row| rows[row].1);
    let free = open.map(|open| 1 << open | of(&|row| rows[row].0 >> open & 1 == 1));
    Some((init, free))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn form(is_reflected: bool) -> Form {
        Form { polynomial: CCITT, refin: is_reflected, refout: is_reflected, is_low_first: false }
    }

    fn checksum(named: &Named, bytes: &[u8]) -> u16 {
        let form = form(named.is_reflected);
        form.word(form.divide(named.init, bytes.iter().copied())) ^ named.xorout
    }

    #[test]
    fn named_checksums_have_their_published_check_values() {
        let published = [0x31C3, 0x29B1, 0xD64E, 0xCE3C, 0x2189, 0x6F91, 0x906E];
        for (named, expected) in NAMED.iter().zip(published) {
            assert_eq!(checksum(named, b"123456789"), expected, "{}", named.name);
        }
    }

    #[test]
    fn an_la_66_alone_in_the_ring_has_these_candidates() {
        // B5E3 stands for a loopback word; OUT 81000000, IN 00012345.
        let out = [0xB5, 0xE3, 0x81, 0, 0, 0];
        let input = [0, 1, 0x23, 0x45, 0xB5, 0xE3];
        let whole = [
            (0xC6FF, 0xDC2B),
            (0xC8EF, 0xD23B),
            (0x3710, 0x2DC4),
            (0x3900, 0x23D4),
            (0xD10A, 0x0F52),
            (0xD97A, 0x0722),
            (0x2685, 0xF8DD),
        ];
        let data = [
            (0xAB8C, 0x7CE4),
            (0x2F4C, 0xF824),
            (0xD0B3, 0x07DB),
            (0x5473, 0x831B),
            (0x31D5, 0x462E),
            (0x32F4, 0x450F),
            (0xCD0B, 0xBAF0),
        ];
        for ((named, whole), data) in NAMED.iter().zip(whole).zip(data) {
            assert_eq!((checksum(named, &out), checksum(named, &input)), whole, "{}", named.name);
            let parts = (checksum(named, &out[2..]), checksum(named, &input[..4]));
            assert_eq!(parts, data, "{}", named.name);
        }
    }

    #[test]
    fn a_table_gives_what_bits_give() {
        for form in Form::all() {
            let bytes = (0..=255).map(|byte: u8| byte.wrapping_mul(77));
            assert_eq!(Divider::new(form).divide(bytes.clone()), form.divide(0, bytes));
        }
    }

    #[test]
    fn all_forms_differ() {
        let all: alloc::vec::Vec<Form> = Form::all().collect();
        assert_eq!(all.len(), 32);
        assert!(all.iter().enumerate().all(|(n, form)| !all[..n].contains(form)));
    }

    #[test]
    fn bytes_read_from_their_other_end_have_the_same_checksum_on_the_wire() {
        let bytes = *b"123456789";
        for form in Form::all() {
            let word = form.word(form.divide(0x1234, bytes.into_iter()));
            let turned = form.turned();
            let other = turned.word(turned.divide(0x1234, bytes.into_iter().map(u8::reverse_bits)));
            assert_eq!(other.to_be_bytes(), word.to_be_bytes().map(u8::reverse_bits));
        }
    }

    #[test]
    fn two_lengths_separate_start_value_from_final_xor() {
        for form in Form::all().take(8) {
            let usual = |length: usize| {
                let zeros = core::iter::repeat_n(0, length);
                (length, form.word(form.divide(0xFFFF, zeros)))
            };
            assert_eq!(separate(form, usual(6), usual(10)), Some((0xFFFF, 0)));
            let constant = |length: usize| {
                let zeros = core::iter::repeat_n(0, length);
                (length, form.word(form.divide(0x5A5A, zeros)) ^ 0x0F0F)
            };
            // Two pairs of values give the same checksums at every length: x + 1 divides the
            // polynomial.
            let (init, xorout) = separate(form, constant(10), constant(14)).unwrap();
            for length in [0, 1, 2, 10, 14, 15, 100, 514] {
                let zeros = core::iter::repeat_n(0, length);
                let found = form.word(form.divide(init, zeros)) ^ xorout;
                assert_eq!(found, constant(length).1);
            }
            assert_eq!(separate(form, constant(10), constant(10)), None);
        }
    }
}
