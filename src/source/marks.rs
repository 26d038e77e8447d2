//! The marks that a Linux tty puts among the characters, with INPCK and PARMRK set (termios(3)).
//!
//! `FF FF` is a good FFh, `FF 00 c` a bad character c, which is not doubled even if it is FFh.

/// What begins a mark.
const FLAG: u8 = 0xFF;

/// What the tty says of a character.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Sign {
    /// It came well.
    Good(u8),
    /// Parity or stop bit were wrong; with 00h it may be a break.
    Bad(u8),
    /// It stands where no character can: marks are not in force.
    Stray(u8),
}

/// How much of a mark there was. It may be split between any two reads.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub enum Escape {
    /// Nothing.
    #[default]
    None,
    /// FF.
    Begun,
    /// FF 00.
    Bad,
}

impl Escape {
    /// Takes a byte, and hands on the characters it completes. False if it cannot stand there.
    pub fn take(&mut self, byte: u8, hear: &mut impl FnMut(Sign)) -> bool {
        let (next, is_possible) = match (*self, byte) {
            (Escape::None, FLAG) => (Escape::Begun, true),
            (Escape::None, good) => {
                hear(Sign::Good(good));
                (Escape::None, true)
            }
            (Escape::Begun, FLAG) => {
                hear(Sign::Good(FLAG));
                (Escape::None, true)
            }
            (Escape::Begun, 0) => (Escape::Bad, true),
            (Escape::Begun, other) => {
                hear(Sign::Stray(FLAG));
                hear(Sign::Stray(other));
                (Escape::None, false)
            }
            (Escape::Bad, bad) => {
                hear(Sign::Bad(bad));
                (Escape::None, true)
            }
        };
        *self = next;
        is_possible
    }
}
