//! Allocate and Release of the predefined master/slave connection set, and the Open, Close of
//! connections between nodes with an unconnected message manager (UCMM).
//!
//! DeviceNet specification (CIP Vol. 3), chapters 4 (UCMM) and 5 (DeviceNet object, services 4Bh,
//! 4Ch).

use super::defect::Defect;
use super::identifier::MacId;
use super::message::BodyFormat;
use crate::field::{List, Value};
use nom::number::complete::{le_u16, u8};
use nom::{IResult, Parser};

/// The connections that an Allocate asks for, or a Release gives back.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct Choice(u8);

impl Choice {
    /// Explicit messages.
    pub const EXPLICIT: Choice = Choice(0x01);
    /// Polled I/O.
    pub const POLL: Choice = Choice(0x02);
    /// Bit-strobed I/O.
    pub const STROBE: Choice = Choice(0x04);
    /// Multicast polled I/O; reserved in devices of the specification's release 2.0.
    pub const MULTICAST: Choice = Choice(0x08);
    /// Change-of-state I/O.
    pub const COS: Choice = Choice(0x10);
    /// Cyclic I/O.
    pub const CYCLIC: Choice = Choice(0x20);
    /// The master does not acknowledge change-of-state or cyclic messages.
    pub const NO_ACKNOWLEDGE: Choice = Choice(0x40);

    /// Change of state or cyclic.
    pub const PRODUCING: Choice = Choice(0x30);
    /// All connections.
    pub const ALL: Choice = Choice(0x3F);

    const NAMES: [(Choice, &'static str); 6] = [
        (Choice::EXPLICIT, "explicit"),
        (Choice::POLL, "poll"),
        (Choice::STROBE, "strobe"),
        (Choice::MULTICAST, "multicast"),
        (Choice::COS, "cos"),
        (Choice::CYCLIC, "cyclic"),
    ];

    /// The choice byte.
    #[must_use]
    pub const fn of(byte: u8) -> Self {
        Choice(byte)
    }

    /// The byte again.
    #[must_use]
    pub const fn byte(self) -> u8 {
        self.0
    }

    /// Whether it has any of these.
    #[must_use]
    pub const fn has(self, other: Choice) -> bool {
        self.0 & other.0 != 0
    }

    /// With these as well.
    #[must_use]
    pub const fn and(self, other: Choice) -> Self {
        Choice(self.0 | other.0)
    }

    /// Without these.
    #[must_use]
    pub const fn without(self, other: Choice) -> Self {
        Choice(self.0 & !other.0)
    }

    /// Whether an Allocate must not ask for it: nothing, bit 7, change of state with cyclic, or
    /// no acknowledge for neither.
    #[must_use]
    pub const fn is_invalid(self) -> bool {
        let both = self.has(Choice::COS) && self.has(Choice::CYCLIC);
        let alone = self.has(Choice::NO_ACKNOWLEDGE) && !self.has(Choice::PRODUCING);
        self.0 == 0 || self.0 & 0x80 != 0 || both || alone
    }

    /// Whether a Release must not carry it: nothing, or bits 6 and 7.
    #[must_use]
    pub const fn is_invalid_release(self) -> bool {
        self.0 & 0x3F == 0 || self.0 & 0xC0 != 0
    }

    /// The names of the connections.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        Choice::NAMES.into_iter().filter(move |(choice, _)| self.has(*choice)).map(|(_, name)| name)
    }
}

impl List for Choice {
    fn len(&self) -> usize {
        self.names().count()
    }

    fn get(&self, index: usize) -> Value<'_> {
        self.names().nth(index).into()
    }
}

/// What an Allocate or Release asks for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Allocation {
    /// Which connections.
    pub choice: Choice,
    /// Who will own them, as sent; a Release names nobody.
    pub allocator: Option<u8>,
}

/// The data of an Allocate.
///
/// # Errors
/// The input ends before it does.
pub fn allocate(input: &[u8]) -> IResult<&[u8], Allocation> {
    (u8, u8)
        .map(|(choice, mac)| Allocation { choice: Choice(choice), allocator: Some(mac) })
        .parse(input)
}

/// The data of a Release.
///
/// # Errors
/// The input is empty.
pub fn release(input: &[u8]) -> IResult<&[u8], Allocation> {
    u8.map(|choice| Allocation { choice: Choice(choice), allocator: None }).parse(input)
}

/// What an Open asks for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Open {
    /// The body format, with the reserved bits above it.
    pub format: u8,
    /// Which message group the connection shall use; 15 asks only whether the node is there.
    pub group: u8,
    /// The message id that the client will send with.
    pub source: u8,
}

/// The body of an Open.
///
/// # Errors
/// The input ends before it does.
pub fn open(input: &[u8]) -> IResult<&[u8], Open> {
    (u8, u8).map(|(format, ids)| Open { format, group: ids >> 4, source: ids & 0x0F }).parse(input)
}

