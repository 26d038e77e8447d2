//! How many bits a frame takes on the wire, exactly.
//!
//! From the start of frame to the end of the CRC sequence, a bit of the other level is stuffed in
//! after five equal ones (CAN 2.0, part A §5). The bits are fed to two small tables, of the
//! checksum and of the stuffing, a byte at a time.

use super::frame::{Frame, FrameKind, Identifier, MAX_CLASSIC_DATA};

/// The generator of the 15-bit checksum: x¹⁵+x¹⁴+x¹⁰+x⁸+x⁷+x⁴+x³+1 (CAN 2.0, part A §3.1.1).
const POLYNOMIAL: u16 = 0x4599;

/// What follows the stuffed part: CRC delimiter, acknowledge slot and delimiter, end of frame.
const TAIL: u16 = 10;

/// The intermission before the next frame.
const INTERMISSION: u16 = 3;

/// The runs that the last bits can make: one to five equal ones, of either level.
const RUNS: usize = 10;

/// Of each byte, followed by so many bytes of zeros.
static CHECKSUMS: [[u16; 256]; 16] = checksums();
static STUFFING: [[Stuffed; 256]; RUNS] = stuffing();

/// What a byte does to a run: the run it leaves, and the bits stuffed into it.
#[derive(Clone, Copy)]
struct Stuffed {
    run: u8,
    bits: u8,
}

/// The bits of a frame whose data is whole, from the start of frame to the end of the intermission.
pub fn of(frame: &Frame) -> u16 {
    let is_remote = frame.kind == FrameKind::Remote;
    let dlc = u32::from(frame.dlc & 0xF);
    let data = if is_remote { &[] } else { frame.bytes() };
    let data = &data[..data.len().min(MAX_CLASSIC_DATA)];
    let stuffed = match frame.id {
        // SOF, identifier, RTR, IDE 0, reserved 0, DLC: 19 bits.
        Identifier::Standard(id) => {
            standard(u32::from(id) << 7 | u32::from(is_remote) << 6 | dlc, data)
        }
        // SOF, identifier, SRR 1, IDE 1, identifier, RTR, reserved 0 twice, DLC: 39 bits.
        Identifier::Extended(id) => {
            let mut bits = Bits::new();
            bits.push((id >> 18) << 2 | 0b11, 14);
            bits.push((id & 0x3_FFFF) << 7 | u32::from(is_remote) << 6 | dlc, 25);
            data.iter().for_each(|byte| bits.push_byte(*byte));
            bits.finish()
        }
    };
    stuffed + TAIL + INTERMISSION
}

/// The stuffed part of a frame with an 11-bit identifier, which begins with these 19 bits: two
/// bits and then whole bytes, 34 + 8n in all with the checksum.
fn standard(head: u32, data: &[u8]) -> u16 {
    let whole = data.iter().fold(u128::from(head), |bits, byte| bits << 8 | u128::from(*byte));
    let bytes = (whole << 15 | u128::from(checksum_of(whole))).to_be_bytes();
    // SOF is dominant; the bit after it goes on with that run, or begins the next.
    let second = head >> 17 & 1 == 1;
    let mut run = if second { run_of(true, 1) } else { run_of(false, 2) };
    let mut stuffed = 0;
    for byte in &bytes[bytes.len() - 4 - data.len()..] {
        let step = STUFFING[usize::from(run)][usize::from(*byte)];
        run = step.run;
        stuffed += u16::from(step.bits);
    }
    34 + 8 * data.len() as u16 + stuffed
}

/// The checksum of a sequence of bits, the most significant first.
pub fn checksum(bits: impl Iterator<Item = bool>) -> u16 {
    bits.fold(0, advance)
}

/// The checksum of the bits of a number: zeros before the first one do not count. It is the sum,
/// modulo 2, of what each byte adds, so that none needs to wait for the one before it.
pub fn checksum_of(bits: u128) -> u16 {
    let used = 16 - bits.leading_zeros() as usize / 8;
    let added = bits.to_le_bytes().into_iter().zip(&CHECKSUMS).take(used);
    added.fold(0, |sum, (byte, sums)| sum ^ sums[usize::from(byte)])
}

