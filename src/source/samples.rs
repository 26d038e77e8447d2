//! Packed logic samples: where each channel's level changes.

use dissectors::event::Levels;

/// Widest sample that is looked at as one number.
const WORD: usize = 8;

/// Words that are looked at together: of samples of a byte, 64.
const WORDS: usize = 8;

/// The levels of one channel in the block at hand.
struct Channel {
    name: String,
    /// Which bit of the sample.
    bit: usize,
    level: bool,
    /// The level before the first edge of the block.
    level_before: bool,
    edges: Vec<u64>,
    has_edges: bool,
    /// There were no edges before the block at hand.
    is_new: bool,
}

/// Turns blocks of packed samples into level changes, channel by channel.
pub struct Samples {
    unitsize: usize,
    channels: Vec<Channel>,
    /// The last sample.
    last: Vec<u8>,
    /// Bytes of a sample that is not whole yet.
    rest: Vec<u8>,
    /// Samples before the block at hand, and up to its end.
    from: u64,
    until: u64,
}

impl Samples {
    /// Samples of `unitsize` bytes in which these bits are channels.
    pub fn new(unitsize: usize, channels: Vec<(String, usize)>) -> Self {
        let channels: Vec<Channel> = channels
            .into_iter()
            .filter(|(_, bit)| *bit < unitsize * 8)
            .map(|(name, bit)| Channel {
                name,
                bit,
                level: true,
                level_before: true,
                edges: Vec::new(),
                has_edges: false,
                is_new: true,
            })
            .collect();
        let (last, rest) = (Vec::new(), Vec::new());
        Samples { unitsize, channels, last, rest, from: 0, until: 0 }
    }

    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.channels.len()
    }

    /// A channel's name.
    pub fn name(&self, channel: usize) -> &str {
        &self.channels[channel].name
    }

    /// Whether a channel ever changed its level.
    pub fn has_edges(&self, channel: usize) -> bool {
        self.channels[channel].has_edges
    }

    /// Samples so far.
    pub fn samples(&self) -> u64 {
        self.until
    }

    /// Bytes of a last sample that is not whole.
    pub fn incomplete(&self) -> usize {
        self.rest.len()
    }

    /// A channel's levels in the block at hand; from the capture's start, where these are its
    /// first edges.
    pub fn levels(&self, channel: usize) -> Levels<'_> {
        let channel = &self.channels[channel];
        let from = if channel.is_new { 0 } else { self.from };
        Levels { edges: &channel.edges, level: channel.level_before, from, until: self.until }
    }

    /// Takes the next block of bytes, whole samples or not.
    pub fn take(&mut self, mut block: &[u8]) {
        self.from = self.until;
        for channel in &mut self.channels {
            channel.edges.clear();
            channel.level_before = channel.level;
            channel.is_new = !channel.has_edges;
        }
        if !self.rest.is_empty() {
            let missing = (self.unitsize - self.rest.len()).min(block.len());
            self.rest.extend_from_slice(&block[..missing]);
            block = &block[missing..];
            if self.rest.len() < self.unitsize {
                return;
            }
            let whole = std::mem::take(&mut self.rest);
            self.take_samples(&whole);
        }
        let (whole, rest) = block.split_at(block.len() - block.len() % self.unitsize);
        self.take_samples(whole);
        self.rest.extend_from_slice(rest);
    }

    fn take_samples(&mut self, samples: &[u8]) {
        if samples.is_empty() {
            return;
        }
        if self.last.is_empty() {
            self.last = samples[..self.unitsize].to_vec();
            for channel in &mut self.channels {
                channel.level = self.last[channel.bit / 8] >> (channel.bit % 8) & 1 == 1;
                channel.level_before = channel.level;
            }
        }
        match self.unitsize {
            1 | 2 | 4 | 8 => self.take_words(samples),
            _ => self.take_wide(samples),
        }
    }

    /// Samples that divide a word: eight words are compared at once, and where they differ, the
    /// levels of a channel become the bits of one number.
    fn take_words(&mut self, samples: &[u8]) {
        let width = 8 * self.unitsize;
        let each = Each::of(width);
        let all = self.channels.iter().fold(0_u64, |all, channel| all | 1 << channel.bit);
        let mut expected = word(&self.last) * each.first;
        let (blocks, rest) = samples.as_chunks::<{ WORDS * WORD }>();
        for block in blocks {
            let (words, _) = block.as_chunks::<WORD>();
            let changed = words
                .iter()
                .fold(0, |changed, bytes| changed | (u64::from_le_bytes(*bytes) ^ expected));
            if changed & (all * each.first) != 0 {
                for channel in &mut self.channels {
                    if changed >> channel.bit & each.first != 0 {
                        let levels = words.iter().rev().fold(0, |levels, bytes| {
                            let word = u64::from_le_bytes(*bytes);
                            levels << each.samples | each.pack(word >> channel.bit)
                        });
                        channel.take(levels, WORDS as u32 * each.samples, self.until);
                    }
                }
                let [.., last] = words else { continue };
                expected = (u64::from_le_bytes(*last) >> each.shift) * each.first;
            }
            self.until += u64::from(WORDS as u32 * each.samples);
        }
        self.last.copy_from_slice(&expected.to_le_bytes()[..self.unitsize]);
        self.take_wide(rest);
    }

    /// Samples of any other width, looked at one by one.
    fn take_wide(&mut self, samples: &[u8]) {
        for sample in samples.chunks_exact(self.unitsize) {
            if sample != self.last {
                for channel in &mut self.channels {
                    let level = sample[channel.bit / 8] >> (channel.bit % 8) & 1 == 1;
                    if level != channel.level {
                        channel.toggle(self.until);
                    }
                }
                self.last.copy_from_slice(sample);
            }
            self.until += 1;
        }
    }
}

