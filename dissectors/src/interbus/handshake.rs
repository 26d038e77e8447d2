//! The handshake of the service bits (LA-66 manual §4), as far as rows show it.
//!
//! ```text
//! OUT  0  0  1  1  1  0  0        31: the master asks, sees the acknowledgement, withdraws
//! IN   0  0  0  0  1  1  0        31: the device acknowledges, sees that, is back
//!      N  P  R  R  A  L  N        normal, prepared, request, acknowledge, release
//! ```
//!
//! A log may be coarser than the bus: then rows skip states, or whole handshakes, and a step that
//! no bus may make proves nothing. How fine a log is, it shows itself.

use super::layer::kind;
use super::word::Word;

/// Where a handshake stands in one row.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum State {
    /// IN tells the position.
    Normal,
    /// The same, and the master has laid out a service.
    Prepared,
    /// The master asks; IN still tells the position.
    Request,
    /// The device has done it.
    Acknowledge,
    /// The master has withdrawn the request, and the device is not back yet.
    Release,
}

impl State {
    /// The state that the words of a row show, be one of them unknown.
    #[must_use]
    pub fn of(out: Option<Word>, input: Option<Word>, is_prepared: bool) -> Self {
        match (out.map(Word::has_service_bit), input.map(Word::has_service_bit)) {
            (Some(true) | None, Some(true)) => State::Acknowledge,
            (Some(true), _) => State::Request,
            (Some(false), Some(true)) => State::Release,
            _ if is_prepared => State::Prepared,
            _ => State::Normal,
        }
    }

    /// The kind of its record.
    #[must_use]
    pub const fn kind(self) -> &'static str {
        match self {
            State::Normal => kind::NORMAL,
            State::Prepared => kind::PREPARED,
            State::Request => kind::SERVICE_REQUEST,
            State::Acknowledge => kind::SERVICE_ACKNOWLEDGE,
            State::Release => kind::RELEASE,
        }
    }

    /// Whether no service is going on.
    #[must_use]
    pub const fn is_at_rest(self) -> bool {
        matches!(self, State::Normal | State::Prepared)
    }

    /// Its place in the order of a handshake.
    const fn place(self) -> u8 {
        match self {
            State::Normal | State::Prepared => 0,
            State::Request => 1,
            State::Acknowledge => 2,
            State::Release => 3,
        }
    }
}

/// Rows that are no further apart than this, in ns, cannot skip a handshake: it takes four bus
/// cycles, and a cycle of one device (260 µs at 500 kbit/s) with the master's 0.2 ms or more takes
/// a quarter of this at least.
const FINE_NS: i64 = 1_000_000;

/// Steps of handshakes that a log must show before it is called fine.
const SHOWN: u32 = 6;

/// A fine log has so many steps in order for one that is not.
const IN_ORDER: u32 = 8;

/// How fine a log is: whether its rows show handshakes state by state.
#[derive(Clone, Copy, Default, Debug)]
pub struct Grain {
    in_order: u32,
    skipping: u32,
    /// Steps that a controller's own log and one that is a little too coarse both show.
    blurred: u32,
}

impl Grain {
    /// Takes the step from one row to the next.
    pub fn add(&mut self, from: State, to: State) {
        if from.place() == to.place() {
            return;
        }
        match (from, to) {
            // A controller that logs what it has just decided shows both bits change in one row.
            (State::Request, State::Release) | (State::Release, State::Request) => {
                self.blurred += 1;
            }
            _ if (from.place() + 1) % 4 == to.place() => self.in_order += 1,
            _ => self.skipping += 1,
        }
        if self.in_order.max(self.skipping).max(self.blurred) == u32::MAX >> 8 {
            self.in_order /= 2;
            self.skipping /= 2;
            self.blurred /= 2;
        }
    }

    /// Whether two rows so many ns apart have no handshake between them that they do not show.
    #[must_use]
    pub const fn is_fine(&self, apart: Option<i64>) -> bool {
        let is_close = matches!(apart, Some(0..=FINE_NS));
        let unclear = self.skipping + self.blurred;
        is_close || (self.in_order >= SHOWN && self.in_order >= unclear * IN_ORDER)
    }

    /// Whether it has ever shown a step that skips a state.
    #[must_use]
    pub const fn has_skipped(&self) -> bool {
        self.skipping > 0
    }

    /// Steps in order, and steps that may have skipped a state.
    #[must_use]
    pub const fn steps(&self) -> (u32, u32) {
        (self.in_order, self.skipping + self.blurred)
    }

    /// Whether there is enough to tell how fine the log is.
    #[must_use]
    pub const fn is_decided(&self) -> bool {
        self.in_order + self.skipping + self.blurred >= SHOWN
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_of_the_service_bits() {
        let word = |bit: bool| Some(Word::new(u32::from(bit) << 31));
        let state = |out, input| State::of(word(out), word(input), false);
        assert_eq!(state(false, false), State::Normal);
        assert_eq!(state(true, false), State::Request);
        assert_eq!(state(true, true), State::Acknowledge);
        assert_eq!(state(false, true), State::Release);
        assert_eq!(State::of(word(false), word(false), true), State::Prepared);
        // One side alone.
        assert_eq!(State::of(None, word(false), false), State::Normal);
        assert_eq!(State::of(word(true), None, false), State::Request);
    }

    #[test]
    fn a_log_is_fine_once_it_has_shown_handshakes_whole() {
        use State::{Acknowledge, Normal, Release, Request};
        let after = |steps: &[State], times| {
            let mut grain = Grain::default();
            for _ in 0..times {
                steps.windows(2).for_each(|two| grain.add(two[0], two[1]));
            }
            grain
        };
        let whole = [Normal, Request, Acknowledge, Release, Normal];
        assert!(!after(&whole, 1).is_fine(None) && after(&whole, 2).is_fine(None));
        // Every handshake in a single row: two steps, one of them in order.
        assert!(!after(&[Normal, Request, Normal], 50).is_fine(None));
        assert!(!after(&whole, 0).is_fine(Some(50_000_000)));
        assert!(after(&whole, 0).is_fine(Some(1_000_000)));
    }
}
