//! `chars`: the plain text form of a character stream.

use super::{Export, forms};
use crate::clock::Exact;
use dissectors::event::Moment;
use dissectors::protocol::Medium;
use dissectors::record::{Heard, Record, Sink};
use dissectors::uart::{Character, Parity};
use std::io::{self, Write};

/// Writes the characters of records, one a line.
pub struct Chars<W> {
    out: W,
    result: io::Result<()>,
    has_header: bool,
}

impl<W: Write> Chars<W> {
    /// Writes to `out`.
    pub fn new(out: W) -> Self {
        Chars { out, result: Ok(()), has_header: false }
    }

    fn write_header(&mut self) -> io::Result<()> {
        self.has_header = true;
        self.out.write_all(b"time,byte,parity\n")
    }

    fn write(&mut self, record: &Record<'_>) -> io::Result<()> {
        if record.protocol.medium != Medium::Serial {
            let what = format!(
                "{} is no serial line, and chars holds characters of one: {}",
                record.bus.name,
                forms(record.protocol.medium)
            );
            return Err(io::Error::new(io::ErrorKind::Unsupported, what));
        }
        if !self.has_header {
            self.write_header()?;
        }
        match record.heard {
            Heard::Characters(characters) => {
                characters.iter().try_for_each(|character| self.write_character(character))
            }
            Heard::Break(event) => self.write_line(event.start, 0, "break"),
            Heard::Lost(_) | Heard::Nothing | Heard::Frame(_) | Heard::Row(_) | Heard::Cycle(_) => {
                Ok(())
            }
        }
    }

    fn write_character(&mut self, character: &Character) -> io::Result<()> {
        if character.value() > 0xFF {
            let what = "nine data bits a character do not fit into chars: write CSV or JSON";
            return Err(io::Error::new(io::ErrorKind::Unsupported, what));
        }
        let state = match (character.has_framing_error(), character.parity()) {
            (true, _) => "framing",
            (_, Parity::Ok) => "ok",
            (_, Parity::Error) => "error",
            (_, Parity::Suspect | Parity::Unknown | Parity::None) => "unknown",
        };
        self.write_line(character.start, character.byte(), state)
    }

    fn write_line(&mut self, time: Moment, byte: u8, state: &str) -> io::Result<()> {
        let Some(ns) = time.ns() else {
            let what = "the source has no times, and chars needs them: write CSV or JSON";
            return Err(io::Error::new(io::ErrorKind::Unsupported, what));
        };
        writeln!(self.out, "{},{byte:02X},{state}", Exact(ns))
    }
}

impl<W: Write> Sink for Chars<W> {
    fn record(&mut self, record: &Record<'_>) {
        if self.result.is_ok() {
            self.result = self.write(record);
        }
    }
}

impl<W: Write> Export for Chars<W> {
    fn status(&mut self) -> io::Result<()> {
        std::mem::replace(&mut self.result, Ok(()))
    }

    fn flush(&mut self) -> io::Result<()> {
        if !self.has_header {
            self.write_header()?;
        }
        self.out.flush()
    }
}
