//! What is known of one device in the ring, and what a row tells of it: what it was asked
//! (`asking`), and what it answers (`answering`).

mod answering;
mod asking;

use super::Settings;
use super::axis::Axis;
use super::codes;
use super::handshake::{Grain, State};
use super::judge::{Asked, Judgement};
use super::pace::Pace;
use super::row::Row;
use super::service::{LENGTH, PRESET};
use super::word::{Access, Word};
use super::writes::Writes;
use crate::event::Moment;
use crate::finding::Finding;
use crate::motion::Jump;
use crate::record::Turn;
use alloc::string::String;

/// Services are rare where not more than one row in so many shows any: then rows in a row with the
/// same request are one request.
const RARE: u32 = 20;

/// Where nothing tells how fine a log is, rows up to this far apart, in ns, are taken to show a
/// preset that is written between them: a controller needs some ms for a handshake.
const CLOSE_NS: i64 = 2_500_000;

/// Rows so many times further apart than the two before have a gap between them.
const GAP: i64 = 4;

/// What a row of process data tells.
#[derive(Clone, Copy, Debug)]
pub struct Told {
    /// Where the handshake stands.
    pub state: State,
    /// The word that speaks of a service: OUT until it is acknowledged, then IN.
    pub service: Option<Word>,
    /// The position, where IN tells one.
    pub position: Option<u32>,
    /// IN's error bit.
    pub has_error: Option<bool>,
    /// The part the row plays.
    pub turn: Turn,
    /// The record that asked for what is acknowledged.
    pub request: Option<u64>,
    /// How long that took, in ns.
    pub response_time: Option<i64>,
    /// One step in mm.
    pub step_mm: Option<f64>,
}

/// The row that is being looked at.
#[derive(Clone, Copy)]
struct Now<'a> {
    at: Moment,
    uncertainty: u32,
    n: u64,
    /// No handshake can have been skipped since the row before.
    is_fine: bool,
    /// What OUT and IN say belongs together.
    is_paired: bool,
    /// The row has IN.
    has_input: bool,
    settings: &'a Settings,
}

/// A service that the master asks for.
#[derive(Clone, Copy, Debug)]
struct Request {
    /// What it asks for, as OUT stood first and as it stands.
    first: Word,
    word: Word,
    /// What stood there before in rows with the service bit: another request, which the log may
    /// not show to the end.
    former: Option<Word>,
    n: u64,
    at: Moment,
    uncertainty: u32,
    /// Rows that show it unanswered.
    rows: u32,
    is_changed: bool,
    is_answered: bool,
    is_told_late: bool,
    is_withheld: bool,
    /// What was told of what it asks for.
    told: Asked,
}

impl Request {
    /// Whether this acknowledges not the request, but what stood there before: then that was no
    /// request of its own.
    fn is_former_meant_by(&self, input: Word) -> bool {
        self.former.is_some_and(|former| acknowledges(input, former))
    }

    /// Whether this is its acknowledgement.
    fn is_meant_by(&self, input: Word) -> bool {
        input.names_same_service(self.word)
            || (self.is_changed && input.names_same_service(self.first))
    }
}

/// Since when the master has waited for the device to come back.
#[derive(Clone, Copy, Debug)]
struct Release {
    at: Moment,
    uncertainty: u32,
    rows: u32,
    is_told: bool,
    is_withheld: bool,
}

/// One device.
#[derive(Debug)]
pub struct Known {
    /// The measuring length on the rod's label in µm, if the user told it.
    length_um: Option<u32>,
    at: Moment,
    out: Option<Word>,
    input: Option<Word>,
    /// The state of the last row that had both words.
    state: Option<State>,
    pace: Pace,
    /// The last time between two rows in ns.
    spacing: Option<i64>,
    grain: Grain,
    /// Rows, and those of them that show a service going on.
    rows: u32,
    busy: u32,
    /// Whether a row was at rest, and whether services were rare when the last one was.
    has_rested: bool,
    is_rare: bool,
    /// OUT as it was when its service bit was last 1.
    asked: Option<Word>,
    /// Whether OUT has changed since.
    has_changed: bool,
    request: Option<Request>,
    release: Option<Release>,
    /// Since when the error bit is set.
    error_since: Option<Moment>,
    /// The error status, if it was read since.
    status: Option<u32>,
    /// What was acknowledged last: IN's bits 31 to 24.
    acknowledged: Option<u8>,
    /// Bits beside a position that were told.
    stray_told: u8,
    /// Values of the services as they were last read or written.
    values: [Option<u32>; 16],
    step_mm: Option<f64>,
    writes: Writes,
    /// A service was seen that moves the position.
    was_moved: bool,
    axis: Axis,
}

impl Known {
    /// A device of which nothing was heard.
    pub fn new(length_um: Option<u32>) -> Self {
        Known {
            length_um,
            at: Moment::UNKNOWN,
            out: None,
            input: None,
            state: None,
            pace: Pace::default(),
            spacing: None,
            grain: Grain::default(),
            rows: 0,
            busy: 0,
            has_rested: false,
            is_rare: false,
            asked: None,
            has_changed: false,
            request: None,
            release: None,
            error_since: None,
            status: None,
            acknowledged: None,
            stray_told: 0,
            values: [None; 16],
            step_mm: None,
            writes: Writes::default(),
            was_moved: false,
            axis: Axis::new(),
        }
    }

    /// How fine its rows are.
    pub const fn grain(&self) -> &Grain {
        &self.grain
    }