fn add_byte(sum: u16, byte: u8) -> u16 {
    (sum << 8 & 0x7FFF) ^ CHECKSUMS[0][usize::from((sum >> 7) as u8 ^ byte)]
}

const fn advance(sum: u16, bit: bool) -> u16 {
    let shifted = (sum << 1) & 0x7FFF;
    if (sum >> 14 & 1 == 1) != bit { shifted ^ POLYNOMIAL } else { shifted }
}

/// The stuffed part of a frame, counted.
struct Bits {
    count: u16,
    sum: u16,
    run: u8,
}

impl Bits {
    /// Before a frame the bus is recessive, and that run does not count: as if the start of frame,
    /// which is dominant, came after one bit.
    const fn new() -> Self {
        Bits { count: 0, sum: 0, run: run_of(true, 1) }
    }

    /// The lowest `width` bits of `value`, the highest of them first.
    fn push(&mut self, value: u32, width: u32) {
        for index in (0..width % 8).rev() {
            self.push_bit(value >> (width / 8 * 8 + index) & 1 == 1);
        }
        for index in (0..width / 8).rev() {
            self.push_byte((value >> (8 * index)) as u8);
        }
    }

    fn push_byte(&mut self, byte: u8) {
        self.sum = add_byte(self.sum, byte);
        self.stuff_byte(byte);
    }

    fn push_bit(&mut self, bit: bool) {
        self.sum = advance(self.sum, bit);
        self.stuff_bit(bit);
    }

    fn stuff_byte(&mut self, byte: u8) {
        let Stuffed { run, bits } = STUFFING[usize::from(self.run)][usize::from(byte)];
        self.run = run;
        self.count += 8 + u16::from(bits);
    }

    fn stuff_bit(&mut self, bit: bool) {
        let Stuffed { run, bits } = stuff(self.run, bit);
        self.run = run;
        self.count += 1 + u16::from(bits);
    }

    /// Sends the checksum, and returns how many bits there were.
    fn finish(mut self) -> u16 {
        let sum = self.sum;
        self.stuff_byte((sum >> 7) as u8);
        for index in (0..7).rev() {
            self.stuff_bit(sum >> index & 1 == 1);
        }
        // A run that ends with the last bit of the checksum is stuffed too: that was counted.
        self.count
    }
}

/// The number of a run of so many equal bits.
const fn run_of(level: bool, length: u8) -> u8 {
    (if level { 5 } else { 0 }) + length - 1
}

/// What one bit does to a run. After the fifth equal bit one of the other level is stuffed in,
/// which begins the next run.
const fn stuff(run: u8, bit: bool) -> Stuffed {
    let (level, length) = (run >= 5, run % 5 + 1);
    let length = if bit == level { length + 1 } else { 1 };
    if length == 5 {
        Stuffed { run: run_of(!bit, 1), bits: 1 }
    } else {
        Stuffed { run: run_of(bit, length), bits: 0 }
    }
}

const fn checksums() -> [[u16; 256]; 16] {
    let mut tables = [[0; 256]; 16];
    let mut byte = 0;
    while byte < 256 {
        let (mut sum, mut zeros) = ((byte as u16) << 7, 0);
        while zeros < 8 * tables.len() {
            sum = advance(sum, false);
            zeros += 1;
            if zeros % 8 == 0 {
                tables[zeros / 8 - 1][byte] = sum;
            }
        }
        byte += 1;
    }
    tables
}

const fn stuffing() -> [[Stuffed; 256]; RUNS] {
    let mut table = [[Stuffed { run: 0, bits: 0 }; 256]; RUNS];
    let mut run = 0;
    while run < RUNS {
        let mut byte = 0;
        while byte < 256 {
            let (mut now, mut bits, mut bit) = (run as u8, 0, 8);
            while bit > 0 {
                bit -= 1;
                let next = stuff(now, byte >> bit & 1 == 1);
                now = next.run;
                bits += next.bits;
            }
            table[run][byte] = Stuffed { run: now, bits };
            byte += 1;
        }
        run += 1;
    }
    table
}

