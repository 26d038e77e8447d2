//! The log of candump (can-utils): a frame a line, losses as candump tells them.
//! `(1700000010.000000) can0 42C#010E010101 R`

use super::{Export, forms};
use crate::clock::Exact;
use dissectors::can::{Direction, Frame, FrameKind, MAX_CLASSIC_DATA};
use dissectors::protocol::Medium;
use dissectors::record::{Heard, Record, Sink};
use std::fmt::Write as _;
use std::io::{self, Write};

/// The flag of error frames in an identifier.
const ERROR: u32 = 0x2000_0000;

/// The flag of CAN FD, which candump always sets.
const FD: u8 = 0x04;

/// Writes the frames of records, one a line.
pub struct Candump<W> {
    out: W,
    result: io::Result<()>,
    line: String,
    /// Frames lost so far by bus, which every loss adds to.
    lost: Vec<(String, u64)>,
}

impl<W: Write> Candump<W> {
    /// Writes to `out`.
    pub fn new(out: W) -> Self {
        Candump { out, result: Ok(()), line: String::new(), lost: Vec::new() }
    }

    fn write(&mut self, record: &Record<'_>) -> io::Result<()> {
        if record.protocol.medium != Medium::Can {
            let what = format!(
                "{} is no CAN bus, and candump holds CAN frames: {}",
                record.bus.name,
                forms(record.protocol.medium)
            );
            return Err(io::Error::new(io::ErrorKind::Unsupported, what));
        }
        self.line.clear();
        match record.heard {
            Heard::Frame(frame) => {
                write_stamp(frame, &mut self.line)?;
                write_name(&record.bus.name, &mut self.line);
                self.line.push(' ');
                write_frame(frame, &mut self.line);
                self.line.push_str(match frame.direction {
                    Some(Direction::Received) => " R\n",
                    Some(Direction::Sent) => " T\n",
                    None => "\n",
                });
            }
            Heard::Lost(loss) => self.compose_loss(&record.bus.name, loss.count),
            Heard::Characters(_)
            | Heard::Row(_)
            | Heard::Cycle(_)
            | Heard::Break(_)
            | Heard::Nothing => {
                return Ok(());
            }
        }
        self.out.write_all(self.line.as_bytes())
    }

    /// A String takes any text.
    fn compose_loss(&mut self, bus: &str, count: Option<u64>) {
        let index = self.lost.iter().position(|(name, _)| name == bus).unwrap_or_else(|| {
            self.lost.push((bus.to_owned(), 0));
            self.lost.len() - 1
        });
        let total = &mut self.lost[index].1;
        *total = total.saturating_add(count.unwrap_or(0));
        let total = *total;
        let number = count.map_or(String::new(), |count| format!("{count} "));
        let plural = if count == Some(1) { "" } else { "s" };
        let _ = write!(self.line, "DROPCOUNT: dropped {number}CAN frame{plural} on '");
        write_name(bus, &mut self.line);
        let _ = writeln!(self.line, "' socket (total drops {total})");
    }
}

/// Microseconds, as candump writes them; nanoseconds where there are such.
fn write_stamp(frame: &Frame, line: &mut String) -> io::Result<()> {
    let Some(ns) = frame.start.ns() else {
        let what = "the source has no times, and candump needs them: write CSV or JSON";
        return Err(io::Error::new(io::ErrorKind::Unsupported, what));
    };
    line.push('(');
    if ns < 0 {
        let _ = write!(line, "{}", Exact(ns));
    } else {
        let mut buffer = itoa::Buffer::new();
        // Ten digits with their leading zeros: those of 1_xx_xxx_xxx_xxx without the first.
        line.push_str(&buffer.format(10_000_000_000 + ns / 1_000_000_000)[1..]);
        line.push('.');
        line.push_str(&buffer.format(1_000_000_000 + ns % 1_000_000_000)[1..]);
    }
    if ns % 1_000 == 0 && frame.uncertainty >= 1_000 {
        line.truncate(line.len() - 3);
    }
    line.push_str(") ");
    Ok(())
}

