//! A tap that samples the levels of one wire or several, as logic analyzers do.

use super::level::Low;
use super::time::{Ps, S};
use anyhow::Result;

/// The levels of up to eight wires, a bit each: 1 is high. The first wire has the lowest bit.
pub type Levels = u8;

/// A form of capture that holds samples.
pub trait Samples {
    /// So many samples of these levels.
    ///
    /// # Errors
    /// They cannot be written.
    fn run(&mut self, levels: Levels, samples: u64) -> Result<()>;

    /// Nothing comes any more.
    ///
    /// # Errors
    /// It cannot be written.
    fn end(self: Box<Self>) -> Result<()>;
}

/// The tap. Sample `n` is taken at `n / rate`.
pub struct Sampler {
    rate: u64,
    /// The levels of idle wires: high, unless the tap is upside down.
    idle: Levels,
    /// Samples taken.
    taken: u64,
    capture: Box<dyn Samples>,
}

impl Sampler {
    /// A tap with this many samples a second on so many wires, which writes to this capture.
    pub fn new(rate: u64, wires: usize, is_inverted: bool, capture: Box<dyn Samples>) -> Self {
        let high = (1_u16 << wires.min(8)) - 1;
        let idle = if is_inverted { 0 } else { high as Levels };
        Sampler { rate, idle, taken: 0, capture }
    }

    /// The levels up to this time are known.
    fn sample(&mut self, levels: Levels, until: Ps) -> Result<()> {
        let wide = i128::from(until) * i128::from(self.rate);
        let samples = u64::try_from(wide.div_euclid(i128::from(S)))?
            + u64::from(wide.rem_euclid(i128::from(S)) > 0);
        let new = samples.saturating_sub(self.taken);
        self.taken += new;
        if new > 0 { self.capture.run(levels, new) } else { Ok(()) }
    }

    /// Watches one wire up to this time: low in these spans, which are in order, else high.
    ///
    /// # Errors
    /// The capture cannot be written.
    pub fn watch(&mut self, spans: &[Low], until: Ps) -> Result<()> {
        for low in spans {
            self.sample(self.idle, low.from)?;
            self.sample(self.idle ^ 1, low.to)?;
        }
        self.sample(self.idle, until)
    }

    /// Watches several wires up to this time, each low in its spans. The spans of a wire are in
    /// order and do not overlap.
    ///
    /// # Errors
    /// The capture cannot be written.
    pub fn watch_all(&mut self, wires: &[&[Low]], until: Ps) -> Result<()> {
        let edges_of = |(wire, spans): (usize, &&[Low])| {
            let edges = spans.iter().flat_map(|low| [low.from, low.to]);
            edges.map(move |at| (at, 1 << wire)).collect::<Vec<(Ps, Levels)>>()
        };
        let mut edges: Vec<_> = wires.iter().enumerate().flat_map(edges_of).collect();
        edges.sort_by_key(|(at, _)| *at);
        let mut levels = self.idle;
        for (at, wire) in edges {
            self.sample(levels, at)?;
            levels ^= wire;
        }
        self.sample(levels, until)
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
    use std::cell::RefCell;
    use std::rc::Rc;

    #[derive(Clone, Default)]
    struct Runs(Rc<RefCell<Vec<(Levels, u64)>>>);

    impl Samples for Runs {
        fn run(&mut self, levels: Levels, samples: u64) -> Result<()> {
            self.0.borrow_mut().push((levels, samples));
            Ok(())
        }
        fn end(self: Box<Self>) -> Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_sample_shows_the_level_at_its_time() {
        // 1 MHz: samples at 0, 1, 2, ... µs. Low from 1.0 to 2.5 µs: samples 1 and 2. Low from 3.2
        // to 3.8 µs falls between two samples.
        let spans =
            [Low { from: 1_000_000, to: 2_500_000 }, Low { from: 3_200_000, to: 3_800_000 }];
        let runs = Runs::default();
        let mut tap = Sampler::new(1_000_000, 1, false, Box::new(runs.clone()));
        tap.watch(&spans, 6_000_000).unwrap();
        tap.finish(8_000_000).unwrap();
        assert_eq!(*runs.0.borrow(), [(1, 1), (0, 2), (1, 1), (1, 2), (1, 2)]);
    }

    #[test]
    fn two_wires_are_sampled_together() {
        // 1 MHz. The first is low from 1 to 3 µs, the second from 2 to 5 µs.
        let low = |from: Ps, to: Ps| [Low { from: from * 1_000_000, to: to * 1_000_000 }];
        let runs = Runs::default();
        let mut tap = Sampler::new(1_000_000, 2, false, Box::new(runs.clone()));
        tap.watch_all(&[&low(1, 3), &low(2, 5)], 6_000_000).unwrap();
        tap.finish(6_000_000).unwrap();
        assert_eq!(*runs.0.borrow(), [(0b11, 1), (0b10, 1), (0b00, 1), (0b01, 2), (0b11, 1)]);
        let upside_down = Sampler::new(1_000_000, 2, true, Box::new(runs.clone()));
        upside_down.finish(1_000_000).unwrap();
        assert_eq!(runs.0.borrow().last(), Some(&(0, 1)));
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
