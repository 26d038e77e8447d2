//! `stats`: stations, findings and response times of a capture.

mod response;

use crate::cli::Decoding;
use crate::decode::{FAILED, Outcome, USAGE, decode, settings};
use crate::export::Export;
use crate::say;
use crate::source::live::is_tap;
use crate::stdout::Stdout;
use crate::tally::{FindingTally, Period, Positions, StationTally};
use crate::terminal::clean;
use crate::verdict::Learned;
use clap::{Args, ValueEnum};
use dissectors::bus::Bus;
use dissectors::finding::Span;
use dissectors::measure::Measurement;
use dissectors::record::{Record, Sink};
use dissectors::setting::Setting;
use serde_json::{Map, Value, json};
use std::fmt::Write as _;
use std::io::{self, IsTerminal, Write};
use std::process::ExitCode;

/// What to sum up, and how.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Captures: files, or - for standard input; several are read as one stream. Or a live tap,
    /// which is followed until Ctrl-C.
    #[arg(value_name = "SOURCE", required = true)]
    sources: Vec<String>,

    #[command(flatten)]
    decoding: Decoding,

    /// Form of the statistics.
    #[arg(long, value_name = "FORM", default_value = "text", help_heading = "Output")]
    format: Form,
}

/// The forms of statistics.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum Form {
    /// Tables for people.
    Text,
    /// One JSON object.
    Json,
}

/// Prints the statistics.
pub fn run(arguments: &Arguments) -> ExitCode {
    let decoding = &arguments.decoding;
    let settings = match settings(decoding) {
        Ok(settings) => settings,
        Err(error) => {
            say!("fieldtap: {error:#}");
            return ExitCode::from(USAGE);
        }
    };
    let is_live = arguments.sources.iter().any(|name| is_tap(name));
    let mut nowhere = Nowhere { is_to_announce: is_live && !decoding.quiet };
    let outcome = decode(decoding, &arguments.sources, settings, &mut nowhere).ended_as_meant();
    let text = match arguments.format {
        _ if outcome.is_unopened() => String::new(),
        Form::Text => text(&outcome),
        Form::Json => format!("{:#}\n", as_json(&outcome)),
    };
    match Stdout::new().write_all(text.as_bytes()) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => ExitCode::SUCCESS,
        Err(error) => {
            say!("fieldtap: the output cannot be written: {error}");
            ExitCode::from(FAILED)
        }
        Ok(()) => {
            outcome.report();
            outcome.exit_code()
        }
    }
}

/// Statistics need no record but in passing.
struct Nowhere {
    /// It is still to be said that nothing is shown until the end.
    is_to_announce: bool,
}

