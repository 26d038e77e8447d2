//! The faults that can be ordered, by name.

use crate::simulate::order::{self, Orderable};
use clap::ValueEnum;

/// What can go wrong on a SLIN bus. Each is named after the finding that it must raise.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
pub enum Fault {
    /// One bit of one character flips: a data bit or the parity bit, of request or answer
    Parity,
    /// The stop bit of one character begins low
    Framing,
    /// The footer's checksum is wrong under every reading of the manuals
    Checksum,
    /// The footer names another station
    AddressMismatch,
    /// A station that answered before is silent, for one to six of its turns
    NoResponse,
    /// The answer ends without a footer
    MissingFooter,
    /// The answer has five or six data words
    TooManyWords,
    /// A second encoder with the same address answers after the first
    DuplicateAddress,
    /// A second encoder with the same address answers at the same time
    Collision,
    /// The answer begins after the limit
    LateResponse,
    /// The answer begins before the limit (TR only, and not at 9600 Bd)
    EarlyResponse,
    /// The master sets reserved bits of its request
    ReservedBits,
    /// One to three data words that belong to nobody follow an exchange
    StrayData,
    /// The answer comes when its request was given up
    LateAnswer,
    /// The answer comes after the next request, which asks an empty address (needs --scan)
    LateAnswerCrossing,
    /// One position is off by thousands of steps, with every mark right
    PositionJump,
    /// The line is low for less than a bit: after a request, or after the exchange if there is no room
    Glitch,
    /// An encoder at position 0 sends a footer alone (bit 3 high)
    NoDataWords,
    /// The same with bit 3 low: the footer looks like another request
    Ambiguous,
    /// An address without an encoder is asked now and then, as with --scan
    NeverAnswered,
    /// The line is low for two to five characters
    Break,
    /// The tap's receiver is overrun and misses part of an exchange (pcapng only)
    Overrun,
    /// The tap loses part of an exchange (pcapng only)
    Lost,
    /// The tap's two lines are swapped
    SwappedLines,
    /// The tap is set to another rate than the line's (pcapng and chars only)
    WrongRate,
    /// The line has odd parity where even is right
    WrongParity,
    /// The line carries Baumer's other RS485 protocol: 38400 8N1
    NotSlin,
}

impl Fault {
    /// The finding that it is there for.
    pub fn code(self) -> &'static str {
        match self {
            Fault::Parity => "slin.parity",
            Fault::Framing => "uart.framing",
            Fault::Checksum => "slin.checksum",
            Fault::AddressMismatch => "slin.address-mismatch",
            Fault::NoResponse => "slin.no-response",
            Fault::MissingFooter => "slin.missing-footer",
            Fault::TooManyWords => "slin.too-many-words",
            Fault::DuplicateAddress | Fault::Collision => "slin.duplicate-address",
            Fault::LateResponse => "slin.late-response",
            Fault::EarlyResponse => "slin.early-response",
            Fault::ReservedBits => "slin.reserved-bits",
            Fault::StrayData => "slin.stray-data",
            Fault::LateAnswer | Fault::LateAnswerCrossing => "slin.late-answer",
            Fault::PositionJump => "slin.position-jump",
            Fault::Glitch => "slin.glitch",
            Fault::NoDataWords => "slin.no-data-words",
            Fault::Ambiguous => "slin.ambiguous",
            Fault::NeverAnswered => "slin.never-answered",
            Fault::Break => "uart.break",
            Fault::Overrun => "uart.overrun",
            Fault::Lost => "uart.lost",
            Fault::SwappedLines => "uart.swapped-lines",
            Fault::WrongRate => "uart.wrong-rate",
            Fault::WrongParity => "uart.wrong-parity",
            Fault::NotSlin => "slin.not-slin",
        }
    }

    /// Whether it is there all the time or not at all.
    pub fn is_bus_wide(self) -> bool {
        self == Fault::NeverAnswered || self.spoils_everything()
    }

    /// Whether no exchange can be read as it was sent.
    pub fn spoils_everything(self) -> bool {
        matches!(self, Fault::SwappedLines | Fault::WrongRate | Fault::WrongParity | Fault::NotSlin)
    }

    /// Whether it is in the nature of one encoder: the lowest, if no address is given.
    pub fn belongs_to_one(self) -> bool {
        self == Fault::DuplicateAddress || self == Fault::Collision || self.is_at_zero()
    }

    /// Whether the encoder has to stand at position 0.
    pub fn is_at_zero(self) -> bool {
        self == Fault::NoDataWords || self == Fault::Ambiguous
    }

    /// Whether it is in the tap and not on the line.
    pub fn is_in_the_tap(self) -> bool {
        self == Fault::Overrun || self == Fault::Lost
    }
}

/// A fault of a SLIN bus that was ordered.
pub type Order = order::Order<Fault>;

impl Orderable for Fault {
    fn is_without_probability(self) -> bool {
        self.is_bus_wide()
    }

    fn station(text: &str) -> Result<u8, String> {
        super::plan::address(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_is_named_like_its_code() {
        for fault in Fault::value_variants() {
            let (_, last) = fault.code().split_once('.').unwrap();
            let also = matches!(fault, Fault::Collision | Fault::LateAnswerCrossing);
            assert!(fault.name() == last || also, "{}", fault.name());
            assert!(!fault.meaning().is_empty());
        }
    }

    #[test]
    fn orders_are_read() {
        let order = |fault, station, probability| Ok(Order { fault, station, probability });
        assert_eq!("parity=0.5".parse(), order(Fault::Parity, None, 0.5));
        assert_eq!("parity@3=1".parse(), order(Fault::Parity, Some(3), 1.0));
        assert_eq!("stray-data".parse(), order(Fault::StrayData, None, 0.01));
        assert_eq!("wrong-rate".parse(), order(Fault::WrongRate, None, 0.01));
        for text in ["", "parity=2", "parity=x", "parity@8", "wrong-rate=1", "sloppy", "parity="] {
            assert!(text.parse::<Order>().is_err(), "{text}");
        }
        for text in ["parity@3=0.5", "glitch=0.01", "wrong-rate"] {
            assert_eq!(text.parse::<Order>().unwrap().to_string(), text);
        }
    }
}
