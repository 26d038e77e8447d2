//! What a technician sees at the encoder itself: the DUO LED in the bus cover (manual §9.2).

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
}
