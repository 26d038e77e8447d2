//! The faults that can be ordered, by name: each is named after the finding that it must raise.

use crate::simulate::order::{self, Orderable};
use crate::simulate::time::{MS, Ps, S};
use clap::ValueEnum;

/// What can go wrong on a DeviceNet bus.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, ValueEnum)]
#[expect(clippy::enum_variant_names, reason = "a device fault is called so")]
pub enum Fault {
    /// A node flags an error in the middle of a frame, which is sent again
    ErrorFrame,
    /// A stuff bit is turned over
    Stuff,
    /// A bit of the end of frame is dominant
    Form,
    /// Noise turns over a bit of a frame
    Crc,
    /// A node asks for time behind a frame
    Overload,
    /// The controller of the tap leaves the bus for a moment (log, pcapng)
    BusOff,
    /// The capture has fewer bytes of a frame than it had (pcapng)
    Truncated,
    /// The tap loses one to five frames (log, pcapng)
    Dropped,
    /// One encoder alone, which repeats its first frame for want of an acknowledge: --lone
    NotAcknowledged,
    /// The tap runs at another bit rate and hears nothing but errors (log, pcapng)
    WrongBitrate,
    /// The scanner polls without a pause
    HighLoad,

    /// A request of a reserved service, or a service that the unconnected port must refuse
    Malformed,
    /// A frame with a reserved identifier
    ReservedId,
    /// A second node with the same MAC ID is switched on and is refused
    DuplicateMac,
    /// The scanner leaves a slave alone for longer than four times its packet rate (poll, strobe)
    ConnectionTimeout,
    /// A slave does not answer an explicit request
    NoResponse,
    /// A slave does not answer a poll command
    NoPollResponse,
    /// A slave does not answer a strobe command
    NoStrobeResponse,
    /// A fragment with the wrong count
    FragmentSequence,
    /// A fragment is sent twice, and never acknowledged
    FragmentUnacknowledged,
    /// A fragment is acknowledged when it is sent for the second time
    FragmentRetry,
    /// A fragment is refused: too much data
    FragmentRejected,
    /// I/O of the wrong length, for one to five productions
    SizeMismatch,
    /// I/O without data, for one to five productions
    Idle,
    /// A heartbeat says that the device has a fault
    DeviceFault,
    /// A frame with an identifier of 29 bits, or a remote frame
    ForeignFrame,
    /// The scanner asks for what the encoder does not have
    ErrorResponse,
    /// A response comes twice
    UnsolicitedResponse,
    /// An encoder is switched off and on
    NodeRestart,
    /// Another master wants the encoder, which has one
    AllocationRefused,
    /// An allocation that asks for nothing, or for what excludes each other
    AllocationInvalid,
    /// A slave answers an explicit request after 600 to 900 ms
    LateResponse,
    /// A production comes late: after 1.7 to 3 times the packet rate (cos, cyclic)
    LateProduction,
    /// A production follows the one before within the inhibit time (cos)
    InhibitViolated,
    /// The master does not acknowledge a production, which is sent again (cos, cyclic)
    IoUnacknowledged,
    /// The master acknowledges where that was suppressed (cos, cyclic with --no-acknowledge)
    UnexpectedAck,
    /// An encoder produces as often as it can: COS delta 1, no inhibit time
    IoFlood,
    /// A slave says that it shuts down, and restarts
    Shutdown,
    /// The scanner releases an I/O connection, and I/O goes on for a moment (poll, cos, cyclic)
    NotAllocated,
    /// A second request with the same transaction ID while the first is open
    XidBusy,
    /// A production although the position changed by less than the delta (cos)
    DeltaIgnored,

    /// A position error: the alarm flag is set for 2.5 s (--assembly 2)
    Alarm,
    /// The lithium cell is low: the warning flag is set for 3 s (--assembly 2)
    Warning,
    /// The scanner sets steps per turn beyond 8192
    ValueOutOfRange,
    /// The scanner sets an attribute that can only be read
    NotSettable,
    /// A value is set and not saved before the encoder is switched off and on
    UnsavedParameter,
    /// The preset is set while the shaft turns
    PresetWhileMoving,
    /// A position beyond the total resolution
    PositionOutOfRange,
    /// Total resolution and steps per turn make a number of turns that is not a power of two
    TurnsNotPowerOfTwo,
    /// A preset is set and saved, as it should be
    Written,
}

