//! What a run has seen, counted: the basis of the last lines and of `stats`.

use dissectors::event::Moment;
use dissectors::field::{Role, Value};
use dissectors::finding::{Code, Cure, Finding, Severity, State};
use dissectors::record::{Record, Sink, Turn};
use hdrhistogram::Histogram;
use std::collections::BTreeMap;

/// Significant digits of response times.
const DIGITS: u8 = 3;

/// Requests to one station that may be open at once.
const OPEN: usize = 4;

/// First and last time of something.
#[derive(Clone, Copy, Debug)]
pub struct Period {
    /// When it was first seen; unknown where the source has no times.
    pub first: Moment,
    /// When it was last seen.
    pub last: Moment,
}

impl Period {
    /// No time at all.
    pub const NEVER: Period = Period { first: Moment::UNKNOWN, last: Moment::UNKNOWN };

    fn add(&mut self, time: Moment) {
        if !self.first.is_known() {
            self.first = time;
        }
        if time.is_known() {
            self.last = time;
        }
    }

    /// From first to last in ns.
    pub fn length(&self) -> Option<i64> {
        self.last.since(self.first)
    }
}

/// What is known of one station on one bus.
#[derive(Clone, Debug)]
pub struct StationTally {
    /// The bus it is on.
    pub bus: String,
    /// Its number.
    pub station: u16,
    /// How often it was asked.
    pub asked: u64,
    /// How often it answered when it was asked.
    pub answered: u64,
    /// Records of answers, asked for or not.
    pub answers: u64,
    /// When it was asked or answered.
    pub period: Period,
    /// Its response times in ns.
    pub response_times: Histogram<u32>,
    /// Largest ± of the stamps that these were taken from, in ns.
    uncertainty: u32,
    /// Where it was.
    pub positions: Option<Positions>,
    /// What it was asked for, by name, in the order that was first done.
    pub services: Vec<(String, u64)>,
    /// The last requests to it that were not answered yet; 0 is none.
    open: [i64; OPEN],
    /// The request that was answered last.
    last_answered: Option<i64>,
}

/// The positions of a station in records without an error.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Positions {
    /// The first.
    pub first: i64,
    /// The lowest.
    pub lowest: i64,
    /// The highest.
    pub highest: i64,
    /// The last.
    pub last: i64,
    /// When it last changed, if it ever did.
    pub moved: Option<Moment>,
}

impl Positions {
    const fn new(first: i64) -> Self {
        Positions { first, lowest: first, highest: first, last: first, moved: None }
    }

    fn add(&mut self, position: i64, time: Moment) {
        self.lowest = self.lowest.min(position);
        self.highest = self.highest.max(position);
        if std::mem::replace(&mut self.last, position) != position {
            self.moved = Some(time);
        }
    }
}

/// One finding code at one station, or at none.
#[derive(Clone, Debug)]
pub struct FindingTally {
    /// The code.
    pub code: &'static Code,
    /// The bus.
    pub bus: String,
    /// The station it concerns.
    pub station: Option<u16>,
    /// How often: the begin of a state and its repeats, not its end.
    pub count: u64,
    /// When.
    pub period: Period,
    /// What to do first, each with how often it was the right thing.
    cures: Vec<(&'static Cure, u64)>,
}

impl FindingTally {
    fn add(&mut self, time: Moment, cure: &'static Cure) {
        self.count += 1;
        self.period.add(time);
        match self.cures.iter_mut().find(|(known, _)| *known == cure) {
            Some((_, count)) => *count += 1,
            None => self.cures.push((cure, 1)),
        }
    }

    /// What to do first: what helps against most of them.
    pub fn cure(&self) -> &'static Cure {
        let most = self.cures.iter().rev().max_by_key(|(_, count)| *count);
        most.map_or(&self.code.cure, |(cure, _)| cure)
    }
}

/// Everything that was counted.
#[derive(Default)]
pub struct Tally {
    /// Records.
    pub records: u64,
    /// Stations, in the order they appeared.
    pub stations: Vec<StationTally>,
    /// Findings, in the order they appeared.
    pub findings: Vec<FindingTally>,
    /// Judgements that were withheld, by code.
    pub withheld: BTreeMap<&'static str, u64>,
    /// The time of all records.
    pub period: Option<Period>,
    /// Largest ± of a stamp in ns.
    pub uncertainty: u32,
    /// Lines of the sources that could not be read and were left out.
    pub unread: u64,
    /// The numbers of all stations that records were of, a bit each.
    heard: [u64; 16],
    /// Where the stations of each bus stand.
    places: Vec<Places>,
}

/// The stations of a bus: by their number, where each stands among all.
#[derive(Default)]
struct Places {
    bus: String,
    by_station: Vec<Option<usize>>,
}

impl StationTally {
    /// ± of its response times in ns: that of the request's stamp and that of the answer's.
    pub fn uncertainty_of_response(&self) -> i64 {
        2 * i64::from(self.uncertainty)
    }

    fn add_turn(&mut self, record: &Record<'_>) {
        self.period.add(record.start);
        if record.turn == Turn::Asks {
            self.asked += 1;
            self.count_service(record);
            self.open.rotate_right(1);
            self.open[0] = record.n.cast_signed();
            return;
        }
        self.answers += 1;
        let Value::Int(request) = record.by_role(Role::Request) else { return };
        // One request has one answer, but a command to many stations has many.
        if self.last_answered != Some(request) {
            self.last_answered = Some(request);
            match self.open.iter_mut().find(|open| **open == request) {
                Some(open) => *open = 0,
                None => {
                    self.asked += 1;
                    self.count_service(record);
                }
            }
            self.answered += 1;
            if let Value::Int(ns) = record.by_role(Role::ResponseTime) {
                self.uncertainty = self.uncertainty.max(record.uncertainty);
                // The histogram grows with its values.
                let _ = self.response_times.record(u64::try_from(ns).unwrap_or(0));
            }
        }
    }

