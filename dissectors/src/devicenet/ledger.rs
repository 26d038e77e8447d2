//! Everything that is known of a bus, and how each frame is looked at.

use super::codes;
use super::connection::{Connection, Direction, Instance, Mark, State as Stands};
use super::dynamic::Dynamics;
use super::encoder::NodeState;
use super::flood::Flood;
use super::fragment::Assemblies;
use super::identifier::{MAC_IDS, MacId, Place, Port};
use super::layer::{Facts, kind};
use super::message::Part;
use super::node::Node;
use super::settings::Settings;
use super::timing::{Timing, Verdict};
use crate::can::{Frame, FrameKind, Identifier};
use crate::event::Moment;
use crate::finding::{Code, Finding, State};
use crate::uart::Wire;
use alloc::vec::Vec;

/// A frame that is being looked at.
#[derive(Clone, Copy)]
pub(super) struct Now<'a> {
    pub frame: &'a Frame,
    pub id: u16,
    pub data: &'a [u8],
    /// Its record's number and stamp.
    pub mark: Mark,
    pub bits: Option<u16>,
    /// It is sent over and over for want of an acknowledge.
    pub is_repeating: bool,
}

/// What is found wrong with the record that is being made.
#[derive(Default)]
pub(super) struct Judgement {
    pub findings: Vec<Finding>,
    pub withheld: Vec<&'static Code>,
}

impl Judgement {
    /// Adds a finding. A code stands once in a record.
    pub fn find(&mut self, finding: Finding) {
        if !self.findings.iter().any(|other| other.code == finding.code) {
            self.findings.push(finding);
        }
    }

    /// Adds what a limit calls for.
    pub fn judge(&mut self, verdict: Verdict, finding: Finding) {
        match verdict {
            Verdict::Kept => {}
            Verdict::Broken => self.find(finding),
            Verdict::Withheld if self.withheld.contains(&finding.code) => {}
            Verdict::Withheld => self.withheld.push(finding.code),
        }
    }

    /// A lasting condition that began then ends now.
    pub fn end(&mut self, code: &'static Code, since: Moment, now: Moment) {
        self.find(Finding::new(code).state(State::End(now.since(since))));
    }

    pub fn clear(&mut self) {
        self.findings.clear();
        self.withheld.clear();
    }
}

/// Everything that is known of a bus.
pub(super) struct Ledger {
    pub settings: Settings,
    pub timing: Timing,
    pub nodes: Vec<Node>,
    /// Nodes that anything may be waited for.
    pub watched: u64,
    /// Nothing that is waited for is due before this; unknown if nothing is waited for.
    pub next: Moment,
    pub assemblies: Assemblies,
    pub dynamics: Dynamics,
    pub flood: Flood,
    pub judgement: Judgement,
    /// Error frames so far.
    pub errors: u64,
    /// Nodes that restarted and whose encoders were not told yet.
    pub restarted: u64,
    /// The last strobe of each master, and who strobed last.
    pub strobes: [Option<Mark>; MAC_IDS],
    pub last_strober: Option<MacId>,
    /// Slaves that are strobed, as far as it was seen.
    pub strobed: u64,
    /// The master that allocated a multicast connection, and its last command.
    pub multicaster: Option<MacId>,
    pub multicast: Option<Mark>,
}

impl Ledger {
    pub fn new(wire: Wire, settings: Settings) -> Self {
        Ledger {
            settings,
            timing: Timing::new(wire),
            nodes: alloc::vec![Node::default(); MAC_IDS],
            watched: 0,
            next: Moment::UNKNOWN,
            assemblies: Assemblies::default(),
            dynamics: Dynamics::new(),
            flood: Flood::new(wire.baud()),
            judgement: Judgement::default(),
            errors: 0,
            restarted: 0,
            strobes: [None; MAC_IDS],
            last_strober: None,
            strobed: 0,
            multicaster: None,
            multicast: None,
        }
    }

    /// The rate of the bus is known from now on.
    pub fn learn_rate(&mut self, wire: Wire) {
        self.timing = Timing::new(wire);
        self.flood.learn_rate(wire.baud());
    }

    pub fn node(&mut self, mac: MacId) -> &mut Node {
        &mut self.nodes[mac.index()]
    }

    /// The owner of a slave, where its Allocate was seen.
    pub fn owner(&self, slave: MacId) -> Option<MacId> {
        self.nodes[slave.index()].owner
    }

