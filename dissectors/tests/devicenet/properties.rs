//! What holds whatever is on the bus.

use crate::bus::{Heard, Told, decode};
use fieldtap_dissectors::can::{Frame, Identifier};
use fieldtap_dissectors::event::Moment;
use proptest::collection::vec;
use proptest::prelude::*;

const MS: i64 = 1_000_000;

fn frame(ns: i64, id: u16, data: &[u8]) -> Frame {
    Frame::data(Moment::from_ns(ns), 1_000, Identifier::Standard(id), data)
}

/// What goes wrong on the way.
#[derive(Clone, Copy, Debug)]
enum Fault {
    None,
    /// The fragment of that index is missing in the capture.
    Lose(usize),
    /// It is sent twice, as if its acknowledgement had not come.
    Repeat(usize),
}

/// A Set of class 64h instance 1 attribute 1 from master 0 to `server`, in fragments, each with
/// its acknowledgement, and the answer.
fn transfer(server: u16, client: u8, value: &[u8], fault: Fault) -> Vec<(u16, Vec<u8>)> {
    let [asks_on, answers_on] = [0x404, 0x403].map(|base| base | server << 3);
    let message = [&[0x10, 0x64, 1, 1], value].concat();
    let last = message.chunks(6).count() - 1;
    let mut frames = Vec::new();
    for (index, chunk) in message.chunks(6).enumerate() {
        let part = if index == 0 {
            0
        } else if index == last {
            0x80
        } else {
            0x40
        };
        let byte = part | index as u8 & 0x3F;
        let fragment = (asks_on, [&[0x80 | client, byte], chunk].concat());
        let sendings = match fault {
            Fault::Lose(lost) if lost == index => 0,
            Fault::Repeat(repeated) if repeated == index => 2,
            _ => 1,
        };
        frames.extend(std::iter::repeat_n(fragment, sendings));
        frames.push((answers_on, vec![0x80 | client, 0xC0 | index as u8 & 0x3F, 0]));
    }
    frames.push((answers_on, vec![client, 0x90]));
    frames
}

/// Frames of several senders, each in its own order, one every 2 ms.
fn interleave(lines: &[Vec<(u16, Vec<u8>)>], picks: &[usize]) -> Vec<Heard> {
    let mut queues: Vec<_> = lines.iter().map(|line| line.iter()).collect();
    let mut order = picks.iter().cycle();
    let mut frames = Vec::new();
    while queues.iter().any(|queue| queue.len() > 0) {
        let queue = order.next().unwrap_or(&0) % queues.len();
        let waiting = (0..queues.len()).map(|turn| (queue + turn) % queues.len());
        let Some(queue) = waiting.into_iter().find(|it| queues[*it].len() > 0) else { break };
        let (id, data) = queues[queue].next().unwrap();
        frames.push(Heard::Frame(frame(frames.len() as i64 * 2 * MS, *id, data)));
    }
    frames
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02X}")).collect()
}

/// A frame as a DeviceNet bus, or something like it, may carry it.
fn any_frame() -> impl Strategy<Value = (u16, Vec<u8>)> {
    let port = prop_oneof![
        8 => (0_u16..8, 0_u16..3).prop_map(|(port, mac)| 0x400 | mac << 3 | port),
        4 => (12_u16..16, 0_u16..3).prop_map(|(port, mac)| port << 6 | mac),
        2 => (5_u16..7, 0_u16..3).prop_map(|(port, mac)| 0x600 | port << 6 | mac),
        1 => 0_u16..0x800,
    ];
    let header = prop_oneof![4 => 0_u8..3, 2 => 0x80_u8..0x83, 1 => any::<u8>()];
    let second = prop_oneof![
        2 => prop::sample::select(vec![0x4B, 0xCB, 0x4C, 0xCC, 0x0E, 0x8E, 0x10, 0x90, 0x94, 0xCD]),
        2 => prop::sample::select(vec![0x00, 0x41, 0x42, 0x81, 0x82, 0xC0, 0xC1]),
        1 => any::<u8>(),
    ];
    let rest = prop_oneof![
        1 => Just(vec![3, 1, 3, 0]),
        1 => Just(vec![5, 2, 9, 75, 0]),
        1 => Just(vec![5, 2, 7]),
        3 => vec(any::<u8>(), 0..=6),
    ];
    let data = prop_oneof![
        6 => (header, second, rest).prop_map(|(header, second, rest)| {
            [&[header, second], &rest[..]].concat()
        }),
        1 => vec(any::<u8>(), 0..=8),
    ];
    (port, data)
}

/// Frames with pauses of nothing up to seconds; some run backwards.
fn any_frames() -> impl Strategy<Value = Vec<Frame>> {
    let pause = prop_oneof![
        8 => 0..3 * MS,
        2 => 0..100 * MS,
        1 => 0..12_000 * MS,
        1 => -50 * MS..0,
    ];
    vec((pause, any_frame()), 0..300).prop_map(|frames| {
        let mut now = 0;
        let placed = frames.into_iter().map(|(pause, (id, data))| {
            now += pause;
            frame(now, id, &data)
        });
        placed.collect()
    })
}

fn one_by_one(frames: &[Frame]) -> Vec<Heard> {
    frames.iter().map(|frame| Heard::Frame(*frame)).collect()
}

