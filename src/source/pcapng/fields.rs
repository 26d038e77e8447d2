//! Fields of pcapng blocks: numbers in the section's byte order, options, and stamps.

use dissectors::event::Moment;
use pcap_file::Endianness;

/// Reads numbers in a section's byte order.
#[derive(Clone, Copy, Debug)]
pub struct Order(pub Endianness);

impl Order {
    /// Two bytes.
    pub fn u16(self, bytes: [u8; 2]) -> u16 {
        match self.0 {
            Endianness::Big => u16::from_be_bytes(bytes),
            Endianness::Little => u16::from_le_bytes(bytes),
        }
    }

    /// Four bytes.
    pub fn u32(self, bytes: [u8; 4]) -> u32 {
        match self.0 {
            Endianness::Big => u32::from_be_bytes(bytes),
            Endianness::Little => u32::from_le_bytes(bytes),
        }
    }

    /// Eight bytes.
    pub fn u64(self, bytes: [u8; 8]) -> u64 {
        match self.0 {
            Endianness::Big => u64::from_be_bytes(bytes),
            Endianness::Little => u64::from_le_bytes(bytes),
        }
    }

    /// Eight bytes of a stamp: the high half comes first in either order.
    pub fn ticks(self, [a, b, c, d, e, f, g, h]: [u8; 8]) -> u64 {
        u64::from(self.u32([a, b, c, d])) << 32 | u64::from(self.u32([e, f, g, h]))
    }
}

/// The options at the end of a block: code and value. What does not fit ends them.
pub struct Options<'a> {
    order: Order,
    rest: &'a [u8],
}

impl<'a> Options<'a> {
    /// The options in these bytes.
    pub fn new(order: Order, rest: &'a [u8]) -> Self {
        Options { order, rest }
    }
}

impl<'a> Iterator for Options<'a> {
    type Item = (u16, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        let (&[a, b, c, d], rest) = self.rest.split_first_chunk()?;
        let (code, length) = (self.order.u16([a, b]), usize::from(self.order.u16([c, d])));
        if code == 0 {
            return None;
        }
        let (value, _) = rest.split_at_checked(length)?;
        // Padding to four bytes; the last one's may be missing.
        self.rest = rest.get(length.next_multiple_of(4)..).unwrap_or_default();
        Some((code, value))
    }
}

/// What an interface's stamps count, and from where.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Stamps {
    unit: Unit,
    /// To be added, in s.
    offset: i64,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Unit {
    /// So many ns.
    Times(u32),
    /// One ns divided by 10 to this.
    Decimal(u8),
    /// One s divided by 2 to this.
    Binary(u8),
}

impl Stamps {
    /// As `if_tsresol` and `if_tsoffset` say; by default, microseconds since the epoch.
    pub fn new(resolution: Option<u8>, offset: Option<i64>) -> Self {
        let unit = match resolution.unwrap_or(6) {
            binary @ 0x80.. => Unit::Binary(binary & 0x7F),
            decimal @ 0..=9 => Unit::Times(10_u32.pow(9 - u32::from(decimal))),
            decimal => Unit::Decimal(decimal - 9),
        };
        Stamps { unit, offset: offset.unwrap_or(0) }
    }

    /// What one tick is worth in ns, rounded up.
    pub fn resolution(self) -> u32 {
        match self.unit {
            Unit::Times(ns) => ns,
            Unit::Decimal(_) | Unit::Binary(30..) => 1,
            Unit::Binary(power) => 1_000_000_000_u32.div_ceil(1 << power),
        }
    }

    /// The time of a tick, rounded down to a ns; `None` after the year 2262, which no stamp means.
    pub fn moment(self, ticks: u64) -> Option<Moment> {
        let ns = match self.unit {
            Unit::Times(ns) => i128::from(ticks) * i128::from(ns),
            Unit::Decimal(power) => {
                10_i128.checked_pow(power.into()).map_or(0, |part| i128::from(ticks) / part)
            }
            Unit::Binary(power) => (i128::from(ticks) * 1_000_000_000) >> power,
        };
        let ns = ns + i128::from(self.offset) * 1_000_000_000;
        i64::try_from(ns).ok().map(Moment::from_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_count_what_the_interface_says() {
        let ns = |resolution, offset, ticks| {
            Stamps::new(resolution, offset).moment(ticks).map(|at| at.ns().unwrap())
        };
        // No option: microseconds. 10^-n s for n below 80h, 2^-n s above (pcapng, if_tsresol).
        assert_eq!(ns(None, None, 1_500_000), Some(1_500_000_000));
        assert_eq!(ns(Some(9), None, 1_500_000), Some(1_500_000));
        assert_eq!(ns(Some(3), None, 1_500), Some(1_500_000_000));
        assert_eq!(ns(Some(0), None, 2), Some(2_000_000_000));
        assert_eq!(ns(Some(12), None, 1_999), Some(1));
        assert_eq!(ns(Some(0x80 | 10), None, 1_536), Some(1_500_000_000));
        assert_eq!(ns(Some(0x80 | 30), None, 1 << 30), Some(1_000_000_000));
        assert_eq!(ns(Some(6), Some(-1), 1_500_000), Some(500_000_000));
        assert_eq!(ns(Some(9), Some(1_700_000_000), 7), Some(1_700_000_000_000_000_007));
        // Microseconds where the file says seconds: nobody means that.
        assert_eq!(ns(Some(0), None, 1_700_000_000_000_000), None);
        for strange in [0x7F, 0xFF] {
            assert_eq!(ns(Some(strange), Some(i64::MIN), u64::MAX), None);
            assert_eq!(ns(Some(strange), None, u64::MAX), Some(0));
        }
    }

    #[test]
    fn a_resolution_is_never_better_than_a_nanosecond() {
        let resolutions = [(6, 1_000), (9, 1), (12, 1), (0, 1_000_000_000)];
        for (told, ns) in resolutions {
            assert_eq!(Stamps::new(Some(told), None).resolution(), ns, "{told}");
        }
        // 2^-20 s are 953.67 ns.
        assert_eq!(Stamps::new(Some(0x94), None).resolution(), 954);
        assert_eq!(Stamps::new(Some(0xFF), None).resolution(), 1);
    }

    #[test]
    fn options_end_where_they_stop_making_sense() {
        let order = Order(Endianness::Little);
        let list = |bytes: &[u8]| -> Vec<(u16, Vec<u8>)> {
            Options::new(order, bytes).map(|(code, value)| (code, value.to_vec())).collect()
        };
        let good = b"\x02\x00\x03\x00abc\0\x01\x00\x01\x00x\0\0\0\0\0\0\0\x05\x00\x00\x00";
        assert_eq!(list(good), [(2, b"abc".to_vec()), (1, b"x".to_vec())]);
        assert_eq!(list(b"\x02\x00\x01\x00a"), [(2, b"a".to_vec())]);
        for bad in [&b""[..], b"\x02\x00", b"\x02\x00\x05\x00abc\0"] {
            assert!(list(bad).is_empty(), "{bad:?}");
        }
    }
}
