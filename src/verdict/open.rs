//! OPEN: what could not be judged, and why?

use super::line::{is_can, is_unread, unreadable};
use super::{Cut, Learned, counted};
use crate::pipeline::Pipeline;
use crate::tally::Tally;
use dissectors::bus::{Bus, LineCounts};
use dissectors::finding::Span;
use dissectors::protocol::Medium;

/// Characters whose parity is not known, and those one of which had an error.
pub fn open_parity(buses: &[Bus]) -> [u64; 2] {
    let sum = |count: fn(LineCounts) -> u64| buses.iter().map(|bus| count(bus.counts())).sum();
    [sum(|counts| counts.unknown_parity), sum(|counts| counts.suspect_parity)]
}

/// Whether frames of a CAN bus came while its rate was not known: without it there is no load.
pub fn is_load_open(buses: &[Bus]) -> bool {
    buses.iter().any(|bus| bus.counts().frames_without_rate > 0)
}

/// What is not judged for want of a bit rate.
fn without_rate(buses: &[Bus]) -> Option<String> {
    let what = "load and time on the wire";
    let is_unknown = |bus: &Bus| is_can(bus) && bus.wire().baud().is_none();
    if buses.iter().any(is_unknown) {
        return Some(format!("{what} not judged (bit rate not known: --bitrate)"));
    }
    let frames = buses.iter().map(|bus| bus.counts().frames_without_rate).sum();
    (frames > 0).then(|| {
        let frames = counted(frames, "frame");
        format!("{what} of the first {frames} not judged (bit rate found later: --bitrate)")
    })
}

pub fn open(tally: &Tally, pipeline: &Pipeline, cut: Option<Cut>) -> String {
    let buses = pipeline.buses();
    let mut open: Vec<String> = cut.map(|cut| cut.open().to_owned()).into_iter().collect();
    if tally.unread > 0 {
        open.push(format!("{} could not be read", counted(tally.unread, "line")));
    }
    if pipeline.records() == 0 {
        let why =
            if has_strange_edges(buses) { "nothing could be read" } else { "nothing was heard" };
        open.push(format!("everything: {why}"));
    }
    if let times @ 1.. = buses.iter().map(|bus| bus.counts().deaf).sum() {
        open.push(format!("what was on the line while nobody listened, {times} x"));
    }
    if let times @ 1.. = buses.iter().map(|bus| bus.counts().not_kept).sum() {
        open.push(format!("what was on the line while nothing was kept, {times} x"));
    }
    if buses.iter().any(|bus| bus.counts().sought > 0) {
        open.push("what was on the line while its rate was looked for (--baud)".to_owned());
    }
    if let times @ 1.. = pipeline.steps_back() {
        open.push(format!("times run backwards {times} x"));
    }
    for (name, count) in &tally.withheld {
        let name = name.rsplit('.').next().unwrap_or(name);
        open.push(format!("{name} not judged {count} x ({})", why_withheld(tally, buses)));
    }
    let [unknown, suspect] = open_parity(buses);
    if suspect > 0 {
        open.push(format!(
            "parity of {} not judged (suspect: the adapter marks whole packets)",
            counted(suspect, "character")
        ));
    }
    if unknown > 0 {
        open.push(format!("parity of {unknown} characters not judged (the source has none)"));
    }
    open.extend(without_rate(buses));
    if is_radix_open(buses) {
        open.push("words hex or decimal undecided (--words)".to_owned());
    }
    if buses.iter().any(has_doubtful_times) {
        open.push("the times make no sense (is --time-unit right?)".to_owned());
    }
    // The window follows bit 3: to say that one is open says it of the other.
    let is_told = ["window", "bitrate", "time unit"];
    let undecided =
        |learned: &Learned| learned.value.is_none() && !is_told.contains(&learned.subject);
    let several = buses.len() > 1;
    let (unread, read): (Vec<&Bus>, Vec<&Bus>) =
        buses.iter().partition(|bus| several && is_unread(bus));
    for bus in read {
        let name = if several { format!("{} ", bus.info().name) } else { String::new() };
        for learned in Learned::of(bus).iter().filter(|learned| undecided(learned)) {
            open.push(format!("{name}{}", learned.question()));
        }
    }
    open.extend(unreadable(&unread));
    if open.is_empty() { "nothing".to_owned() } else { open.join("; ") }
}

/// Whether nothing tells if words are hex or decimal.
pub fn is_radix_open(buses: &[Bus]) -> bool {
    buses.iter().any(|bus| bus.info().is_radix_guessed)
}

/// Whether levels changed in a way that nothing which was looked for explains.
pub fn has_strange_edges(buses: &[Bus]) -> bool {
    buses.iter().any(|bus| bus.counts().strange_edges > 0)
}

/// Whether the unit of its times may be another.
pub fn has_doubtful_times(bus: &Bus) -> bool {
    bus.conclusions().iter().any(|it| it.subject == "time unit" && it.value.is_none())
}

fn why_withheld(tally: &Tally, buses: &[Bus]) -> String {
    let of_words = |bus: &Bus| bus.protocol().is_some_and(|it| it.medium == Medium::Words);
    if buses.iter().all(|bus| bus.info().clock.is_none()) {
        "the source has no times".to_owned()
    } else if buses.iter().all(of_words) && buses.iter().any(has_doubtful_times) {
        "rows may be missing, or the times are wrong: --every-cycle, --time-unit".to_owned()
    } else if buses.iter().all(of_words) {
        "rows may be missing between those of the log: --every-cycle".to_owned()
    } else if buses.iter().any(|bus| bus.wire().baud().is_none()) {
        "rate not known".to_owned()
    } else {
        format!("clock ±{}", Span(i64::from(tally.uncertainty)))
    }
}
