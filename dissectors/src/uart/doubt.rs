//! A second opinion on settings that the user gave: whether the line itself says otherwise.

use super::find::{Found, find, fits};
use super::{Baud, LineSettings, codes};
use crate::edges::Edges;
use crate::finding::{Code, Finding};

/// Share of characters with their stop bits that makes an opinion worth having, in percent.
const SURE: usize = 95;

/// Share below which given settings are doubted, in percent.
const DOUBTFUL: usize = 85;

/// Characters it takes.
const ENOUGH: usize = 16;

/// Rates that differ by more are different, in percent.
const SAME_RATE: u64 = 3;

impl Baud {
    /// What is wrong with a rate that the user set, where the source tells this one.
    pub(crate) fn doubt(self, set: Baud) -> Option<Finding> {
        let finding = Finding::new(&codes::WRONG_RATE).expected(i64::from(self.get()));
        self.differs_from(set).then_some(finding)
    }

    fn differs_from(self, set: Baud) -> bool {
        let (set, found) = (u64::from(set.get()), u64::from(self.get()));
        set.abs_diff(found) * 100 > found * SAME_RATE
    }
}

/// What is wrong with the settings that were given, if another reading of the same levels is far
/// better than the one that is `used`.
pub(super) fn doubt(
    edges: &Edges,
    ticks_per_second: u64,
    given: LineSettings,
    used: LineSettings,
) -> Option<Finding> {
    let own = find(edges, ticks_per_second, LineSettings::default())?;
    if own.all < ENOUGH || own.good * 100 < own.all * SURE {
        return None;
    }
    let with_used = find(edges, ticks_per_second, used);
    let (good, all) = with_used.as_ref().map_or((0, own.all), |found| (found.good, found.all));
    let bit = ticks_per_second as f64 / f64::from(used.baud?.get());
    let is_bad = good * 100 < all * DOUBTFUL || !fits(&edges.ticks, bit);
    let differs = is_bad.then(|| what_differs(given, &own)).flatten()?;
    let finding = Finding::new(differs).actual((all - good) as i64).limit(all as i64);
    Some(if differs == &codes::WRONG_RATE {
        finding.expected(i64::from(own.baud.get()))
    } else {
        finding
    })
}

/// Which of the given settings the line contradicts.
fn what_differs(given: LineSettings, own: &Found) -> Option<&'static Code> {
    if given.inverted.is_some_and(|inverted| inverted != own.is_inverted) {
        Some(&codes::SWAPPED_LINES)
    } else if given.baud.is_some_and(|set| own.baud.differs_from(set)) {
        Some(&codes::WRONG_RATE)
    } else if given.format.is_some_and(|format| format != own.format) {
        Some(&codes::WRONG_PARITY)
    } else {
        None
    }
}