    /// How often a slave's change-of-state connection produces at least, in ns, if known: never,
    /// where its rate is 0.
    pub fn production_rate(&self, slave: MacId) -> Option<i64> {
        let connection = &self.nodes[slave.index()].connections[Instance::Production.index()];
        connection.rate.map(|_| connection.rate_ns().unwrap_or(i64::MAX))
    }

    /// What the traffic so far tells of a node.
    pub fn node_state(&self, mac: MacId) -> NodeState {
        let node = &self.nodes[mac.index()];
        let is_used = |connection: &Connection| {
            let heard = connection.produced.last.or(connection.consumed.last);
            match connection.state {
                Stands::Unknown => heard.is_some(),
                Stands::Gone | Stands::TimedOut => false,
                _ => true,
            }
        };
        let has_timed_out = |connection: &Connection| connection.state == Stands::TimedOut;
        if node.connections.iter().any(has_timed_out) {
            NodeState::TimedOut
        } else if node.connections.iter().any(is_used) {
            NodeState::Connected
        } else if node.heard.is_known() || node.online.is_known() {
            NodeState::Unconnected
        } else {
            NodeState::Absent
        }
    }

    /// Something is waited for that is due then at the earliest.
    pub fn wait(&mut self, mac: Option<MacId>, due: Moment) {
        if let Some(mac) = mac {
            self.watched |= mac.bit();
        }
        if !self.next.is_known() || self.next.is_after(due) {
            self.next = due;
        }
    }

    /// Waits for the next message of a connection.
    pub fn wait_for(&mut self, slave: MacId, instance: Instance) {
        let settings = self.settings;
        for direction in [Direction::Produced, Direction::Consumed] {
            let connection = self.node(slave).connection(instance);
            if let Some((due, _)) = connection.deadline(direction, &settings) {
                self.wait(Some(slave), due);
            }
        }
    }

    /// Looks at a frame: what it is goes into the facts, what is wrong into the judgement.
    pub fn look(&mut self, now: &Now<'_>) -> Facts {
        let mut facts = Facts::new(kind::RESERVED);
        facts.place = Place::of(now.id);
        match self.dynamics.of(now.id) {
            Some((dynamic, from_server)) => self.dynamic(now, dynamic, from_server, &mut facts),
            None => self.port(now, Port::of(now.id), &mut facts),
        }
        let is_check = matches!(facts.kind, kind::DUP_MAC_REQUEST | kind::DUP_MAC_RESPONSE);
        if let Some(source) = facts.source.filter(|_| !is_check) {
            let errors = self.errors;
            let node = self.node(source);
            (node.heard, node.errors_before) = (now.mark.start, errors);
        }
        if facts.defect.is_some() {
            self.judgement.find(Finding::new(&codes::MALFORMED));
        }
        facts
    }

    fn port(&mut self, now: &Now<'_>, port: Port, facts: &mut Facts) {
        match port {
            Port::PollCommand(slave) => self.poll_command(now, slave, facts),
            Port::PollResponse(slave) => self.poll_response(now, slave, facts),
            Port::Production(slave) => self.production(now, slave, facts),
            Port::Acknowledge(slave) => self.io_acknowledge(now, slave, facts),
            Port::StrobeCommand(master) => self.strobe_command(now, master, facts),
            Port::StrobeResponse(slave) => self.strobe_response(now, slave, facts),
            Port::MulticastCommand(group) => self.multicast_command(now, group, facts),
            Port::MulticastResponse(slave) => self.multicast_response(now, slave, facts),
            Port::ExplicitResponse(_)
            | Port::ExplicitRequest(_)
            | Port::UnconnectedRequest(_)
            | Port::UcmmResponse(_)
            | Port::UcmmRequest(_) => self.explicit(now, port, facts),
            Port::DuplicateMac(node) => self.duplicate_check(now, node, facts),
            Port::CommFaultResponse => self.comm_fault_response(now, facts),
            Port::CommFaultRequest => self.comm_fault_request(now, facts),
            Port::OwnershipResponse | Port::OwnershipRequest => self.ownership(now, port, facts),
            Port::Free(source) => self.unknown_io(now, source, facts),
            Port::Reserved => self.judgement.find(Finding::new(&codes::RESERVED_ID)),
        }
    }

