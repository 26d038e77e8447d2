//! VCD as sigrok writes it: time and value on one line.

use super::samples::{Samples, rate_in_words};
use anyhow::Result;
use std::io::Write;

/// A capture of this form.
pub struct Vcd<W> {
    out: W,
    rate: u64,
    /// Ticks of the time scale in a second.
    scale: u64,
    samples: u64,
    level: Option<bool>,
}

impl<W: Write> Vcd<W> {
    /// Begins a capture with one channel.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn new(mut out: W, channel: &str, rate: u64) -> Result<Self> {
        let scale = scale(rate);
        // A date that never changes: the same seed makes the same file.
        write!(
            out,
            "$date Thu Jan  1 00:00:00 2026 $end\n$version libsigrok 0.5.2 $end\n$comment\n  Acquisition with 1/1 channels at {}\n\
             $end\n$timescale {} $end\n$scope module libsigrok $end\n\
             $var wire 1 ! {channel} $end\n$upscope $end\n$enddefinitions $end\n",
            rate_in_words(rate),
            tick_in_words(scale)
        )?;
        Ok(Vcd { out, rate, scale, samples: 0, level: None })
    }

    fn ticks(&self) -> u128 {
        u128::from(self.samples) * u128::from(self.scale) / u128::from(self.rate)
    }
}

/// The coarsest time scale of 1, 10 or 100 of a unit that a sample fits into whole; if there is
/// none within two decades, the finest of these.
fn scale(rate: u64) -> u64 {
    let decade = (0..).map(|power| 10_u64.pow(power)).find(|scale| *scale >= rate).unwrap_or(1);
    let choices = [decade, decade * 10, decade * 100];
    choices.into_iter().find(|scale| scale % rate == 0).unwrap_or(choices[2])
}

fn tick_in_words(scale: u64) -> String {
    let units = [(1, "s"), (1_000, "ms"), (1_000_000, "us"), (1_000_000_000, "ns")];
    let picoseconds = (1_000_000_000_000, "ps");
    let (unit, name) = units.into_iter().find(|(unit, _)| scale <= *unit).unwrap_or(picoseconds);
    format!("{} {name}", unit / scale)
}

impl<W: Write> Samples for Vcd<W> {
    fn run(&mut self, level: bool, samples: u64) -> Result<()> {
        if self.level != Some(level) {
            writeln!(self.out, "#{} {}!", self.ticks(), u8::from(level))?;
            self.level = Some(level);
        }
        self.samples += samples;
        Ok(())
    }

    fn end(mut self) -> Result<()> {
        writeln!(self.out, "#{}", self.ticks())?;
        self.out.flush()?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_is_a_whole_number_of_ticks() {
        // 4 MHz: 250 ns is no multiple of 100 ns but of 10 ns.
        assert_eq!(tick_in_words(scale(4_000_000)), "10 ns");
        assert_eq!(tick_in_words(scale(1_000_000)), "1 us");
        assert_eq!(tick_in_words(scale(500_000)), "1 us");
        assert_eq!(tick_in_words(scale(3_000_000)), "1 ns");
        assert_eq!(tick_in_words(scale(1)), "1 s");
        assert_eq!(tick_in_words(scale(1_000_000_000)), "1 ns");
    }

    #[test]
    fn changes_stand_on_one_line_and_the_end_alone() {
        let mut out = Vec::new();
        let mut vcd = Vcd::new(&mut out, "BUS", 4_000_000).unwrap();
        for (level, samples) in [(true, 4), (false, 2), (false, 2), (true, 8)] {
            vcd.run(level, samples).unwrap();
        }
        vcd.end().unwrap();
        let text = String::from_utf8(out).unwrap();
        let (head, changes) = text.split_once("$enddefinitions $end\n").unwrap();
        assert!(head.contains("$var wire 1 ! BUS $end\n"));
        // 4 samples are 1000 ns: 100 ticks.
        assert_eq!(changes, "#0 1!\n#100 0!\n#200 1!\n#400\n");
    }
}