impl Sink for Nowhere {
    fn record(&mut self, _: &Record<'_>) {}
}

impl Export for Nowhere {
    /// Asked first when the source was opened.
    fn status(&mut self) -> io::Result<()> {
        if std::mem::take(&mut self.is_to_announce) {
            say!("fieldtap: counting; Ctrl-C shows the tables");
        }
        Ok(())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Requests a second.
fn rate(station: &StationTally) -> Option<f64> {
    let seconds = station.period.length().filter(|ns| *ns > 0)? as f64 / 1e9;
    let telegrams = station.asked.max(station.answers);
    (telegrams > 1).then(|| (telegrams - 1) as f64 / seconds)
}

/// A String takes any text, so writing to it cannot fail.
fn text(outcome: &Outcome) -> String {
    let mut text = String::new();
    let tally = &outcome.tally;
    let stations = tally.sorted_stations();
    let [min, median, p99, max] = response::HEADINGS;
    let _ = writeln!(
        text,
        "{:<8} {:>4} {:>8} {:>8} {:>9} {min:>10} {median:>10} {p99:>10} {max:>10}",
        "bus", "who", "asked", "answered", "per s"
    );
    for station in &stations {
        let rate = rate(station).map_or(String::new(), |rate| format!("{rate:.1}"));
        let _ = write!(
            text,
            "{:<8} {:>4} {:>8} {:>8} {rate:>9}",
            clean(&station.bus),
            station.station,
            station.asked,
            station.answered
        );
        for cell in response::cells(station) {
            let _ = write!(text, " {cell:>10}");
        }
        let _ = writeln!(text);
    }
    text.push_str(&response::notes(&stations, outcome.pipeline.buses()));
    text.push_str(&positions(&stations));
    text.push_str(&services(&stations));
    let _ =
        writeln!(text, "\n{:<24} {:>4} {:>8} {:<8} when", "finding", "who", "count", "severity");
    for finding in sorted(&tally.findings) {
        let who = finding.station.map_or(String::new(), |station| station.to_string());
        let (name, severity) = (finding.code.name, finding.code.severity.name());
        let when = outcome.clock.period(finding.period);
        let when = when.trim_start_matches(", ");
        let _ = writeln!(text, "{name:<24} {who:>4} {:>8} {severity:<8} {when}", finding.count);
    }
    if tally.findings.is_empty() {
        text.push_str("none\n");
    }
    text.push('\n');
    text.push_str(&measured(outcome.pipeline.buses()));
    text.push_str(&busyness(outcome.pipeline.buses()));
    for (name, count) in &tally.withheld {
        let _ = writeln!(text, "withheld {name}: {count} x");
    }
    // On a terminal, standard error says the rest right below.
    if !outcome.is_quiet && io::stdout().is_terminal() && io::stderr().is_terminal() {
        return text;
    }
    for bus in outcome.pipeline.buses() {
        for learned in Learned::of(bus) {
            let _ = writeln!(text, "auto {}: {learned}", clean(&bus.info().name));
        }
    }
    for (heading, line) in outcome.verdict().lines() {
        let _ = writeln!(text, "{heading:<6} {line}");
    }
    text
}

/// What was measured of each station over and over; nothing where nothing was. A String takes any
/// text.
fn measured(buses: &[Bus]) -> String {
    let mut text = String::new();
    for bus in buses {
        for Measurement { subject, station, spans, limit } in bus.measurements() {
            if text.is_empty() {
                text.push_str(
                    "bus       who measured            count       min      mean       max  deviation\n",
                );
            }
            let [min, mean, max] = [spans.min(), spans.mean(), spans.max()].map(Span);
            let deviation = Span(spans.deviation().cast_signed());
            let _ = write!(
                text,
                "{:<8} {station:>4} {subject:<16} {:>8} {:>9} {:>9} {:>9} {:>10}",
                clean(&bus.info().name),
                spans.count(),
                min.to_string(),
                mean.to_string(),
                max.to_string(),
                deviation.to_string(),
            );
            if let Some((limit, above)) = limit.filter(|(_, above)| *above > 0) {
                let _ = write!(text, "  {above} x above {}", Span(limit));
            }
            text.push('\n');
        }
    }
    if !text.is_empty() {
        text.push('\n');
    }
    text
}

/// Where stations were; nothing where no record told a position. A String takes any text.
fn positions(stations: &[&StationTally]) -> String {
    let mut text = String::new();
    for (station, it) in stations.iter().filter_map(|it| Some((it, it.positions?))) {
        if text.is_empty() {
            text.push_str("\nbus       who      first     lowest    highest       last\n");
        }
        let (bus, who) = (clean(&station.bus), station.station);
        let Positions { first, lowest, highest, last, .. } = it;
        let _ =
            writeln!(text, "{bus:<8} {who:>4} {first:>10} {lowest:>10} {highest:>10} {last:>10}");
    }
    text
}

/// What stations were asked for; nothing where the protocol has no services.
fn services(stations: &[&StationTally]) -> String {
    let mut text = String::new();
    for station in stations {
        for (name, count) in &station.services {
            if text.is_empty() {
                text.push_str("\nbus       who    count service\n");
            }
            let (bus, who) = (clean(&station.bus), station.station);
            let _ = writeln!(text, "{bus:<8} {who:>4} {count:>8} {}", clean(name));
        }
    }
    text
}

/// How busy the CAN buses were; nothing where there are none. A String takes any text.
fn busyness(buses: &[Bus]) -> String {
    let mut text = String::new();
    for bus in buses.iter().filter(|bus| bus.counts().frames > 0) {
        if text.is_empty() {
            text.push_str("bus        frames   errors   losses      load      peak  bit/s\n");
        }
        let (counts, load) = (bus.counts(), bus.load());
        let percent = |permille: Option<u16>| match permille {
            Some(permille) => format!("{}.{} %", permille / 10, permille % 10),
            None => "-".to_owned(),
        };
        let rate = bus.wire().baud().map_or("not known".to_owned(), |rate| rate.to_string());
        let _ = writeln!(
            text,
            "{:<8} {:>8} {:>8} {:>8} {:>9} {:>9}  {rate}",
            clean(&bus.info().name),
            counts.frames,
            counts.error_frames,
            counts.losses,
            percent(load.and_then(|load| load.mean())),
            percent(load.and_then(|load| load.peak())),
        );
    }
    if !text.is_empty() {
        text.push('\n');
    }
    text
}

/// The worst and the most frequent first.
fn sorted(findings: &[FindingTally]) -> Vec<&FindingTally> {
    let mut sorted: Vec<&FindingTally> = findings.iter().collect();
    sorted.sort_by_key(|finding| std::cmp::Reverse((finding.code.severity, finding.count)));
    sorted
}

fn as_json(outcome: &Outcome) -> Value {
    let tally = &outcome.tally;
    let verdict: Map<String, Value> = outcome
        .verdict()
        .lines()
        .into_iter()
        .map(|(heading, line)| (heading.to_lowercase(), line.into()))
        .collect();
    json!({
        "records": tally.records,
        "buses": outcome.pipeline.buses().iter().map(bus_json).collect::<Vec<_>>(),
        "stations": tally.sorted_stations().into_iter().map(station_json).collect::<Vec<_>>(),
        "measured": outcome.pipeline.buses().iter().flat_map(measured_json).collect::<Vec<_>>(),
        "findings": sorted(&tally.findings).into_iter().map(finding_json).collect::<Vec<_>>(),
        "withheld": tally.withheld,
        "verdict": verdict,
    })
}

fn bus_json(bus: &Bus) -> Value {
    let (counts, wire) = (bus.counts(), bus.wire());
    let mut object = json!({
        "bus": bus.info().name,
        "clock": bus.info().clock.map(|clock| clock.name()),
        "protocol": bus.protocol().map(|protocol| protocol.name),
        "baud": wire.baud().map(|baud| baud.get()),
        "frame": wire.format().to_string(),
        "inverted": bus.is_inverted(),
        "characters": counts.characters,
        "damaged": counts.damaged,
        "unknown_parity": counts.unknown_parity,
        "glitches": counts.glitches,
        "breaks": counts.breaks,
        "losses": counts.losses,
        "auto": bus.conclusions().into_iter().map(|conclusion| json!({
            "subject": conclusion.subject,
            "station": conclusion.station,
            "value": conclusion.value,
            "evidence": conclusion.evidence,
        })).collect::<Vec<_>>(),
    });
    if counts.cycles > 0 {
        object["cycles"] = counts.cycles.into();
        object["damaged_cycles"] = counts.bad_cycles.into();
    }
    let settings = bus.settings();
    if let Some(protocol) = bus.protocol().filter(|_| !settings.is_empty()) {
        object[protocol.name] = json!({ "profile": profile_json(settings) });
    }
    if counts.frames > 0 {
        let load = bus.load();
        let share = |permille: Option<u16>| permille.map(|load| f64::from(load) / 1_000.0);
        object["bitrate"] = wire.baud().map(|rate| rate.get()).into();
        object["frames"] = counts.frames.into();
        object["error_frames"] = counts.error_frames.into();
        object["load"] = share(load.and_then(|load| load.mean())).into();
        object["peak_load"] = share(load.and_then(|load| load.peak())).into();
    }
    object
}

/// The answers to what the protocol leaves open about its line: dots in keys separate objects.
fn profile_json(settings: Vec<Setting>) -> Value {
    let mut profile = json!({});
    for Setting { key, value, origin, evidence } in settings {
        let place = key.split('.').fold(&mut profile, |object, part| &mut object[part]);
        *place = json!({ "value": value, "origin": origin.name(), "evidence": evidence });
    }
    profile
}

fn station_json(station: &StationTally) -> Value {
    let named = |ns: [u64; 4]| response::HEADINGS.into_iter().zip(ns);
    let times: Option<Map<String, Value>> = response::percentiles(station)
        .map(|times| named(times).map(|(name, ns)| (name.to_owned(), ns.into())).collect());
    let uncertainty = times.is_some().then(|| station.uncertainty_of_response());
    let mut object = json!({
        "bus": station.bus,
        "station": station.station,
        "asked": station.asked,
        "answered": station.answered,
        "answers": station.answers,
        "rate_per_s": rate(station),
        "response_time_ns": times,
        "response_time_uncertainty_ns": uncertainty,
    });
    if let Some(Positions { first, lowest, highest, last, moved }) = station.positions {
        let moved_ns = moved.and_then(|time| time.ns());
        object["position"] = json!({
            "first": first, "lowest": lowest, "highest": highest, "last": last,
            "moved_ns": moved_ns,
        });
    }
    if !station.services.is_empty() {
        let services = station.services.iter();
        object["services"] = services
            .map(|(name, count)| (name.clone(), (*count).into()))
            .collect::<Map<_, _>>()
            .into();
    }
    add_period(&mut object, station.period);
    object
}

fn measured_json(bus: &Bus) -> impl Iterator<Item = Value> {
    let name = bus.info().name.clone();
    let all = bus.measurements().into_iter();
    all.map(move |Measurement { subject, station, spans, limit }| {
        let mut object = json!({
            "bus": name,
            "station": station,
            "subject": subject,
            "count": spans.count(),
            "min_ns": spans.min(),
            "mean_ns": spans.mean(),
            "max_ns": spans.max(),
            "deviation_ns": spans.deviation(),
        });
        if let Some((limit, above)) = limit {
            object["limit_ns"] = limit.into();
            object["above_limit"] = above.into();
        }
        object
    })
}

fn finding_json(finding: &FindingTally) -> Value {
    let mut object = json!({
        "code": finding.code.name,
        "severity": finding.code.severity.name(),
        "bus": finding.bus,
        "station": finding.station,
        "count": finding.count,
    });
    add_period(&mut object, finding.period);
    object
}

fn add_period(object: &mut Value, period: Period) {
    for (key, time) in [("first_ns", period.first), ("last_ns", period.last)] {
        if let Some(ns) = time.ns() {
            object[key] = ns.into();
        }
    }
}
