//! Process words of TR-Electronic's service interface (LA-66 manual §2.2, §2.3).
//!
//! ```text
//! 31  service bit
//! 30  0 read, 1 write
//! 29  error, in IN only
//! 28  reserve, always 0
//! 27  ┐
//! 24  ┘ service
//! 23  ┐
//!  0  ┘ data of the service; position, where IN's service bit is 0
//! ```

/// One way of a device's process data: 32 bits out, or 32 bits in.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Word(u32);

/// Whether a parameter is read or written.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Access {
    /// It is read.
    Read,
    /// It is written.
    Write,
}

impl Access {
    /// The word that records carry.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Access::Read => "read",
            Access::Write => "write",
        }
    }
}

impl Word {
    /// The word of these 32 bits.
    #[must_use]
    pub const fn new(bits: u32) -> Self {
        Word(bits)
    }

    /// Bit 31: OUT asks for a service, IN acknowledges one.
    #[must_use]
    pub const fn has_service_bit(self) -> bool {
        self.0 >> 31 == 1
    }

    /// Bit 30.
    #[must_use]
    pub const fn access(self) -> Access {
        if self.0 >> 30 & 1 == 1 { Access::Write } else { Access::Read }
    }

    /// Bit 29: the device reports an error. It has no meaning in OUT.
    #[must_use]
    pub const fn has_error_bit(self) -> bool {
        self.0 >> 29 & 1 == 1
    }

    /// Bit 28, always 0.
    #[must_use]
    pub const fn has_reserve_bit(self) -> bool {
        self.0 >> 28 & 1 == 1
    }

    /// Bits 27 to 24: the service, 0 to 15.
    #[must_use]
    pub const fn service(self) -> u8 {
        (self.0 >> 24 & 0xF) as u8
    }

    /// Bits 23 to 0: data, or the position.
    #[must_use]
    pub const fn data(self) -> u32 {
        self.0 & 0x00FF_FFFF
    }

    /// Bits 31 to 24, as the manual writes services: C2h.
    #[must_use]
    pub const fn code(self) -> u8 {
        (self.0 >> 24) as u8
    }

    /// What is laid out: all but the service bit.
    #[must_use]
    pub const fn laid_out(self) -> u32 {
        self.0 & 0x7FFF_FFFF
    }

    /// Whether both name the same service and access.
    #[must_use]
    pub const fn names_same_service(self, other: Word) -> bool {
        (self.0 ^ other.0) & 0x4F00_0000 == 0
    }

    /// The bits of a normal IN word that are to be 0: all above the position but the error bit.
    #[must_use]
    pub const fn stray_bits(self) -> u8 {
        self.code() & 0x5F
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The words of the LA-66 manual §3 and of its worked examples.
    #[test]
    fn words_of_the_manual() {
        use Access::{Read, Write};
        let parts = |bits| {
            let word = Word::new(bits);
            let is = (word.has_service_bit(), word.access(), word.has_error_bit());
            (is, word.service(), word.data())
        };
        assert_eq!(parts(0x4200_1388), ((false, Write, false), 2, 5_000));
        assert_eq!(parts(0xC200_1388), ((true, Write, false), 2, 5_000));
        // 500 mm at 0.01 mm are 50000 steps, C350h.
        assert_eq!(parts(0xC200_C350), ((true, Write, false), 2, 50_000));
        assert_eq!(parts(0x0200_1388), ((false, Read, false), 2, 5_000));
        assert_eq!(parts(0x8100_0001), ((true, Read, false), 1, 1));
        assert_eq!(parts(0xC600_0064), ((true, Write, false), 6, 100));
        assert_eq!(parts(0xE2FF_FFFF), ((true, Write, true), 2, 16_777_215));
        assert_eq!(parts(0x2001_2345), ((false, Read, true), 0, 74_565));
        assert_eq!(parts(0x8800_0020), ((true, Read, false), 8, 32));
        assert_eq!(Word::new(0xC200_1388).code(), 0xC2);
    }

    #[test]
    fn bits_beside_a_position() {
        assert_eq!(Word::new(0x0001_2345).stray_bits(), 0);
        assert_eq!(Word::new(0x2001_2345).stray_bits(), 0);
        assert_eq!(Word::new(0x3101_2345).stray_bits(), 0x11);
        assert!(Word::new(0x1000_0000).has_reserve_bit());
        assert!(Word::new(0xE200_0000).names_same_service(Word::new(0xC200_1388)));
        assert!(!Word::new(0x8200_0000).names_same_service(Word::new(0xC200_1388)));
    }
}
