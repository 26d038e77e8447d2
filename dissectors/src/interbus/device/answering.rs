//! What a device answers: the position, or that it has done a service.

use super::{Known, Now, Request, Told, acknowledges};
use crate::event::Moment;
use crate::finding::{Finding, State as Edge};
use crate::interbus::codes;
use crate::interbus::handshake::State;
use crate::interbus::judge::Judgement;
use crate::interbus::service::{ADJUST, LENGTH, PRESET, STATUS, Service};
use crate::interbus::settings::ReadEcho;
use crate::interbus::word::{Access, Word};
use crate::record::Turn;

/// How an acknowledgement begins.
#[derive(Clone, Copy, Debug)]
struct Beginning {
    /// No IN was seen before.
    is_first: bool,
    /// The device could not do it.
    is_refused: bool,
}

impl Known {
    pub(super) fn see_in(
        &mut self,
        input: Word,
        before: Option<Word>,
        now: &Now<'_>,
        judgement: &mut Judgement,
        told: &mut Told,
    ) {
        let had_error = self.error_since.is_some();
        self.see_error_bit(input, now.at, told.state, judgement);
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
        if !is_refused {
            self.done(input, asked, now, judgement);
            told.step_mm = self.step_mm;
        }
    }

    /// A service was done: what was written, or read.
    fn done(
        &mut self,
        input: Word,
        asked: Option<Request>,
        now: &Now<'_>,
        judgement: &mut Judgement,
    ) {
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
            Access::Read if !is_echo && service.allows(Access::Read) => {
                judgement.judge_answer(service, data);
                self.learn(service.number, data);
            }
            _ => {}
        }
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
            let finding = finding.limit(i64::from(service.number));
            judgement.find_if(self.pace.is_trusted_close(), finding);
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

    /// The error bit is a state: an acknowledgement without it tells that this service was done,
    /// and nothing of the error, so that it ends beside a position only.
    fn see_error_bit(&mut self, input: Word, now: Moment, state: State, judgement: &mut Judgement) {
        match (self.error_since, input.has_error_bit()) {
            (None, false) => {}
            (Some(_), true) => judgement.ongoing.push(&codes::ERROR_BIT),
            (Some(_), false) if input.has_service_bit() => {
                judgement.ongoing.push(&codes::ERROR_BIT);
            }
            (None, true) => {
                self.error_since = Some(now);
                let mut finding = Finding::new(&codes::ERROR_BIT).state(Edge::Begin);
                // What was read before tells nothing of a service that is refused now.
                let status = self.status.filter(|status| *status != 0 && state.is_at_rest());
                finding.actual = status.map(i64::from);
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
}
