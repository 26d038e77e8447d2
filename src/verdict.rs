//! The last four lines: what a technician asks first.
//!
//! Is the line all right, who is there, what was wrong, and what could not be judged.

use crate::clock::Clock;
use crate::pipeline::Pipeline;
use crate::tally::{FindingTally, StationTally, Tally};
use crate::terminal::clean;
use dissectors::bus::{Bus, LineCounts};
use dissectors::can::Load;
use dissectors::finding::{Severity, Span};
use dissectors::protocol::{Conclusion, Medium};
use dissectors::uart::{Baud, Wire};
use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::{self, Write};

/// The four lines, each with its heading.
pub struct Verdict {
    /// Rate, format, and what came over the wire.
    pub line: String,
    /// Who was asked, who answered, who never did.
    pub who: String,
    /// The worst that was found, and what to do.
    pub wrong: String,
    /// What was not judged, and why.
    pub open: String,
}

/// What ended a run before its source did.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Cut {
    /// The source could not go on.
    Failure,
    /// The user interrupted.
    Interruption,
}

impl Cut {
    /// What was not judged for it.
    const fn open(self) -> &'static str {
        match self {
            Cut::Failure => "what comes after the source's failure",
            Cut::Interruption => "what comes after the interruption",
        }
    }
}

impl Verdict {
    /// Sums a run up.
    pub fn of(tally: &Tally, pipeline: &Pipeline, clock: &Clock, cut: Option<Cut>) -> Verdict {
        let buses = pipeline.buses();
        let several = buses.len() > 1;
        let wrong = match wrong(tally, several, clock) {
            None => nothing(tally, pipeline, cut),
            // Decimal positions that are read as hex jump from 999 to 1000.
            Some(wrong) if is_radix_open(buses) => format!("only if words are hex: {wrong}"),
            Some(wrong) => wrong,
        };
        Verdict {
            line: clean(&line(buses, several, cut)),
            who: clean(&who(tally, several)),
            wrong: clean(&wrong),
            open: clean(&open(tally, pipeline, cut)),
        }
    }