/// A fault of a DeviceNet bus that was ordered.
pub type Order = order::Order<Fault>;

impl Orderable for Fault {
    fn is_without_probability(self) -> bool {
        self.is_bus_wide()
    }

    fn station(text: &str) -> Result<u8, String> {
        super::plan::mac(text)
    }
}

/// A code that must be told.
pub type Code = &'static str;

impl Fault {
    /// The finding that it is there for.
    pub fn code(self) -> Code {
        use Fault::*;
        match self {
            ErrorFrame => "can.error-frame",
            Stuff => "can.stuff",
            Form => "can.form",
            Crc => "can.crc",
            Overload => "can.overload",
            BusOff => "can.bus-off",
            Truncated => "can.truncated",
            Dropped => "can.dropped",
            NotAcknowledged => "can.not-acknowledged",
            WrongBitrate => "can.wrong-bitrate",
            HighLoad => "can.high-load",
            Malformed => "devicenet.malformed",
            ReservedId => "devicenet.reserved-id",
            DuplicateMac => "devicenet.duplicate-mac",
            ConnectionTimeout => "devicenet.connection-timeout",
            NoResponse => "devicenet.no-response",
            NoPollResponse => "devicenet.no-poll-response",
            NoStrobeResponse => "devicenet.no-strobe-response",
            FragmentSequence => "devicenet.fragment-sequence",
            FragmentUnacknowledged => "devicenet.fragment-unacknowledged",
            FragmentRetry => "devicenet.fragment-retry",
            FragmentRejected => "devicenet.fragment-rejected",
            SizeMismatch => "devicenet.size-mismatch",
            Idle => "devicenet.idle",
            DeviceFault => "devicenet.device-fault",
            ForeignFrame => "devicenet.foreign-frame",
            ErrorResponse => "devicenet.error-response",
            UnsolicitedResponse => "devicenet.unsolicited-response",
            NodeRestart => "devicenet.node-restart",
            AllocationRefused => "devicenet.allocation-refused",
            AllocationInvalid => "devicenet.allocation-invalid",
            LateResponse => "devicenet.late-response",
            LateProduction => "devicenet.late-production",
            InhibitViolated => "devicenet.inhibit-violated",
            IoUnacknowledged => "devicenet.io-unacknowledged",
            UnexpectedAck => "devicenet.unexpected-ack",
            IoFlood => "devicenet.io-flood",
            Shutdown => "devicenet.shutdown",
            NotAllocated => "devicenet.not-allocated",
            XidBusy => "devicenet.xid-busy",
            DeltaIgnored => "devicenet.delta-ignored",
            Alarm => "encoder.alarm",
            Warning => "encoder.warning",
            ValueOutOfRange => "encoder.value-out-of-range",
            NotSettable => "encoder.not-settable",
            UnsavedParameter => "encoder.unsaved-parameter",
            PresetWhileMoving => "encoder.preset-while-moving",
            PositionOutOfRange => "encoder.position-out-of-range",
            TurnsNotPowerOfTwo => "encoder.turns-not-power-of-two",
            Written => "encoder.written",
        }
    }

