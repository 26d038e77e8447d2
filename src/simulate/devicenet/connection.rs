//! The connections of a slave (class 5), as the predefined set has them.

use super::frame::id;
use super::object::{Answer, status};
use crate::simulate::time::{MS, Ps, S};

/// To what a device rounds packet rates up, in ms.
const TICK: u16 = 10;
/// A connection times out after this many packet rates.
const MULTIPLIER: Ps = 4;
/// Before the first message it has this long at least.
const FIRST: Ps = 10 * S;

/// Where a connection is in its life (attribute 1).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum State {
    /// Nobody allocated it.
    Nonexistent = 0,
    /// Its packet rate is not set.
    Configuring = 1,
    /// It works.
    Established = 3,
    /// Nothing came for too long.
    TimedOut = 4,
}

/// A connection.
#[derive(Clone, Debug)]
pub struct Connection {
    instance: u8,
    slave: u8,
    master: u8,
    /// Where it is in its life.
    pub state: State,
    /// Expected packet rate, in ms.
    pub rate: u16,
    /// Production inhibit time, in ms.
    pub inhibit: u16,
    watchdog: u8,
    /// The assembly that it produces.
    pub assembly: u8,
    /// Whether its productions are acknowledged.
    pub is_acknowledged: bool,
    /// When it times out.
    pub deadline: Ps,
}

impl Connection {
    /// One that nobody allocated.
    pub fn new(instance: u8, slave: u8, assembly: u8) -> Self {
        Connection {
            instance,
            slave,
            master: 0,
            state: State::Nonexistent,
            rate: 0,
            inhibit: 0,
            watchdog: 0,
            assembly,
            is_acknowledged: true,
            deadline: Ps::MAX,
        }
    }

    /// A master allocates it.
    pub fn allocate(&mut self, master: u8, is_acknowledged: bool, now: Ps) {
        *self = Connection {
            master,
            is_acknowledged,
            ..Connection::new(self.instance, self.slave, self.assembly)
        };
        if self.instance == 1 {
            (self.rate, self.watchdog, self.state) = (2_500, 1, State::Established);
            self.start(now);
        } else {
            self.state = State::Configuring;
        }
    }

    /// It is released.
    pub fn release(&mut self) {
        (self.state, self.deadline) = (State::Nonexistent, Ps::MAX);
    }

    /// Whether it works.
    pub fn is_established(&self) -> bool {
        self.state == State::Established
    }

    /// Whether messages come on it: none do where acknowledges are suppressed.
    fn hears(&self) -> bool {
        self.instance != 4 || self.is_acknowledged
    }

    fn start(&mut self, now: Ps) {
        let patience = MULTIPLIER * Ps::from(self.rate) * MS;
        let is_watched = self.rate > 0 && self.hears();
        self.deadline = if is_watched { now + patience.max(FIRST) } else { Ps::MAX };
    }

    /// A message came.
    pub fn hear(&mut self, now: Ps) {
        if self.rate > 0 && self.is_established() && self.hears() {
            self.deadline = now + MULTIPLIER * Ps::from(self.rate) * MS;
        }
    }

    /// Whether it timed out now. An explicit connection waits for the next message then
    /// (time-out action deferred delete, which the scanner sets).
    pub fn time_out(&mut self, now: Ps) -> bool {
        let is_over = now >= self.deadline;
        if is_over {
            self.deadline = Ps::MAX;
            if self.instance != 1 {
                self.state = State::TimedOut;
            }
        }
        is_over && self.instance != 1
    }

    fn produced_size(&self) -> u16 {
        match self.instance {
            1 => 64,
            _ => 3 + u16::from(self.assembly),
        }
    }

