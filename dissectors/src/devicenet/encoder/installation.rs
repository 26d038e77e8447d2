//! What a technician sees and sets at the encoder itself: the DUO LED and the switches in the bus
//! cover (manual §9).

use core::fmt;

/// What the traffic tells of a node.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum NodeState {
    /// Not heard, or its duplicate MAC ID check is not finished.
    Absent,
    /// On line; nobody has connected to it.
    Unconnected,
    /// It has connections.
    Connected,
    /// An I/O connection timed out.
    TimedOut,
    /// A critical error: its MAC ID is taken, or it cannot communicate.
    Faulted,
}

/// What the DUO LED looks like.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Led {
    /// Dark.
    Off,
    /// Green, flashing.
    GreenFlashing,
    /// Green.
    Green,
    /// Red, flashing.
    RedFlashing,
    /// Red.
    Red,
}

impl Led {
    /// What it should look like in this state.
    #[must_use]
    pub const fn of(state: NodeState) -> Self {
        match state {
            NodeState::Absent => Led::Off,
            NodeState::Unconnected => Led::GreenFlashing,
            NodeState::Connected => Led::Green,
            NodeState::TimedOut => Led::RedFlashing,
            NodeState::Faulted => Led::Red,
        }
    }

    /// What it means.
    #[must_use]
    pub const fn meaning(self) -> &'static str {
        match self {
            Led::Off => "no supply, or the duplicate MAC ID check is not finished",
            Led::GreenFlashing => "on line, no connection",
            Led::Green => "connected",
            Led::RedFlashing => "I/O connection timed out",
            Led::Red => "critical error, or the MAC ID is assigned twice",
        }
    }
}

impl fmt::Display for Led {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            Led::Off => "off",
            Led::GreenFlashing => "green flashing",
            Led::Green => "green",
            Led::RedFlashing => "red flashing",
            Led::Red => "red",
        })
    }
}

/// A setting of DIP switches 2 and 3; switch 1 does not matter.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct BitRateSwitches {
    /// Switch 2 is ON.
    pub switch_2: bool,
    /// Switch 3 is ON.
    pub switch_3: bool,
    /// Bits per second.
    pub bit_rate: u32,
}

/// The bit rates by switches (manual §9.1.2). The last setting is not defined and taken as the
/// default, 125 kbit/s.
pub static BIT_RATE_SWITCHES: [BitRateSwitches; 4] = [
    BitRateSwitches { switch_2: false, switch_3: false, bit_rate: 125_000 },
    BitRateSwitches { switch_2: false, switch_3: true, bit_rate: 250_000 },
    BitRateSwitches { switch_2: true, switch_3: false, bit_rate: 500_000 },
    BitRateSwitches { switch_2: true, switch_3: true, bit_rate: 125_000 },
];

/// The MAC ID that the two decimal rotary switches set. `None` for 64 to 99, which they can show
/// and DeviceNet does not have.
#[must_use]
pub const fn mac_id_of_switches(tens: u8, ones: u8) -> Option<u8> {
    if tens > 9 || ones > 9 {
        return None;
    }
    let number = tens * 10 + ones;
    if number < 64 { Some(number) } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;

    #[test]
    fn the_led_follows_the_node() {
        for (state, led) in [
            (NodeState::Absent, "off"),
            (NodeState::Unconnected, "green flashing"),
            (NodeState::Connected, "green"),
            (NodeState::Faulted, "red"),
            (NodeState::TimedOut, "red flashing"),
        ] {
            assert_eq!(Led::of(state).to_string(), led);
        }
    }

    #[test]
    fn switches_2_and_3_set_the_bit_rate() {
        let rates = [(false, false), (false, true), (true, false), (true, true)].map(|setting| {
            let row = BIT_RATE_SWITCHES.iter().find(|s| (s.switch_2, s.switch_3) == setting);
            row.unwrap().bit_rate / 1000
        });
        assert_eq!(rates, [125, 250, 500, 125]);
    }

    #[test]
    fn rotary_switches_set_the_mac_id() {
        // The manual's example: 23.
        assert_eq!(mac_id_of_switches(2, 3), Some(23));
        assert_eq!(mac_id_of_switches(6, 3), Some(63));
        assert_eq!(mac_id_of_switches(6, 4), None);
        assert_eq!(mac_id_of_switches(255, 0), None);
    }
}
