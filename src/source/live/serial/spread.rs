//! When the characters of a read began on the wire.
//!
//! All that is known is when the read returned, and that one character follows the other at the
//! frame's length at the closest. So the last one is taken to have ended just then, and those before
//! it to have come without a pause: each read is spread backwards from its end.

use dissectors::event::Moment;
use dissectors::uart::{Baud, Format};

/// Places characters in time.
#[derive(Clone, Copy, Debug)]
pub struct Spread {
    bits: u32,
    baud: u32,
    /// How much later than its read a character may be placed, in ns: ± of a stamp.
    slack: i64,
    /// Until then characters were placed, or the line was said to be silent.
    heard_until: Option<i64>,
}

impl Spread {
    /// For characters of this format and rate, with stamps worth ± `slack` ns.
    pub fn new(baud: Baud, format: Format, slack: i64) -> Self {
        Spread { bits: format.bits(), baud: baud.get(), slack, heard_until: None }
    }

    /// How long so many characters take without a pause, in ns, rounded to the nearest: as captures
    /// place the characters of a block.
    fn ns(&self, characters: usize) -> i64 {
        let baud = u128::from(self.baud);
        let bits = characters as u128 * u128::from(self.bits);
        i64::try_from((bits * 1_000_000_000 + baud / 2) / baud).unwrap_or(i64::MAX)
    }

    /// How long one character takes, in ns.
    pub fn character_ns(&self) -> i64 {
        self.ns(1)
    }

    /// Up to when was heard, unless the clock was set back since: it knows nothing of what it said
    /// before.
    fn heard_until(&self, now: i64) -> Option<i64> {
        self.heard_until.filter(|until| *until <= now.saturating_add(self.slack))
    }

    /// Since when so many characters, whose read returned at `now`, may have come, where they do not
    /// fill the time since then: their stamps are worth no more than that.
    pub fn doubt(&self, now: i64, count: usize) -> Option<i64> {
        let first = now.saturating_sub(self.ns(count));
        self.heard_until(now).filter(|until| first.saturating_sub(*until) > self.slack)
    }

    /// When each of so many characters began whose read returned at `now`. None begins before what
    /// was read before had ended.
    pub fn place(&mut self, now: i64, count: usize) -> impl Iterator<Item = Moment> + use<> {
        let length = self.ns(count);
        let backwards = now.saturating_sub(length);
        let first = self.heard_until(now).map_or(backwards, |until| until.max(backwards));
        let latest = now.saturating_add(self.slack);
        // More than the line can carry at its rate, or a pseudo terminal, which knows no rate: they
        // are drawn together.
        let room = latest.saturating_sub(first);
        let is_tight = room < length;
        let end = if is_tight { latest } else { first.saturating_add(length) };
        self.heard_until = Some(end);
        let spread = *self;
        (0..count).map(move |number| {
            let offset = match is_tight {
                true => {
                    room.max(0) / i64::try_from(count.max(1)).unwrap_or(i64::MAX) * number as i64
                }
                false => spread.ns(number),
            };
            Moment::from_ns(first.saturating_add(offset))
        })
    }

    /// Up to when was heard, if anything was.
    pub fn until(&self) -> Option<i64> {
        self.heard_until
    }

    /// Nothing was there to be read at `now`, and what was on the line `wait` before would have been.
    /// Returns up to when the line is known: no earlier than what was heard.
    pub fn silence(&mut self, now: i64, wait: i64) -> i64 {
        let until = now.saturating_sub(wait);
        let until = self.heard_until(now).map_or(until, |heard| heard.max(until));
        self.heard_until = Some(until);
        until
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 115200 Bd 8E1: a character takes 11 / 115200 s = 95486.1 ns.
    fn spread() -> Spread {
        Spread::new(Baud::new(115_200).unwrap(), Format::FT12, 2_000_000)
    }

    fn placed(spread: &mut Spread, now: i64, count: usize) -> Vec<i64> {
        spread.place(now, count).map(|at| at.ns().unwrap()).collect()
    }

    #[test]
    fn a_read_is_spread_backwards_from_its_end() {
        // 3 x 95486.1 = 286458 before the end; then one and two characters later.
        let starts = placed(&mut spread(), 10_000_000, 3);
        assert_eq!(starts, [9_713_542, 9_713_542 + 95_486, 9_713_542 + 190_972]);
    }

    #[test]
    fn no_character_begins_before_the_one_before_has_ended() {
        let mut spread = spread();
        assert_eq!(placed(&mut spread, 10_000_000, 1), [9_904_514]);
        // Two characters 100 µs after the first take 191 µs: they begin where it ended.
        assert_eq!(placed(&mut spread, 10_100_000, 2), [10_000_000, 10_095_486]);
        // That lasted until 10190972, and so does what comes right after.
        assert_eq!(placed(&mut spread, 10_150_000, 1), [10_190_972]);
        // After a pause it is the read that counts.
        assert_eq!(placed(&mut spread, 20_000_000, 1), [19_904_514]);
    }

    #[test]
    fn what_is_faster_than_the_line_is_drawn_together_and_stays_in_order() {
        let mut spread = spread();
        placed(&mut spread, 10_000_000, 1);
        // 100 characters take 9.5 ms. 1 ms has passed; with ± 2 ms there is room for 3 ms: 30 µs
        // for each.
        let starts = placed(&mut spread, 11_000_000, 100);
        assert_eq!((starts[0], starts[1], starts[99]), (10_000_000, 10_030_000, 12_970_000));
        let next = placed(&mut spread, 11_000_001, 2);
        assert_eq!(next, [13_000_000, 13_000_000], "there is no room left, and no way back");
    }

    #[test]
    fn characters_that_do_not_fill_the_time_since_may_have_come_at_any() {
        let mut spread = spread();
        assert_eq!(spread.doubt(10_000_000, 1), None, "nothing was heard before");
        placed(&mut spread, 10_000_000, 1);
        // A second later: 10473 characters fill it, and ± 2 ms are 20.9 of them.
        let now = 1_010_000_000;
        for (count, since) in [(10_473, None), (10_453, None), (10_451, Some(10_000_000))] {
            assert_eq!(spread.doubt(now, count), since, "{count}");
        }
    }

    #[test]
    fn nothing_comes_before_a_silence_that_was_told() {
        let mut spread = spread();
        assert_eq!(spread.silence(10_000_000, 100_000), 9_900_000);
        assert_eq!(placed(&mut spread, 10_000_000, 2), [9_900_000, 9_995_486]);
    }

    #[test]
    fn the_line_is_known_up_to_what_was_heard() {
        let mut spread = spread();
        placed(&mut spread, 10_000_000, 1);
        // Twenty characters that come with it take 20 x 95486.1 = 1909722 ns; the last begins after 19.
        assert_eq!(placed(&mut spread, 10_000_000, 20)[19], 10_000_000 + 1_814_236);
        assert_eq!(spread.silence(10_000_000, 4_000_000), 10_000_000 + 1_909_722);
        assert_eq!(spread.silence(20_000_000, 4_000_000), 16_000_000);
    }

    #[test]
    fn a_clock_that_is_set_back_begins_anew() {
        let mut spread = spread();
        placed(&mut spread, 10_000_000_000, 1);
        assert_eq!(placed(&mut spread, 5_000_000_000, 1), [4_999_904_514]);
        assert_eq!(spread.silence(6_000_000_000, 0), 6_000_000_000);
        assert_eq!(spread.silence(1_000_000_000, 0), 1_000_000_000);
        assert_eq!(placed(&mut spread, i64::MIN, 2).len(), 2, "whatever the clock says");
    }
}
