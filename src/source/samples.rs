//! Packed logic samples: where each channel's level changes.

use dissectors::event::Levels;

/// Widest sample that is looked at as one number.
const WORD: usize = 8;

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
    /// Channel of each bit of a sample.
    by_bit: Vec<Option<usize>>,
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
        let mut by_bit = vec![None; unitsize * 8];
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
        for (index, channel) in channels.iter().enumerate() {
            by_bit[channel.bit] = Some(index);
        }
        let (last, rest) = (Vec::new(), Vec::new());
        Samples { unitsize, channels, by_bit, last, rest, from: 0, until: 0 }
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

    /// Samples that divide a word: eight bytes are compared at once.
    fn take_words(&mut self, samples: &[u8]) {
        let unit = self.unitsize;
        let ones = u64::MAX >> (64 - 8 * unit);
        let repeat = u64::MAX / ones;
        let channels = self.channels.iter().fold(0_u64, |mask, channel| mask | 1 << channel.bit);
        let mask = channels * repeat;
        let mut last = word(&self.last);
        let mut expected = (last & ones) * repeat;
        let (words, rest) = samples.as_chunks::<WORD>();
        let mut tick = self.until;
        let per_word = (WORD / unit) as u64;
        for bytes in words {
            let mut word = u64::from_le_bytes(*bytes);
            let mut changed = (word ^ expected) & mask;
            // Each change makes a new last sample; the samples before it are done with.
            while changed != 0 {
                let index = changed.trailing_zeros() as usize / (8 * unit);
                let shift = index * 8 * unit;
                let sample = word >> shift & ones;
                self.toggle((sample ^ last) & channels, tick + index as u64);
                last = sample;
                expected = last * repeat;
                // Behind this sample, compare with it.
                let behind =
                    if shift + 8 * unit >= 64 { 0 } else { u64::MAX << (shift + 8 * unit) };
                changed = (word ^ expected) & mask & behind;
            }
            word = u64::from_le_bytes(*bytes) >> (64 - 8 * unit);
            last = word & ones;
            expected = last * repeat;
            tick += per_word;
        }
        for sample in rest.chunks_exact(unit) {
            let sample = word(sample);
            self.toggle((sample ^ last) & channels, tick);
            last = sample;
            tick += 1;
        }
        self.until = tick;
        self.last.copy_from_slice(&last.to_le_bytes()[..unit]);
    }

    fn toggle(&mut self, mut bits: u64, tick: u64) {
        while bits != 0 {
            let bit = bits.trailing_zeros() as usize;
            bits &= bits - 1;
            if let Some(channel) = self.by_bit[bit] {
                self.channels[channel].toggle(tick);
            }
        }
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

impl Channel {
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
