//! CAN frames, and the identifiers of the predefined master/slave connection set.

/// An identifier.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Id {
    /// Of 11 bits: all that DeviceNet uses.
    Standard(u16),
    /// Of 29 bits: a stranger's.
    Extended(u32),
}

/// A data or remote frame of CAN 2.0.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Frame {
    /// Its identifier.
    pub id: Id,
    /// Whether it asks for data instead of holding some.
    pub is_remote: bool,
    data: [u8; 8],
    length: u8,
}

impl Frame {
    /// A data frame with an identifier of 11 bits. Bytes beyond the eighth are left out.
    pub fn new(id: u16, bytes: &[u8]) -> Self {
        Frame::of(Id::Standard(id & 0x7FF), bytes)
    }

    /// A data frame.
    pub fn of(id: Id, bytes: &[u8]) -> Self {
        let length = bytes.len().min(8);
        let mut data = [0; 8];
        data[..length].copy_from_slice(&bytes[..length]);
        Frame { id, is_remote: false, data, length: length as u8 }
    }

    /// A remote frame that asks for this many bytes, eight at most.
    pub fn remote(id: Id, length: u8) -> Self {
        Frame { is_remote: true, length: length.min(8), ..Frame::of(id, &[]) }
    }

    /// The data length code.
    pub fn length(&self) -> u8 {
        self.length
    }

    /// The data; a remote frame has none.
    pub fn bytes(&self) -> &[u8] {
        let length = if self.is_remote { 0 } else { usize::from(self.length) };
        &self.data[..length]
    }

    /// Its identifier, if that has 11 bits and a DeviceNet node takes the frame.
    pub fn devicenet_id(&self) -> Option<u16> {
        match self.id {
            Id::Standard(id) if !self.is_remote => Some(id),
            _ => None,
        }
    }

    /// The bits that arbitration goes by, first bit highest: less wins.
    pub fn rank(&self) -> u32 {
        let remote = u32::from(self.is_remote);
        match self.id {
            Id::Standard(id) => u32::from(id) << 21 | remote << 20,
            // The base identifier, SRR and IDE recessive, the other 18 bits, RTR.
            Id::Extended(id) => id >> 18 << 21 | 0b11 << 19 | (id & 0x3_FFFF) << 1 | remote,
        }
    }
}

/// Identifiers by who they belong to (DeviceNet predefined master/slave connection set; CIP Vol. 3,
/// chapter 3).
pub mod id {
    /// A slave's change-of-state or cyclic production.
    pub fn production(slave: u8) -> u16 {
        0x340 | u16::from(slave)
    }

    /// A slave's answer to the bit-strobe command.
    pub fn strobe_response(slave: u8) -> u16 {
        0x380 | u16::from(slave)
    }

    /// A slave's answer to its poll command.
    pub fn poll_response(slave: u8) -> u16 {
        0x3C0 | u16::from(slave)
    }

    fn group2(mac: u8, message: u16) -> u16 {
        0x400 | u16::from(mac) << 3 | message
    }

    /// The bit-strobe command of a master.
    pub fn strobe_command(master: u8) -> u16 {
        group2(master, 0)
    }

    /// The master's acknowledge of a slave's production.
    pub fn acknowledge(slave: u8) -> u16 {
        group2(slave, 2)
    }

    /// A slave's explicit and unconnected responses, its heartbeat and shutdown.
    pub fn response(slave: u8) -> u16 {
        group2(slave, 3)
    }

    /// Explicit requests to a slave.
    pub fn request(slave: u8) -> u16 {
        group2(slave, 4)
    }

    /// The poll command to a slave.
    pub fn poll_command(slave: u8) -> u16 {
        group2(slave, 5)
    }

    /// Unconnected requests to a Group 2 only slave.
    pub fn unconnected(slave: u8) -> u16 {
        group2(slave, 6)
    }

    /// The duplicate MAC ID check of a node.
    pub fn mac_check(node: u8) -> u16 {
        group2(node, 7)
    }

    /// Unconnected requests of a node that has the message manager (UCMM).
    pub fn ucmm_request(client: u8) -> u16 {
        0x780 | u16::from(client)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mac_23_and_master_0_have_these_identifiers() {
        assert_eq!(id::mac_check(23), 0x4BF);
        assert_eq!(id::unconnected(23), 0x4BE);
        assert_eq!((id::request(23), id::response(23)), (0x4BC, 0x4BB));
        assert_eq!((id::poll_command(23), id::poll_response(23)), (0x4BD, 0x3D7));
        assert_eq!((id::production(23), id::acknowledge(23)), (0x357, 0x4BA));
        assert_eq!((id::strobe_command(0), id::strobe_response(23)), (0x400, 0x397));
        assert_eq!(id::ucmm_request(0), 0x780);
    }

    #[test]
    fn the_lowest_identifier_wins_and_a_short_one_beats_a_long_one() {
        let standard = Frame::new(0x3D7, &[]).rank();
        assert!(standard < Frame::new(0x4BD, &[]).rank());
        assert!(standard < Frame::remote(Id::Standard(0x3D7), 0).rank());
        assert!(standard < Frame::of(Id::Extended(0x3D7 << 18), &[]).rank());
        assert!(Frame::of(Id::Extended(0x3D7 << 18), &[]).rank() < Frame::new(0x3D8, &[]).rank());
    }
}
