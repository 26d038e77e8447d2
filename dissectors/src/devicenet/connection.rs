//! The five connections of the predefined master/slave set, as far as the traffic tells of them.
//!
//! DeviceNet specification (CIP Vol. 3), chapter 5; CIP Vol. 1, chapter 3 (connection object).

use super::settings::Settings;
use crate::event::Moment;

/// Watchdog action of an explicit connection that waits for the I/O connections to go (attribute
/// 12): deferred delete.
const DEFERRED: u8 = 3;

/// Connections of the predefined set.
pub(super) const CONNECTIONS: usize = 5;

/// Which of them: instance 1 to 5 of class 5.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Instance {
    Explicit,
    Poll,
    Strobe,
    /// Change of state, or cyclic.
    Production,
    Multicast,
}

impl Instance {
    pub const ALL: [Instance; CONNECTIONS] = [
        Instance::Explicit,
        Instance::Poll,
        Instance::Strobe,
        Instance::Production,
        Instance::Multicast,
    ];

    /// The instance with that number.
    pub fn of(number: u16) -> Option<Self> {
        Self::ALL.get(usize::from(number).checked_sub(1)?).copied()
    }

    pub const fn index(self) -> usize {
        self as usize
    }
}

/// Where a connection stands.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub(super) enum State {
    /// Nothing was seen that tells.
    #[default]
    Unknown,
    /// Allocated; I/O waits for its expected packet rate.
    Configuring,
    /// In use.
    Established,
    /// Nothing came for too long.
    TimedOut,
    /// Released, or its node restarted.
    Gone,
}

/// From where to where data flows.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Direction {
    /// The slave produces it.
    Produced,
    /// The slave consumes it.
    Consumed,
}

/// A message of a connection, for what comes later to refer to.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub(super) struct Mark {
    /// Number of its record.
    pub n: u64,
    pub start: Moment,
    /// ± of `start` in ns.
    pub uncertainty: u32,
}

/// The data of one direction.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct Flow {
    /// Connection size in bytes, once it was read.
    pub size: Option<u16>,
    /// The assembly that it carries, once its path was read or written.
    pub assembly: Option<u16>,
    /// The last message, unless something was lost since.
    pub last: Option<Mark>,
    /// Whether any message carried data.
    pub has_data: bool,
    /// Since when messages are empty.
    pub idle: Option<Moment>,
    /// The wrong size that messages have, and since when.
    pub wrong: Option<(usize, Moment)>,
    pub habit: Habit,
}

/// Whether messages are fragmented, where no size tells.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct Habit {
    /// A frame that may be a first fragment.
    pub candidate: Option<(u64, [u8; 8])>,
    /// Complete messages that were put together so.
    pub messages: u8,
}

/// One connection.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct Connection {
    pub state: State,
    /// Since when it is established, or timed out.
    pub since: Moment,
    /// Expected packet rate in ms as the slave told; 0: none.
    pub rate: Option<u16>,
    /// Time-out multiplier (attribute 18): 4 x 2^n.
    pub multiplier: u8,
    /// Production inhibit time in ms.
    pub inhibit: Option<u16>,
    /// What the slave does when it times out (attribute 12).
    pub watchdog: Option<u8>,
    /// The slave is not to answer (transport class 0).
    pub is_mute: bool,
    pub produced: Flow,
    pub consumed: Flow,
}

impl Connection {
    pub const fn flow(&mut self, direction: Direction) -> &mut Flow {
        match direction {
            Direction::Produced => &mut self.produced,
            Direction::Consumed => &mut self.consumed,
        }
    }

    /// How long nothing may come, in ns; `None` where there is no limit.
    pub fn limit(&self) -> Option<i64> {
        let rate = i64::from(self.rate.filter(|rate| *rate > 0)?);
        Some(rate * 1_000_000 * (4 << self.multiplier.min(7)))
    }

    /// Expected packet rate in ns, if there is one.
    pub fn rate_ns(&self) -> Option<i64> {
        self.rate.filter(|rate| *rate > 0).map(|rate| i64::from(rate) * 1_000_000)
    }

    /// When it times out for want of messages in that direction: the limit, counted from the last
    /// message; before the first message at least ten seconds are allowed (CIP Vol. 1, chapter 3:
    /// inactivity/watchdog timer).
    pub fn deadline(&self, direction: Direction, settings: &Settings) -> Option<(Moment, u32)> {
        if self.state != State::Established {
            return None;
        }
        let limit = self.limit()?;
        let flow = match direction {
            Direction::Produced => &self.produced,
            Direction::Consumed => &self.consumed,
        };
        let (from, limit, uncertainty) = match flow.last {
            Some(mark) => (mark.start, limit, mark.uncertainty),
            None => (self.since, limit.max(settings.first_timeout_ns), 0),
        };
        from.is_known().then(|| (from.plus(limit), uncertainty))
    }

    /// A new allocation: nothing of the old one holds.
    pub fn allocate(&mut self, state: State, now: Moment) {
        let rate = if state == State::Established { Some(2_500) } else { Some(0) };
        *self = Connection { state, rate, since: now, inhibit: Some(0), ..Connection::default() };
    }

    /// Whether it goes when it times out, or waits for the I/O connections to go.
    pub fn is_deferred(&self) -> bool {
        self.watchdog == Some(DEFERRED)
    }

    /// Nothing came for too long: it stands so from now on.
    pub const fn time_out(&mut self, state: State, now: Moment) {
        (self.state, self.since) = (state, now);
    }

    /// It is in use from now on.
    pub fn establish(&mut self, now: Moment) {
        (self.state, self.since) = (State::Established, now);
        (self.produced.last, self.consumed.last) = (None, None);
    }

    /// What was lost may have been anything.
    pub fn lose(&mut self) {
        self.since = Moment::UNKNOWN;
        for flow in [&mut self.produced, &mut self.consumed] {
            (flow.last, flow.habit.candidate) = (None, None);
        }
    }

    /// Whether it may be judged for size, pace and answers.
    pub const fn is_judged(&self) -> bool {
        !matches!(self.state, State::TimedOut | State::Gone)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_is_four_times_the_rate() {
        // CIP Vol. 1: 4 x EPR, multiplier codes 0 to 7 stand for 4 to 512.
        let mut connection = Connection { rate: Some(75), ..Connection::default() };
        assert_eq!(connection.limit(), Some(300_000_000));
        connection.multiplier = 1;
        assert_eq!(connection.limit(), Some(600_000_000));
        connection.rate = Some(0);
        assert_eq!(connection.limit(), None);
    }

    #[test]
    fn the_first_message_has_ten_seconds() {
        let settings = Settings::default();
        let mut connection = Connection { rate: Some(75), ..Connection::default() };
        connection.establish(Moment::from_ns(0));
        let due = |connection: &Connection| {
            let (due, _) = connection.deadline(Direction::Consumed, &settings)?;
            due.ns()
        };
        assert_eq!(due(&connection), Some(10_000_000_000));
        let start = Moment::from_ns(1_000_000_000);
        connection.consumed.last = Some(Mark { n: 1, start, uncertainty: 0 });
        assert_eq!(due(&connection), Some(1_300_000_000));
        connection.lose();
        assert_eq!(due(&connection), None);
    }
}
