//! Lines of rings, coded in any way: what is concluded about them is right, or it is not concluded.
//! Codings that give the same bits on the wires count as equal.

use crate::harness::{Scratch, argument, fieldtap, say};
use serde_json::Value;

/// Lines that are tried unless `FIELDTAP_LINES` says another number.
const LINES: u64 = 24;

/// The coding that was concluded, and the one that was simulated with its cycles.
struct Line {
    found: Value,
    coding: Value,
    ring: Vec<Value>,
    cycles: Vec<Value>,
}

impl Line {
    fn of(seed: u64, more: &[&str]) -> Line {
        let scratch = Scratch::new();
        let (capture, truth) = (scratch.path("line.sr"), scratch.path("truth"));
        let seed = seed.to_string();
        let files = ["-q", "-o", argument(&capture), "--truth", argument(&truth)];
        let coding = ["--random-profile", &seed, "--seed", &seed];
        let simulate = ["simulate", "interbus"].iter().chain(&files).chain(&coding).chain(more);
        fieldtap(simulate).good();
        let stats = ["stats", "--format", "json", "--protocol", "interbus", argument(&capture)];
        let stats: Value = serde_json::from_str(&fieldtap(stats).good().stdout).expect("JSON");
        let account = std::fs::read_to_string(truth).expect("the account was written");
        let mut lines =
            account.lines().map(|line| serde_json::from_str::<Value>(line).expect(line));
        let mut bus = lines.next().expect("a first line")["bus"].take();
        let ring = bus["ring"].as_array().expect("a ring").clone();
        Line {
            found: stats["buses"][0]["interbus"]["profile"].clone(),
            coding: bus["profile"].take(),
            ring,
            cycles: lines.filter(|line| line["cycle"].is_u64()).collect(),
        }
    }

    /// A conclusion, if there is one.
    fn found(&self, path: &str) -> Option<&str> {
        let found = path.split('.').fold(&self.found, |value, key| &value[key]);
        found["value"].as_str()
    }

    fn coded(&self, path: &str) -> String {
        let coded = path.split('.').fold(&self.coding, |value, key| &value[key]);
        coded.as_str().map_or_else(|| coded.to_string(), str::to_owned)
    }

    /// Whether bytes are read with their bits turned round: then all that follows is, too.
    fn is_turned(&self) -> bool {
        self.found("data_bit_order").is_some_and(|order| order != self.coded("data_bit_order"))
    }

    /// Bytes as a reader of this bit order has them.
    fn read(&self, hex: &str) -> Vec<u8> {
        let byte = |at: usize| u8::from_str_radix(&hex[at..at + 2], 16).expect("hex");
        let turn = |byte: u8| if self.is_turned() { byte.reverse_bits() } else { byte };
        (0..hex.len()).step_by(2).map(|at| turn(byte(at))).collect()
    }

    /// What was concluded and is not so.
    fn wrong(&self) -> Vec<String> {
        let mut wrong = Vec::new();
        let mut claim = |what: &str, found: Option<String>, is: String| {
            if let Some(found) = found.filter(|found| *found != is) {
                wrong.push(format!("{what}: found {found}, is {is}"));
            }
        };
        // What is labelled a default claims nothing.
        let text = |path: &str| {
            let origin =
                path.split('.').fold(&self.found, |value, key| &value[key])["origin"].clone();
            self.found(path).filter(|_| origin == "found").map(str::to_owned)
        };
        claim("bitrate", text("bitrate"), self.coded("bitrate"));
        claim("idle level", text("idle_level"), self.coded("idle_level"));
        let flags = self.coding["flag_order"].as_array().expect("three flags");
        let flags: Vec<&str> = flags.iter().map(|flag| flag.as_str().expect("a name")).collect();
        claim("flags", text("flag_order"), flags.join(" "));
        claim("SL", text("id_value"), self.coded("flag_polarity.SL"));
        claim("CR", text("check_value"), self.coded("flag_polarity.CR"));
        let status = if self.coded("flag_polarity.TYPE") == "1" { "0" } else { "1" };
        claim("TYPE", text("status_value"), status.to_owned());
        let word = |hex: &str| -> Vec<u8> { self.read(hex) };
        let mask = word(&self.coded("lbw.mask"));
        let masked = |bytes: Vec<u8>| -> Vec<u8> {
            bytes.iter().zip(&mask).map(|(byte, mask)| byte & mask).collect()
        };
        let lbw = self.found("lbw").map(|hex| {
            let bytes: Vec<u8> = (0..2)
                .map(|n| u8::from_str_radix(&hex[2 * n..2 * n + 2], 16).expect("hex"))
                .collect();
            format!("{:02X?}", masked(bytes))
        });
        claim("loopback word", lbw, format!("{:02X?}", masked(word(&self.coded("lbw.value")))));
        let device = |device: &Value| {
            let bits = 8 * device["bytes"].as_u64().expect("a length");
            format!("{bits}:{}", device["id"].as_str().expect("an ID"))
        };
        let ring: Vec<String> = self.ring.iter().map(device).collect();
        claim("ring", text("ring"), ring.join(" "));
        if let Some(crc) = self.checksum() {
            wrong.extend(self.cycles.iter().find_map(|cycle| self.wrong_checksum(&crc, cycle)));
        }
        wrong
    }