#[cfg(test)]
mod tests {
    use super::super::frame::{Frame, FrameKind, Identifier};
    use crate::event::Moment;

    fn bits(id: Identifier, data: &[u8]) -> Option<u16> {
        Frame::data(Moment::UNKNOWN, 0, id, data).bits()
    }

    /// Totals with the intermission, computed with can-utils' exact routine (`canframelen.c`).
    #[test]
    fn frames_are_as_long_as_can_utils_says() {
        for (id, data, total) in [
            (0x42C, &[0x01, 0x0E, 0x01, 0x01, 0x01][..], 92),
            (0x42B, &[0x01, 0x8E, 0x36, 0x00], 81),
            (0x42D, &[], 48),
            (0x3C5, &[0x80, 0xFF, 0x3F], 75),
            (0x41E, &[0x0A, 0x4B, 0x03, 0x01, 0x03, 0x0A], 102),
            (0x5FD, &[0x43, 0, 0, 0, 0, 0, 0, 0], 124),
            (0x407, &[0x00, 0x01, 0x00, 0x92, 0x39, 0x60, 0x60], 110),
            (0x3C0, &[0, 0, 0, 0], 89),
            (0x40D, &[], 49),
            (0x3C1, &[0xF9, 0x7E, 0x1E, 0, 0], 93),
            (0x34A, &[0; 8], 125),
            (0x40F, &[0, 0, 0xFF, 0x01, 0, 0x78, 0x56], 112),
            (0x40C, &[0x00, 0x0E, 0x23, 0x01, 0x0A], 92),
            (0x40B, &[0x00, 0x8E, 0x4E, 0x61, 0xBC, 0x00], 99),
            (0x000, &[0; 8], 127),
            (0x555, &[0x55; 8], 112),
            (0x7FF, &[0xFF; 8], 126),
            (0x180, &[0x6A, 0, 0, 0, 0, 0, 0, 0], 125),
        ] {
            assert_eq!(bits(Identifier::Standard(id), data), Some(total), "{id:03X}#{data:02X?}");
        }
    }

    #[test]
    fn bytes_at_a_time_or_bits_make_no_difference() {
        for seed in 0..20_000_u64 {
            let mixed = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15);
            let (head, data) = (mixed as u32 & 0x3_FFFF, (mixed >> 7).to_le_bytes());
            // Few different bits: long runs.
            let data = data.map(|byte| if seed % 2 == 0 { byte } else { byte & 0x81 });
            let data = &data[..seed as usize % 9];
            let mut bits = super::Bits::new();
            bits.push(head, 19);
            data.iter().for_each(|byte| bits.push_byte(*byte));
            assert_eq!(super::standard(head, data), bits.finish(), "{head:05X} {data:02X?}");
        }
    }

    #[test]
    fn extended_and_remote_frames() {
        // BitCount 141 in a log of Vector's hardware.
        let data = [0x01, 0xA0, 0x0F, 0xA6, 0x60, 0x3B, 0xD1, 0x40];
        assert_eq!(bits(Identifier::Extended(0x18EB_FF00), &data), Some(141));
        // A remote frame has no data, whatever its DLC says.
        let id = Identifier::Standard(0x123);
        let remote = Frame::new(Moment::UNKNOWN, 0, FrameKind::Remote, id, 4);
        assert_eq!(remote.bits(), Some(47));
    }

    #[test]
    fn what_is_not_whole_has_no_length() {
        let id = Identifier::Standard(0x42C);
        let cut = Frame::new(Moment::UNKNOWN, 0, FrameKind::Data, id, 5).with(&[1, 0x0E]);
        assert!(cut.is_cut() && cut.bits().is_none());
        assert_eq!(Frame::new(Moment::UNKNOWN, 0, FrameKind::Fd, id, 12).bits(), None);
    }
}
