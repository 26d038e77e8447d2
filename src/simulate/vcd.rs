//! VCD as sigrok writes it: time and value on one line.

use super::samples::{Levels, Samples, rate_in_words};
use anyhow::Result;
use std::io::Write;

/// A capture of this form.
pub struct Vcd<W> {
    out: W,
    rate: u64,
    /// Ticks of the time scale in a second.
    scale: u64,
    samples: u64,
    wires: usize,
    levels: Option<Levels>,
}

/// The sign that stands for a wire: `!`, `"`, `#` …
fn sign(wire: usize) -> char {
    char::from(b'!' + wire as u8)
}

impl<W: Write> Vcd<W> {
    /// Begins a capture with these channels, eight at most.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn new(mut out: W, channels: &[&str], rate: u64) -> Result<Self> {
        let scale = scale(rate);
        let wires = channels.len();
        let declared = channels.iter().enumerate();
        let declared =
            declared.map(|(wire, name)| format!("$var wire 1 {} {name} $end\n", sign(wire)));
        // A date that never changes: the same seed makes the same file.
        write!(
            out,
            "$date Thu Jan  1 00:00:00 2026 $end\n$version libsigrok 0.5.2 $end\n$comment\n  Acquisition with {wires}/{wires} channels at {}\n\
             $end\n$timescale {} $end\n$scope module libsigrok $end\n\
             {}$upscope $end\n$enddefinitions $end\n",
            rate_in_words(rate),
            tick_in_words(scale),
            declared.collect::<String>()
        )?;
        Ok(Vcd { out, rate, scale, samples: 0, wires, levels: None })
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
    fn run(&mut self, levels: Levels, samples: u64) -> Result<()> {
        let changed = self.levels.map_or(Levels::MAX, |before| before ^ levels);
        let is_new = |wire: &usize| changed >> wire & 1 == 1;
        let wires: Vec<usize> = (0..self.wires).filter(is_new).collect();
        if !wires.is_empty() {
            write!(self.out, "#{}", self.ticks())?;
            for wire in wires {
                write!(self.out, " {}{}", levels >> wire & 1, sign(wire))?;
            }
            writeln!(self.out)?;
        }
        self.levels = Some(levels);
        self.samples += samples;
        Ok(())
    }

    fn end(mut self: Box<Self>) -> Result<()> {
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
        let mut vcd = Box::new(Vcd::new(&mut out, &["BUS"], 4_000_000).unwrap());
        for (levels, samples) in [(1, 4), (0, 2), (0, 2), (1, 8)] {
            vcd.run(levels, samples).unwrap();
        }
        vcd.end().unwrap();
        let text = String::from_utf8(out).unwrap();
        let (head, changes) = text.split_once("$enddefinitions $end\n").unwrap();
        assert!(head.contains("$var wire 1 ! BUS $end\n"));
        // 4 samples are 1000 ns: 100 ticks.
        assert_eq!(changes, "#0 1!\n#100 0!\n#200 1!\n#400\n");
    }

    #[test]
    fn of_several_wires_those_that_changed_are_told() {
        let mut out = Vec::new();
        let mut vcd = Box::new(Vcd::new(&mut out, &["DO", "DI"], 1_000_000).unwrap());
        for (levels, samples) in [(0b11, 1), (0b10, 1), (0b01, 1)] {
            vcd.run(levels, samples).unwrap();
        }
        vcd.end().unwrap();
        let text = String::from_utf8(out).unwrap();
        assert!(text.contains("$var wire 1 ! DO $end\n$var wire 1 \" DI $end\n"));
        assert!(text.ends_with("#0 1! 1\"\n#1 0!\n#2 1! 0\"\n#3\n"));
    }
}
