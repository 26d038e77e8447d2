//! The words of the LA-66 as their senders build them, straight from its manual (§2, §3).

/// 1: service mode. 0: normal mode.
pub const SERVICE: u32 = 1 << 31;
/// 1: write. 0: read.
pub const WRITE: u32 = 1 << 30;
/// 1: error. In what the encoder sends.
pub const ERROR: u32 = 1 << 29;
/// Always 0.
pub const RESERVE: u32 = 1 << 28;
/// Data of a service, or the position.
pub const DATA: u32 = 0x00FF_FFFF;
/// The bit of the error status that has a meaning: the magnet is outside the measuring range.
pub const MAGNET: u32 = 1 << 5;

/// Counting direction: 0 increases to the end of the rod, 1 decreases.
pub const DIRECTION: u32 = 1;
/// Measuring length in steps.
pub const LENGTH: u32 = 2;
/// The value that the external preset input sets.
pub const PRESET: u32 = 4;
/// Sets the position at once. Only writing.
pub const ADJUST: u32 = 6;
/// Error status. Only reading.
pub const STATUS: u32 = 8;

/// A request to read, without the service bit.
pub fn read(service: u32) -> u32 {
    service << 24
}

/// A request to write, without the service bit.
pub fn write(service: u32, data: u32) -> u32 {
    WRITE | service << 24 | data & DATA
}

/// The service that a word names.
pub fn service(word: u32) -> u32 {
    word >> 24 & 0x0F
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_codes_of_the_manual() {
        // LA-66 manual §3.1 to §3.5: C1/81, C2/82, C4/84, C6, and 88 for the error status.
        let high = |word: u32| (SERVICE | word) >> 24;
        for (service, codes) in [(DIRECTION, [0xC1, 0x81]), (LENGTH, [0xC2, 0x82])] {
            assert_eq!([high(write(service, 0)), high(read(service))], codes);
        }
        assert_eq!([high(write(PRESET, 0)), high(read(PRESET))], [0xC4, 0x84]);
        assert_eq!([high(write(ADJUST, 0)), high(read(STATUS))], [0xC6, 0x88]);
        // §3.2: 500 mm at 0.1 mm are 5000 steps, 1388h.
        assert_eq!(SERVICE | write(LENGTH, 500 * 10), 0xC200_1388);
        assert_eq!(service(0xC200_1388), LENGTH);
    }
}
