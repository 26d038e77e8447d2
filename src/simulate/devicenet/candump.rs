//! The log of candump: `(seconds) interface id#data`, a line a frame.

use super::frame::{Frame, Id};
use super::tap::{ErrorFrame, Heard, Tap, What};
use crate::simulate::time::{Ps, US};
use anyhow::Result;
use std::io::Write;

/// The bit of an identifier that makes an error frame of it.
const ERROR: u32 = 0x2000_0000;

/// A capture of this form.
pub struct Candump<W> {
    out: W,
    interface: String,
    /// The date, in s since the Unix epoch.
    start: i64,
    missed: u64,
}

impl<W: Write> Candump<W> {
    /// Begins a log of this interface.
    pub fn new(out: W, interface: &str, start: u32) -> Self {
        Candump { out, interface: interface.to_owned(), start: i64::from(start), missed: 0 }
    }

    fn write(&mut self, at: Ps, text: &str) -> Result<()> {
        let micros = self.start * 1_000_000 + at / US;
        let (seconds, micros) = (micros / 1_000_000, micros % 1_000_000);
        writeln!(self.out, "({seconds:010}.{micros:06}) {} {text}", self.interface)?;
        Ok(())
    }

    fn miss(&mut self, frames: u64) -> Result<()> {
        self.missed += frames;
        let (interface, total) = (&self.interface, self.missed);
        writeln!(
            self.out,
            "DROPCOUNT: dropped {frames} CAN frame{} on '{interface}' socket (total drops {total})",
            if frames == 1 { "" } else { "s" }
        )?;
        Ok(())
    }
}

fn hex(bytes: &[u8]) -> String {
    crate::simulate::hex(bytes.iter().copied())
}

/// A frame as it stands in the log.
pub fn text(frame: &Frame) -> String {
    let id = match frame.id {
        Id::Standard(id) => format!("{id:03X}"),
        Id::Extended(id) => format!("{id:08X}"),
    };
    match (frame.is_remote, frame.length()) {
        (false, _) => format!("{id}#{}", hex(frame.bytes())),
        (true, 0) => format!("{id}#R"),
        (true, length) => format!("{id}#R{length}"),
    }
}

impl<W: Write> Tap for Candump<W> {
    fn hear(&mut self, heard: &Heard<'_>) -> Result<()> {
        for what in &heard.what {
            match what {
                What::Frame(frame, _) => self.write(heard.at, &text(frame))?,
                What::Error(ErrorFrame { classes, data }) => {
                    self.write(heard.at, &format!("{:08X}#{}", ERROR | classes, hex(data)))?;
                }
                What::Missed(frames) => self.miss(*frames)?,
            }
        }
        Ok(())
    }

    fn end(mut self: Box<Self>, _: Ps) -> Result<()> {
        self.out.flush()?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::devicenet::wire::Flaw;
    use crate::simulate::time::MS;

    #[test]
    fn lines_are_those_of_candump() {
        let mut log = Vec::new();
        let mut tap = Candump::new(&mut log, "can0", 1_767_225_600);
        let frame = Frame::new(0x4BC, &[0x00, 0x0E, 0x2F, 0x01, 0x0C]);
        let remote = Frame::remote(Id::Standard(0x3D7), 4);
        let extended = Frame::of(Id::Extended(0x123), &[]);
        let error = ErrorFrame::of(Flaw::Stuff, 1);
        let what = vec![
            What::Frame(&frame, 5),
            What::Missed(3),
            What::Frame(&remote, 0),
            What::Frame(&extended, 0),
            What::Error(error),
        ];
        tap.hear(&Heard { spans: &[], until: 0, at: 1_500 * MS, what }).unwrap();
        let lines = "\
(1767225601.500000) can0 4BC#000E2F010C
DROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 3)
(1767225601.500000) can0 3D7#R4
(1767225601.500000) can0 00000123#
(1767225601.500000) can0 20000288#0000040A00000001
";
        assert_eq!(String::from_utf8(log).unwrap(), lines);
    }
}