fn end_of(frames: &[Frame]) -> Option<i64> {
    frames.last().and_then(|frame| frame.start.ns()).map(|ns| ns + 60_000 * MS)
}

fn complete(told: &[Told]) -> Vec<&Told> {
    told.iter().filter(|told| !told.get("fragments").is_empty()).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, ..ProptestConfig::default() })]

    #[test]
    fn a_fragmented_message_is_put_together_whatever_is_between(
        values in vec(vec(any::<u8>(), 5..600), 1..4),
        picks in vec(0_usize..8, 1..40),
    ) {
        let mut lines: Vec<_> = (0..)
            .zip(&values)
            .map(|(server, value)| transfer(server + 1, server as u8, value, Fault::None))
            .collect();
        // Polls of the same nodes, and explicit messages of another client to one of them.
        lines.push((0..20).map(|n| (0x40D, vec![n])).collect());
        lines.push(vec![(0x40C, vec![9, 0x0E, 1, 1, 1]), (0x40B, vec![9, 0x8E, 0xD4, 1])]);
        let told = decode(&interleave(&lines, &picks), None);
        let data: Vec<&str> = complete(&told).iter().map(|told| told.get("data")).collect();
        for value in &values {
            prop_assert!(data.contains(&hex(value).as_str()));
        }
        prop_assert_eq!(data.len(), values.len());
        let bad = told.iter().find(|told| !told.codes.is_empty());
        prop_assert!(bad.is_none(), "{:?}", bad);
        let answers = told.iter().filter(|told| told.kind == "explicit-response");
        for answer in answers {
            prop_assert!(!answer.get("request").is_empty(), "{:?}", answer);
        }
    }

    #[test]
    fn what_is_lost_or_repeated_of_a_message_is_told(
        value in vec(any::<u8>(), 5..600),
        at in any::<prop::sample::Index>(),
        is_lost in any::<bool>(),
    ) {
        let count = (value.len() + 4).div_ceil(6);
        let index = at.index(count);
        let fault = if is_lost { Fault::Lose(index) } else { Fault::Repeat(index) };
        // A whole transfer before: the connection is known.
        let frames = [transfer(1, 0, &[1; 9], Fault::None), transfer(1, 0, &value, fault)].concat();
        let before = transfer(1, 0, &[1; 9], Fault::None).len();
        let told = decode(&interleave(&[frames], &[0]), None);
        let codes: Vec<&str> =
            told[before..].iter().flat_map(|told| &told.codes).map(String::as_str).collect();
        let data = complete(&told[before..]);
        if is_lost {
            prop_assert!(data.is_empty());
            prop_assert!(codes.contains(&"fragment-sequence"), "{codes:?}");
        } else {
            prop_assert_eq!(codes, ["fragment-retry"]);
            prop_assert_eq!(data.len(), 1);
            prop_assert_eq!(data[0].get("data"), hex(&value));
        }
    }

    #[test]
    fn records_do_not_depend_on_how_frames_come(
        frames in any_frames(),
        cuts in vec(1_usize..9, 1..20),
        steps in vec(0..400 * MS, 1..20),
    ) {
        let wanted = decode(&one_by_one(&frames), end_of(&frames));
        let mut batches = Vec::new();
        let mut rest = &frames[..];
        for cut in cuts.iter().cycle() {
            if rest.is_empty() {
                break;
            }
            let (batch, after) = rest.split_at((*cut).min(rest.len()));
            batches.push(Heard::Batch(batch.to_vec()));
            rest = after;
        }
        prop_assert_eq!(&decode(&batches, end_of(&frames)), &wanted);
        // And told again and again that nothing came.
        let mut patient = Vec::new();
        let mut step = steps.iter().cycle();
        for (index, frame) in frames.iter().enumerate() {
            patient.push(Heard::Frame(*frame));
            let next = frames.get(index + 1).and_then(|next| next.start.ns());
            let mut now = frame.start.ns().unwrap_or(0);
            for _ in 0..30 {
                now += step.next().unwrap_or(&MS).max(&1);
                if next.is_none_or(|next| now >= next) {
                    break;
                }
                patient.push(Heard::Advance(now));
            }
        }
        prop_assert_eq!(&decode(&patient, end_of(&frames)), &wanted);
    }

    #[test]
    fn whatever_is_heard_is_told_in_order(frames in any_frames()) {
        let told = decode(&one_by_one(&frames), end_of(&frames));
        let events = told.iter().filter(|told| told.kind == "event").count();
        prop_assert_eq!(told.len() - events, frames.len());
        for (n, told) in (1..).zip(&told) {
            prop_assert_eq!(told.n, n);
            let mut codes = told.codes.clone();
            codes.iter_mut().for_each(|code| *code = code.trim_end_matches(['+', '-']).to_owned());
            codes.sort();
            codes.dedup();
            prop_assert_eq!(codes.len(), told.codes.len(), "{:?}", told);
            prop_assert!(!told.summary.is_empty());
            prop_assert!(told.about.is_none_or(|about| about < n));
            let request = told.number("request");
            prop_assert!(request.is_none_or(|request| request < n as i64), "{:?}", told);
        }
        let goes_back = frames.windows(2).any(|pair| pair[1].start.since(pair[0].start) < Some(0));
        if !goes_back {
            let times: Vec<Option<i64>> = told.iter().map(|told| told.ns).collect();
            prop_assert!(times.is_sorted());
        }
    }
}
