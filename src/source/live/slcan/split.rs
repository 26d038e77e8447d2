//! Lines of an adapter out of the bytes of a serial port, which come in pieces of any size.

/// Ends a line; alone, it says that a command was done.
const DONE: u8 = b'\r';

/// Says that a command was not done.
const BELL: u8 = 0x07;

/// Longest line: a frame of CAN FD with an extended identifier and a time stamp has 142 bytes.
const LONGEST: usize = 160;

/// What an adapter says.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Saying<'a> {
    /// A line without its end; an empty one says that a command was done.
    Line(&'a [u8]),
    /// A command was not done.
    Refusal,
    /// The same, in the middle of a line, of which the rest is lost.
    CutRefusal,
    /// A line longer than any that there is: said as soon as it is, and of its end nothing more.
    TooLong,
}

/// A line that is being put together.
pub struct Splitter {
    line: [u8; LONGEST],
    length: usize,
}

impl Default for Splitter {
    fn default() -> Self {
        Splitter { line: [0; LONGEST], length: 0 }
    }
}

impl Splitter {
    /// Takes the next byte; what it completes is returned.
    pub fn take(&mut self, byte: u8) -> Option<Saying<'_>> {
        match byte {
            DONE => {
                let length = std::mem::take(&mut self.length);
                self.line.get(..length).map(Saying::Line)
            }
            BELL => Some(match std::mem::take(&mut self.length) {
                1..=LONGEST => Saying::CutRefusal,
                _ => Saying::Refusal,
            }),
            // Some end their lines as Windows does.
            b'\n' if self.length == 0 => None,
            _ => {
                if let Some(free) = self.line.get_mut(self.length) {
                    *free = byte;
                }
                let is_first_too_much = self.length == LONGEST;
                self.length = (self.length + 1).min(LONGEST + 1);
                is_first_too_much.then_some(Saying::TooLong)
            }
        }
    }

    /// Whether a line was begun.
    pub fn has_begun(&self) -> bool {
        self.length > 0
    }

    /// Forgets what was begun.
    pub fn forget(&mut self) {
        self.length = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn split(bytes: &[u8]) -> Vec<String> {
        let mut splitter = Splitter::default();
        let sayings = bytes.iter().filter_map(|byte| {
            splitter.take(*byte).map(|saying| match saying {
                Saying::Line(line) => String::from_utf8_lossy(line).into_owned(),
                Saying::Refusal => "refused".to_owned(),
                Saying::CutRefusal => "cut and refused".to_owned(),
                Saying::TooLong => "too long".to_owned(),
            })
        });
        sayings.collect()
    }

    #[test]
    fn lines_and_refusals_are_told_apart() {
        assert_eq!(split(b"\rV1013\r\x07t1230\r\nt12"), ["", "V1013", "refused", "t1230"]);
    }

    #[test]
    fn a_refusal_inside_a_line_cuts_it() {
        assert_eq!(split(b"t12\x073\r"), ["cut and refused", "3"]);
        // Of what is too long it was said.
        assert_eq!(split(&[&[b'x'; 200][..], b"\x07"].concat()), ["too long", "refused"]);
    }

    #[test]
    fn a_line_without_end_does_not_grow_and_the_next_one_is_good() {
        let long = [&[b'x'; 100_000][..], b"\rt1230\r"].concat();
        assert_eq!(split(&long), ["too long", "t1230"]);
        assert_eq!(split(&[b'x'; 100_000]), ["too long"], "it need not end");
        let longest = [b'x'; LONGEST];
        assert_eq!(split(&[&longest[..], b"\r"].concat())[0].len(), LONGEST);
    }
}
