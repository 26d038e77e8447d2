//! WRONG: what was the worst, and what is to be done?

use super::open::{
    has_doubtful_times, has_strange_edges, is_load_open, is_radix_open, open_parity,
};
use super::{Cut, counted};
use crate::clock::Clock;
use crate::pipeline::Pipeline;
use crate::tally::{FindingTally, Tally};
use dissectors::bus::Bus;
use dissectors::finding::Severity;
use dissectors::protocol::Medium;
use std::cmp::Reverse;
use std::collections::BTreeSet;
use std::fmt::Write;

/// What a bus without a finding is told.
pub fn nothing(tally: &Tally, pipeline: &Pipeline, cut: Option<Cut>) -> String {
    let (shown, all) = (tally.records, pipeline.records());
    let buses = pipeline.buses();
    if all == 0 && has_strange_edges(buses) {
        return "not judged: what was heard is another protocol's, or cannot be read -> leave out \
                --protocol, or look at rate and levels"
            .to_owned();
    }
    if all == 0 {
        return unheard(pipeline.buses(), cut).to_owned();
    }
    if shown == 0 {
        return format!("none of {} was selected", counted(all, "record"));
    }
    if is_radix_open(buses) {
        return "not judged: the words may be hex or decimal -> say --words hex or --words decimal"
            .to_owned();
    }
    let infos = tally.count(Severity::Info);
    let infos = if infos > 0 { format!(", {}", counted(infos, "note")) } else { String::new() };
    let of = if shown < all { format!(" selected of {all}") } else { String::new() };
    let judged = judged(tally, pipeline, cut);
    format!("nothing found in {}{of}{infos}; {judged}", counted(shown, "record"))
}

/// What is told, and to do, where nothing was heard at all.
fn unheard(buses: &[Bus], cut: Option<Cut>) -> &'static str {
    if cut == Some(Cut::Failure) {
        return "nothing was heard -> see what is said of the source above";
    }
    match buses.first().and_then(Bus::protocol).map(|protocol| protocol.medium) {
        Some(Medium::Serial) => {
            "nothing was heard -> check that the master runs, A to A, B to B, ground to ground"
        }
        Some(Medium::Can) => {
            "nothing was heard -> check that the bus runs, CAN_H to CAN_H, CAN_L to CAN_L, bit rate"
        }
        Some(Medium::Words) | None => "nothing was heard",
    }
}

/// The worst that was found, and what to do about it.
pub fn wrong(tally: &Tally, several: bool, clock: &Clock) -> Option<String> {
    let mut bad: Vec<&FindingTally> =
        tally.findings.iter().filter(|finding| finding.code.severity > Severity::Info).collect();
    // A cause that lies in the bus as a whole may explain one that seems to lie at a station.
    let weight = |finding: &&FindingTally| {
        let is_cause = finding.code.is_cause;
        let is_general = is_cause && finding.station.is_none();
        Reverse((is_cause, is_general, finding.code.severity, finding.count))
    };
    bad.sort_by_key(weight);
    let worst = *bad.first()?;
    let alike = || bad.iter().filter(|finding| finding.code == worst.code);
    let hit = alike().count();
    let heard = tally.stations.iter().filter(|station| station.answers > 0).count();
    let bus = if several { format!("{} ", worst.bus) } else { String::new() };
    let what = worst.code.name.rsplit('.').next().unwrap_or(worst.code.name);
    let times = clock.period(worst.period);
    let mut text = match worst.station {
        Some(station) => format!("{bus}{station}: {} x {what}{times}", worst.count),
        None => format!("{bus}{} x {what}{times}", worst.count),
    };
    let kinds: BTreeSet<&str> = bad.iter().map(|finding| finding.code.name).collect();
    if worst.station.is_some() && bad.len() == 1 && heard > 1 {
        text.push_str(", others clean");
    }
    if worst.station.is_some() && hit > 1 {
        let _ = write!(text, ", {} too", counted(hit as u64 - 1, "more station"));
    }
    if kinds.len() > 1 {
        let _ = write!(text, ", {}", counted(kinds.len() as u64 - 1, "more kind"));
    }
    // What nearly always hits the same station is a matter of that station, else of the bus.
    let all: u64 = alike().map(|finding| finding.count).sum();
    let is_one = heard > 1 && worst.count * 10 >= all * 9;
    match worst.station.filter(|_| is_one) {
        Some(station) => {
            let _ = write!(text, " -> {} of {station}", worst.cure().one);
        }
        None => {
            let _ = write!(text, " -> {}", worst.cure().all);
        }
    }
    Some(text)
}

fn judged(tally: &Tally, pipeline: &Pipeline, cut: Option<Cut>) -> String {
    let unread = (tally.unread > 0).then_some("lines that could not be read");
    let names = tally.withheld.keys().map(|name| name.rsplit('.').next().unwrap_or(name));
    let [unknown, suspect] = open_parity(pipeline.buses());
    let parity = (unknown + suspect > 0).then_some("parity");
    let load = is_load_open(pipeline.buses()).then_some("load");
    let times = pipeline.buses().iter().any(has_doubtful_times).then_some("the times");
    let whole = cut.map(Cut::open).into_iter().chain(unread);
    let names: Vec<&str> = whole.chain(names).chain(parity).chain(load).chain(times).collect();
    match names.as_slice() {
        [] => "everything was judged".to_owned(),
        names => format!("all judged but {}", names.join(", ")),
    }
}
