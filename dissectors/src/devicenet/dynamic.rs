//! Connections that nodes opened through the unconnected message manager (UCMM): they take an
//! identifier over, whatever the predefined set makes of it.

use super::identifier::MacId;
use super::message::BodyFormat;
use alloc::vec::Vec;

/// Connections that are remembered.
const CONNECTIONS: usize = 64;

/// Number of 11-bit identifiers.
const IDENTIFIERS: usize = 0x800;

/// An explicit connection between two nodes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Dynamic {
    /// The server's number for it.
    pub instance: u16,
    pub client: MacId,
    pub server: MacId,
    /// The identifier of the client's messages.
    pub asks_on: u16,
    /// The identifier of the server's messages.
    pub answers_on: u16,
    pub format: BodyFormat,
}

/// The connections that are open.
pub(super) struct Dynamics {
    open: Vec<Dynamic>,
    /// Which identifiers are taken over: a set of bits, as nearly all frames ask for it.
    taken: [u64; IDENTIFIERS / 64],
}

impl Dynamics {
    pub const fn new() -> Self {
        Dynamics { open: Vec::new(), taken: [0; IDENTIFIERS / 64] }
    }

    /// The connection that uses an identifier, and whether its server sends with it.
    pub fn of(&self, id: u16) -> Option<(Dynamic, bool)> {
        let word = self.taken.get(usize::from(id / 64))?;
        if word >> (id % 64) & 1 == 0 {
            return None;
        }
        // The last that was opened holds.
        let mut newest = self.open.iter().rev();
        let it = newest.find(|it| it.asks_on == id || it.answers_on == id)?;
        Some((*it, it.answers_on == id))
    }

    /// A connection is opened. Where there are too many, the oldest is forgotten.
    pub fn open(&mut self, connection: Dynamic) {
        self.close(connection.server, connection.instance);
        if self.open.len() >= CONNECTIONS {
            self.open.remove(0);
        }
        self.open.push(connection);
        self.note();
    }

    /// A connection is closed.
    pub fn close(&mut self, server: MacId, instance: u16) {
        self.open.retain(|it| it.server != server || it.instance != instance);
        self.note();
    }

    /// A node restarted: none of its connections is left.
    pub fn restart(&mut self, node: MacId) {
        if self.open.iter().any(|it| it.server == node || it.client == node) {
            self.open.retain(|it| it.server != node && it.client != node);
            self.note();
        }
    }

    fn note(&mut self) {
        self.taken = [0; IDENTIFIERS / 64];
        for id in self.open.iter().flat_map(|it| [it.asks_on, it.answers_on]) {
            if let Some(word) = self.taken.get_mut(usize::from(id / 64)) {
                *word |= 1 << (id % 64);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn connection(instance: u16, asks_on: u16) -> Dynamic {
        let [client, server] = [0, 5].map(MacId::of);
        let format = BodyFormat::Word16Instance16;
        Dynamic { instance, client, server, asks_on, answers_on: asks_on + 1, format }
    }

    #[test]
    fn an_identifier_is_taken_over_until_the_connection_closes() {
        let mut dynamics = Dynamics::new();
        dynamics.open(connection(2, 0x42C));
        assert_eq!(dynamics.of(0x42C), Some((connection(2, 0x42C), false)));
        assert_eq!(dynamics.of(0x42D), Some((connection(2, 0x42C), true)));
        assert_eq!(dynamics.of(0x42B), None);
        dynamics.close(MacId::of(5), 3);
        assert!(dynamics.of(0x42C).is_some());
        dynamics.close(MacId::of(5), 2);
        assert_eq!(dynamics.of(0x42C), None);
    }

    #[test]
    fn many_connections_use_no_more_memory() {
        let mut dynamics = Dynamics::new();
        for instance in 0..1_000 {
            dynamics.open(connection(instance, instance * 2 % 0x7F0));
        }
        assert_eq!(dynamics.open.len(), CONNECTIONS);
        dynamics.restart(MacId::of(0));
        assert!(dynamics.open.is_empty() && dynamics.of(0x100).is_none());
    }
}
