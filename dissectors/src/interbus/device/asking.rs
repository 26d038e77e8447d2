//! What the master asks of a device, and how long it waits.

use super::{Known, Now, Release, Request, acknowledges};
use crate::event::Moment;
use crate::finding::Finding;
use crate::interbus::codes;
use crate::interbus::handshake::State;
use crate::interbus::judge::{Asked, Judgement};
use crate::interbus::word::{Access, Word};
use core::mem::replace;

/// Rows that show a state without a break before a time limit is judged in a log that skips
/// states: less may be several handshakes, each seen at the same place.
const IN_A_ROW: u32 = 8;

impl Known {
    pub(super) fn see_out(
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
                if !replace(&mut request.is_changed, true) {
                    judgement.find(Finding::new(&codes::REQUEST_CHANGED));
                }
                if !request.is_answered {
                    judgement.judge_request(out, &mut request.told);
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
        let mut told = Asked::default();
        judgement.judge_request(out, &mut told);
        if !now.at.is_known() || self.input.is_none() {
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
            is_withheld: false,
            told,
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

    /// What was to come and has not: only IN can tell, in a row that has it.
    pub(super) fn watch_time(&mut self, state: State, now: &Now<'_>, judgement: &mut Judgement) {
        let is_asking = self.out.is_some_and(Word::has_service_bit);
        if state == State::Release {
            let fresh = Release {
                at: now.at,
                uncertainty: now.uncertainty,
                rows: 0,
                is_told: false,
                is_withheld: false,
            };
            let mut release = self.release.unwrap_or(fresh);
            release.rows = release.rows.saturating_add(1);
            let limit = now.settings.no_release_ns;
            let late = late(now, (release.at, release.uncertainty), limit);
            if let Some(ns) =
                late.filter(|_| !release.is_told && self.is_seen(release.rows, limit, now))
            {
                let finding = Finding::new(&codes::NO_RELEASE).actual(ns).limit(limit);
                release.is_told = self.pace.has_passed(release.rows, limit);
                if release.is_told || !replace(&mut release.is_withheld, true) {
                    judgement.find_if(release.is_told, finding);
                }
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
            let finding = Finding::new(&codes::NO_ACKNOWLEDGE).actual(ns).limit(limit);
            request.is_told_late = self.pace.has_passed(request.rows, limit);
            if request.is_told_late || !replace(&mut request.is_withheld, true) {
                judgement.find_if(request.is_told_late, finding);
            }
        }
        self.request = Some(request);
    }

    /// Whether so many rows of one state are one state: a coarse log may show several handshakes
    /// at the same place each.
    fn is_seen(&self, rows: u32, limit: i64, now: &Now<'_>) -> bool {
        let is_close = !self.grain.has_skipped() && self.pace.shortest() <= limit / 4;
        let is_long = self.is_rare && rows >= IN_A_ROW;
        now.is_fine || (self.has_rested && (is_close || is_long))
    }
}

/// How long it has been since then, if that is more than the limit for certain and IN still says
/// the same.
fn late(now: &Now<'_>, (at, uncertainty): (Moment, u32), limit: i64) -> Option<i64> {
    let doubt = i64::from(uncertainty) + i64::from(now.uncertainty);
    now.at.since(at).filter(|ns| now.has_input && *ns > limit.saturating_add(doubt))
}