    /// What makes no sense about the times of its rows.
    pub fn complaint(&self) -> Option<String> {
        self.pace.complaint(self.busy > 0)
    }

    /// The rod's length in µm and in steps, where both are known.
    pub fn resolution(&self) -> Option<(u32, u32)> {
        self.length_um.zip(self.values[usize::from(LENGTH)]).filter(|(_, steps)| *steps > 0)
    }

    /// Preset value 1, if it is known.
    pub const fn preset(&self) -> Option<u32> {
        self.values[PRESET as usize]
    }

    /// Something was lost: what was open may be over.
    pub fn interrupt(&mut self) {
        self.axis.interrupt();
        (self.state, self.request, self.release) = (None, None, None);
        (self.out, self.input, self.at) = (None, None, Moment::UNKNOWN);
        (self.spacing, self.has_rested) = (None, false);
    }

    /// Takes a row of process data, which becomes record `n`.
    pub fn hear(
        &mut self,
        row: &Row,
        (out, input): (Option<Word>, Option<Word>),
        n: u64,
        (settings, is_unit_guessed): (&Settings, bool),
        judgement: &mut Judgement,
    ) -> (Told, Option<Jump>) {
        let mut apart = row.start.since(self.at);
        if apart.is_some_and(|ns| ns < 0) {
            self.interrupt();
            apart = None;
        }
        self.at = row.start;
        if let Some(ns) = apart {
            let doubt = 2 * i64::from(row.uncertainty);
            self.pace.add(ns, doubt, is_unit_guessed && !is_date(row.start));
        }
        let is_whole = out.is_some() && input.is_some();
        let is_gap = apart.zip(self.spacing).is_some_and(|(ns, last)| ns / GAP > last);
        self.spacing = apart.filter(|ns| *ns > 0).or(self.spacing);
        let close = apart.filter(|_| self.pace.is_trusted_close());
        let now = Now {
            at: row.start,
            uncertainty: row.uncertainty,
            n,
            is_fine: settings.every_cycle || (is_whole && !is_gap && self.grain.is_fine(close)),
            is_paired: settings.every_cycle || is_whole,
            has_input: input.is_some(),
            settings,
        };
        let (out_before, in_before) = (self.out, self.input);
        (self.out, self.input) = (out.or(out_before), input.or(in_before));
        if let Some(out) = out {
            self.see_out(out, out_before, in_before, &now, judgement);
        }
        let is_laid_out = self.out.is_some_and(|out| out.laid_out() != 0);
        let state = State::of(self.out, self.input, self.has_changed && is_laid_out);
        let mut told = Told {
            state,
            service: match state {
                State::Normal => None,
                State::Prepared | State::Request => self.out,
                State::Acknowledge | State::Release => self.input,
            },
            position: None,
            has_error: input.map(Word::has_error_bit),
            turn: Turn::Neither,
            request: None,
            response_time: None,
            step_mm: self.step_mm,
        };
        // Of a device whose IN is not in the log, nobody can say that it never answers.
        if self.input.is_some() && self.request.is_some_and(|request| request.n == n) {
            told.turn = Turn::Asks;
        }
        if let Some(input) = input {
            self.see_in(input, in_before, &now, judgement, &mut told);
        }
        self.count(state);
        self.watch_time(state, &now, judgement);
        if is_whole && let Some(before) = self.state.replace(state) {
            self.grain.add(before, state);
        }
        let is_still = out.is_none_or(|out| out_before.is_none_or(|before| before == out));
        let jump = match told.position {
            Some(position) if state.is_at_rest() && input.is_some_and(|it| it.code() == 0) => {
                if !is_still && !now.is_fine {
                    self.axis.interrupt();
                }
                self.axis.add(position, n, row.start)
            }
            Some(_) | None if input.is_none() => None,
            _ => {
                self.axis.interrupt();
                None
            }
        };
        let jump = jump.filter(|jump| self.can_tell(jump, close, &now, judgement));
        (told, jump)
    }

    fn count(&mut self, state: State) {
        if self.rows == u32::MAX / RARE {
            (self.rows, self.busy) = (self.rows / 2, self.busy / 2);
        }
        self.rows += 1;
        if state.is_at_rest() {
            self.has_rested = true;
            self.is_rare = self.busy * RARE <= self.rows;
        } else {
            self.busy += 1;
        }
    }

    /// Whether a jump cannot be a preset whose handshake the log does not show.
    fn can_tell(
        &self,
        jump: &Jump,
        apart: Option<i64>,
        now: &Now<'_>,
        judgement: &mut Judgement,
    ) -> bool {
        let is_close = apart.is_some_and(|ns| ns <= CLOSE_NS);
        let is_untouched = !self.grain.has_skipped() && !self.was_moved;
        let can_tell = now.is_fine || (is_untouched && (is_close || jump.is_spike));
        if !can_tell {
            judgement.find_if(false, Finding::new(&codes::POSITION_JUMP));
        }
        can_tell
    }
}

/// Whether this can only be seconds since the epoch, be it a bare number: it is after 2000.
fn is_date(at: Moment) -> bool {
    at.ns().is_some_and(|ns| ns > 946_684_800_000_000_000)
}

/// Whether this IN is what a device in order answers to this OUT.
fn acknowledges(input: Word, out: Word) -> bool {
    let is_same = input.data() == out.data() || out.access() == Access::Read;
    is_same && input.names_same_service(out)
}
