//! The checksum of a frame: x^16 + x^12 + x^5 + 1, with all that is not known of it as parameters.

use super::profile::{ByteOrder, Crc};

/// The polynomial without its highest term.
const POLYNOMIAL: u16 = 0x1021;

impl Crc {
    /// The value for these bytes.
    pub fn of(&self, bytes: &[u8]) -> u16 {
        let register = bytes.iter().fold(self.init.0, |register, byte| {
            let byte = if self.refin { byte.reverse_bits() } else { *byte };
            (0..8).fold(register ^ u16::from(byte) << 8, |register, _| {
                register << 1 ^ if register & 0x8000 == 0 { 0 } else { POLYNOMIAL }
            })
        });
        let register = if self.refout { register.reverse_bits() } else { register };
        register ^ self.xorout.0
    }

    /// The two bytes as they are sent.
    pub fn sent(&self, bytes: &[u8]) -> [u8; 2] {
        match self.byte_order {
            ByteOrder::HighLow => self.of(bytes).to_be_bytes(),
            ByteOrder::LowHigh => self.of(bytes).to_le_bytes(),
        }
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use crate::simulate::interbus::line::profile::Word;

    /// Named parameters, of CRC-16s with this polynomial.
    pub fn named(init: u16, is_reflected: bool, xorout: u16) -> Crc {
        Crc {
            init: Word(init),
            refin: is_reflected,
            refout: is_reflected,
            xorout: Word(xorout),
            ..Crc::default()
        }
    }

    #[test]
    fn published_check_values() {
        // The check values of the CRC catalogue on `123456789`; and what a program of its own
        // gives for the frames of an LA-66 alone: OUT 81000000 and IN 00012345 with B5E3 for the
        // loopback word, and without it.
        let (out, input) = ([0x81, 0, 0, 0], [0, 1, 0x23, 0x45]);
        let with = |first: &[u8], second: &[u8]| [first, second].concat();
        let lbw = [0xB5, 0xE3];
        for (crc, check, whole, data) in [
            (named(0, false, 0), 0x31C3, [0xC6FF, 0xDC2B], [0xAB8C, 0x7CE4]),
            (named(0xFFFF, false, 0), 0x29B1, [0xC8EF, 0xD23B], [0x2F4C, 0xF824]),
            (named(0xFFFF, false, 0xFFFF), 0xD64E, [0x3710, 0x2DC4], [0xD0B3, 0x07DB]),
            (named(0, false, 0xFFFF), 0xCE3C, [0x3900, 0x23D4], [0x5473, 0x831B]),
            (named(0, true, 0), 0x2189, [0xD10A, 0x0F52], [0x31D5, 0x462E]),
            (named(0xFFFF, true, 0), 0x6F91, [0xD97A, 0x0722], [0x32F4, 0x450F]),
            (named(0xFFFF, true, 0xFFFF), 0x906E, [0x2685, 0xF8DD], [0xCD0B, 0xBAF0]),
        ] {
            assert_eq!(crc.of(b"123456789"), check);
            assert_eq!([crc.of(&with(&lbw, &out)), crc.of(&with(&input, &lbw))], whole);
            assert_eq!([crc.of(&out), crc.of(&input)], data);
        }
        let swapped = Crc { byte_order: ByteOrder::LowHigh, ..named(0, false, 0) };
        assert_eq!(swapped.sent(b"123456789"), [0xC3, 0x31]);
    }
}
