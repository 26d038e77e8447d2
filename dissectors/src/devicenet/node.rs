//! What is known of one node.

use super::allocation::Choice;
use super::connection::{CONNECTIONS, Connection, Instance, Mark, State};
use super::identifier::MacId;
use super::message::{BodyFormat, Identity};
use super::pace::Pace;
use super::transactions::Transactions;
use crate::event::Moment;

/// A duplicate MAC ID check that is under way.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub(super) struct Check {
    /// The first request.
    pub first: Mark,
    /// The last request of it: they follow each other.
    pub last: Moment,
    /// The node was heard shortly before.
    pub is_restart: bool,
    /// Error frames since the node was heard.
    pub errors: u64,
    /// Its outcome was told, or nothing is to be told.
    pub is_told: bool,
    /// Its time is over.
    pub is_over: bool,
    /// Nobody else is there: its requests are not acknowledged.
    pub is_alone: bool,
}

/// A change-of-state or cyclic message that waits for its acknowledgement.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Production {
    pub mark: Mark,
    /// The first of the messages in a row that were not acknowledged: this one, or one before.
    pub since: Mark,
    pub length: u8,
    pub data: [u8; 8],
    pub is_acknowledged: bool,
    /// It was told that the acknowledgement is missing.
    pub is_told: bool,
}

/// A command that waits for its answer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Command {
    pub mark: Mark,
    /// Its bits on the wire; 0 if not known.
    pub bits: u16,
    /// When its answer began.
    pub answered: Option<Moment>,
    /// Another answer came after that: it and what follows answers nothing.
    pub is_over: bool,
}

/// Requests that were not answered in a row.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct Silence {
    pub count: u32,
    /// Since when it is told as a lasting condition.
    pub since: Option<Moment>,
}

/// One node of the bus.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct Node {
    /// Vendor and serial number, once they were told.
    pub identity: Option<Identity>,
    /// When it told them, the last time that it came.
    pub identified: Moment,
    /// Vendor and serial number as its Identity object told them, one after the other.
    pub told: (Option<u16>, Option<u32>),
    /// When it last sent anything but a duplicate MAC ID check; unknown if never.
    pub heard: Moment,
    /// Error frames on the bus when it last sent anything.
    pub errors_before: u64,
    /// When it last finished a check; unknown if never.
    pub online: Moment,
    pub check: Option<Check>,
    /// The body format of its explicit connection, once it was told.
    pub format: Option<BodyFormat>,
    /// The body format that a request's length gave away.
    pub guess: Option<BodyFormat>,
    pub owner: Option<MacId>,
    /// The connections that are allocated, as far as it was seen or the traffic shows.
    pub choice: Choice,
    /// The connections that an Allocate or Release was seen of.
    pub seen: Choice,
    pub connections: [Connection; CONNECTIONS],
    /// The clients whose requests or answers were seen, by XID.
    pub heard_clients: [u64; 2],
    pub transactions: Transactions,
    pub silence: Silence,
    /// Since when its heartbeat tells of a fault.
    pub fault: Option<Moment>,
    /// Its acknowledge timer (class 2Bh attribute 1), in ms.
    pub acknowledge_timer: Option<u16>,
    /// The last change-of-state or cyclic message of its own, and of its master.
    pub production: Option<Production>,
    pub master_production: Option<Production>,
    /// The last poll and strobe command.
    pub poll: Option<Command>,
    pub strobe: Option<Command>,
    pub pace: Pace,
    /// It has answered a poll, a strobe since it was allocated.
    pub answers_polls: bool,
    pub answers_strobes: bool,
}

impl Node {
    pub const fn connection(&mut self, instance: Instance) -> &mut Connection {
        &mut self.connections[instance.index()]
    }

    /// The last change-of-state or cyclic message: its own, or its master's, which travels on the
    /// poll connection.
    pub const fn last_production(&mut self, instance: Instance) -> &mut Option<Production> {
        match instance {
            Instance::Poll => &mut self.master_production,
            _ => &mut self.production,
        }
    }

    /// Whether these connections are allocated, as far as it was seen.
    pub fn has(&self, choice: Choice) -> bool {
        self.choice.has(choice)
    }

