//! What is remembered of one encoder.

use super::codes;
use super::judge::Verdict;
use crate::event::Moment;
use crate::finding::{Finding, State};
use crate::motion::Motion;
use crate::station::{MAX_POSITION_BITS, Resolution};

/// Answers that the search for two encoders with one address looks back on.
const RECENT_ANSWERS: u32 = 10;

/// How many of them must be torn.
const TORN_ANSWERS: u32 = 5;

/// Requests without an answer in a row that make silence a state.
const SILENT_IN_A_ROW: u32 = 3;

/// One address of the bus.
#[derive(Clone, Debug)]
pub(super) struct Station {
    /// Whether it ever answered.
    pub is_heard: bool,
    /// Whether it was told that it never did.
    pub is_told_unheard: bool,
    /// Requests in a row that it did not answer.
    pub silent: u32,
    /// End of the first of them.
    pub silent_since: Moment,
    /// End of its last request.
    pub asked: Moment,
    /// How often it ended one answer twice.
    pub double_footers: u32,
    /// Its positions.
    pub motion: Motion,
    /// Its last answers, the newest in bit 0: set if two or more characters were damaged.
    torn: u16,
    answers: u32,
    is_told_torn: bool,
}

impl Station {
    pub fn new(resolution: Option<Resolution>) -> Self {
        Station {
            is_heard: false,
            is_told_unheard: false,
            silent: 0,
            silent_since: Moment::UNKNOWN,
            asked: Moment::UNKNOWN,
            double_footers: 0,
            motion: Motion::new(MAX_POSITION_BITS.into(), resolution.map(Resolution::positions)),
            torn: 0,
            answers: 0,
            is_told_torn: false,
        }
    }

    /// Remembers whether an answer had two or more damaged characters.
    pub fn remember_damage(&mut self, is_torn: bool) {
        self.torn = (self.torn << 1 | u16::from(is_torn)) & ((1 << RECENT_ANSWERS) - 1);
        self.answers = (self.answers + 1).min(RECENT_ANSWERS);
        if self.torn.count_ones() < TORN_ANSWERS {
            self.is_told_torn = false;
        }
    }

    /// Whether any of its last answers was torn.
    pub const fn has_torn_answers(&self) -> bool {
        self.torn != 0
    }

    /// Torn answers and answers, when there are first so many that two encoders must be there.
    pub fn begins_to_look_doubled(&mut self) -> Option<(u32, u32)> {
        let torn = self.torn.count_ones();
        if torn < TORN_ANSWERS || self.is_told_torn {
            return None;
        }
        self.is_told_torn = true;
        Some((torn, self.answers))
    }

    /// A request was not answered. Tells it, or that the silence goes on.
    pub fn miss(&mut self, asked_until: Moment, verdict: &mut Verdict) {
        self.silent = self.silent.saturating_add(1);
        if self.silent == 1 {
            self.silent_since = asked_until;
        }
        if !self.is_heard {
            if !core::mem::replace(&mut self.is_told_unheard, true) {
                verdict.add(Finding::new(&codes::NEVER_ANSWERED));
            }
            return;
        }
        let finding = Finding::new(&codes::NO_RESPONSE);
        match self.silent {
            ..SILENT_IN_A_ROW => verdict.add(finding),
            SILENT_IN_A_ROW => {
                verdict.add(finding.actual(i64::from(self.silent)).state(State::Begin));
            }
            _ => verdict.ongoing.push(&codes::NO_RESPONSE),
        }
    }

    /// It answers. Tells the end of its silence, if that had become a state.
    pub fn end_silence(&mut self, now: Moment) -> Option<Finding> {
        let silent = core::mem::take(&mut self.silent);
        (silent >= SILENT_IN_A_ROW && self.is_heard).then(|| {
            Finding::new(&codes::NO_RESPONSE)
                .actual(i64::from(silent))
                .state(State::End(now.since(self.silent_since)))
        })
    }
}