    /// What may be told because of it besides.
    pub fn may(self) -> &'static [Code] {
        use Fault::*;
        const RESTARTS: &[Code] = &[
            "devicenet.node-restart",
            "devicenet.no-poll-response",
            "devicenet.no-strobe-response",
            "devicenet.no-response",
            "devicenet.late-production",
            "devicenet.connection-timeout",
            "devicenet.fragment-unacknowledged",
            "encoder.unsaved-parameter",
        ];
        match self {
            ErrorFrame | Stuff | Form | Crc => {
                &["can.error-frame", "can.stuff", "can.form", "can.crc"]
            }
            Overload => &["can.error-frame", "can.form"],
            BusOff => &["can.error-frame", "devicenet.no-poll-response", "devicenet.no-response"],
            NotAcknowledged | WrongBitrate => {
                &["can.error-frame", "can.stuff", "can.form", "can.crc"]
            }
            HighLoad => &["devicenet.io-flood", "devicenet.no-poll-response"],
            Truncated => &["devicenet.malformed", "devicenet.size-mismatch"],
            Malformed | ErrorResponse | ValueOutOfRange | NotSettable => {
                &["devicenet.error-response"]
            }
            DuplicateMac => &["devicenet.node-restart"],
            // A slave whose bit is not set does not answer the strobe.
            ConnectionTimeout => &["devicenet.late-production", "devicenet.no-strobe-response"],
            // The scanner allocates again what it was not told to have.
            NoResponse => &["devicenet.late-response", "devicenet.allocation-refused"],
            FragmentSequence | FragmentUnacknowledged => &[
                "devicenet.fragment-retry",
                "devicenet.fragment-unacknowledged",
                "devicenet.no-response",
            ],
            // The shaft may turn when the preset comes for the second time.
            FragmentRetry => &["encoder.preset-while-moving"],
            FragmentRejected => &["devicenet.no-response"],
            AllocationInvalid => &["devicenet.allocation-refused"],
            NodeRestart | Shutdown | UnsavedParameter => RESTARTS,
            XidBusy => &["devicenet.unsolicited-response"],
            LateProduction => &["devicenet.connection-timeout"],
            InhibitViolated => &["devicenet.delta-ignored"],
            DeltaIgnored => &["devicenet.inhibit-violated"],
            IoFlood => &["can.high-load"],
            PresetWhileMoving | Written => &["encoder.written"],
            _ => &[],
        }
    }

    /// Whether it is there all the time or not at all.
    pub fn is_bus_wide(self) -> bool {
        matches!(self, Fault::NotAcknowledged | Fault::WrongBitrate | Fault::HighLoad)
    }

    /// Whether it is in the nature of the encoders that it is ordered for.
    pub fn is_nature(self) -> bool {
        self.is_bus_wide() || matches!(self, Fault::IoFlood | Fault::TurnsNotPowerOfTwo)
    }

    /// Whether it is in the tap and not on the line.
    pub fn is_in_the_tap(self) -> bool {
        matches!(self, Fault::BusOff | Fault::Truncated | Fault::Dropped | Fault::WrongBitrate)
    }

    /// Within which time it must be told.
    pub fn told_within(self) -> Ps {
        use Fault::*;
        match self {
            LateResponse | DeviceFault => 1_500 * MS,
            // The scanner asks again after 1.5 s.
            NoResponse => 2 * S,
            FragmentSequence | FragmentUnacknowledged | FragmentRetry => 2_500 * MS,
            ConnectionTimeout | LateProduction => 3 * S,
            DuplicateMac | NodeRestart | Shutdown | UnsavedParameter => 4 * S,
            HighLoad | IoFlood => 3 * S,
            _ => 500 * MS,
        }
    }

    /// How long no other fault may strike the same station, so that each is beyond doubt.
    pub fn rest(self) -> Ps {
        use Fault::*;
        match self {
            NodeRestart | Shutdown | UnsavedParameter => 8 * S,
            ConnectionTimeout | DuplicateMac => 5 * S,
            // Longer than the flag lasts, so that it is off between two.
            Warning => 4 * S,
            FragmentSequence | FragmentUnacknowledged | NoResponse => 4 * S,
            FragmentRetry | LateResponse | Alarm | DeviceFault | NotAllocated => 3 * S,
            ErrorFrame | Stuff | Form | Crc | Overload | Truncated | ForeignFrame | ReservedId => {
                20 * MS
            }
            Dropped | BusOff => 1_500 * MS,
            _ => 400 * MS,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_is_named_like_its_code() {
        for fault in Fault::value_variants() {
            let (_, last) = fault.code().split_once('.').unwrap();
            assert_eq!(fault.name(), last);
            assert!(!fault.meaning().is_empty());
        }
        let order: Order = "alarm@23=0.5".parse().unwrap();
        assert_eq!((order.fault, order.station), (Fault::Alarm, Some(23)));
        assert!("alarm@64".parse::<Order>().is_err(), "MAC IDs end with 63");
    }
}