    /// Identifiers, size and the like.
    ///
    /// # Errors
    /// The general status code.
    pub fn get(&self, attribute: u8) -> Answer {
        if self.state == State::Nonexistent {
            return Err(status::OBJECT);
        }
        let (produced, consumed, transport) = match self.instance {
            1 => (id::response(self.slave), id::request(self.slave), 0x83),
            2 => (id::poll_response(self.slave), id::poll_command(self.slave), 0x82),
            3 => (id::strobe_response(self.slave), id::strobe_command(self.master), 0x83),
            _ => (id::production(self.slave), id::acknowledge(self.slave), 0x12),
        };
        let consumed_size: u16 = match self.instance {
            1 => 64,
            3 => 8,
            _ => 0,
        };
        let word = |value: u16| Ok(value.to_le_bytes().to_vec());
        match attribute {
            1 => Ok(vec![self.state as u8]),
            2 => Ok(vec![u8::from(self.instance != 1)]),
            3 => Ok(vec![transport]),
            4 => word(produced),
            5 => word(consumed),
            6 => Ok(vec![if self.instance == 1 { 0x21 } else { 0x01 }]),
            7 => word(self.produced_size()),
            8 => word(consumed_size),
            9 => word(self.rate),
            12 => Ok(vec![self.watchdog]),
            13 => word(if self.instance == 1 { 0 } else { 4 }),
            14 if self.instance == 1 => Ok(Vec::new()),
            14 => Ok(vec![0x20, 0x04, 0x24, self.assembly]),
            15 => word(0),
            16 => Ok(Vec::new()),
            17 => word(self.inhibit),
            _ => Err(status::ATTRIBUTE),
        }
    }

    /// Packet rate, inhibit time, time-out action and produced path can be set. The packet rate is
    /// rounded up, and the answer tells to what.
    ///
    /// # Errors
    /// The general status code.
    pub fn set(&mut self, attribute: u8, value: &[u8], now: Ps) -> Answer {
        if self.state == State::Nonexistent {
            return Err(status::OBJECT);
        }
        match (attribute, value) {
            (9, [low, high]) => {
                let wanted = u16::from_le_bytes([*low, *high]);
                self.rate = wanted.checked_next_multiple_of(TICK).unwrap_or(wanted);
                self.state = State::Established;
                self.start(now);
                return Ok(self.rate.to_le_bytes().to_vec());
            }
            (12, [action @ 0..=3]) => self.watchdog = *action,
            // Stored at once, without Save (manual §6).
            (14, [0x20, 0x04, 0x24, assembly @ 1..=2]) if self.instance != 1 => {
                self.assembly = *assembly;
            }
            (17, [low, high]) => self.inhibit = u16::from_le_bytes([*low, *high]),
            (9 | 12 | 14 | 17, _) => return Err(status::VALUE),
            _ if self.get(attribute).is_ok() => return Err(status::NOT_SETTABLE),
            _ => return Err(status::ATTRIBUTE),
        }
        Ok(Vec::new())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_io_connection_works_when_its_packet_rate_is_set() {
        let mut poll = Connection::new(2, 23, 1);
        assert_eq!(poll.get(9), Err(status::OBJECT));
        poll.allocate(0, true, 0);
        assert!(!poll.is_established());
        // 75 ms become 80.
        assert_eq!(poll.set(9, &[75, 0], 0), Ok(vec![80, 0]));
        assert!(poll.is_established());
        // 10 s for the first message, then 4 · 80 ms.
        assert_eq!(poll.deadline, 10 * S);
        poll.hear(S);
        assert_eq!(poll.deadline, S + 320 * MS);
        assert!(!poll.time_out(S + 319 * MS) && poll.time_out(S + 320 * MS));
        assert_eq!(poll.get(1), Ok(vec![4]));
    }

    #[test]
    fn the_produced_path_chooses_the_assembly() {
        let mut poll = Connection::new(2, 23, 1);
        poll.allocate(0, true, 0);
        assert_eq!(poll.get(7), Ok(vec![4, 0]));
        assert_eq!(poll.set(14, &[0x20, 0x04, 0x24, 0x02], 0), Ok(vec![]));
        assert_eq!((poll.get(7), poll.get(8)), (Ok(vec![5, 0]), Ok(vec![0, 0])));
        assert_eq!(poll.set(14, &[0x20, 0x04, 0x24, 0x03], 0), Err(status::VALUE));
        assert_eq!(poll.set(7, &[8, 0], 0), Err(status::NOT_SETTABLE));
    }

    #[test]
    fn an_explicit_connection_works_at_once() {
        let mut explicit = Connection::new(1, 23, 1);
        explicit.allocate(0, true, 0);
        assert!(explicit.is_established());
        assert_eq!(explicit.get(9), Ok(vec![0xC4, 0x09]));
        assert_eq!(explicit.get(5), Ok(0x4BC_u16.to_le_bytes().to_vec()));
    }
}
