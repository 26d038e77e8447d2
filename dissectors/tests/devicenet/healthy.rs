//! Healthy buses: nothing to complain of, wherever a capture begins.

use crate::bus::{Heard, Told, decode, frame_ns};

/// Findings that are only worth knowing.
const INFOS: [&str; 5] = ["not-allocated", "unexpected-ack", "xid-busy", "delta-ignored", "idle"];

/// Collects frames, each after a pause in ms.
#[derive(Default)]
struct Line {
    ms: f64,
    heard: Vec<Heard>,
    /// The index of the first Allocate.
    allocate: Option<usize>,
}

impl Line {
    fn send(&mut self, pause: f64, frame: &str) {
        self.ms += pause;
        if frame.starts_with("4BE#004B") && self.allocate.is_none() {
            self.allocate = Some(self.heard.len());
        }
        self.heard.push(Heard::Frame(frame_ns((self.ms * 1e6) as i64, frame)));
    }

    /// A request to node 23 and its answer.
    fn ask(&mut self, request: &str, answer: &str) {
        self.send(3.0, &format!("4BC#{request}"));
        self.send(1.5, &format!("4BB#{answer}"));
    }

    /// Node 23 is switched on, master 0 looks for a UCMM and allocates what the choice says.
    fn start(&mut self, choice: &str, instance: u8, rate: &str) {
        self.send(1.0, "4BF#00D40101000000");
        self.send(1_000.0, "4BF#00D40101000000");
        self.send(2_000.0, "780#174B0234");
        self.send(1_000.0, "780#174B0234");
        self.send(1_000.0, "4BE#004B03010100");
        self.send(2.0, "4BB#00CB00");
        self.ask(&format!("004B0301{choice}00"), "00CB00");
        self.ask("000E010101", "008ED401");
        self.ask("001005010C03", "0090");
        self.ask(&format!("0010050{instance}09{rate}"), &format!("0090{rate}"));
        self.ask(&format!("000E050{instance}07"), "008E0400");
        self.ask(&format!("000E050{instance}08"), "008E0000");
    }

    /// Writes four bytes, which takes two fragments, and saves.
    fn write(&mut self) {
        for (frame, pause) in [
            ("4BC#8000102F010A4523", 3.0),
            ("4BB#80C000", 1.0),
            ("4BC#80810100", 1.0),
            ("4BB#80C100", 1.0),
            ("4BB#0090", 2.0),
            ("4BC#00162F01", 5.0),
            ("4BB#0096", 40.0),
        ] {
            self.send(pause, frame);
        }
        // The attribute list is longer than a frame: 20 ids.
        self.send(1.0, "4BC#000E2F0102");
        for (count, byte) in [(0, "00"), (1, "41"), (2, "42"), (3, "83")] {
            self.send(1.0, &format!("4BB#80{byte}8E0102030405"));
            self.send(1.0, &format!("4BC#80C{count}00"));
        }
    }

    fn stop(&mut self) {
        self.send(3.0, "4BE#004C030103");
        self.send(1.0, "4BB#00CC");
    }
}

fn polled() -> Line {
    let mut line = Line::default();
    line.start("02", 2, "4B00");
    for cycle in 0..40 {
        line.send(50.0, "4BD#");
        line.send(1.2, &format!("3D7#{cycle:02X}000000"));
        if cycle == 10 {
            line.write();
        }
    }
    line.stop();
    line
}

fn changing(choice: &str, rate: &str, is_acknowledged: bool) -> Line {
    let mut line = Line::default();
    line.start(choice, 4, rate);
    for cycle in 0..40 {
        // A write takes 65 ms, and the rate is 100 ms.
        line.send(if cycle == 11 { 25.0 } else { 90.0 }, &format!("357#{cycle:02X}000000"));
        if is_acknowledged {
            line.send(0.8, "4BA#");
        }
        if cycle == 10 {
            line.write();
        }
    }
    line
}

