//! Times that are measured over and over: how long they are, and how even.

/// Spans of time, summed up.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct Spans {
    count: u64,
    min: i64,
    max: i64,
    /// All is added up as differences to the first, so that the squares stay small.
    first: i64,
    sum: i128,
    squares: u128,
}

impl Spans {
    /// Adds a span of so many ns.
    pub fn add(&mut self, ns: i64) {
        if self.count == 0 {
            (self.min, self.max, self.first) = (ns, ns, ns);
        }
        self.count += 1;
        (self.min, self.max) = (self.min.min(ns), self.max.max(ns));
        let difference = i128::from(ns) - i128::from(self.first);
        self.sum += difference;
        let square = difference.unsigned_abs().saturating_mul(difference.unsigned_abs());
        self.squares = self.squares.saturating_add(square);
    }

    /// How many there were.
    #[must_use]
    pub const fn count(&self) -> u64 {
        self.count
    }

    /// The shortest in ns; 0 where there was none.
    #[must_use]
    pub const fn min(&self) -> i64 {
        self.min
    }

    /// The longest in ns; 0 where there was none.
    #[must_use]
    pub const fn max(&self) -> i64 {
        self.max
    }

    /// The mean in ns, cut to whole ones; 0 where there was none.
    #[must_use]
    pub fn mean(&self) -> i64 {
        let mean = i128::from(self.first) + self.sum / i128::from(self.count.max(1));
        i64::try_from(mean).unwrap_or(i64::MAX)
    }

    /// The standard deviation in ns, cut to whole ones: how far they are off the mean.
    #[must_use]
    pub fn deviation(&self) -> u64 {
        let count = u128::from(self.count.max(1));
        let mean = self.sum.unsigned_abs() / count;
        let variance = (self.squares / count).saturating_sub(mean.saturating_mul(mean));
        u64::try_from(variance.isqrt()).unwrap_or(u64::MAX)
    }
}

/// What was measured of one station.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Measurement {
    /// What it is, such as `poll interval`.
    pub subject: &'static str,
    /// Whose.
    pub station: u16,
    /// The spans.
    pub spans: Spans,
    /// What practice takes for the longest in ns, and how many were longer: no rule, no finding.
    pub limit: Option<(i64, u64)>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_are_summed_up() {
        let mut spans = Spans::default();
        assert_eq!((spans.count(), spans.mean(), spans.deviation()), (0, 0, 0));
        // The usual example: mean 5, deviation 2.
        for ns in [2, 4, 4, 4, 5, 5, 7, 9] {
            spans.add(ns);
        }
        assert_eq!((spans.count(), spans.min(), spans.max()), (8, 2, 9));
        assert_eq!((spans.mean(), spans.deviation()), (5, 2));
    }

    #[test]
    fn spans_beyond_measure_do_no_harm() {
        let mut spans = Spans::default();
        for ns in [i64::MIN, i64::MAX, i64::MAX, 0] {
            spans.add(ns);
        }
        assert_eq!((spans.min(), spans.max()), (i64::MIN, i64::MAX));
        let _ = (spans.mean(), spans.deviation());
        assert_eq!(spans.count(), 4);
    }
}
