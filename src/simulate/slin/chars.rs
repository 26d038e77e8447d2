//! `chars`: characters as lines of text, `time,byte,parity`.

use super::receiver::{Heard, State};
use super::tap::{Characters, Loss};
use crate::simulate::time::{NS, Ps};
use anyhow::{Result, bail};
use std::io::Write;

/// A capture of this form.
pub struct Chars<W> {
    out: W,
    /// What is added to every time: the date, in s since the Unix epoch.
    start: i64,
}

impl<W: Write> Chars<W> {
    /// Begins a capture.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn new(mut out: W, start: i64) -> Result<Self> {
        writeln!(out, "time,byte,parity")?;
        Ok(Chars { out, start })
    }
}

impl<W: Write> Characters for Chars<W> {
    fn character(&mut self, heard: &Heard) -> Result<()> {
        let state = match heard.state {
            State::Good => "ok",
            State::Unchecked => "unknown",
            State::ParityError => "error",
            State::FramingError => "framing",
            State::Break => "break",
        };
        let ns = heard.start / NS;
        let seconds = self.start + ns / 1_000_000_000;
        let rest = ns % 1_000_000_000;
        writeln!(self.out, "{seconds}.{rest:09},{:02X},{state}", heard.byte)?;
        Ok(())
    }

    fn loss(&mut self, _: Loss, _: Ps) -> Result<()> {
        bail!("chars cannot say that characters are missing: write pcapng")
    }

    fn end(mut self, _: Ps) -> Result<()> {
        self.out.flush()?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_exact_to_the_nanosecond() {
        let mut out = Vec::new();
        let mut chars = Chars::new(&mut out, 1_700_000_000).unwrap();
        for (start, byte, state) in [
            (1_000, 0x80, State::Good),
            (1_000_000_000_000, 0x1A, State::ParityError),
            (61_000_002_000_999, 0, State::Break),
        ] {
            chars.character(&Heard { start, byte, state }).unwrap();
        }
        let expected = "time,byte,parity\n1700000000.000000001,80,ok\n\
                        1700000001.000000000,1A,error\n1700000061.000002000,00,break\n";
        assert_eq!(String::from_utf8(out).unwrap(), expected);
    }
}
