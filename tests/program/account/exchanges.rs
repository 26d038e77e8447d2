//! Requests and answers, as the account tells them: who answers what, and with which data.

use super::{Account, Compared, Sent, has_assumed};
use crate::harness::codes;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};

/// Faults that keep a message from being put together.
const BREAKING: [&str; 7] = [
    "fragment-sequence",
    "fragment-retry",
    "fragment-rejected",
    "fragment-unacknowledged",
    "node-restart",
    "shutdown",
    "unsaved-parameter",
];

/// A request that waits for its answer.
struct Open {
    service: Option<u8>,
    /// The record of its first frame.
    n: u64,
}

/// A message of which fragments have come.
#[derive(Default)]
struct Message {
    has_begun: bool,
    body: Vec<u8>,
    records: Vec<u64>,
}

/// What a bus is about at the moment.
#[derive(Default)]
pub struct Exchanges {
    /// By server and client, in the order in which they were asked.
    open: BTreeMap<(u8, u8), Vec<Open>>,
    /// By sender and receiver.
    messages: BTreeMap<(u8, u8), Message>,
    /// The last poll and production by station; the last strobe of all.
    polls: BTreeMap<u8, u64>,
    productions: BTreeMap<u8, u64>,
    strobe: Option<u64>,
    /// Servers of which a message was cut: what they are asked and say is not known to be so.
    unsure: BTreeSet<u8>,
    pub compared: Compared,
}

impl Exchanges {
    /// The tap lost something: what was asked before is not known to be answered.
    pub fn lose(&mut self) {
        let compared = std::mem::take(&mut self.compared);
        *self = Exchanges { compared, ..Exchanges::default() };
    }

    /// The tap has cut this frame: whatever message it was part of is lost.
    pub fn miss(&mut self, sent: &Sent, record: &Value) {
        match sent.station.filter(|_| sent.is_explicit()) {
            Some(station) => {
                self.unsure.insert(station);
                self.open(sent, record, false);
            }
            None => self.command(sent, record),
        }
    }

    /// A request begins, if it does: in place of the one before, or as a second one.
    fn open(&mut self, sent: &Sent, record: &Value, is_second: bool) {
        let is_begin = matches!(sent.fragment.as_deref(), None | Some("first"));
        if !is_begin || !sent.kind.ends_with("request") {
            return;
        }
        let server = sent.destination.expect("it has one");
        let open = self.open.entry((server, sent.source)).or_default();
        if !is_second {
            open.clear();
        }
        let service = sent.bytes().get(usize::from(sent.fragment.is_some()) + 1).copied();
        open.push(Open { service, n: record["n"].as_u64().expect("a number") });
    }

    /// The next frame, and its record.
    pub fn compare(&mut self, account: &Account, sent: &Sent, record: &Value, context: &str) {
        self.command(sent, record);
        let station = sent.station.unwrap_or(sent.source);
        match sent.kind.as_str() {
            "poll-response" => self.answers(self.polls.get(&station).copied(), record, context),
            "strobe-response" => self.answers(self.strobe, record, context),
            "io-ack" => self.answers(self.productions.get(&station).copied(), record, context),
            _ if sent.is_explicit() && sent.fragment.as_deref() != Some("ack") => {
                self.message(account, sent, record, context);
            }
            _ => {}
        }
    }

    /// What asks for an answer, if this does.
    fn command(&mut self, sent: &Sent, record: &Value) {
        let n = record["n"].as_u64().expect("a number");
        let station = sent.station.unwrap_or(sent.source);
        match sent.kind.as_str() {
            "poll-command" => drop(self.polls.insert(station, n)),
            "strobe-command" => self.strobe = Some(n),
            "cos" | "cyclic" => drop(self.productions.insert(station, n)),
            _ => {}
        }
    }

    /// An answer names what it answers, unless the analyzer knows that it saw no such thing.
    fn answers(&mut self, request: Option<u64>, record: &Value, context: &str) {
        let told = record["devicenet"]["request"].as_u64();
        let excuses = ["devicenet.unsolicited-response", "devicenet.unexpected-ack"];
        let codes = codes(record);
        let is_excused = codes.iter().any(|code| excuses.contains(&code.as_str()))
            || has_assumed(record, "allocation")
            || has_assumed(record, "start");
        if told.is_some() || !is_excused {
            assert_eq!(told, request, "{context}");
            self.compared.answers += 1;
        }
    }

