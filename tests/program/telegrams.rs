//! The worked telegrams: every variant, through every form they can be captured in.

use crate::harness::{Run, Scratch, argument, codes, fieldtap};
use serde_json::Value;
use std::path::Path;

/// One line of the table.
struct Telegram {
    profile: &'static str,
    characters: &'static str,
    records: &'static str,
}

fn telegrams() -> impl Iterator<Item = Telegram> {
    let lines = include_str!("slin-telegrams.txt").lines();
    let lines = lines.filter(|line| !line.is_empty() && !line.starts_with('#'));
    lines.map(|line| {
        let (heard, records) = line.split_once(" => ").expect("a line has two sides");
        let (profile, characters) = heard.trim().split_once(' ').expect("a profile comes first");
        Telegram { profile, characters: characters.trim(), records }
    })
}

/// A heard character: start in ns, byte, whether its parity is wrong.
type Heard = (u64, u8, bool);

/// The characters with their start times, at 115200 Bd: 11 bits are 95.486 µs.
fn heard(characters: &str) -> Vec<Heard> {
    let mut next = 0.0;
    let mut heard = Vec::new();
    for token in characters.split(' ') {
        if let Some(pause) = token.strip_prefix('+') {
            next += pause.parse::<f64>().expect("a pause is a number") * 1e3;
            continue;
        }
        let byte = u8::from_str_radix(&token[..2], 16).expect("a byte has two hex digits");
        heard.push((next as u64, byte, token.ends_with('*')));
        next += 11.0 * 1e9 / 115_200.0;
    }
    heard
}

/// A record in the table's words.
fn told(record: &Value) -> String {
    let kind = record["kind"].as_str().expect("a kind is text");
    let mut text = format!("{kind} {}", record["station"]);
    if kind == "response" {
        let position = record["slin"]["position"].as_i64();
        text += &position.map_or(" -".to_owned(), |position| format!(" {position}"));
    }
    codes(record).iter().fold(text, |text, code| text + " " + code)
}

fn check(run: Run, telegram: &Telegram, records: &str) {
    let told: Vec<String> = run.good().records().iter().map(told).collect();
    assert_eq!(told.join("; "), records, "{} {}", telegram.profile, telegram.characters);
}

fn read(path: &Path, telegram: &Telegram, more: &[&str]) -> Run {
    let mut arguments = vec!["read", "--format", "json", "--profile", telegram.profile];
    arguments.extend_from_slice(more);
    arguments.push(argument(path));
    fieldtap(arguments)
}

#[test]
fn there_are_a_hundred() {
    assert_eq!(telegrams().count(), 100);
}

#[test]
fn as_chars() {
    let scratch = Scratch::new();
    for telegram in telegrams() {
        let rows = heard(telegram.characters).into_iter().map(|(ns, byte, is_wrong)| {
            let parity = if is_wrong { "error" } else { "ok" };
            format!("{}.{:09},{byte:02X},{parity}\n", ns / 1_000_000_000, ns % 1_000_000_000)
        });
        let text: String = std::iter::once("time,byte,parity\n".to_owned()).chain(rows).collect();
        let file = scratch.file("telegram.chars", text);
        check(read(&file, &telegram, &[]), &telegram, telegram.records);
    }
}

/// Line levels: each character is start bit, data bits, parity bit, stop bit.
#[test]
fn as_samples() {
    const RATE: u64 = 4_000_000;
    let scratch = Scratch::new();
    for telegram in telegrams() {
        let heard = heard(telegram.characters);
        let end = heard.last().expect("there are characters").0 + 3_000_000;
        let mut samples = vec![1_u8; (end * RATE / 1_000_000_000) as usize];
        for (ns, byte, is_wrong) in heard {
            let parity = (byte.count_ones() % 2 == 1) != is_wrong;
            let data = (0..8).map(|bit| byte >> bit & 1 == 1);
            let bits = std::iter::once(false).chain(data).chain([parity, true]);
            for (bit, level) in bits.enumerate() {
                // The line is idle for a millisecond first.
                let at = |bit: usize| {
                    let ns = 1e6 + ns as f64 + bit as f64 * 1e9 / 115_200.0;
                    (ns * RATE as f64 / 1e9).round() as usize
                };
                samples[at(bit)..at(bit + 1)].fill(u8::from(level));
            }
        }
        let file = scratch.file("telegram.bin", samples);
        let forced =
            ["--input-format", "logic", "--samplerate", "4M", "--baud", "115200", "--frame", "8E1"];
        check(read(&file, &telegram, &forced), &telegram, telegram.records);
    }
}
