//! The log of Wireshark's toolbar. Both pipes are optional: tshark has none.
//!
//! A message is `T`, the length of what follows in three bytes (big-endian), the control's number,
//! a command, and its text.

use super::sentences::LOG;
use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;
use std::time::Duration;

/// Commands of the toolbar's protocol.
const INITIALIZED: u8 = 0;
const ADD: u8 = 2;

/// Longest text that a message may have.
const LONGEST: usize = 32_767;

/// How long the last lines may take at the end.
const PATIENCE: Duration = Duration::from_millis(200);

/// The log. Lines wait until Wireshark is ready for them; nobody waits for Wireshark.
pub struct Log {
    lines: Sender<String>,
    is_done: Receiver<()>,
}

impl Log {
    /// Begins a log on these pipes: what the toolbar tells us, and what we tell it.
    pub fn begin(from_toolbar: &Path, to_toolbar: &Path) -> Log {
        let (lines, waiting) = channel();
        let (done, is_done) = channel();
        let pipes: (PathBuf, PathBuf) = (from_toolbar.to_owned(), to_toolbar.to_owned());
        thread::spawn(move || {
            // A toolbar that is gone wants no log.
            let _ = pass_on(&pipes.0, &pipes.1, &waiting);
            drop(done);
        });
        Log { lines, is_done }
    }

    /// Says a line.
    pub fn say(&self, line: String) {
        // Nobody hears it where the toolbar is gone.
        let _ = self.lines.send(line);
    }

    /// Gives the last lines a moment.
    pub fn end(self) {
        let Log { lines, is_done } = self;
        drop(lines);
        let _ = is_done.recv_timeout(PATIENCE);
    }
}

fn pass_on(from: &Path, to: &Path, lines: &Receiver<String>) -> io::Result<()> {
    let mut to = OpenOptions::new().write(true).open(to)?;
    let mut from = File::open(from)?;
    while command(&mut from)? != INITIALIZED {}
    lines.iter().try_for_each(|line| to.write_all(&message(LOG, ADD, &(line + "\n"))))
}

/// Reads a message, of which only the command matters.
fn command(from: &mut impl Read) -> io::Result<u8> {
    let mut header = [0; 6];
    from.read_exact(&mut header)?;
    let [mark, high, middle, low, _control, command] = header;
    let length = u64::from(u32::from_be_bytes([0, high, middle, low]));
    if mark != b'T' || length < 2 {
        return Err(io::ErrorKind::InvalidData.into());
    }
    io::copy(&mut from.take(length - 2), &mut io::sink())?;
    Ok(command)
}

fn message(control: u8, command: u8, text: &str) -> Vec<u8> {
    let text = &text[..text.floor_char_boundary(LONGEST)];
    // At most 32769: it fits into three bytes.
    let [_, length @ ..] = (text.len() as u32 + 2).to_be_bytes();
    [&b"T"[..], &length, &[control, command], text.as_bytes()].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The header as Wireshark's developer's guide has it (section 8.3.2).
    #[test]
    fn messages_have_a_header_of_six_bytes() {
        assert_eq!(message(0, ADD, "hi\n"), b"T\x00\x00\x05\x00\x02hi\n");
        let long = message(0, ADD, &"é".repeat(20_000));
        // 32766 bytes are the most whole letters of two bytes; and two more.
        assert_eq!(long[..4], [b'T', 0, 0x80, 0]);
        assert_eq!(long.len(), 6 + 32_766);
    }

    #[test]
    fn messages_are_read_one_after_the_other() {
        let mut from = &b"T\x00\x00\x06\x03\x01text\x54\x00\x00\x02\x00\x00"[..];
        assert_eq!(command(&mut from).expect("a message"), 1);
        assert_eq!(command(&mut from).expect("a message"), INITIALIZED);
        assert!(command(&mut from).is_err());
        assert!(command(&mut &b"X\x00\x00\x02\x00\x00"[..]).is_err());
        assert!(command(&mut &b"T\x00\x00\x01\x00\x00"[..]).is_err());
    }
}
