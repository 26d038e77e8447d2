//! The services of the LA-66 (manual §3).
//!
//! TR-Electronic's 582 rotary encoders have the same interface with a table of their own, which
//! nobody has shown yet: it would stand here, beside this one.

use super::word::{Access, Word};
use core::fmt;

/// Counting direction to the end of the rod (§3.1).
pub const DIRECTION: u8 = 1;
/// Measuring length in steps (§3.2).
pub const LENGTH: u8 = 2;
/// What the external preset input sets (§3.3).
pub const PRESET: u8 = 4;
/// Sets the position at once (§3.4).
pub const ADJUST: u8 = 6;
/// Error status (§3.5).
pub const STATUS: u8 = 8;

/// The only bit of the error status with a meaning: the magnet is outside the measuring range.
pub const MAGNET: u32 = 1 << 5;

/// One service.
#[derive(Debug)]
pub struct Service {
    /// Its number, 1 to 15.
    pub number: u8,
    /// Its name in the manual.
    pub name: &'static str,
    reads: bool,
    writes: bool,
    /// The highest value of its data.
    pub highest: u32,
}

static SERVICES: [Service; 5] = [
    Service {
        number: DIRECTION,
        name: "counting direction",
        reads: true,
        writes: true,
        highest: 1,
    },
    Service {
        number: LENGTH,
        name: "measuring length in steps",
        reads: true,
        writes: true,
        highest: 0xFF_FFFF,
    },
    Service {
        number: PRESET,
        name: "preset value 1",
        reads: true,
        writes: true,
        highest: 0xFF_FFFF,
    },
    Service {
        number: ADJUST,
        name: "preset adjustment",
        reads: false,
        writes: true,
        highest: 0xFF_FFFF,
    },
    Service { number: STATUS, name: "error status", reads: true, writes: false, highest: 0xFFFF },
];

impl Service {
    /// The service of this number; `None` where the manual defines none.
    #[must_use]
    pub fn numbered(number: u8) -> Option<&'static Service> {
        SERVICES.iter().find(|service| service.number == number)
    }

    /// Whether it can be asked for like this: 86h and C8h do not exist.
    #[must_use]
    pub const fn allows(&self, access: Access) -> bool {
        match access {
            Access::Read => self.reads,
            Access::Write => self.writes,
        }
    }

    /// Writes a value in words.
    ///
    /// # Errors
    /// Only where `out` fails.
    pub fn say(&self, value: u32, out: &mut dyn fmt::Write) -> fmt::Result {
        match (self.number, value) {
            (DIRECTION, 0) => write!(out, "0, increasing to the end of the rod"),
            (DIRECTION, 1) => write!(out, "1, decreasing to the end of the rod"),
            (STATUS, 0) => write!(out, "no error"),
            (STATUS, MAGNET) => write!(out, "magnet outside the measuring range"),
            (STATUS, status) => write!(out, "{status:04X}h"),
            (_, value) => write!(out, "{value}"),
        }
    }
}

/// Whether an LA-66 and its master can have sent these words: OUT asks for a service that there is,
/// IN tells a position, or acknowledges such a service (manual §2.2, §2.3). Who reads words in a
/// wrong radix sees others.
#[must_use]
pub fn can_be(out: Option<Word>, input: Option<Word>) -> bool {
    let is_service = |word: Word| {
        let service = Service::numbered(word.service());
        !word.has_reserve_bit() && service.is_some_and(|it| it.allows(word.access()))
    };
    let is_out = out.is_none_or(|word| !word.has_service_bit() || is_service(word));
    let is_in = |word: Word| match word.has_service_bit() {
        true => is_service(word),
        false => word.stray_bits() == 0,
    };
    is_out && input.is_none_or(is_in)
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::String;

    #[test]
    fn services_are_those_of_the_manual() {
        let numbers = (0..16).filter(|number| Service::numbered(*number).is_some());
        assert!(numbers.eq([1, 2, 4, 6, 8]));
        let allows = |number, access| Service::numbered(number).unwrap().allows(access);
        assert!(!allows(ADJUST, Access::Read) && allows(ADJUST, Access::Write));
        assert!(allows(STATUS, Access::Read) && !allows(STATUS, Access::Write));
        assert!([1, 2, 4].iter().all(|n| allows(*n, Access::Read) && allows(*n, Access::Write)));
    }

    #[test]
    fn values_in_words() {
        let say = |number, value| {
            let mut text = String::new();
            Service::numbered(number).unwrap().say(value, &mut text).unwrap();
            text
        };
        assert_eq!(say(DIRECTION, 1), "1, decreasing to the end of the rod");
        assert_eq!(say(LENGTH, 5_000), "5000");
        assert_eq!(say(STATUS, 0x20), "magnet outside the measuring range");
        assert_eq!(say(STATUS, 0x21), "0021h");
    }
}
