//! What is known of one device in the ring, and what a row tells of it.

use super::Settings;
use super::axis::Axis;
use super::codes;
use super::handshake::{Grain, State};
use super::judge::Judgement;
use super::row::Row;
use super::service::{ADJUST, LENGTH, PRESET, STATUS, Service};
use super::settings::ReadEcho;
use super::word::{Access, Word};
use super::writes::Writes;
use crate::event::Moment;
use crate::finding::{Finding, State as Edge};
use crate::motion::Jump;
use crate::record::Turn;

/// Rows that show a state without a break before a time limit is judged in a log that skips
/// states: less may be several handshakes, each seen at the same place.
const IN_A_ROW: u32 = 8;

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

/// How an acknowledgement begins.
#[derive(Clone, Copy, Debug)]
struct Beginning {
    /// No IN was seen before.
    is_first: bool,
    /// The device could not do it.
    is_refused: bool,
}

/// Since when the master has waited for the device to come back.
#[derive(Clone, Copy, Debug)]
struct Release {
    at: Moment,
    uncertainty: u32,
    rows: u32,
    is_told: bool,
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
    /// The shortest time between two rows in ns, and the last one.
    shortest: i64,
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
            shortest: i64::MAX,
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
        settings: &Settings,
        judgement: &mut Judgement,
    ) -> (Told, Option<Jump>) {
        let mut apart = row.start.since(self.at);
        if apart.is_some_and(|ns| ns < 0) {
            self.interrupt();
            apart = None;
        }
        self.at = row.start;
        if let Some(ns) = apart.filter(|ns| *ns > 0) {
            self.shortest = self.shortest.min(ns);
        }
        let is_whole = out.is_some() && input.is_some();
        let is_gap = apart.zip(self.spacing).is_some_and(|(ns, last)| ns / GAP > last);
        self.spacing = apart.filter(|ns| *ns > 0).or(self.spacing);
        let now = Now {
            at: row.start,
            uncertainty: row.uncertainty,
            n,
            is_fine: settings.every_cycle || (is_whole && !is_gap && self.grain.is_fine(apart)),
            is_paired: settings.every_cycle || is_whole,
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
        if self.request.is_some_and(|request| request.n == n) {
            told.turn = Turn::Asks;
        }
        if let Some(input) = input {
            self.see_in(input, in_before, &now, judgement, &mut told);
        }
        self.count(state);
        self.watch_time(state, &now, judgement);
        if is_whole {
            if let Some(before) = self.state.replace(state) {
                self.grain.add(before, state);
            }
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
        let jump = jump.filter(|jump| self.can_tell(jump, apart, &now, judgement));
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

    fn see_out(
        &mut self,
        out: Word,
        before: Option<Word>,
        in_before: Option<Word>,
        now: &Now<'_>,
        judgement: &mut Judgement,
    ) {
        let was_asking = before.is_some_and(Word::has_service_bit);
        if !out.has_service_bit() {
            self.has_changed |= self.asked.is_none_or(|asked| asked.laid_out() != out.laid_out());
            if was_asking {
                self.judge_withdrawal(now, judgement);
            }
            return;
        }
        self.asked = Some(out);
        self.has_changed = false;
        if !was_asking {
            if let Some(before) = before {
                let changed = before.laid_out() ^ out.laid_out();
                // A read service has no data.
                let is_of_use = out.access() == Access::Write || changed >> 24 != 0;
                if changed != 0 && is_of_use {
                    let finding = Finding::new(&codes::DATA_WITH_SERVICE_BIT);
                    judgement.find_if(now.settings.every_cycle, finding);
                }
            }
            self.begin(out, now, judgement);
        } else if let Some(before) = before.filter(|before| *before != out) {
            // The device still acknowledges what stood there before: no new request came between.
            let is_proven = self.input == in_before
                && self.input.is_some_and(|input| {
                    let is_old = acknowledges(input, before) && !acknowledges(input, out);
                    input.has_service_bit() && is_old && now.is_paired
                });
            self.change(out, now.is_fine || is_proven, now, judgement);
        }
    }

    /// OUT has another service or other data, and its service bit was 1 in the row before too.
    fn change(&mut self, out: Word, is_one: bool, now: &Now<'_>, judgement: &mut Judgement) {
        match &mut self.request {
            Some(request) if is_one => {
                request.word = out;
                if !core::mem::replace(&mut request.is_changed, true) {
                    judgement.find(Finding::new(&codes::REQUEST_CHANGED));
                }
            }
            request => {
                let former = request.map(|it| it.former.unwrap_or(it.first));
                judgement.find_if(false, Finding::new(&codes::REQUEST_CHANGED));
                self.begin(out, now, judgement);
                if let Some(request) = &mut self.request {
                    request.former = former;
                }
            }
        }
    }

    fn begin(&mut self, out: Word, now: &Now<'_>, judgement: &mut Judgement) {
        judgement.judge_request(out);
        if !now.at.is_known() {
            judgement.find_if(false, Finding::new(&codes::NO_ACKNOWLEDGE));
        }
        self.request = Some(Request {
            first: out,
            word: out,
            former: None,
            n: now.n,
            at: now.at,
            uncertainty: now.uncertainty,
            rows: 0,
            is_changed: false,
            is_answered: false,
            is_told_late: false,
        });
    }

    /// The service bit of OUT has gone.
    fn judge_withdrawal(&mut self, now: &Now<'_>, judgement: &mut Judgement) {
        let is_acknowledged = self.input.is_none_or(Word::has_service_bit);
        let open = self.request.filter(|it| !it.is_answered && !it.is_told_late);
        if open.is_some() && !is_acknowledged && now.is_paired {
            judgement.find_if(now.is_fine, Finding::new(&codes::WITHDRAWN));
        }
    }

    fn see_in(
        &mut self,
        input: Word,
        before: Option<Word>,
        now: &Now<'_>,
        judgement: &mut Judgement,
        told: &mut Told,
    ) {
        let had_error = self.error_since.is_some();
        self.see_error_bit(input.has_error_bit(), now.at, told.state, judgement);
        if !input.has_service_bit() {
            told.position = Some(input.data());
            let stray = input.stray_bits();
            if stray != 0 && stray != self.stray_told {
                let finding = Finding::new(&codes::RESERVED_BITS);
                judgement.find(finding.actual(i64::from(input.code())));
            }
            self.stray_told = stray;
            return;
        }
        let open = self.request.filter(|request| !request.is_answered);
        let was_acknowledging = before.is_some_and(Word::has_service_bit);
        let is_new = match before {
            Some(before) if was_acknowledging => {
                let is_same = before.names_same_service(input) && before.data() == input.data();
                let is_next = open.is_some_and(|open| !now.is_fine && open.is_meant_by(input));
                let is_update = now.is_fine && open.is_none() && before.names_same_service(input);
                is_next || (!is_same && !is_update)
            }
            _ => true,
        };
        if is_new {
            // An error bit that was set before tells of the magnet, not of this service.
            let is_refused = input.has_error_bit()
                && (!had_error || input.access() == Access::Write)
                && input.service() != STATUS;
            let beginning = Beginning { is_first: before.is_none(), is_refused };
            self.acknowledge(input, beginning, now, judgement, told);
        }
    }

    /// The device acknowledges a service.
    fn acknowledge(
        &mut self,
        input: Word,
        Beginning { is_first, is_refused }: Beginning,
        now: &Now<'_>,
        judgement: &mut Judgement,
        told: &mut Told,
    ) {
        self.acknowledged = Some(input.code());
        self.release = None;
        if input.has_reserve_bit() {
            judgement.find(Finding::new(&codes::RESERVED_BITS).actual(i64::from(input.code())));
        }
        let is_asking = self.out.is_some_and(Word::has_service_bit);
        let open = self.request.as_mut().filter(|request| !request.is_answered);
        // Where a log skips states, what was asked last may be over long since.
        let open = open.filter(|open| is_asking || now.is_fine || acknowledges(input, open.word));
        let mut asked = None;
        told.turn = Turn::Answers;
        told.request = Some(now.n);
        match open {
            Some(open) => {
                open.is_answered = true;
                told.request = Some(open.n);
                if open.n != now.n {
                    told.response_time = now.at.since(open.at);
                }
                if open.is_meant_by(input) {
                    asked = Some(*open);
                } else if now.is_paired && open.is_former_meant_by(input) {
                    judgement.find(Finding::new(&codes::REQUEST_CHANGED));
                } else if now.is_paired {
                    let finding = Finding::new(&codes::SERVICE_MISMATCH);
                    let expected = i64::from(open.word.code());
                    return judgement.find(finding.expected(expected).actual(input.code().into()));
                }
            }
            None if !is_first && !is_asking && self.out.is_some() => {
                let is_certain = now.settings.every_cycle;
                judgement.find_if(is_certain, Finding::new(&codes::UNREQUESTED_ACKNOWLEDGE));
                if is_certain {
                    told.request = None;
                    return;
                }
            }
            None => {}
        }
        if is_refused {
            return;
        }
        let Some(service) = Service::numbered(input.service()) else { return };
        let asked = asked.filter(|asked| now.is_paired && !asked.is_changed);
        let data = input.data();
        let is_changed =
            |it: &Request| !acknowledges(input, it.word) && it.is_former_meant_by(input);
        if asked.as_ref().is_some_and(is_changed) {
            judgement.find(Finding::new(&codes::REQUEST_CHANGED));
        }
        let asked = asked.filter(|asked| !is_changed(asked));
        let is_echo = input.access() == Access::Write || now.settings.read_echo == ReadEcho::Echo;
        if let Some(out) =
            asked.map(|asked| asked.word.data()).filter(|out| is_echo && *out != data)
        {
            let finding = Finding::new(&codes::ECHO_MISMATCH).expected(i64::from(out));
            judgement.find(finding.actual(i64::from(data)));
            if input.access() == Access::Write {
                self.values[usize::from(service.number)] = None;
            }
            return;
        }
        match input.access() {
            Access::Write if service.allows(Access::Write) => {
                self.written(service, data, now, judgement);
            }
            Access::Read if !is_echo => {
                judgement.judge_answer(service, data);
                self.learn(service.number, data);
            }
            _ => {}
        }
        told.step_mm = self.step_mm;
    }

    fn written(
        &mut self,
        service: &'static Service,
        data: u32,
        now: &Now<'_>,
        judgement: &mut Judgement,
    ) {
        let mut written = Finding::new(&codes::WRITTEN).actual(i64::from(data));
        written.expected = self.values[usize::from(service.number)].map(i64::from);
        judgement.find(written);
        if self.writes.add(service.number, data, now.at) {
            let finding = Finding::new(&codes::REPEATED_WRITE).actual(i64::from(data));
            judgement.find(finding.limit(i64::from(service.number)));
        }
        if service.number != PRESET {
            self.was_moved = true;
            self.axis.interrupt();
        }
        if service.number != ADJUST {
            self.learn(service.number, data);
        }
    }

    fn learn(&mut self, service: u8, data: u32) {
        self.values[usize::from(service)] = Some(data);
        if service == STATUS {
            self.status = Some(data);
        }
        if service == LENGTH && data > 0 {
            self.axis.learn(data, self.length_um);
            self.step_mm = self.length_um.map(|um| f64::from(um) / f64::from(data) / 1_000.0);
        }
    }

    fn see_error_bit(
        &mut self,
        is_set: bool,
        now: Moment,
        state: State,
        judgement: &mut Judgement,
    ) {
        match (self.error_since, is_set) {
            (None, false) => {}
            (Some(_), true) => judgement.ongoing.push(&codes::ERROR_BIT),
            (None, true) => {
                self.error_since = Some(now);
                let mut finding = Finding::new(&codes::ERROR_BIT).state(Edge::Begin);
                // What was read before tells nothing of a service that is refused now.
                finding.actual = self.status.filter(|_| state.is_at_rest()).map(i64::from);
                judgement.find(finding);
            }
            (Some(since), false) => {
                self.error_since = None;
                self.status = None;
                let finding = Finding::new(&codes::ERROR_BIT);
                let mut finding = finding.state(Edge::End(now.since(since)));
                finding.actual = self.acknowledged.map(i64::from);
                judgement.find(finding);
            }
        }
    }

    /// What was to come and has not.
    fn watch_time(&mut self, state: State, now: &Now<'_>, judgement: &mut Judgement) {
        let is_asking = self.out.is_some_and(Word::has_service_bit);
        if state == State::Release {
            let fresh =
                Release { at: now.at, uncertainty: now.uncertainty, rows: 0, is_told: false };
            let mut release = self.release.unwrap_or(fresh);
            release.rows = release.rows.saturating_add(1);
            let limit = now.settings.no_release_ns;
            let late = late(now, (release.at, release.uncertainty), limit);
            if let Some(ns) =
                late.filter(|_| !release.is_told && self.is_seen(release.rows, limit, now))
            {
                release.is_told = true;
                judgement.find(Finding::new(&codes::NO_RELEASE).actual(ns).limit(limit));
            }
            self.release = Some(release);
        } else if self.release.is_some() {
            self.release = None;
        }
        let Some(mut request) = self.request.filter(|it| is_asking && !it.is_answered) else {
            return;
        };
        request.rows = request.rows.saturating_add(1);
        let limit = now.settings.no_acknowledge_ns;
        let late = late(now, (request.at, request.uncertainty), limit);
        if let Some(ns) =
            late.filter(|_| !request.is_told_late && self.is_seen(request.rows, limit, now))
        {
            request.is_told_late = true;
            judgement.find(Finding::new(&codes::NO_ACKNOWLEDGE).actual(ns).limit(limit));
        }
        self.request = Some(request);
    }

    /// Whether so many rows of one state are one state: a coarse log may show several handshakes
    /// at the same place each.
    fn is_seen(&self, rows: u32, limit: i64, now: &Now<'_>) -> bool {
        let is_close = !self.grain.has_skipped() && self.shortest <= limit / 4;
        let is_long = self.is_rare && rows >= IN_A_ROW;
        now.is_fine || (self.has_rested && (is_close || is_long))
    }
}

/// Whether this IN is what a device in order answers to this OUT.
fn acknowledges(input: Word, out: Word) -> bool {
    let is_same = input.data() == out.data() || out.access() == Access::Read;
    is_same && input.names_same_service(out)
}

/// How long it has been since then, if that is more than the limit for certain.
fn late(now: &Now<'_>, (at, uncertainty): (Moment, u32), limit: i64) -> Option<i64> {
    let doubt = i64::from(uncertainty) + i64::from(now.uncertainty);
    now.at.since(at).filter(|ns| *ns > limit.saturating_add(doubt))
}
