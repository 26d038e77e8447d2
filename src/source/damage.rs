//! Captures damaged in many ways, which no reader may stumble over: for tests.

use super::transcript::transcript;
use super::{InputFormat, SourceOptions};

/// Damages a good capture and reads it, thousands of times. Readers may find anything in it, but
/// must come to an end.
pub fn survive(format: InputFormat, good: &[u8]) {
    let mut random = Random(0x2545_F491_4F6C_DD1D);
    for _ in 0..3_000 {
        let mut bytes = good.to_vec();
        for _ in 0..1 + random.below(4) {
            let at = random.below(bytes.len());
            match random.below(6) {
                0 => bytes[at] = random.byte(),
                1 => bytes[at] ^= 1 << random.below(8),
                2 => bytes[at] = [0, 0xFF, 0x7F, 0x80][random.below(4)],
                3 => bytes.insert(at, random.byte()),
                4 => bytes.truncate(at.max(1)),
                _ => {
                    let from = random.below(bytes.len());
                    let length = random.below(bytes.len() - from);
                    let part = bytes[from..from + length].to_vec();
                    bytes.splice(at..at, part);
                }
            }
        }
        transcript(format, &bytes, &SourceOptions::default());
    }
}

/// Xorshift: the same sequence in every run.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn below(&mut self, limit: usize) -> usize {
        usize::try_from(self.next() % limit.max(1) as u64).unwrap_or(0)
    }

    fn byte(&mut self) -> u8 {
        self.next().to_le_bytes()[0]
    }
}
