//! Faults that take more than one exchange. No other strikes meanwhile.

/// Right telegrams of a station after a jump, so that its neighbours are beyond doubt.
const QUIET: u32 = 6;

/// What goes on. Encoders are told by their place in the list.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Ongoing {
    /// Nothing.
    Nothing,
    /// An encoder does not answer so many more times.
    Silence {
        /// Which.
        encoder: usize,
        /// How often, at least once.
        times: u64,
    },
    /// An encoder's answer comes when this empty address is asked, and that is next.
    Crossing {
        /// Which.
        encoder: usize,
        /// The empty address.
        address: u8,
    },
    /// An encoder's position jumped.
    Jump {
        /// Which.
        encoder: usize,
        /// In which exchange.
        exchange: u64,
        /// How many of its telegrams are still to be right, at least one.
        telegrams: u32,
    },
}

impl Ongoing {
    /// An encoder stays silent so many more times.
    pub fn silence(encoder: usize, times: u64) -> Self {
        if times == 0 { Ongoing::Nothing } else { Ongoing::Silence { encoder, times } }
    }

    /// An encoder's position jumped just now.
    pub fn jump(encoder: usize, exchange: u64) -> Self {
        Ongoing::Jump { encoder, exchange, telegrams: QUIET }
    }

    /// What is left to go on when this encoder was asked once more.
    pub fn after(self, asked: usize) -> Self {
        match self {
            Ongoing::Silence { encoder, times } if encoder == asked => {
                Ongoing::silence(encoder, times - 1)
            }
            Ongoing::Jump { encoder, telegrams: 1, .. } if encoder == asked => Ongoing::Nothing,
            Ongoing::Jump { encoder, exchange, telegrams } if encoder == asked => {
                Ongoing::Jump { encoder, exchange, telegrams: telegrams - 1 }
            }
            ongoing => ongoing,
        }
    }

    /// Whether this encoder does not answer now.
    pub fn silences(self, asked: usize) -> bool {
        matches!(self, Ongoing::Silence { encoder, .. } if encoder == asked)
    }

    /// The exchange whose jump shows in the next telegram of this encoder.
    pub fn jump_shown_by(self, asked: usize) -> Option<u64> {
        match self {
            Ongoing::Jump { encoder, exchange, telegrams: QUIET } if encoder == asked => {
                Some(exchange)
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_silence_lasts_as_often_as_it_was_ordered() {
        let once = Ongoing::silence(2, 2).after(1).after(2);
        assert_eq!(once, Ongoing::Silence { encoder: 2, times: 1 });
        assert!(once.silences(2) && !once.silences(1));
        assert_eq!(once.after(2), Ongoing::Nothing);
        assert_eq!(Ongoing::silence(0, 0), Ongoing::Nothing);
    }

    #[test]
    fn a_jump_shows_in_the_next_telegram_and_then_no_more() {
        let mut ongoing = Ongoing::jump(0, 17).after(1);
        assert_eq!((ongoing.jump_shown_by(0), ongoing.jump_shown_by(1)), (Some(17), None));
        for _ in 0..QUIET {
            assert_ne!(ongoing, Ongoing::Nothing);
            ongoing = ongoing.after(0);
            assert_eq!(ongoing.jump_shown_by(0), None);
        }
        assert_eq!(ongoing, Ongoing::Nothing);
    }
}
