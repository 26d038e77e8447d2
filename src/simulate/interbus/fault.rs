//! The faults that can be ordered, by name.

use crate::simulate::order::{self, Orderable};
use clap::ValueEnum;

/// What can go wrong in a ring.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, ValueEnum)]
pub enum Fault {
    /// An encoder sets its service bit although nobody asked
    UnrequestedAcknowledge,
    /// An encoder acknowledges another service than it was asked for
    ServiceMismatch,
    /// An encoder gives back other data than were written
    EchoMismatch,
    /// An encoder sets its error bit for a while, and nobody asks why
    ErrorBit,
    /// The master asks for a service that there is not
    UndefinedService,
    /// The master reads what can only be written, or the other way round
    Access,
    /// Bits that are always 0 are not, in what the master or the encoder sends
    ReservedBits,
    /// The master writes a counting direction that there is not
    ValueOutOfRange,
    /// The magnet leaves the measuring range, and the master asks for the error status
    Magnet,
    /// An encoder does not acknowledge a service
    NoAcknowledge,
    /// An encoder does not withdraw its acknowledgement
    NoRelease,
    /// The master lays data out and sets the service bit in one go
    DataWithServiceBit,
    /// The master changes its request before it is acknowledged
    RequestChanged,
    /// The master withdraws its request before it is acknowledged
    Withdrawn,
    /// The position is off, for one bus cycle or from then on
    PositionJump,
    /// The master writes the same parameter again and again
    RepeatedWrite,
    /// A parameter is written, as it should be
    Written,

    /// A bit of a frame is turned over between two neighbours (line levels)
    Crc,
    /// Nobody says anything for longer than 25 ms, and the master begins anew (line levels)
    Reset,
    /// A character of a frame is missing (line levels)
    MissingCharacter,
    /// A frame has a character too many (line levels)
    ExtraCharacter,
    /// A device leaves the ring, which the master sets up anew (line levels)
    Reconfiguration,
    /// The control word of a frame is another one (line levels)
    ControlWord,
}

/// A fault of a ring that was ordered.
pub type Order = order::Order<Fault>;

/// The number of a device in the ring, from 1.
///
/// # Errors
/// It is none.
pub fn device(text: &str) -> Result<u8, String> {
    text.parse().ok().filter(|number| *number > 0).ok_or("a device is 1 to 255".to_owned())
}

impl Orderable for Fault {
    fn is_without_probability(self) -> bool {
        false
    }

    fn station(text: &str) -> Result<u8, String> {
        device(text)
    }
}

/// A code that must be told.
pub type Code = &'static str;

impl Fault {
    /// The finding that it is there for.
    pub fn code(self) -> Code {
        use Fault::*;
        match self {
            UnrequestedAcknowledge => "interbus.unrequested-acknowledge",
            ServiceMismatch => "interbus.service-mismatch",
            EchoMismatch => "interbus.echo-mismatch",
            ErrorBit => "interbus.error-bit",
            UndefinedService => "interbus.undefined-service",
            Access => "interbus.access",
            ReservedBits => "interbus.reserved-bits",
            ValueOutOfRange => "interbus.value-out-of-range",
            Magnet => "interbus.magnet",
            NoAcknowledge => "interbus.no-acknowledge",
            NoRelease => "interbus.no-release",
            DataWithServiceBit => "interbus.data-with-service-bit",
            RequestChanged => "interbus.request-changed",
            Withdrawn => "interbus.withdrawn",
            PositionJump => "interbus.position-jump",
            RepeatedWrite => "interbus.repeated-write",
            Written => "interbus.written",
            Crc | MissingCharacter => "interbus.crc",
            Reset => "interbus.reset",
            ExtraCharacter | Reconfiguration | ControlWord => "interbus.line",
        }
    }

    /// What may be told because of it besides.
    pub fn may(self) -> &'static [Code] {
        use Fault::*;
        match self {
            Magnet => &["interbus.error-bit"],
            // Refused with the error bit.
            UndefinedService | Access | ValueOutOfRange => &["interbus.error-bit"],
            // Which of the two words is wrong cannot always be told.
            ServiceMismatch => &["interbus.undefined-service", "interbus.access"],
            RequestChanged => &["interbus.echo-mismatch", "interbus.service-mismatch"],
            Crc | MissingCharacter | ExtraCharacter => &["interbus.line", "interbus.crc"],
            Reset | Reconfiguration => &["interbus.line"],
            _ => &[],
        }
    }

    /// Whether only a capture of the line can show it.
    pub fn is_on_the_line(self) -> bool {
        self >= Fault::Crc
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_is_ordered_for_a_device() {
        let order: Order = "echo-mismatch@2=0.5".parse().unwrap();
        assert_eq!((order.fault, order.station), (Fault::EchoMismatch, Some(2)));
        assert!("crc@0".parse::<Order>().is_err(), "devices are counted from 1");
        for fault in Fault::value_variants() {
            assert!(fault.code().starts_with("interbus."));
            assert!(!fault.meaning().is_empty());
            assert_eq!(fault.meaning().contains("line levels"), fault.is_on_the_line());
        }
    }
}