    /// The lines with their headings, in order.
    pub fn lines(&self) -> [(&'static str, &str); 4] {
        [("LINE", &self.line), ("WHO", &self.who), ("WRONG", &self.wrong), ("OPEN", &self.open)]
    }
}

fn line(buses: &[Bus], several: bool, cut: Option<Cut>) -> String {
    match cut {
        _ if !buses.is_empty() => {}
        Some(Cut::Failure) => return "not known: the source failed".to_owned(),
        Some(Cut::Interruption) | None => return "silent: nothing was heard".to_owned(),
    }
    let texts = buses.iter().map(|bus| {
        let name = if several { format!("{} ", bus.info().name) } else { String::new() };
        name + &line_of(bus)
    });
    texts.collect::<Vec<_>>().join("; ")
}

fn line_of(bus: &Bus) -> String {
    match bus.protocol().map(|protocol| protocol.medium) {
        Some(Medium::Words) => line_of_words(bus),
        _ if is_can(bus) => line_of_can(bus.counts(), bus.wire(), bus.load()),
        _ => {
            let is_inverted = if bus.is_inverted() { ", upside down" } else { "" };
            line_of_characters(bus.counts(), bus.wire()) + is_inverted
        }
    }
}

/// The line of a bus of which nothing is known but what was counted on it.
pub fn line_of_counts(counts: LineCounts, wire: Wire, is_can: bool) -> String {
    if is_can { line_of_can(counts, wire, None) } else { line_of_characters(counts, wire) }
}

fn line_of_words(bus: &Bus) -> String {
    let LineCounts { rows, cycles, bad_cycles, losses, strange_edges, .. } = bus.counts();
    let losses = if losses > 0 { format!(", losses: {losses}") } else { String::new() };
    if cycles > 0 {
        let state = if bad_cycles * 100 > cycles { "bad" } else { "ok" };
        let rate = bus.wire().baud().map_or("rate not known".to_owned(), bitrate);
        let share = bad_cycles as f64 * 100.0 / cycles as f64;
        let cycles = counted(cycles, "cycle");
        return format!("{state}: {rate}, {cycles}, {bad_cycles} damaged ({share:.2} %){losses}");
    }
    if rows == 0 && strange_edges > 0 {
        let edges = counted(strange_edges, "level change");
        return format!("not this protocol's: {edges}, and no telegram fits them");
    }
    if rows == 0 {
        return "silent: no rows and no cycles".to_owned();
    }
    format!("ok: {}{losses}", counted(rows, "row"))
}

/// Whether frames were heard on it, or would be.
fn is_can(bus: &Bus) -> bool {
    bus.counts().frames > 0 || bus.protocol().is_some_and(|protocol| protocol.medium == Medium::Can)
}

fn line_of_can(counts: LineCounts, wire: Wire, load: Option<Load>) -> String {
    let LineCounts { frames, error_frames, losses, .. } = counts;
    if frames == 0 {
        return "silent: no frames".to_owned();
    }
    let state = if error_frames * 100 > frames { "bad" } else { "ok" };
    let rate = match wire.baud() {
        Some(rate) => bitrate(rate),
        None => "bit rate not known".to_owned(),
    };
    let plural = if frames == 1 { "" } else { "s" };
    let share = error_frames as f64 * 100.0 / frames as f64;
    let errors = counted(error_frames, "error frame");
    let mut text = format!("{state}: {rate}, {frames} frame{plural}, {errors} ({share:.2} %)");
    let percent = |permille: u16| f64::from(permille) / 10.0;
    // A String takes any text.
    if let Some(mean) = load.as_ref().and_then(Load::mean) {
        let _ = write!(text, ", load {:.1} %", percent(mean));
    }
    if let Some(peak) = load.as_ref().and_then(Load::peak) {
        let _ = write!(text, ", peak {:.1} %", percent(peak));
    }
    if losses > 0 {
        let _ = write!(text, ", {losses} loss{}", if losses == 1 { "" } else { "es" });
    }
    text
}

/// A bit rate as people say it.
fn bitrate(rate: Baud) -> String {
    match rate.get() {
        rate if rate.is_multiple_of(1_000) => format!("{} kbit/s", rate / 1_000),
        rate => format!("{rate} bit/s"),
    }
}

fn line_of_characters(counts: LineCounts, wire: Wire) -> String {
    let state = match counts {
        LineCounts { characters: 0, breaks: 0, .. } => return "silent: no characters".to_owned(),
        LineCounts { characters, damaged, glitches, .. }
            if damaged * 100 > characters || glitches > characters =>
        {
            "bad"
        }
        _ => "ok",
    };
    let rate = match wire.baud() {
        Some(baud) => baud.to_string(),
        None => "rate not known,".to_owned(),
    };
    let plural = if counts.characters == 1 { "" } else { "s" };
    let mut text =
        format!("{state}: {rate} {}, {} character{plural}", wire.format(), counts.characters);
    let share = counts.damaged as f64 * 100.0 / counts.characters.max(1) as f64;
    // A String takes any text.
    let _ = write!(text, ", {} damaged ({share:.2} %)", counts.damaged);
    for (count, what) in
        [(counts.breaks, "break"), (counts.losses, "loss"), (counts.glitches, "glitch")]
    {
        if count > 0 {
            let plural = match (count, what) {
                (1, _) => "",
                (_, "break") => "s",
                _ => "es",
            };
            let _ = write!(text, ", {count} {what}{plural}");
        }
    }
    text
}

fn who(tally: &Tally, several: bool) -> String {
    let mut buses: BTreeMap<&str, Vec<&StationTally>> = BTreeMap::new();
    for station in &tally.stations {
        buses.entry(&station.bus).or_default().push(station);
    }
    if buses.is_empty() {
        let heard: Vec<String> = tally.heard().map(|station| station.to_string()).collect();
        return match heard.is_empty() {
            true => "no stations".to_owned(),
            false => format!("heard {}", heard.join(" ")),
        };
    }
    let texts = buses.into_iter().map(|(bus, mut stations)| {
        stations.sort_by_key(|station| station.station);
        let name = if several { format!("{bus} ") } else { String::new() };
        name + &who_of(&stations)
    });
    texts.collect::<Vec<_>>().join("; ")
}

fn who_of(stations: &[&StationTally]) -> String {
    let numbers = |is_one: &dyn Fn(&StationTally) -> bool| {
        let chosen = stations.iter().filter(|station| is_one(station));
        let numbers: Vec<String> = chosen.map(|station| station.station.to_string()).collect();
        if numbers.is_empty() { "nobody".to_owned() } else { numbers.join(" ") }
    };
    let mut text = format!(
        "asked {} | answered {}",
        numbers(&|station| station.asked > 0),
        numbers(&|station| station.answered > 0)
    );
    let silent: Vec<String> = stations
        .iter()
        .filter(|station| station.asked > 0 && station.answered == 0)
        .map(|station| format!("{} (0 of {})", station.station, station.asked))
        .collect();
    if !silent.is_empty() {
        let _ = write!(text, " | never {}", silent.join(" "));
    }
    let unasked = numbers(&|station| station.asked == 0 && station.answers > 0);
    if unasked != "nobody" {
        let _ = write!(text, " | unasked {unasked}");
    }
    let heard = numbers(&|station| station.asked == 0 && station.answers == 0);
    if heard != "nobody" {
        let _ = write!(text, " | heard {heard}");
    }
    text
}

/// What a bus without a finding is told.
fn nothing(tally: &Tally, pipeline: &Pipeline, cut: Option<Cut>) -> String {
    let (shown, all) = (tally.records, pipeline.records());
    let buses = pipeline.buses();
    if all == 0 && buses.iter().any(|bus| bus.counts().strange_edges > 0) {
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
fn wrong(tally: &Tally, several: bool, clock: &Clock) -> Option<String> {
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

fn counted(count: u64, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
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

/// Characters whose parity is not known, and those one of which had an error.
fn open_parity(buses: &[Bus]) -> [u64; 2] {
    let sum = |count: fn(LineCounts) -> u64| buses.iter().map(|bus| count(bus.counts())).sum();
    [sum(|counts| counts.unknown_parity), sum(|counts| counts.suspect_parity)]
}

/// Whether frames of a CAN bus came while its rate was not known: without it there is no load.
fn is_load_open(buses: &[Bus]) -> bool {
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

fn open(tally: &Tally, pipeline: &Pipeline, cut: Option<Cut>) -> String {
    let buses = pipeline.buses();
    let mut open: Vec<String> = cut.map(|cut| cut.open().to_owned()).into_iter().collect();
    if tally.unread > 0 {
        open.push(format!("{} could not be read", counted(tally.unread, "line")));
    }
    if pipeline.records() == 0 {
        open.push("everything: nothing was heard".to_owned());
    }
    if let times @ 1.. = buses.iter().map(|bus| bus.counts().deaf).sum() {
        open.push(format!("what was on the line while nobody listened, {times} x"));
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
    for learned in buses.iter().flat_map(Learned::of).filter(undecided) {
        open.push(learned.question());
    }
    if open.is_empty() { "nothing".to_owned() } else { open.join("; ") }
}

/// What was found out about one question: for the bus, or for the stations where it is the same.
pub struct Learned {
    /// What it is about.
    pub subject: &'static str,
    /// What was concluded; `None` while undecided.
    pub value: Option<String>,
    /// The stations, each with the evidence; no station for the bus as a whole.
    pub evidence: Vec<(Option<u16>, String)>,
}

impl Learned {
    /// Everything a bus found out, stations with the same conclusion put together.
    pub fn of(bus: &Bus) -> Vec<Learned> {
        let mut all: Vec<Learned> = Vec::new();
        for Conclusion { subject, station, value, evidence } in bus.conclusions() {
            let same =
                |learned: &&mut Learned| learned.subject == subject && learned.value == value;
            match all.iter_mut().find(same) {
                Some(learned) => learned.evidence.push((station, evidence)),
                None => {
                    all.push(Learned { subject, value, evidence: vec![(station, evidence)] });
                }
            }
        }
        all
    }

    /// What was asked and answered, without the evidence.
    fn question(&self) -> String {
        let value = self.value.as_deref().unwrap_or("undecided");
        let stations = self.evidence.iter().filter_map(|(station, _)| *station);
        let stations: Vec<String> = stations.map(|station| station.to_string()).collect();
        let whose = if stations.is_empty() { "" } else { " for " };
        format!("{} {value}{whose}{}", self.subject, stations.join(" "))
    }
}

impl fmt::Display for Learned {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.subject, self.value.as_deref().unwrap_or("undecided"))?;
        // Stations with the same evidence stand together.
        for (index, alike) in self.evidence.chunk_by(|(_, a), (_, b)| a == b).enumerate() {
            let stations = alike.iter().filter_map(|(station, _)| *station);
            let stations: Vec<String> = stations.map(|station| station.to_string()).collect();
            match (stations.is_empty(), index) {
                (true, _) => write!(f, " ")?,
                (false, 0) => write!(f, ": {} ", stations.join(" "))?,
                (false, _) => write!(f, ", {} ", stations.join(" "))?,
            }
            write!(f, "({})", alike[0].1)?;
        }
        Ok(())
    }
}

/// Whether nothing tells if words are hex or decimal.
fn is_radix_open(buses: &[Bus]) -> bool {
    buses.iter().any(|bus| bus.info().is_radix_guessed)
}

/// Whether the unit of its times may be another.
fn has_doubtful_times(bus: &Bus) -> bool {
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