/// The samples of a word.
struct Each {
    /// How many there are.
    samples: u32,
    /// The first bit of each.
    first: u64,
    /// How far up the last one stands.
    shift: u32,
    /// By what the first bits are multiplied to stand side by side where the last sample does: the
    /// bit of sample i is moved up by what it lacks, and no two meet.
    gather: u64,
}

impl Each {
    /// Of samples of so many bits: 8, 16, 32 or 64.
    fn of(width: usize) -> Self {
        let samples = 64 / width;
        let shift = 64 - width;
        let sum = |bit: &dyn Fn(usize) -> usize| (0..samples).map(|i| 1 << bit(i)).sum();
        Each {
            samples: samples as u32,
            first: sum(&|i| width * i),
            shift: shift as u32,
            gather: sum(&|i| shift - (width - 1) * i),
        }
    }

    /// The first bit of each sample, side by side.
    const fn pack(&self, word: u64) -> u64 {
        (word & self.first).wrapping_mul(self.gather) >> self.shift
    }
}

impl Channel {
    /// Takes the levels of so many samples, 64 at most, from this tick on: a bit each.
    fn take(&mut self, levels: u64, count: u32, tick: u64) {
        let before = levels << 1 | u64::from(self.level);
        let mut edges = (levels ^ before) & u64::MAX >> (64 - count);
        self.level = levels >> (count - 1) & 1 == 1;
        self.has_edges |= edges != 0;
        while edges != 0 {
            self.edges.push(tick + u64::from(edges.trailing_zeros()));
            edges &= edges - 1;
        }
    }

    fn toggle(&mut self, tick: u64) {
        self.level = !self.level;
        self.edges.push(tick);
        self.has_edges = true;
    }
}

fn word(bytes: &[u8]) -> u64 {
    let mut word = [0; WORD];
    word[..bytes.len()].copy_from_slice(bytes);
    u64::from_le_bytes(word)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Edges of each channel when the samples come in blocks of this many bytes.
    fn edges(unitsize: usize, bits: &[usize], bytes: &[u8], block: usize) -> Vec<Vec<u64>> {
        let channels = bits.iter().map(|bit| (format!("D{bit}"), *bit)).collect();
        let mut samples = Samples::new(unitsize, channels);
        let mut edges = vec![Vec::new(); bits.len()];
        for block in bytes.chunks(block) {
            samples.take(block);
            for (channel, edges) in edges.iter_mut().enumerate() {
                edges.extend_from_slice(samples.levels(channel).edges);
            }
        }
        assert_eq!(samples.samples(), (bytes.len() / unitsize) as u64);
        edges
    }

    /// The definition, sample by sample.
    fn expected(unitsize: usize, bit: usize, bytes: &[u8]) -> Vec<u64> {
        let level = |sample: &[u8]| sample[bit / 8] >> (bit % 8) & 1;
        let levels: Vec<u8> = bytes.chunks_exact(unitsize).map(level).collect();
        (1..)
            .zip(levels.windows(2))
            .filter(|(_, pair)| pair[0] != pair[1])
            .map(|(n, _)| n)
            .collect()
    }

    #[test]
    fn edges_are_found_in_samples_of_any_width_and_any_division() {
        // A sequence without a pattern: x -> 5x + 3 modulo 2^16, its high byte, every value
        // repeated a few times.
        let mut x = 1_u16;
        let mut bytes = Vec::new();
        while bytes.len() < 2_000 {
            x = x.wrapping_mul(0x4E35).wrapping_add(3);
            let [value, count] = x.to_be_bytes();
            bytes.extend(std::iter::repeat_n(value, usize::from(count % 9)));
        }
        for unitsize in [1, 2, 3, 4, 5, 8, 9] {
            let bits: Vec<usize> = [0, 1, 7, 8 * unitsize - 1].into_iter().collect();
            let bits = if unitsize == 1 { &bits[..3] } else { &bits[..] };
            for block in [1, 2, 7, 8, 64, 1_000, 5_000] {
                let found = edges(unitsize, bits, &bytes, block);
                for (bit, found) in bits.iter().zip(found) {
                    assert_eq!(found, expected(unitsize, *bit, &bytes), "{unitsize} {bit} {block}");
                }
            }
        }
    }

    #[test]
    fn bits_that_are_no_channel_may_carry_anything() {
        let bytes: Vec<u8> = (0..=255).collect();
        assert_eq!(edges(1, &[7], &bytes, 256), [vec![128]]);
    }

    #[test]
    fn the_first_sample_is_no_edge() {
        let mut samples = Samples::new(1, vec![("low".into(), 0), ("high".into(), 1)]);
        samples.take(&[0b10, 0b10, 0b11]);
        assert_eq!((samples.levels(0).level, samples.levels(0).edges), (false, &[2][..]));
        assert!(samples.levels(1).level && !samples.has_edges(1) && samples.has_edges(0));
    }
}