impl Open {
    /// The group select that opens nothing.
    pub const PING: u8 = 0x0F;

    /// What is wrong with it: the reserved bits and formats, the groups that there are not, and
    /// message ids outside the group's.
    #[must_use]
    pub fn defect(self) -> Option<Defect> {
        if self.format & 0xF0 != 0 {
            return Some(Defect::ReservedBits);
        }
        if BodyFormat::of(self.format).is_none() {
            return Some(Defect::ReservedFormat);
        }
        match (self.group, self.source) {
            (0 | Open::PING, _) | (1, 0) | (3, 0..=4) => None,
            (1 | 3, _) => Some(Defect::MessageId),
            _ => Some(Defect::ReservedValue),
        }
    }
}

/// What the server opened.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Opened {
    /// The body format that is used, with the reserved bits above it.
    pub format: u8,
    /// In group 2, the message id of the client's messages.
    pub destination: u8,
    /// The message id that the server will send with.
    pub source: u8,
    /// The connection's instance.
    pub instance: u16,
}

/// The body of the answer to an Open.
///
/// # Errors
/// The input ends before it does.
pub fn opened(input: &[u8]) -> IResult<&[u8], Opened> {
    (u8, u8, le_u16)
        .map(|(format, ids, instance)| Opened {
            format,
            destination: ids >> 4,
            source: ids & 0x0F,
            instance,
        })
        .parse(input)
}

impl Opened {
    /// What is wrong with it as an answer to that.
    #[must_use]
    pub fn defect(self, open: Open) -> Option<Defect> {
        if self.format & 0xF0 != 0 {
            return Some(Defect::ReservedBits);
        }
        if BodyFormat::of(self.format).is_none() {
            return Some(Defect::ReservedFormat);
        }
        let (destination, source) = (self.destination, self.source);
        let fits = match open.group {
            1 => destination <= 5 && source <= 5 && destination != source,
            3 => destination == 0 && source <= 4,
            _ => destination == 0,
        };
        (!fits).then_some(Defect::MessageId)
    }

    /// The identifiers of requests and responses; `None` for a ping and for groups that there
    /// are not.
    #[must_use]
    pub fn identifiers(self, open: Open, client: MacId, server: MacId) -> Option<(u16, u16)> {
        let [client, server] = [client, server].map(|mac| u16::from(mac.get()));
        let [asks, answers, destination] =
            [open.source, self.source, self.destination].map(u16::from);
        match open.group {
            0 => Some((asks << 6 | client, answers << 6 | server)),
            1 => {
                let base = 0x400 | server << 3;
                Some((base | destination & 7, base | answers & 7))
            }
            3 if asks < 7 && answers < 7 => {
                Some((0x600 | asks << 6 | client, 0x600 | answers << 6 | server))
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    #[test]
    fn choices_that_a_slave_must_refuse() {
        for (byte, is_invalid) in
            [(0x03, false), (0x51, false), (0, true), (0x83, true), (0x31, true), (0x43, true)]
        {
            assert_eq!(Choice::of(byte).is_invalid(), is_invalid, "{byte:02X}");
        }
        let names: Vec<_> = Choice::of(0x51).names().collect();
        assert_eq!(names, ["explicit", "cos"]);
    }

    #[test]
    fn opened_connections_have_the_identifiers_of_the_worked_examples() {
        // 05 4B 02 10 -> 00 CB 02 45 02 00 opens 42C and 42D of group 2 on server 5.
        // 05 4B 02 34 -> 00 CB 02 00 02 00 opens 700 and 605 of group 3.
        let [client, server] = [0, 5].map(MacId::of);
        for (ask, answer, wanted) in [
            ([0x02, 0x10], [0x02, 0x45, 2, 0], (0x42C, 0x42D)),
            ([0x02, 0x34], [0x02, 0x00, 2, 0], (0x700, 0x605)),
        ] {
            let (_, open) = open(&ask).unwrap();
            let (_, opened) = opened(&answer).unwrap();
            assert_eq!((open.defect(), opened.defect(open)), (None, None));
            assert_eq!(opened.identifiers(open, client, server), Some(wanted));
            assert_eq!(opened.instance, 2);
        }
    }

    #[test]
    fn opens_with_wrong_ids_are_malformed() {
        for (bytes, defect) in [
            ([0x02, 0x17], Some(Defect::MessageId)),
            ([0x02, 0x35], Some(Defect::MessageId)),
            ([0x12, 0x30], Some(Defect::ReservedBits)),
            ([0x05, 0x30], Some(Defect::ReservedFormat)),
            ([0x00, 0x20], Some(Defect::ReservedValue)),
            ([0x00, 0xF0], None),
        ] {
            assert_eq!(open(&bytes).unwrap().1.defect(), defect, "{bytes:02X?}");
        }
    }
}