    /// Whether 405h is a poll: what is not known otherwise is taken for one.
    pub fn is_polled(&self) -> bool {
        self.has(Choice::POLL) || !self.has(Choice::PRODUCING)
    }

    /// Whether an Allocate or Release of the connection was seen.
    pub fn has_seen(&self, instance: Instance) -> bool {
        self.seen.has(choice_of(instance))
    }

    /// Takes note of what an Allocate was granted or a Release gave back. Whoever allocates
    /// explicit messages together with I/O begins from nothing; all others add to what there is.
    pub fn see(&mut self, choice: Choice, is_allocated: bool) {
        let io = choice.without(Choice::EXPLICIT.and(Choice::NO_ACKNOWLEDGE));
        let is_fresh = is_allocated && choice.has(Choice::EXPLICIT) && io != Choice::default();
        let both = choice.has(Choice::PRODUCING).then_some(Choice::PRODUCING);
        let seen = if is_fresh { Choice::ALL } else { choice.and(both.unwrap_or_default()) };
        // Polls that were heard before go on, though who allocated them was not seen.
        let was_polled = self.is_polled() && (self.poll.is_some() || self.answers_polls);
        self.seen = self.seen.and(seen);
        if was_polled && !self.seen.has(Choice::POLL) {
            self.choice = self.choice.and(Choice::POLL);
        }
    }

    /// Whether any request or answer of a client's transactions was heard.
    pub const fn knows_client(&self, client: MacId, xid: bool) -> bool {
        self.heard_clients[xid as usize] & client.bit() != 0
    }

    /// Whether this request or answer is the first that is heard of a client's transactions.
    pub fn hear_client(&mut self, client: MacId, xid: bool) -> bool {
        let is_first = !self.knows_client(client, xid);
        self.heard_clients[usize::from(xid)] |= client.bit();
        is_first
    }

    /// Takes what its Identity object told. A duplicate MAC ID check says the same numbers, and is
    /// believed first.
    pub fn tell_identity(&mut self, vendor: Option<u16>, serial: Option<u32>, now: Moment) {
        self.told = (vendor.or(self.told.0), serial.or(self.told.1));
        if let (None, (Some(vendor), Some(serial))) = (self.identity, self.told) {
            (self.identity, self.identified) = (Some(Identity { vendor, serial }), now);
        }
    }

    /// Its connections are as after power-on.
    pub fn restart(&mut self) {
        (self.format, self.guess, self.owner) = (None, None, None);
        (self.choice, self.seen) = (Choice::default(), Choice::ALL);
        for connection in &mut self.connections {
            *connection = Connection { state: State::Gone, ..Connection::default() };
        }
        (self.production, self.master_production) = (None, None);
        (self.poll, self.strobe) = (None, None);
        (self.answers_polls, self.answers_strobes) = (false, false);
        self.transactions = Transactions::default();
    }

    /// These connections, if they were gone, may have been allocated anew.
    pub fn doubt(&mut self, choice: Choice) {
        for instance in Instance::ALL {
            let is_gone = self.connection(instance).state == State::Gone;
            if is_gone && choice.has(choice_of(instance)) {
                *self.connection(instance) = Connection::default();
                self.seen = self.seen.without(choice_of(instance));
            }
        }
    }

    /// What was lost may have been anything.
    pub fn lose(&mut self) {
        self.doubt(Choice::ALL);
        self.connections.iter_mut().for_each(Connection::lose);
        (self.production, self.master_production) = (None, None);
        (self.poll, self.strobe, self.check) = (None, None, None);
        self.lose_messages();
    }

    /// What it was asked and said may have been anything.
    pub fn lose_messages(&mut self) {
        self.heard_clients = [0; 2];
        self.transactions = Transactions::default();
    }
}

/// The bits of an allocation choice that stand for a connection.
const fn choice_of(instance: Instance) -> Choice {
    match instance {
        Instance::Explicit => Choice::EXPLICIT,
        Instance::Poll => Choice::POLL,
        Instance::Production => Choice::PRODUCING,
        Instance::Strobe => Choice::STROBE,
        Instance::Multicast => Choice::MULTICAST,
    }
}