    fn message(&mut self, account: &Account, sent: &Sent, record: &Value, context: &str) {
        let n = record["n"].as_u64().expect("a number");
        let bytes = sent.bytes();
        let ends = (sent.source, sent.destination.expect("explicit messages have one"));
        let head = if sent.fragment.is_some() { 2 } else { 1 };
        let is_begin = matches!(sent.fragment.as_deref(), None | Some("first"));
        let message = self.messages.entry(ends).or_default();
        if is_begin {
            *message = Message { has_begun: true, ..Message::default() };
        }
        message.body.extend(&bytes[head..]);
        message.records.push(n);
        let is_broken = sent.fragment.is_some() && account.is_excused(sent, &BREAKING)
            || !message.has_begun
            || sent.fragment.is_some() && self.unsure.contains(&sent.station.unwrap_or(ends.0));
        let is_request = sent.kind.ends_with("request");
        self.open(sent, record, account.is_excused(sent, &["xid-busy"]));
        if sent.service.is_some() && !is_broken {
            self.whole(sent, record, context);
        }
        if !is_request && sent.service.is_some() {
            self.answer(account, sent, record, ends, context);
        }
    }

    /// A whole message, or its last fragment.
    fn whole(&mut self, sent: &Sent, record: &Value, context: &str) {
        let told = &record["devicenet"];
        let message = &self.messages[&(sent.source, sent.destination.expect("it has one"))];
        if sent.fragment.is_some() {
            assert_eq!(told["fragments"], json!(message.records), "{context}");
            self.compared.messages += 1;
        }
        let is_request = sent.kind.ends_with("request");
        let [service, rest @ ..] = &message.body[..] else { panic!("{context}") };
        assert_eq!(told["service_code"], service & 0x7F, "{context}");
        assert_eq!(told["response"], !is_request, "{context}");
        // An answer repeats nothing of the request; what it is about is known from that.
        let is_answered = is_request || told.get("request").is_some();
        let about = [("class", sent.class), ("instance", sent.instance)];
        for (key, value) in about.into_iter().chain([("attribute", sent.attribute)]) {
            if is_answered || told.get(key).is_some() {
                assert_eq!(told[key].as_u64(), value.map(u64::from), "{key}: {context}");
            }
        }
        let path = about.iter().filter(|(_, value)| value.is_some()).count()
            + usize::from(sent.attribute.is_some());
        let data = &rest[if is_request { path } else { 0 }..];
        let hex: String = data.iter().map(|byte| format!("{byte:02X}")).collect();
        assert_eq!(told["data"].as_str().unwrap_or(""), hex, "{context}");
        let is_good = *service != 0x94;
        if let (Some(value), true) = (value(sent, data), is_answered && is_good) {
            // How the encoder's own class is read is not known from the beginning.
            let is_known = sent.class != Some(0x2F) || told.get("class_name").is_some();
            if is_known || told.get("value").is_some() {
                assert_eq!(told["value"], value, "{context}");
                self.compared.values += 1;
            }
        }
    }

    fn answer(
        &mut self,
        account: &Account,
        sent: &Sent,
        record: &Value,
        (server, client): (u8, u8),
        context: &str,
    ) {
        let open = self.open.entry((server, client)).or_default();
        let place = open.iter().position(|open| open.service == sent.service);
        let request = place.map(|place| open.remove(place).n);
        let is_unsure = self.unsure.remove(&server);
        if !account.is_excused(sent, &BREAKING) && !is_unsure {
            self.answers(request, record, context);
        }
    }
}

/// What data are worth: little-endian, in the types of CIP Vol. 1 (identity, connection) and of the
/// manual §8 (encoder position).
fn value(sent: &Sent, data: &[u8]) -> Option<Value> {
    let number = |bytes: &[u8]| bytes.iter().rev().fold(0, |sum, byte| sum << 8 | u64::from(*byte));
    match (sent.class?, sent.attribute?, data) {
        // Vendor, type, product; sizes, packet rate, inhibit time.
        (0x01, 1..=3, [_, _]) | (0x05, 4 | 5 | 7..=9 | 17, [_, _]) => Some(json!(number(data))),
        // Major and minor revision.
        (0x01, 4, [major, minor]) => Some(json!([major, minor])),
        (0x01, 6, [_, _, _, _]) => Some(json!(number(data))),
        // Product name: its length, and as many letters.
        (0x01, 7, [length, name @ ..]) if usize::from(*length) == name.len() => {
            Some(json!(String::from_utf8_lossy(name)))
        }
        (0x2F, 7..=12, [_, _, _, _]) => Some(json!(number(data))),
        _ => None,
    }
}
