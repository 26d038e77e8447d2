//! Finding codes of DeviceNet.

mod connections;
mod messages;
mod network;

pub use connections::{
    CONNECTION_TIMEOUT, DELTA_IGNORED, IDLE, INHIBIT_VIOLATED, IO_FLOOD, IO_UNACKNOWLEDGED,
    LATE_PRODUCTION, NO_POLL_RESPONSE, NO_STROBE_RESPONSE, NOT_ALLOCATED, SIZE_MISMATCH,
    UNEXPECTED_ACK,
};
pub use messages::{
    ALLOCATION_INVALID, ALLOCATION_REFUSED, ERROR_RESPONSE, FRAGMENT_REJECTED, FRAGMENT_RETRY,
    FRAGMENT_SEQUENCE, FRAGMENT_UNACKNOWLEDGED, LATE_RESPONSE, MALFORMED, NO_RESPONSE,
    UNSOLICITED_RESPONSE, XID_BUSY,
};
pub use network::{
    DEVICE_FAULT, DUPLICATE_MAC, FOREIGN_FRAME, NODE_RESTART, RESERVED_ID, SHUTDOWN,
};

use super::encoder::codes as encoder;
use crate::finding::Code;

/// All of them.
pub static CODES: [&Code; 39] = [
    &MALFORMED,
    &RESERVED_ID,
    &DUPLICATE_MAC,
    &CONNECTION_TIMEOUT,
    &NO_RESPONSE,
    &NO_POLL_RESPONSE,
    &FRAGMENT_SEQUENCE,
    &FRAGMENT_UNACKNOWLEDGED,
    &SIZE_MISMATCH,
    &DEVICE_FAULT,
    &FOREIGN_FRAME,
    &ERROR_RESPONSE,
    &NO_STROBE_RESPONSE,
    &UNSOLICITED_RESPONSE,
    &NODE_RESTART,
    &FRAGMENT_RETRY,
    &FRAGMENT_REJECTED,
    &ALLOCATION_REFUSED,
    &ALLOCATION_INVALID,
    &LATE_RESPONSE,
    &LATE_PRODUCTION,
    &INHIBIT_VIOLATED,
    &IO_UNACKNOWLEDGED,
    &IO_FLOOD,
    &SHUTDOWN,
    &NOT_ALLOCATED,
    &UNEXPECTED_ACK,
    &XID_BUSY,
    &DELTA_IGNORED,
    &IDLE,
    &encoder::ALARM,
    &encoder::WARNING,
    &encoder::VALUE_OUT_OF_RANGE,
    &encoder::NOT_SETTABLE,
    &encoder::UNSAVED_PARAMETER,
    &encoder::PRESET_WHILE_MOVING,
    &encoder::POSITION_OUT_OF_RANGE,
    &encoder::TURNS_NOT_POWER_OF_TWO,
    &encoder::WRITTEN,
];

const SUPPLY: &str =
    "measure the network supply at the node (11 to 25 V between V+ and V-), and under load";
const PLUG: &str = "check plug and drop cable of the node: a drop is 6 m at most, all drops together 156/78/39 m at 125/250/500 kbit/s";
const TERMINATION: &str = "measure between CAN_H and CAN_L with the power off: about 60 Ω, which is 121 Ω at both ends of the trunk; the terminator of a Baumer encoder is off as delivered";
const LENGTHS: &str =
    "check the trunk: thick cable 500/250/100 m at 125/250/500 kbit/s, thin cable 100 m";
const SWITCHES: &str = "compare the MAC ID switches with the plan: two decimal rotary switches on Baumer encoders, tens and units, 00 to 63; they are read at power-on";
const RATE: &str = "compare DIP switches 2 and 3 with the bus: OFF-OFF 125, OFF-ON 250, ON-OFF 500, ON-ON 125 kbit/s";
const ERRORS: &str = "look for can.error-frame around it: errors on the wire delay and lose frames";
