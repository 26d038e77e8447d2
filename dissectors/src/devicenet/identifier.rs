//! What an 11-bit identifier says: group, message id, MAC ID, and its place in the predefined
//! master/slave connection set.
//!
//! ```text
//! group 1   0 mmmm aaaaaa     000-3FF   message id 0-15, MAC ID of the source
//! group 2   10 aaaaaa mmm     400-5FF   MAC ID of source or destination, message id 0-7
//! group 3   11 mmm aaaaaa     600-7BF   message id 0-6, MAC ID of the source
//! group 4   11111 mmmmmm      7C0-7EF   message id 0-2F
//! ```
//!
//! DeviceNet specification (CIP Vol. 3), chapter 3: CAN identifier field, predefined connection set.

/// Number of MAC IDs on a bus.
pub const MAC_IDS: usize = 64;

/// A MAC ID: the address of a node, 0 to 63.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct MacId(u8);

impl MacId {
    /// The MAC ID in the low six bits.
    #[must_use]
    pub const fn of(bits: u8) -> Self {
        MacId(bits & 0x3F)
    }

    /// A MAC ID; `None` above 63.
    #[must_use]
    pub const fn new(value: u8) -> Option<Self> {
        if value < MAC_IDS as u8 { Some(MacId(value)) } else { None }
    }

    /// 0 to 63.
    #[must_use]
    pub const fn get(self) -> u8 {
        self.0
    }

    /// As an index of a table with [`MAC_IDS`] entries.
    #[must_use]
    pub const fn index(self) -> usize {
        self.0 as usize
    }

    /// As a bit of a set of MAC IDs.
    #[must_use]
    pub const fn bit(self) -> u64 {
        1 << self.0
    }
}

/// Where an identifier lies.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Place {
    /// 1 to 4.
    pub group: u8,
    /// Message id within the group.
    pub message_id: u8,
    /// The MAC ID in the identifier: of source or destination. Group 4 has none.
    pub mac: Option<MacId>,
}

impl Place {
    /// The place of an identifier; `None` for 7F0h to 7FFh, which must never appear.
    #[must_use]
    pub const fn of(id: u16) -> Option<Self> {
        let low = MacId::of(id as u8);
        Some(match id {
            0x000..=0x3FF => Place { group: 1, message_id: (id >> 6) as u8, mac: Some(low) },
            0x400..=0x5FF => {
                let mac = MacId::of((id >> 3) as u8);
                Place { group: 2, message_id: (id & 7) as u8, mac: Some(mac) }
            }
            0x600..=0x7BF => Place { group: 3, message_id: (id >> 6 & 7) as u8, mac: Some(low) },
            0x7C0..=0x7EF => Place { group: 4, message_id: (id - 0x7C0) as u8, mac: None },
            _ => return None,
        })
    }
}

/// What the predefined master/slave connection set, the unconnected ports and the offline
/// connection set make of an identifier.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Port {
    /// A slave answers a multicast poll.
    MulticastResponse(MacId),
    /// A slave's change-of-state or cyclic message.
    Production(MacId),
    /// A slave answers a bit-strobe.
    StrobeResponse(MacId),
    /// A slave answers a poll, or acknowledges the master's change-of-state or cyclic message.
    PollResponse(MacId),
    /// A master strobes its slaves. The MAC ID is the master's.
    StrobeCommand(MacId),
    /// A master polls a multicast group.
    MulticastCommand(MacId),
    /// A master acknowledges a slave's change-of-state or cyclic message.
    Acknowledge(MacId),
    /// A slave's explicit or unconnected response, heartbeat or shutdown.
    ExplicitResponse(MacId),
    /// An explicit request to a slave.
    ExplicitRequest(MacId),
    /// A master polls a slave, or sends it change-of-state or cyclic data.
    PollCommand(MacId),
    /// An unconnected request to a Group 2 only server.
    UnconnectedRequest(MacId),
    /// The duplicate MAC ID check, both directions.
    DuplicateMac(MacId),
    /// An unconnected response, heartbeat or shutdown of a node with a UCMM.
    UcmmResponse(MacId),
    /// An unconnected request of a node.
    UcmmRequest(MacId),
    /// A faulted node answers.
    CommFaultResponse,
    /// A tool asks faulted nodes.
    CommFaultRequest,
    /// The owner of the offline connection set answers.
    OwnershipResponse,
    /// A tool asks for the offline connection set.
    OwnershipRequest,
    /// For connections that are opened at run time.
    Free(MacId),
    /// Reserved or invalid.
    Reserved,
}

