//! How evenly a slave is polled, and how fast it answers: measured, not judged.
//!
//! No rule says how often a master polls, nor how soon a slave answers; National Instruments'
//! scanners reckon with 2 ms. What has no rule is no finding.

use super::identifier::{MAC_IDS, MacId};
use super::ledger::{Ledger, Now};
use super::node::Command;
use super::timing::Verdict;
use crate::measure::{Measurement, Spans};
use alloc::vec::Vec;

/// The polls of one slave.
#[derive(Clone, Copy, Default, Debug)]
pub(super) struct Pace {
    /// From poll to poll.
    polls: Spans,
    /// From poll to response.
    responses: Spans,
    /// Responses that took longer than masters reckon with.
    slow: u64,
}

impl Ledger {
    /// A poll follows another.
    pub fn measure_poll(&mut self, now: &Now<'_>, slave: MacId) {
        let node = &mut self.nodes[slave.index()];
        let last = node.poll.map(|command| command.mark.start);
        if let Some(interval) = last.and_then(|last| now.mark.start.since(last)) {
            node.pace.polls.add(interval);
        }
    }

    /// A poll is answered. From stamp to stamp it is the time of one of the frames more than the
    /// slave took, depending on which end is stamped: both are allowed.
    pub fn measure_response(&mut self, now: &Now<'_>, slave: MacId, command: Command) {
        let Some(time) = now.mark.start.since(command.mark.start) else { return };
        let bits = u32::from(command.bits) + u32::from(now.bits.unwrap_or_default());
        let limit = self.settings.poll_response_ns.saturating_add(self.timing.bits_ns(bits));
        let uncertainty = i64::from(command.mark.uncertainty) + i64::from(now.mark.uncertainty);
        let is_slow = self.timing.above(time, limit, uncertainty) == Verdict::Broken;
        let pace = &mut self.node(slave).pace;
        pace.responses.add(time);
        pace.slow += u64::from(is_slow);
    }

    /// What was measured of all slaves.
    pub fn measurements(&self) -> Vec<Measurement> {
        let of = |(mac, pace): (MacId, Pace)| {
            let station = u16::from(mac.get());
            let limit = Some((self.settings.poll_response_ns, pace.slow));
            [
                Measurement { subject: "poll interval", station, spans: pace.polls, limit: None },
                Measurement { subject: "poll response", station, spans: pace.responses, limit },
            ]
        };
        let slaves = (0..MAC_IDS as u8).map(MacId::of);
        let all = slaves.map(|mac| (mac, self.nodes[mac.index()].pace)).flat_map(of);
        all.filter(|measurement| measurement.spans.count() > 0).collect()
    }
}