    fn count_service(&mut self, record: &Record<'_>) {
        let Value::Text(name) = record.by_role(Role::Service) else { return };
        match self.services.iter_mut().find(|(known, _)| known == name) {
            Some((_, count)) => *count += 1,
            None => self.services.push((name.to_owned(), 1)),
        }
    }
}

impl Tally {
    /// The worst severity found.
    pub fn worst(&self) -> Option<Severity> {
        self.findings.iter().map(|finding| finding.code.severity).max()
    }

    /// How often anything this bad was found.
    pub fn count(&self, severity: Severity) -> u64 {
        let this_bad = self.findings.iter().filter(|finding| finding.code.severity == severity);
        this_bad.map(|finding| finding.count).sum()
    }

    /// Whether a record was of the station of this number, on any bus.
    pub fn has_heard(&self, station: u16) -> bool {
        let bits = self.heard.get(usize::from(station / 64));
        bits.is_none_or(|bits| bits & (1 << (station % 64)) != 0)
    }

    /// The stations by bus and number.
    pub fn sorted_stations(&self) -> Vec<&StationTally> {
        let mut stations: Vec<&StationTally> = self.stations.iter().collect();
        stations.sort_by_key(|it| (&it.bus, it.station));
        stations
    }

    /// The numbers of these stations, lowest first.
    pub fn heard(&self) -> impl Iterator<Item = u16> {
        (0..64 * self.heard.len() as u16).filter(|station| self.has_heard(*station))
    }

    fn station(&mut self, bus: &str, station: u16) -> usize {
        let Tally { stations, places, .. } = self;
        let bus_index = places.iter().position(|places| places.bus == bus).unwrap_or_else(|| {
            places.push(Places { bus: bus.to_owned(), ..Places::default() });
            places.len() - 1
        });
        let by_station = &mut places[bus_index].by_station;
        let number = usize::from(station);
        if by_station.len() <= number {
            by_station.resize(number + 1, None);
        }
        *by_station[number].get_or_insert_with(|| {
            stations.push(StationTally {
                bus: bus.to_owned(),
                station,
                asked: 0,
                answered: 0,
                answers: 0,
                period: Period::NEVER,
                response_times: histogram(),
                uncertainty: 0,
                positions: None,
                services: Vec::new(),
                open: [0; OPEN],
                last_answered: None,
            });
            stations.len() - 1
        })
    }

    /// What a record tells of its station: that it was asked or answered, and where it is.
    fn add_station(&mut self, record: &Record<'_>, station: u16) {
        let position = match record.by_role(Role::Position) {
            Value::Int(position) => Some(position),
            _ => None,
        };
        if position.is_none() && record.turn == Turn::Neither {
            return;
        }
        let index = self.station(&record.bus.name, station);
        let tally = &mut self.stations[index];
        let is_wrong = |finding: &Finding| finding.severity() == Severity::Error;
        if let Some(position) = position.filter(|_| !record.findings.iter().any(is_wrong)) {
            let positions = tally.positions.get_or_insert(Positions::new(position));
            positions.add(position, record.start);
        }
        if record.turn != Turn::Neither {
            tally.add_turn(record);
        }
    }
    fn add_findings(&mut self, record: &Record<'_>) {
        let is_end = |finding: &&Finding| matches!(finding.state, Some(State::End(_)));
        let told = record.findings.iter().filter(|finding| !is_end(finding));
        let told = told.map(|finding| (finding.code, finding.cure()));
        let ongoing = record.ongoing.iter().map(|code| (*code, &code.cure));
        for (code, cure) in told.chain(ongoing) {
            self.finding(code, record).add(record.start, cure);
        }
        for code in record.withheld {
            *self.withheld.entry(code.name).or_default() += 1;
        }
    }

    fn finding(&mut self, code: &'static Code, record: &Record<'_>) -> &mut FindingTally {
        let (bus, station) = (&record.bus.name, record.station);
        let is_it = |tally: &FindingTally| {
            tally.code == code && tally.station == station && tally.bus == *bus
        };
        let index = self.findings.iter().position(is_it).unwrap_or_else(|| {
            let (bus, period) = (bus.clone(), Period::NEVER);
            let cures = Vec::new();
            self.findings.push(FindingTally { code, bus, station, count: 0, period, cures });
            self.findings.len() - 1
        });
        &mut self.findings[index]
    }
}

impl Sink for Tally {
    fn record(&mut self, record: &Record<'_>) {
        self.records += 1;
        self.period.get_or_insert(Period::NEVER).add(record.start);
        self.uncertainty = self.uncertainty.max(record.uncertainty);
        let station = record.station.or_else(|| sender(record));
        let place =
            station.and_then(|it| Some((it % 64, self.heard.get_mut(usize::from(it / 64))?)));
        if let Some((bit, bits)) = place {
            *bits |= 1 << bit;
        }
        if let Some(station) = record.station {
            self.add_station(record, station);
        }
        self.add_findings(record);
    }
}

/// Who sent what is of no station: a node that looks whether its number is free.
fn sender(record: &Record<'_>) -> Option<u16> {
    match record.by_role(Role::Source) {
        Value::Int(source) => u16::try_from(source).ok(),
        _ => None,
    }
}

/// It grows with the longest time, not with their number: of 512 devices with times up to 40 ms all
/// take 40 MB, half of what counts of 64 bits take.
fn histogram() -> Histogram<u32> {
    // Three digits are among those it allows; the fallback is never needed.
    Histogram::new(DIGITS).unwrap_or_else(|_| unreachable!("three digits are allowed"))
}