impl Port {
    /// The port of an identifier.
    #[must_use]
    pub const fn of(id: u16) -> Self {
        let Some(Place { group, message_id, mac }) = Place::of(id) else {
            return Port::Reserved;
        };
        match (group, message_id, mac) {
            (1, 12, Some(slave)) => Port::MulticastResponse(slave),
            (1, 13, Some(slave)) => Port::Production(slave),
            (1, 14, Some(slave)) => Port::StrobeResponse(slave),
            (1, 15, Some(slave)) => Port::PollResponse(slave),
            (2, 0, Some(master)) => Port::StrobeCommand(master),
            (2, 1, Some(group)) => Port::MulticastCommand(group),
            (2, 2, Some(slave)) => Port::Acknowledge(slave),
            (2, 3, Some(slave)) => Port::ExplicitResponse(slave),
            (2, 4, Some(slave)) => Port::ExplicitRequest(slave),
            (2, 5, Some(slave)) => Port::PollCommand(slave),
            (2, 6, Some(slave)) => Port::UnconnectedRequest(slave),
            (2, _, Some(node)) => Port::DuplicateMac(node),
            (3, 5, Some(server)) => Port::UcmmResponse(server),
            (3, 6, Some(client)) => Port::UcmmRequest(client),
            (1 | 3, _, Some(source)) => Port::Free(source),
            (4, 0x2C, _) => Port::CommFaultResponse,
            (4, 0x2D, _) => Port::CommFaultRequest,
            (4, 0x2E, _) => Port::OwnershipResponse,
            (4, 0x2F, _) => Port::OwnershipRequest,
            _ => Port::Reserved,
        }
    }

    /// The MAC ID in the identifier, where it is the sender's.
    #[must_use]
    pub const fn sender(self) -> Option<MacId> {
        match self {
            Port::MulticastResponse(mac)
            | Port::Production(mac)
            | Port::StrobeResponse(mac)
            | Port::PollResponse(mac)
            | Port::StrobeCommand(mac)
            | Port::ExplicitResponse(mac)
            | Port::DuplicateMac(mac)
            | Port::UcmmResponse(mac)
            | Port::UcmmRequest(mac)
            | Port::Free(mac) => Some(mac),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_identifier_is_built_from_its_parts() {
        // CIP Vol. 3: g1 = id<<6|mac, g2 = 400h|mac<<3|id, g3 = 600h|id<<6|mac, g4 = 7C0h|id.
        for id in 0..0x800_u16 {
            let Some(Place { group, message_id, mac }) = Place::of(id) else {
                assert!(id >= 0x7F0);
                continue;
            };
            let message = u16::from(message_id);
            let mac = mac.map(|mac| u16::from(mac.get()));
            let built = match (group, mac) {
                (1, Some(mac)) => message << 6 | mac,
                (2, Some(mac)) => 0x400 | mac << 3 | message,
                (3, Some(mac)) => 0x600 | message << 6 | mac,
                (4, None) => 0x7C0 + message,
                _ => panic!("{id:03X}"),
            };
            assert_eq!(built, id);
        }
    }

    #[test]
    fn the_predefined_set_of_node_23() {
        // The identifiers that a Baumer encoder with MAC ID 23 uses: 400h + 8 * 23 = 4B8h.
        let node = MacId::of(23);
        for (id, port) in [
            (0x317, Port::MulticastResponse(node)),
            (0x357, Port::Production(node)),
            (0x397, Port::StrobeResponse(node)),
            (0x3D7, Port::PollResponse(node)),
            (0x4B8, Port::StrobeCommand(node)),
            (0x4B9, Port::MulticastCommand(node)),
            (0x4BA, Port::Acknowledge(node)),
            (0x4BB, Port::ExplicitResponse(node)),
            (0x4BC, Port::ExplicitRequest(node)),
            (0x4BD, Port::PollCommand(node)),
            (0x4BE, Port::UnconnectedRequest(node)),
            (0x4BF, Port::DuplicateMac(node)),
            (0x757, Port::UcmmResponse(node)),
            (0x797, Port::UcmmRequest(node)),
            (0x2D7, Port::Free(node)),
            (0x617, Port::Free(node)),
            (0x717, Port::Free(node)),
            (0x7C0, Port::Reserved),
            (0x7EB, Port::Reserved),
            (0x7EC, Port::CommFaultResponse),
            (0x7ED, Port::CommFaultRequest),
            (0x7EE, Port::OwnershipResponse),
            (0x7EF, Port::OwnershipRequest),
            (0x7F0, Port::Reserved),
            (0x7FF, Port::Reserved),
        ] {
            assert_eq!(Port::of(id), port, "{id:03X}");
        }
    }

    #[test]
    fn there_is_no_mac_id_above_63() {
        assert_eq!((MacId::new(63).map(MacId::get), MacId::new(64)), (Some(63), None));
    }
}