/// Names stand between blanks.
fn write_name(name: &str, line: &mut String) {
    let is_out = |c: char| c.is_whitespace() || c.is_control() || c == '\'';
    match name {
        "" => line.push_str("can"),
        name => line.extend(name.chars().map(|c| if is_out(c) { '_' } else { c })),
    }
}

/// A frame as candump writes it: `42C#010E010101`, `18EBFF00#R4`, `123##5AABB`,
/// `123#0102030405060708_C`. A String takes any text.
pub fn write_frame(frame: &Frame, line: &mut String) {
    let id = frame.id.value();
    if frame.kind == FrameKind::Error {
        write_hex(id | ERROR, 8, line);
    } else {
        write_hex(id, if frame.id.is_extended() { 8 } else { 3 }, line);
    }
    line.push('#');
    let has_raw_dlc = usize::from(frame.dlc) > MAX_CLASSIC_DATA && frame.kind != FrameKind::Fd;
    match frame.kind {
        FrameKind::Fd => {
            line.push('#');
            write_hex(u32::from(FD | frame.fd_flags.bits()), 1, line);
        }
        FrameKind::Remote => {
            line.push('R');
            if frame.dlc > 0 {
                write_hex(u32::from(frame.dlc.min(MAX_CLASSIC_DATA as u8)), 1, line);
            }
        }
        FrameKind::Data | FrameKind::Error => {}
    }
    frame.bytes().iter().for_each(|byte| write_hex(u32::from(*byte), 2, line));
    if has_raw_dlc && (frame.kind == FrameKind::Remote || frame.bytes().len() == MAX_CLASSIC_DATA) {
        line.push('_');
        write_hex(u32::from(frame.dlc & 0xF), 1, line);
    }
}

fn write_hex(value: u32, digits: u32, line: &mut String) {
    const DIGITS: &[u8; 16] = b"0123456789ABCDEF";
    for digit in (0..digits).rev() {
        line.push(char::from(DIGITS[(value >> (4 * digit) & 0xF) as usize]));
    }
}

impl<W: Write> Sink for Candump<W> {
    fn record(&mut self, record: &Record<'_>) {
        if self.result.is_ok() {
            self.result = self.write(record);
        }
    }
}

impl<W: Write> Export for Candump<W> {
    fn status(&mut self) -> io::Result<()> {
        std::mem::replace(&mut self.result, Ok(()))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dissectors::can::{FdFlags, Identifier};
    use dissectors::event::Moment;

    fn written(frame: Frame) -> String {
        let mut line = String::new();
        write_stamp(&frame, &mut line).unwrap();
        write_frame(&frame, &mut line);
        line
    }

    #[test]
    fn frames_are_written_as_candump_does() {
        let at = Moment::from_ns(1_700_000_010_000_001_000);
        let id = Identifier::Standard(0x42C);
        let data = Frame::data(at, 1_000, id, &[1, 0x0E, 1, 1, 1]);
        assert_eq!(written(data), "(1700000010.000001) 42C#010E010101");
        let mut fine = data;
        fine.uncertainty = 1;
        assert_eq!(written(fine), "(1700000010.000001000) 42C#010E010101");
        let new = |kind, id, dlc| Frame::new(Moment::from_ns(1_500_000_000), 1_000, kind, id, dlc);
        let said = |frame| written(frame).trim_start_matches("(0000000001.500000) ").to_owned();
        let extended = Identifier::Extended(0x123);
        assert_eq!(said(new(FrameKind::Remote, extended, 4)), "00000123#R4");
        assert_eq!(said(new(FrameKind::Remote, id, 0)), "42C#R");
        assert_eq!(said(new(FrameKind::Remote, id, 15)), "42C#R8_F");
        let eight = new(FrameKind::Data, id, 12).with(&[0; 8]);
        assert_eq!(said(eight), "42C#0000000000000000_C");
        let mut fd = new(FrameKind::Fd, id, 2).with(&[0xAA, 0xBB]);
        fd.fd_flags = FdFlags { has_rate_switch: true, is_error_passive: false };
        assert_eq!(said(fd), "42C##5AABB");
        let error = new(FrameKind::Error, Identifier::Extended(0x88), 8).with(&[0; 8]);
        assert_eq!(said(error), "20000088#0000000000000000");
    }
}
