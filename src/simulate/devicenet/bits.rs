//! A frame as bits: from its start to the checksum, with stuff bits (CAN 2.0 §3.1.1, §5).
//!
//! `true` is recessive, the level of an idle bus.

use super::frame::{Frame, Id};

/// What follows the checksum of a frame: its delimiter, the acknowledge slot and delimiter, and the
/// end of frame.
pub const TAIL: usize = 10;

/// Between two frames.
pub const INTERMISSION: usize = 3;

/// A frame's bits on the wire up to its checksum.
pub struct Encoded {
    /// The levels, stuff bits included.
    pub levels: Vec<bool>,
    /// Which of them are stuff bits.
    pub stuffed: Vec<usize>,
    /// Which of them is the first bit after identifier and control field.
    pub data: usize,
}

/// Encodes a frame.
pub fn encode(frame: &Frame) -> Encoded {
    let mut bits = head(frame);
    let head = bits.len();
    for byte in frame.bytes() {
        push(&mut bits, u32::from(*byte), 8);
    }
    let crc = crc(&bits);
    push(&mut bits, u32::from(crc), 15);
    stuff(&bits, head)
}

/// Bits of a frame on the wire, with stuff bits and intermission.
pub fn length(frame: &Frame) -> usize {
    encode(frame).levels.len() + TAIL + INTERMISSION
}

/// Start of frame, identifier, control field.
fn head(frame: &Frame) -> Vec<bool> {
    let mut bits = vec![false];
    match frame.id {
        Id::Standard(id) => {
            push(&mut bits, u32::from(id), 11);
            bits.extend([frame.is_remote, false, false]);
        }
        Id::Extended(id) => {
            push(&mut bits, id >> 18, 11);
            bits.extend([true, true]);
            push(&mut bits, id, 18);
            bits.extend([frame.is_remote, false, false]);
        }
    }
    push(&mut bits, u32::from(frame.length()), 4);
    bits
}

/// The lowest bits of a value, the highest of them first.
fn push(bits: &mut Vec<bool>, value: u32, count: u32) {
    bits.extend((0..count).rev().map(|bit| value >> bit & 1 == 1));
}

/// The checksum over these bits: 15 bits, generator 4599h.
pub fn crc(bits: &[bool]) -> u16 {
    bits.iter().fold(0, |crc: u16, bit| {
        let is_odd = (crc >> 14 & 1 == 1) != *bit;
        let shifted = crc << 1 & 0x7FFF;
        if is_odd { shifted ^ 0x4599 } else { shifted }
    })
}

/// Puts a bit of the other level after five equal ones; it counts for the next five.
fn stuff(bits: &[bool], head: usize) -> Encoded {
    let mut encoded = Encoded { levels: Vec::with_capacity(160), stuffed: Vec::new(), data: 0 };
    let mut run = 0;
    for (index, bit) in bits.iter().enumerate() {
        if index == head {
            encoded.data = encoded.levels.len();
        }
        run = if encoded.levels.last() == Some(bit) { run + 1 } else { 1 };
        encoded.levels.push(*bit);
        if run == 5 {
            encoded.stuffed.push(encoded.levels.len());
            encoded.levels.push(!bit);
            run = 1;
        }
    }
    encoded
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A frame as candump writes it.
    fn frame(text: &str) -> Frame {
        let (id, data) = text.split_once('#').unwrap();
        let number = u32::from_str_radix(id, 16).unwrap();
        let id = if id.len() == 3 { Id::Standard(number as u16) } else { Id::Extended(number) };
        if let Some(length) = data.strip_prefix('R') {
            return Frame::remote(id, length.parse().unwrap());
        }
        let bytes: Vec<u8> = (0..data.len() / 2)
            .map(|index| u8::from_str_radix(&data[2 * index..2 * index + 2], 16).unwrap())
            .collect();
        Frame::of(id, &bytes)
    }

    fn checksum(frame: &Frame) -> u16 {
        let mut bits = head(frame);
        frame.bytes().iter().for_each(|byte| push(&mut bits, u32::from(*byte), 8));
        crc(&bits)
    }

    /// Frame, checksum, bits with intermission: worked out by others, and on one line measured by
    /// a controller (the last but one).
    #[test]
    fn frames_are_as_long_as_the_tables_say() {
        for (text, crc, bits) in [
            ("42C#010E010101", 0x1191, 92),
            ("42B#018E3600", 0x58D4, 81),
            ("42D#", 0x2223, 48),
            ("3C5#80FF3F", 0x63AB, 75),
            ("41E#0A4B0301030A", 0x0CA9, 102),
            ("5FD#4300000000000000", 0x2941, 124),
            ("407#00010092396060", 0x058C, 110),
            ("3C0#00000000", 0x0190, 89),
            ("40D#", 0x1444, 49),
            ("3C1#F97E1E0000", 0x72AB, 93),
            ("34A#0000000000000000", 0x6036, 125),
            ("40F#0000FF01007856", 0x0034, 112),
            ("40C#000E23010A", 0x2A51, 92),
            ("40B#008E4E61BC00", 0x27B2, 99),
            ("000#0000000000000000", 0x145B, 127),
            ("555#5555555555555555", 0x1B04, 112),
            ("7FF#FFFFFFFFFFFFFFFF", 0x4C89, 126),
            ("123#R4", 0x4352, 47),
            ("18EBFF00#01A00FA6603BD140", 0x2711, 141),
            ("180#6A00000000000000", 0x37E8, 125),
        ] {
            let frame = frame(text);
            assert_eq!(checksum(&frame), crc, "{text}");
            assert_eq!(length(&frame), bits, "{text}");
        }
    }

    #[test]
    fn no_six_bits_are_equal_and_only_stuff_bits_are_added() {
        let frame = frame("000#0000000000000000");
        let encoded = encode(&frame);
        assert!(encoded.levels.windows(6).all(|six| six.iter().any(|bit| *bit != six[0])));
        // 34 + 8 · 8 bits and the stuff bits; the data begin behind 19 bits and three of these.
        assert_eq!(encoded.levels.len(), 98 + encoded.stuffed.len());
        assert_eq!(encoded.data, 22);
    }
}
