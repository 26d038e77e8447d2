//! A tap that samples the line's level, as logic analyzers do.

use super::level::Low;
use super::time::{Ps, S};
use anyhow::Result;

/// A form of capture that holds samples.
pub trait Samples {
    /// So many samples of this level.
    ///
    /// # Errors
    /// They cannot be written.
    fn run(&mut self, level: bool, samples: u64) -> Result<()>;

    /// Nothing comes any more.
    ///
    /// # Errors
    /// It cannot be written.
    fn end(self) -> Result<()>;
}

/// The tap. Sample `n` is taken at `n / rate`.
pub struct Sampler<C> {
    rate: u64,
    /// The level of an idle line: high, unless the tap is upside down.
    idle: bool,
    /// Samples taken.
    taken: u64,
    capture: C,
}

impl<C: Samples> Sampler<C> {
    /// A tap with this many samples a second, which writes to this capture.
    pub fn new(rate: u64, is_inverted: bool, capture: C) -> Self {
        Sampler { rate, idle: !is_inverted, taken: 0, capture }
    }

    /// The level up to this time is known.
    fn sample(&mut self, level: bool, until: Ps) -> Result<()> {
        let wide = i128::from(until) * i128::from(self.rate);
        let samples = u64::try_from(wide.div_euclid(i128::from(S)))?
            + u64::from(wide.rem_euclid(i128::from(S)) > 0);
        let new = samples.saturating_sub(self.taken);
        self.taken += new;
        if new > 0 { self.capture.run(level, new) } else { Ok(()) }
    }

    /// Watches the line up to this time: low in these spans, which are in order, else high.
    ///
    /// # Errors
    /// The capture cannot be written.
    pub fn watch(&mut self, spans: &[Low], until: Ps) -> Result<()> {
        for low in spans {
            self.sample(self.idle, low.from)?;
            self.sample(!self.idle, low.to)?;
        }
        self.sample(self.idle, until)
    }

    /// The capture ends here.
    ///
    /// # Errors
    /// The capture cannot be written.
    pub fn finish(mut self, at: Ps) -> Result<()> {
        self.sample(self.idle, at)?;
        self.capture.end()
    }
}

/// A sample rate as sigrok writes it: `4 MHz`, `345.594 kHz`.
pub fn rate_in_words(rate: u64) -> String {
    let units = [(1_000_000_000, "GHz"), (1_000_000, "MHz"), (1_000, "kHz")];
    let Some((unit, name)) = units.into_iter().find(|(unit, _)| rate >= *unit) else {
        return format!("{rate} Hz");
    };
    let digits = unit.ilog10() as usize;
    let fraction = format!("{:0digits$}", rate % unit);
    let fraction = fraction.trim_end_matches('0');
    let point = if fraction.is_empty() { "" } else { "." };
    format!("{}{point}{fraction} {name}", rate / unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Default)]
    struct Runs(Vec<(bool, u64)>);

    impl Samples for &mut Runs {
        fn run(&mut self, level: bool, samples: u64) -> Result<()> {
            self.0.push((level, samples));
            Ok(())
        }
        fn end(self) -> Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_sample_shows_the_level_at_its_time() {
        // 1 MHz: samples at 0, 1, 2, ... µs. Low from 1.0 to 2.5 µs: samples 1 and 2. Low from 3.2
        // to 3.8 µs falls between two samples.
        let spans =
            [Low { from: 1_000_000, to: 2_500_000 }, Low { from: 3_200_000, to: 3_800_000 }];
        let mut runs = Runs::default();
        let mut tap = Sampler::new(1_000_000, false, &mut runs);
        tap.watch(&spans, 6_000_000).unwrap();
        tap.finish(8_000_000).unwrap();
        assert_eq!(runs.0, [(true, 1), (false, 2), (true, 1), (true, 2), (true, 2)]);
    }

    #[test]
    fn rates_are_written_as_sigrok_writes_them() {
        for (rate, words) in [
            (4_000_000, "4 MHz"),
            (500_000, "500 kHz"),
            (345_594, "345.594 kHz"),
            (12_500_000, "12.5 MHz"),
            (999, "999 Hz"),
            (1_000_000_000, "1 GHz"),
        ] {
            assert_eq!(rate_in_words(rate), words);
        }
    }
}
