//! Lines of an adapter about its own state. Some send them again and again, changed or not, faster
//! than they can be decoded.

use dissectors::event::Moment;

/// How long a line is not told again, in ns.
const WINDOW_NS: i64 = 1_000_000_000;

/// Most lines that are told in that time.
const MOST: usize = 8;

/// Longest line: `sw` and two error counters.
const LONGEST: usize = 8;

/// What was told lately.
#[derive(Clone, Copy, Default, Debug)]
pub struct Repeats {
    since: Option<Moment>,
    told: [[u8; LONGEST]; MOST],
    count: usize,
    left_out: u64,
}

impl Repeats {
    /// Whether a line that was read at this time is to be told. One that was told lately is not, nor
    /// is one after too many others.
    pub fn is_news(&mut self, line: &[u8], now: Moment) -> bool {
        let is_old = |since| now.since(since).is_none_or(|ns| !(0..WINDOW_NS).contains(&ns));
        if self.since.is_none_or(is_old) {
            (self.since, self.count) = (Some(now), 0);
        }
        let mut key = [0; LONGEST];
        key.iter_mut().zip(line).for_each(|(kept, byte)| *kept = *byte);
        let is_told = self.told[..self.count].contains(&key);
        match self.told.get_mut(self.count).filter(|_| !is_told) {
            Some(free) => {
                *free = key;
                self.count += 1;
                true
            }
            None => {
                self.left_out = self.left_out.saturating_add(1);
                false
            }
        }
    }

    /// How many were not told since this was last asked.
    pub fn take_left_out(&mut self) -> u64 {
        std::mem::take(&mut self.left_out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_told_once_in_a_second() {
        let mut repeats = Repeats::default();
        let at = |ms: i64| Moment::from_ns(ms * 1_000_000);
        let lines = [("F00", 0), ("FFF", 1), ("F00", 2), ("FFF", 999), ("F00", 1_000)];
        let told = lines.map(|(line, ms)| repeats.is_news(line.as_bytes(), at(ms)));
        assert_eq!(told, [true, true, false, false, true]);
        assert_eq!([repeats.take_left_out(), repeats.take_left_out()], [2, 0]);
    }

    #[test]
    fn lines_that_all_differ_are_bounded_as_well() {
        let mut repeats = Repeats::default();
        let lines = (0..1000).map(|count| format!("sw{count:03}000"));
        let told = lines.filter(|line| repeats.is_news(line.as_bytes(), Moment::from_ns(0)));
        assert_eq!(told.count(), MOST);
    }
}