    /// The checksum, if all of it was concluded.
    fn checksum(&self) -> Option<Crc> {
        let word = |hex: &str| u16::from_str_radix(hex, 16).expect("hex");
        Some(Crc {
            init: word(self.found("crc.init")?),
            refin: self.found("crc.refin")? == "true",
            refout: self.found("crc.refout")? == "true",
            xorout: word(self.found("crc.xorout")?),
            is_low_first: self.found("crc.byte_order")? == "lo-hi",
            covers_lbw: self.found("crc.covers_lbw")? == "true",
        })
    }

    /// Whether this checksum is not that of the frames of this cycle.
    fn wrong_checksum(&self, crc: &Crc, cycle: &Value) -> Option<String> {
        for (wire, lbw_is_first) in [("do", true), ("di", false)] {
            let frame = self.read(cycle[wire].as_str().expect("bytes"));
            let (data, check) = frame.split_at(frame.len() - 4);
            let covered = match (crc.covers_lbw, lbw_is_first) {
                (true, _) => data,
                (false, true) => &data[2..],
                (false, false) => &data[..data.len() - 2],
            };
            if crc.sent(covered) != check[..2] {
                return Some(format!("checksum: {crc:?} does not fit {wire} of {cycle}"));
            }
        }
        None
    }
}

#[derive(Debug)]
struct Crc {
    init: u16,
    refin: bool,
    refout: bool,
    xorout: u16,
    is_low_first: bool,
    covers_lbw: bool,
}

impl Crc {
    fn sent(&self, bytes: &[u8]) -> [u8; 2] {
        let register = bytes.iter().fold(self.init, |register, byte| {
            let byte = if self.refin { byte.reverse_bits() } else { *byte };
            (0..8).fold(register ^ u16::from(byte) << 8, |register, _| {
                register << 1 ^ if register & 0x8000 == 0 { 0 } else { 0x1021 }
            })
        });
        let register = if self.refout { register.reverse_bits() } else { register };
        let value = register ^ self.xorout;
        if self.is_low_first { value.to_le_bytes() } else { value.to_be_bytes() }
    }
}

/// Random codings and random rings. Most are found out; what is claimed is so.
#[test]
fn no_line_is_taken_for_another() {
    let lines = std::env::var("FIELDTAP_LINES").ok().and_then(|text| text.parse().ok());
    let lines = lines.unwrap_or(LINES);
    let mut wrong = Vec::new();
    let (mut whole, mut with_ring, mut with_checksum) = (0, 0, 0);
    for seed in 1..=lines {
        let moving = ["--cycle", "0.6", "--plc", "1", "--pause", "20", "--duration", "0.06"];
        let line = Line::of(seed, &moving);
        let claims = line.wrong();
        let is_ring = line.found("ring").is_some();
        let is_checksum = line.checksum().is_some();
        if claims.is_empty() {
            with_ring += u64::from(is_ring);
            with_checksum += u64::from(is_checksum);
            let all = ["flag_order", "id_value", "lbw"].iter().all(|key| line.found(key).is_some());
            whole += u64::from(is_ring && is_checksum && all);
        }
        wrong.extend(claims.into_iter().map(|claim| format!("{seed}: {claim}")));
    }
    say(&format!(
        "of {lines} lines {whole} found out whole, the ring of {with_ring}, the checksum of {with_checksum}"
    ));
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(whole * 10 >= lines * 8, "{whole} of {lines}");
}

/// A capture of hardly more than the ID cycles proves nothing, and says so.
#[test]
fn too_little_is_not_enough() {
    for seed in 1..=6 {
        let line = Line::of(seed, &["--cycle", "0.6", "--duration", "0.0002"]);
        assert_eq!(line.wrong(), Vec::<String>::new(), "{seed}");
        assert!(line.checksum().is_none(), "{seed}");
    }
}
