//! `parmrk`: bytes as a Linux tty gives them with INPCK and PARMRK set (termios(3)).
//!
//! `FF 00 00` is a bad 00h or a break: nothing tells which, and 00h is a legal data word, so that
//! it is taken for a character with a parity error.

use super::bytes::{BATCH, BUS, announce, character};
use super::marks::{Escape, Sign};
use super::outbox::{Outbox, Reader};
use super::stream::Stream;
use super::{Input, Place, SourceError, SourceOptions};
use dissectors::uart::{Character, Parity};

/// Whether bytes may be of this format: marks are among them, and nothing that contradicts.
pub fn fits(head: &[u8]) -> bool {
    let (mut escape, mut heard) = (Escape::None, 0);
    let is_possible = head.iter().all(|byte| escape.take(*byte, &mut |_| heard += 1));
    is_possible && heard < head.len() - usize::from(escape != Escape::None)
}

/// A source of bytes with marks.
pub struct Parmrk {
    stream: Stream,
    is_announced: bool,
    has_warned: bool,
    escape: Escape,
    batch: Vec<Character>,
}

impl Parmrk {
    /// Reads bytes from this input.
    ///
    /// # Errors
    /// The user asked for another channel than the one there is.
    pub fn new(input: Input, options: &SourceOptions) -> Result<Self, SourceError> {
        options.choose_only(BUS, &input.name)?;
        Ok(Parmrk {
            stream: Stream::new(input),
            is_announced: false,
            has_warned: false,
            escape: Escape::None,
            batch: Vec::with_capacity(2 * BATCH),
        })
    }

    fn finish(&self) -> Result<bool, SourceError> {
        match self.escape {
            Escape::None => Ok(false),
            Escape::Begun | Escape::Bad => {
                Err(self.stream.error("the file ends inside a mark that FF begins: it was cut"))
            }
        }
    }
}

impl Reader for Parmrk {
    fn read_on(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
        if !std::mem::replace(&mut self.is_announced, true) {
            announce(out);
        }
        let offset = self.stream.offset();
        let there = self.stream.ahead(1)?;
        if there.is_empty() {
            return self.finish();
        }
        let count = there.len().min(BATCH);
        let mut wrong = None;
        for (offset, byte) in (offset..).zip(&there[..count]) {
            if !self.escape.take(*byte, &mut |sign| self.batch.push(heard(sign))) {
                wrong = wrong.or(Some(offset));
            }
        }
        if let (Some(offset), false) = (wrong, self.has_warned) {
            self.has_warned = true;
            let what = "FF is followed by neither FF nor 00: the tty was read without PARMRK, and \
                        parity errors are not marked; set it, or read this with --input-format \
                        bytes";
            out.warning(SourceError::new(self.stream.name(), Place::Byte(offset), what));
        }
        out.characters(0, self.batch.drain(..));
        self.stream.take(count);
        Ok(true)
    }
}

/// The character of a sign: a mark is taken for a parity error.
fn heard(sign: Sign) -> Character {
    let (byte, parity) = match sign {
        Sign::Good(byte) => (byte, Parity::Ok),
        Sign::Bad(byte) => (byte, Parity::Error),
        Sign::Stray(byte) => (byte, Parity::Unknown),
    };
    character(u16::from(byte), parity)
}

#[cfg(test)]
mod tests {
    use super::super::InputFormat;
    use super::super::damage::survive;
    use super::super::outbox::Reading;
    use super::super::transcript::of_source;
    use super::*;
    use std::io::{self, Read};

    /// Hands out so many bytes a read.
    struct Drops(Vec<u8>, usize);

    impl Read for Drops {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            let count = self.1.min(self.0.len()).min(buffer.len());
            buffer[..count].copy_from_slice(&self.0[..count]);
            self.0.drain(..count);
            Ok(count)
        }
    }

    /// What is read, without the division into pieces, which must not matter.
    fn read(bytes: &[u8]) -> String {
        let read = |size| {
            let input = Input::of("test", Drops(bytes.to_vec(), size)).unwrap();
            let parmrk = Parmrk::new(input, &SourceOptions::default()).unwrap();
            let said = of_source(&mut Reading::new(parmrk));
            assert_eq!(said[0], "bus serial");
            let pieces = said[1..].iter().map(|line| line.strip_prefix("0: ").unwrap_or(line));
            pieces.collect::<Vec<_>>().join(", ")
        };
        let whole = read(1024);
        for size in 1..4 {
            // A warning comes before its piece.
            let sorted = |text: &str| {
                let mut words: Vec<String> = text.split(", ").map(str::to_owned).collect();
                words.sort();
                words
            };
            assert_eq!(sorted(&read(size)), sorted(&whole), "{size} bytes a read");
        }
        whole
    }

    #[test]
    fn the_worked_telegram_with_a_bad_zero() {
        // Vector 34: 81 00* 01 89, where the tty gives 81 FF 00 00 01 89.
        assert_eq!(read(&[0x81, 0xFF, 0, 0, 0x01, 0x89]), "81, 00 parity error, 01, 89");
    }

    #[test]
    fn ff_is_doubled_if_good_and_not_if_bad() {
        assert_eq!(read(&[0xFF, 0xFF, 0x41]), "FF, 41");
        assert_eq!(read(&[0xFF, 0, 0xFF, 0x41]), "FF parity error, 41");
        assert_eq!(read(&[0xFF, 0, 0xFF, 0xFF, 0xFF, 0, 1]), "FF parity error, FF, 00, 01");
        assert_eq!(read(&[0, 0xFF, 0, 0x82]), "00, 82 parity error");
    }

    #[test]
    fn without_parmrk_both_bytes_are_kept_and_it_is_told_once() {
        assert_eq!(
            read(&[0x41, 0xFF, 0x42, 0xFF, 0x43, 0x44]),
            "warning: test: at byte 2: FF is followed by neither FF nor 00: the tty was read \
             without PARMRK, and parity errors are not marked; set it, or read this with \
             --input-format bytes, 41, FF parity unknown, 42 parity unknown, FF parity unknown, 43 \
             parity unknown, 44"
        );
    }

    #[test]
    fn a_file_may_be_cut_inside_a_mark() {
        let cut = "the file ends inside a mark that FF begins: it was cut";
        assert_eq!(read(&[0x41, 0xFF]), format!("41, test: at byte 2: {cut}"));
        assert_eq!(read(&[0x41, 0xFF, 0]), format!("41, test: at byte 3: {cut}"));
    }

    #[test]
    fn no_damage_stops_the_reader_for_good() {
        survive(InputFormat::Parmrk, &[0x81, 0xFF, 0, 0, 0x01, 0xFF, 0xFF, 0x89]);
    }
}
