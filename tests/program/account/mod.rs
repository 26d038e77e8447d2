//! The simulator's account of a DeviceNet bus, held against what was decoded of the capture: each
//! frame, and each fault. The simulator shares nothing with the dissectors.

mod exchanges;

use crate::harness::{Scratch, argument, codes, fieldtap};
use exchanges::Exchanges;
use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeSet;

/// A frame as it was sent.
#[derive(Deserialize, Debug)]
pub struct Sent {
    /// Its number among those that the tap hears whole.
    pub frame: Option<u64>,
    pub time_ns: i64,
    pub data: String,
    pub kind: String,
    pub source: u8,
    pub destination: Option<u8>,
    pub station: Option<u8>,
    pub fragment: Option<String>,
    pub service: Option<u8>,
    pub class: Option<u8>,
    pub instance: Option<u8>,
    pub attribute: Option<u8>,
    pub position: Option<u32>,
}

impl Sent {
    pub fn bytes(&self) -> Vec<u8> {
        let digits = |at: usize| u8::from_str_radix(&self.data[at..at + 2], 16).expect("hex");
        (0..self.data.len()).step_by(2).map(digits).collect()
    }

    pub fn is_explicit(&self) -> bool {
        ["explicit-request", "explicit-response", "unconnected-request", "unconnected-response"]
            .contains(&self.kind.as_str())
    }

    fn is_io(&self) -> bool {
        ["poll-", "strobe-", "cos", "cyclic", "io-ack"].iter().any(|io| self.kind.starts_with(io))
    }

    /// Nobody's, as far as DeviceNet goes.
    fn is_strange(&self) -> bool {
        ["foreign", "reserved"].contains(&self.kind.as_str())
    }
}

/// A fault that was injected.
#[derive(Deserialize, Debug)]
struct Struck {
    fault: String,
    station: u8,
    code: String,
    time_ns: i64,
    until_ns: i64,
    may: BTreeSet<String>,
}

/// Stamps of a log are in µs, and at the end of a frame.
const SLACK_NS: i64 = 60_000;

impl Struck {
    fn covers(&self, time_ns: i64, station: Option<&Value>) -> bool {
        let is_hers = station.is_none_or(|station| station == self.station);
        let span = self.time_ns - SLACK_NS..=self.until_ns + SLACK_NS;
        is_hers && span.contains(&time_ns)
    }
}

/// What happened on a bus.
pub struct Account {
    frames: Vec<Sent>,
    faults: Vec<Struck>,
    /// Codes that the capture must raise as a whole.
    expected: BTreeSet<String>,
}

/// How much was compared.
#[derive(Default, Debug)]
pub struct Compared {
    pub frames: usize,
    pub faults: usize,
    /// Answers with the request that they answer.
    pub answers: usize,
    pub values: usize,
    /// Messages that were put together of fragments.
    pub messages: usize,
    /// Findings above info.
    pub findings: usize,
}

impl Compared {
    pub fn add(&mut self, other: &Compared) {
        self.frames += other.frames;
        self.faults += other.faults;
        self.answers += other.answers;
        self.values += other.values;
        self.messages += other.messages;
        self.findings += other.findings;
    }
}

impl Account {
    fn of(text: &str) -> Self {
        let mut account =
            Account { frames: Vec::new(), faults: Vec::new(), expected: BTreeSet::new() };
        for line in text.lines() {
            let told: Value = serde_json::from_str(line).expect(line);
            if let Some(expected) = told["bus"]["expect"].as_array() {
                let names = expected.iter().filter_map(Value::as_str).map(str::to_owned);
                account.expected = names.collect();
            } else if told["fault"].is_string() {
                account.faults.push(serde_json::from_value(told).expect(line));
            } else {
                let sent: Sent = serde_json::from_value(told).expect(line);
                account.frames.extend(sent.frame.is_some().then_some(sent));
            }
        }
        account
    }

    /// Whether one of these faults explains what is odd about a frame.
    pub fn is_excused(&self, sent: &Sent, faults: &[&str]) -> bool {
        let station = sent.station.map(Value::from);
        let mut excuses = self.faults.iter().filter(|it| faults.contains(&it.fault.as_str()));
        excuses.any(|fault| fault.covers(sent.time_ns, station.as_ref()))
    }
}

/// Simulates a bus, reads it, and holds every record and finding against the account.
pub fn check(form: &str, simulate: &[&str], read: &[&str]) -> Compared {
    let scratch = Scratch::new();
    let (capture, truth) = (scratch.path(&format!("bus.{form}")), scratch.path("truth"));
    let mut arguments = vec!["simulate", "devicenet", "-q", "-o", argument(&capture)];
    arguments.extend(["--truth", argument(&truth)]);
    arguments.extend_from_slice(simulate);
    fieldtap(arguments).good();
    let account = Account::of(&std::fs::read_to_string(truth).expect("it was written"));
    let mut arguments = vec!["read", "-q", "--format", "json", argument(&capture)];
    arguments.extend_from_slice(read);
    let run = fieldtap(arguments).good();
    let records: Vec<Value> =
        run.stdout.lines().map(|line| serde_json::from_str(line).expect(line)).collect();
    let context = format!("{form} {simulate:?}");
    let mut compared = compare_frames(&account, &records, &context);
    compared.faults = account.faults.len();
    account.faults.iter().for_each(|fault| find(fault, &records, &context));
    compared.findings = explain(&account, &records, &context);
    compared
}