fn strobed() -> Line {
    let mut line = Line::default();
    line.start("04", 3, "4B00");
    for cycle in 0..40 {
        line.send(50.0, "400#0000800000000000");
        line.send(1.2, &format!("397#{cycle:02X}000000"));
    }
    line
}

/// A slave that produces ten bytes.
fn fragmented() -> Line {
    let mut line = Line::default();
    line.start("02", 2, "4B00");
    line.ask("000E050207", "008E0A00");
    for cycle in 0..40 {
        line.send(50.0, "4BD#");
        line.send(1.2, &format!("3D7#00{cycle:02X}020304050607"));
        line.send(0.8, "3D7#8108090A");
    }
    line
}

/// A master asks the slaves of multicast group 9 at once.
fn multicast() -> Line {
    let mut line = Line::default();
    line.start("08", 5, "4B00");
    for cycle in 0..40 {
        line.send(50.0, "449#01");
        line.send(1.2, &format!("317#{cycle:02X}000000"));
    }
    line
}

fn restarted() -> Line {
    let mut line = polled();
    line.allocate = None;
    line.ms += 20_000.0;
    let again = polled();
    let start = (line.ms * 1e6) as i64;
    let offset = line.heard.len();
    for heard in again.heard {
        if let Heard::Frame(mut frame) = heard {
            frame.start = frame.start.plus(start);
            line.heard.push(Heard::Frame(frame));
        }
    }
    line.allocate = again.allocate.map(|index| index + offset);
    line
}

fn lines() -> Vec<(&'static str, Line)> {
    vec![
        ("poll", polled()),
        ("change of state", changing("10", "6400", true)),
        ("change of state without acknowledge", changing("50", "6400", false)),
        ("cyclic", changing("20", "6400", true)),
        ("strobe", strobed()),
        ("fragmented", fragmented()),
        ("multicast", multicast()),
        ("switched off and on", restarted()),
    ]
}

/// What a record says, its numbers counted from the first record that is compared.
fn meaning(told: &Told, first: u64) -> String {
    let mut fields = told.fields.clone();
    for numbers in ["request", "fragments"] {
        if let Some(text) = fields.get_mut(numbers) {
            let shifted = text.split(' ').map(|n| n.parse::<i64>().unwrap() - first as i64);
            *text = format!("{:?}", shifted.collect::<Vec<_>>());
        }
    }
    let n = told.n - first;
    format!("{n} {:?} {} {:?} {:?} {fields:?}", told.ns, told.kind, told.codes, told.summary)
}

#[test]
fn healthy_traffic_is_healthy_from_any_frame_on() {
    for (name, line) in lines() {
        let end = Some((line.ms * 1e6) as i64);
        for start in 0..line.heard.len() {
            for told in decode(&line.heard[start..], end) {
                let bad = told
                    .codes
                    .iter()
                    .find(|code| !INFOS.contains(&code.trim_end_matches(['+', '-'])));
                assert_eq!(bad, None, "{name} from frame {start}: {told:?}");
            }
        }
    }
}

#[test]
fn from_the_first_allocate_on_a_late_start_makes_no_difference() {
    for (name, line) in lines() {
        let end = Some((line.ms * 1e6) as i64);
        let allocate = line.allocate.unwrap();
        let from = match &line.heard[allocate] {
            Heard::Frame(frame) => frame.start.ns(),
            _ => None,
        };
        let after = |told: &[Told]| -> Vec<String> {
            let after = told.iter().filter(|told| told.ns >= from);
            let first = after.clone().next().unwrap().n;
            after.map(|told| meaning(told, first)).collect()
        };
        let whole = after(&decode(&line.heard, end));
        for start in 0..=allocate {
            let late = after(&decode(&line.heard[start..], end));
            for (late, whole) in late.iter().zip(&whole) {
                assert_eq!(late, whole, "{name} from frame {start}");
            }
            assert_eq!(late.len(), whole.len(), "{name} from frame {start}");
        }
    }
}
