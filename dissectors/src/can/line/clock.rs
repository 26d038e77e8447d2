//! The bit clock: where between level changes the bits are sampled.

/// Where in a bit it is sampled, in quarters. Three quarters lie between what CAN in Automation and
/// DeviceNet set (75 to 87.5 %), and are the one point that is right for two samples a bit however
/// these fall.
const SAMPLE_POINT: i64 = 3;

/// How far a bit is moved at most by one edge, as a share of a bit: what the synchronisation jump
/// width is to a controller (CAN 2.0, part A §8).
const JUMP: i64 = 4;

/// How far the clock of a sender may be off, as a share of a bit.
const DRIFT: i64 = 128;

/// Fractions of a tick that are reckoned with.
const TICK: i64 = 1 << 16;

/// Longest time that is reckoned with, in ticks: idle lines take longer, but have no bits.
const LONGEST: u64 = 1 << 44;

/// The longest bit.
const SLOWEST: i64 = 1 << 48;

/// Counts bits between edges. A level change was at its tick or up to one tick before, so that each
/// edge narrows down where bits begin.
///
/// With every edge the next step waits for the one before it: as few instructions as possible lie
/// between them, and who walks along many edges copies the clock, so that it is kept in registers.
#[derive(Clone, Copy, Debug)]
pub(super) struct BitClock {
    /// Duration of a bit.
    bit: i64,
    /// 2⁶⁴ divided by it, and rounded up: with every edge a span is divided by a bit, and to
    /// multiply is faster. Up to this span it is as exact.
    inverse: u64,
    exact: u64,
    /// The tick of the last edge.
    base: u64,
    /// The next sample point, from there.
    next: i64,
    /// Bits may begin by so much earlier or later than it is reckoned.
    doubt: i64,
    /// Where the bits that are counted began, how many there were, and how many of these when it
    /// was known last where one begins.
    origin: u64,
    bits: i64,
    known: i64,
}

impl BitClock {
    /// A clock whose bits last so many ticks.
    pub fn new(ticks_a_bit: f64) -> Self {
        let bit = ((ticks_a_bit * TICK as f64) as i64).clamp(TICK, SLOWEST);
        let inverse = u64::MAX / bit.unsigned_abs() + 1;
        let exact = u64::MAX / bit.unsigned_abs();
        BitClock { bit, inverse, exact, base: 0, next: 0, doubt: 0, origin: 0, bits: 0, known: 0 }
    }

    /// Pulses of fewer ticks than this are shorter than a quarter of a bit.
    pub fn shortest_pulse(&self) -> u64 {
        (self.bit / 4).unsigned_abs().div_ceil(TICK.unsigned_abs())
    }

    /// The first bits of a line that is known from this tick on, wherever they begin.
    pub fn start(&mut self, tick: u64) {
        self.move_to(tick);
        self.synchronize();
    }

    /// How many bits are sampled before this tick.
    #[inline(always)]
    pub fn advance(&mut self, until: u64) -> u32 {
        let count = self.bits_within(self.passed(until));
        self.next += count * self.bit;
        self.bits += count;
        u32::try_from(count).unwrap_or(u32::MAX)
    }

    /// How many bits are sampled before this tick, at which the level changed.
    #[inline(always)]
    pub fn reach(&mut self, tick: u64) -> u32 {
        let passed = self.passed(tick);
        let count = self.bits_within(passed);
        self.next += count * self.bit - passed;
        self.bits += count;
        self.base = tick;
        u32::try_from(count).unwrap_or(u32::MAX)
    }

    /// How long after the last edge a tick is.
    fn passed(&self, tick: u64) -> i64 {
        tick.saturating_sub(self.base).min(LONGEST).cast_signed() * TICK
    }

    /// How many bits are sampled so long after the last edge.
    fn bits_within(&self, passed: i64) -> i64 {
        let ahead = passed - self.next;
        if ahead <= 0 { 0 } else { self.whole_bits(ahead - 1) + 1 }
    }

    /// How many whole bits a span has, which is not negative.
    fn whole_bits(&self, span: i64) -> i64 {
        // Rounding up adds less than span / 2⁶⁴ to the quotient; that is too little to matter while
        // the span times a bit stays below 2⁶⁴.
        if span.unsigned_abs() > self.exact {
            return span / self.bit;
        }
        let product = u128::from(span.unsigned_abs()) * u128::from(self.inverse);
        ((product >> 64) as u64).cast_signed()
    }

    /// The level changed at this tick; all bits before it were counted.
    fn move_to(&mut self, tick: u64) {
        self.next -= self.passed(tick);
        self.base = tick;
    }