    /// What a frame is by its identifier alone, where its data must not be believed.
    pub fn glance(&mut self, frame: &Frame) -> Facts {
        let Identifier::Standard(id) = frame.id else { return Facts::new(kind::FOREIGN) };
        let mut facts = Facts::new(match (self.dynamics.of(id), Port::of(id)) {
            (Some((_, true)), _) => kind::EXPLICIT_RESPONSE,
            (Some((_, false)), _) => kind::EXPLICIT_REQUEST,
            (None, port) => kind_of(port),
        });
        facts.place = Place::of(id);
        facts
    }

    /// A connection is in use no more, or begins anew: what lasted on it ends.
    pub fn end_states(&mut self, slave: MacId, instance: Instance, now: Moment) {
        let connection = self.nodes[slave.index()].connection(instance);
        let judgement = &mut self.judgement;
        if connection.state == Stands::TimedOut {
            judgement.end(&codes::CONNECTION_TIMEOUT, connection.since, now);
        }
        for flow in [&mut connection.produced, &mut connection.consumed] {
            if let Some((_, since)) = flow.wrong.take() {
                judgement.end(&codes::SIZE_MISMATCH, since, now);
            }
            if let Some(since) = flow.idle.take() {
                judgement.end(&codes::IDLE, since, now);
            }
        }
    }

    /// The message in a frame that the capture has cut may have been any: it is a gap in what its
    /// server was asked and said.
    pub fn lose_message(&mut self, id: u16, facts: &Facts) {
        let server = match (self.dynamics.of(id), Port::of(id)) {
            (Some((dynamic, _)), _) => Some(dynamic.server),
            (
                None,
                Port::ExplicitResponse(server)
                | Port::ExplicitRequest(server)
                | Port::UnconnectedRequest(server)
                | Port::UcmmResponse(server),
            ) => Some(server),
            _ => None,
        };
        self.assemblies.miss(id, server);
        let is_acknowledge = facts.fragment.is_some_and(|it| it.part == Part::Acknowledge);
        if let Some(server) = server.filter(|_| !is_acknowledge) {
            self.node(server).lose_messages();
        }
    }

    /// What was lost may have been anything: nothing that spans the gap is judged.
    pub fn lose(&mut self) {
        self.nodes.iter_mut().for_each(Node::lose);
        self.assemblies.lose();
        self.flood.lose();
        (self.strobes, self.multicast) = ([None; MAC_IDS], None);
        self.next = Moment::UNKNOWN;
    }
}

/// The kind of frames on a port, where nothing else is known.
pub(super) const fn kind_of(port: Port) -> &'static str {
    match port {
        Port::MulticastResponse(_) => kind::MULTICAST_POLL_RESPONSE,
        Port::Production(_) => kind::COS,
        Port::StrobeResponse(_) => kind::STROBE_RESPONSE,
        Port::PollResponse(_) => kind::POLL_RESPONSE,
        Port::StrobeCommand(_) => kind::STROBE_COMMAND,
        Port::Acknowledge(_) => kind::IO_ACK,
        Port::ExplicitResponse(_) => kind::EXPLICIT_RESPONSE,
        Port::ExplicitRequest(_) => kind::EXPLICIT_REQUEST,
        Port::PollCommand(_) => kind::POLL_COMMAND,
        Port::UnconnectedRequest(_) => kind::UNCONNECTED_REQUEST,
        Port::DuplicateMac(_) => kind::DUP_MAC_REQUEST,
        Port::UcmmResponse(_) => kind::UCMM_RESPONSE,
        Port::UcmmRequest(_) => kind::UCMM_REQUEST,
        Port::CommFaultResponse => kind::COMM_FAULT_RESPONSE,
        Port::CommFaultRequest => kind::COMM_FAULT_REQUEST,
        Port::OwnershipResponse => kind::OWNERSHIP_RESPONSE,
        Port::OwnershipRequest => kind::OWNERSHIP_REQUEST,
        // Before multicast polls there were others on this identifier: devices of the
        // specification's release 2.0 reserve it.
        Port::MulticastCommand(_) | Port::Free(_) => kind::IO,
        Port::Reserved => kind::RESERVED,
    }
}

/// Whether a frame is one that DeviceNet does not have: 29 bits, remote, CAN FD.
pub(super) const fn is_foreign(frame: &Frame) -> bool {
    frame.id.is_extended() || matches!(frame.kind, FrameKind::Remote | FrameKind::Fd)
}