/// Every frame has its record, in order, that says what the account says.
fn compare_frames(account: &Account, records: &[Value], context: &str) -> Compared {
    let mut frames = account.frames.iter();
    let mut exchanges = Exchanges::default();
    for record in records {
        let codes = codes(record);
        let has = |code: &str| codes.iter().any(|other| other == code);
        if ["event", "can-error", "lost"].contains(&record["kind"].as_str().expect("text")) {
            if has("can.dropped") || has("can.bus-off") {
                exchanges.lose();
            }
            continue;
        }
        let sent = frames.next().unwrap_or_else(|| panic!("nobody sent {record}: {context}"));
        let context = format!("{context}\n{sent:?}\n{record}");
        if has("can.truncated") {
            // Whose message it is stands in the identifier, but for requests of the message
            // manager; a strobe is for all.
            if !["ucmm-request", "strobe-command"].contains(&sent.kind.as_str()) {
                assert_eq!(record["station"].as_u64(), sent.station.map(u64::from), "{context}");
            }
            exchanges.miss(sent, record);
            continue;
        }
        assert_eq!(record["can"]["data"].as_str().unwrap_or(""), sent.data, "{context}");
        compare_kind(account, sent, record, &context);
        compare_roles(sent, record, &context);
        compare_io(sent, record, &context);
        exchanges.compare(account, sent, record, &context);
    }
    assert_eq!(frames.count(), 0, "{context}");
    Compared { frames: account.frames.len(), ..exchanges.compared }
}

pub fn has_assumed(record: &Value, what: &str) -> bool {
    let assumed = record["devicenet"]["assumed"].as_array();
    assumed.is_some_and(|all| all.iter().any(|one| one == what))
}

/// Who produces cyclically is only known where the allocation was seen, and holds; what a slave
/// answers, where the request was.
fn compare_kind(account: &Account, sent: &Sent, record: &Value, context: &str) {
    let is_released = account.is_excused(sent, &["not-allocated"]);
    let is_known = match sent.kind.as_str() {
        "cyclic" => !has_assumed(record, "allocation") && !is_released,
        "unconnected-response" => !has_assumed(record, "start"),
        _ => true,
    };
    let kind = match (sent.kind.as_str(), is_known) {
        ("cyclic", false) if record["kind"] == "cos" => "cos",
        ("unconnected-response", false) => "explicit-response",
        (kind, _) => kind,
    };
    assert_eq!(record["kind"], kind, "{context}");
    let fragment = record["devicenet"]["fragment"]["type"].as_str();
    assert_eq!(fragment, sent.fragment.as_deref(), "{context}");
}

fn compare_roles(sent: &Sent, record: &Value, context: &str) {
    let told = &record["devicenet"];
    // A command to all slaves is the record of its master.
    let own = record.get("station").map(|_| sent.source);
    let station = sent.station.or(own);
    assert_eq!(record["station"].as_u64(), station.map(u64::from), "{context}");
    let is_unknown = sent.is_strange() || sent.is_io() && has_assumed(record, "allocation");
    for (role, mac) in [("source", Some(sent.source)), ("destination", sent.destination)] {
        if told.get(role).is_some() || !is_unknown {
            assert_eq!(told[role].as_u64(), mac.map(u64::from), "{role}: {context}");
        }
    }
}

/// The position is told where the length is that of an assembly: four bytes, or five with flags.
fn compare_io(sent: &Sent, record: &Value, context: &str) {
    if sent.is_io() && matches!(sent.data.len(), 8 | 10) {
        let position = record["devicenet"]["io"]["position"].as_u64();
        assert_eq!(position, sent.position.map(u64::from), "{context}");
    }
}

/// A fault is told by its code, at its place.
fn find(fault: &Struck, records: &[Value], context: &str) {
    let is_it = |record: &&Value| {
        let time = record["time_ns"].as_i64().expect("a time");
        fault.covers(time, record.get("station")) && codes(record).contains(&fault.code)
    };
    assert!(records.iter().any(|record| is_it(&record)), "missed {fault:?}: {context}");
}

/// No finding above info is without its fault. Returns how many there are.
fn explain(account: &Account, records: &[Value], context: &str) -> usize {
    let mut raised = BTreeSet::new();
    let mut count = 0;
    for record in records {
        let time = record["time_ns"].as_i64().expect("a time");
        for finding in record["findings"].as_array().expect("an array") {
            let code = finding["code"].as_str().expect("text");
            raised.insert(code.to_owned());
            if finding["severity"] == "info" || account.expected.contains(code) {
                continue;
            }
            count += 1;
            let explains = |fault: &Struck| {
                let names = fault.code == code || fault.may.contains(code);
                names && fault.covers(time, record.get("station"))
            };
            assert!(account.faults.iter().any(explains), "invented {finding}: {context}\n{record}");
        }
    }
    assert!(account.expected.is_subset(&raised), "missed: {context}\n{raised:?}");
    count
}