    /// A bit begins with the last edge: hard synchronisation.
    pub fn synchronize(&mut self) {
        self.next = self.bit * SAMPLE_POINT / 4 - TICK / 2;
        self.doubt = TICK / 2;
        (self.origin, self.bits, self.known) = (self.base, 0, 0);
    }

    /// A bit should begin with the last edge: the clock is moved towards it.
    #[inline(always)]
    pub fn resynchronize(&mut self) {
        let begins = self.next - self.bit * SAMPLE_POINT / 4;
        let age = self.bits - self.known;
        let doubt = self.doubt + age.min(DRIFT) * self.bit / DRIFT;
        // What was reckoned and what was seen, as far as they agree.
        let earliest = (begins - doubt).clamp(-TICK, 0);
        let latest = (begins + doubt).clamp(-TICK, 0);
        let error = begins - (earliest + latest) / 2;
        self.next -= error.clamp(-self.bit / JUMP, self.bit / JUMP);
        (self.doubt, self.known) = ((latest - earliest) / 2, self.bits);
    }

    /// How many ticks passed from the hard synchronisation to the last edge, and how many bits.
    pub fn span(&self) -> (u64, u64) {
        (self.base.saturating_sub(self.origin), self.bits.unsigned_abs())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clock(ticks_a_bit: f64) -> BitClock {
        let mut clock = BitClock::new(ticks_a_bit);
        clock.start(100);
        clock
    }

    #[test]
    fn bits_are_sampled_at_three_quarters() {
        // Ten ticks a bit, from tick 99.5 on: sampled at 107, 117, 127.
        let mut clock = clock(10.0);
        let counts = [106, 107, 108, 117, 118, 138].map(|until| clock.advance(until));
        assert_eq!(counts, [0, 0, 1, 0, 1, 2]);
    }

    #[test]
    fn two_samples_a_bit_suffice_however_they_fall() {
        // A bit of five, one to five bits long: the edges are seen at 100 + 2n, or one later.
        for late in [0, 1] {
            for bits in 1..=5_u32 {
                let mut clock = BitClock::new(2.0);
                clock.start(100 + late);
                assert_eq!(clock.advance(100 + late + 2 * u64::from(bits)), bits);
            }
        }
    }

    #[test]
    fn an_edge_moves_the_clock_by_a_quarter_of_a_bit_at_most() {
        // The next bit is due at 119.5; an edge at 122 is late by 1.5 to 2.5 ticks: it is moved so
        // that it began at 121.
        let mut late = clock(10.0);
        late.advance(122);
        late.move_to(122);
        late.resynchronize();
        assert_eq!([late.advance(128), late.advance(129)], [0, 1]);
        // At 127, just before the sample point at 127, it is late by 6.5: moved by 2.5 to 129.5.
        let mut later = clock(10.0);
        later.advance(127);
        later.move_to(127);
        later.resynchronize();
        assert_eq!([later.advance(129), later.advance(130)], [0, 1]);
        // At 118 it is early, by 1.5: the bit was sampled, and the next one begins at 118.
        let mut early = clock(10.0);
        assert_eq!(early.advance(118), 2);
        early.move_to(118);
        early.resynchronize();
        assert_eq!([early.advance(125), early.advance(126)], [0, 1]);
    }

    #[test]
    fn an_edge_within_the_tick_that_is_not_known_moves_nothing() {
        for tick in [119, 120] {
            let mut clock = clock(10.0);
            clock.advance(tick + 1);
            clock.move_to(tick);
            let next = clock.next;
            clock.resynchronize();
            assert_eq!(clock.next == next, tick == 120, "{tick}");
        }
    }

    #[test]
    fn spans_of_any_length_have_their_whole_bits() {
        for ticks_a_bit in [1.0, 2.0, 7.3, 8.0, 32.0, 3_333.3, 1e9] {
            let clock = BitClock::new(ticks_a_bit);
            for count in (0..62).map(|power| (1_i64 << power) / clock.bit) {
                let span = count * clock.bit;
                let counts = [span - 1, span, span + 1].map(|it| clock.whole_bits(it.max(0)));
                assert_eq!(counts, [(count - 1).max(0), count, count], "{ticks_a_bit} {count}");
            }
        }
    }

    #[test]
    fn how_far_a_pause_is_counted_in_pieces_does_not_matter() {
        let (mut whole, mut pieces) = (clock(3.3), clock(3.3));
        let count: u32 = (100..5_000).step_by(7).map(|until| pieces.advance(until)).sum();
        assert_eq!(count + pieces.advance(5_000), whole.advance(5_000));
        assert_eq!(pieces.next, whole.next);
    }
}
