//! Response times in the table of stations, and what they are worth.

use crate::tally::StationTally;
use dissectors::bus::Bus;
use dissectors::finding::Span;
use std::collections::BTreeMap;
use std::fmt::Write;

/// The headings of its columns.
pub const HEADINGS: [&str; 4] = ["min", "median", "p99", "max"];

/// Minimum, median, 99th percentile and maximum in ns; `None` where no answer was timed.
pub fn percentiles(station: &StationTally) -> Option<[u64; 4]> {
    let times = &station.response_times;
    let at = |quantile| times.value_at_quantile(quantile);
    (!times.is_empty()).then(|| [times.min(), at(0.5), at(0.99), times.max()])
}

/// The cells of a station. A time that its two stamps cannot tell from none is told by what it may
/// be at most.
pub fn cells(station: &StationTally) -> [String; 4] {
    let Some(times) = percentiles(station) else { return HEADINGS.map(|_| "-".to_owned()) };
    let both = station.uncertainty_of_response();
    times.map(|ns| match ns.cast_signed() {
        ns if ns <= both && both > 0 => format!("< {}", Span(ns.saturating_add(both))),
        ns => Span(ns).to_string(),
    })
}

/// What stands below the table: what the times are worth, and why some are missing.
pub fn notes(stations: &[&StationTally], buses: &[Bus]) -> String {
    let mut worth: BTreeMap<i64, Vec<&str>> = BTreeMap::new();
    for station in stations.iter().filter(|it| !it.response_times.is_empty()) {
        let names = worth.entry(station.uncertainty_of_response()).or_default();
        if !names.contains(&&*station.bus) {
            names.push(&station.bus);
        }
    }
    let mut text = String::new();
    let several = worth.len() > 1;
    // A String takes any text.
    for (both, names) in worth.iter().filter(|(both, _)| **both > 0) {
        let whose = if several { format!(" of {}", names.join(", ")) } else { String::new() };
        let _ = writeln!(text, "times{whose} ±{}: two stamps", Span(*both));
    }
    if stations.iter().any(|station| station.response_times.is_empty()) {
        let why = match buses.iter().all(|bus| bus.info().clock.is_none()) {
            true => "the source has no times",
            false => "no answer to a request was timed",
        };
        let _ = writeln!(text, "-: {why}");
    }
    text
}
