//! CAN frames on a line: sent as CAN 2.0 part A says, at any rate and by any clock, heard as levels.

mod wire;

use fieldtap_dissectors::bus::{Bus, Sampling, WireFacts};
use fieldtap_dissectors::can::{self, Frame, FrameKind, Identifier};
use fieldtap_dissectors::event::{Clock, Event, Levels, Moment};
use fieldtap_dissectors::protocol::{Medium, Protocol, Settings};
use fieldtap_dissectors::record::{BusInfo, Output, Record, Sink};
use fieldtap_dissectors::uart::Baud;
use proptest::collection::vec;
use proptest::prelude::*;
use wire::{Sent, Wire, stuff};

/// What was heard: frames, with the codes of their records, and of the events at the end.
#[derive(Clone, Default, PartialEq, Debug)]
struct Heard {
    frames: Vec<(Frame, Vec<&'static str>)>,
    events: Vec<(&'static str, Option<i64>, Option<i64>)>,
}

impl Sink for Heard {
    fn record(&mut self, record: &Record<'_>) {
        let codes = record.findings.iter().map(|finding| finding.code.name).collect();
        match record.frame() {
            Some(frame) => self.frames.push((*frame, codes)),
            None => self.events.extend(
                record.findings.iter().map(|found| (found.code.name, found.expected, found.actual)),
            ),
        }
    }
}

impl Heard {
    /// Identifiers of the frames that are whole, and the codes of all.
    fn told(&self) -> Vec<String> {
        let of = |(frame, codes): &(Frame, Vec<&str>)| match frame.kind {
            FrameKind::Error => codes.join(" "),
            _ => [
                vec![format!("{:X}", frame.id.value())],
                codes.iter().map(|code| (*code).to_owned()).collect(),
            ]
            .concat()
            .join(" "),
        };
        self.frames.iter().map(of).collect()
    }
}

/// A line of a capture and how it is read.
#[derive(Clone)]
struct Tap {
    bitrate: u32,
    samples: f64,
    settings: Settings,
    is_inverted: bool,
}

impl Tap {
    /// 125 kbit/s, sampled so many times a bit.
    fn new(samples: f64) -> Self {
        let settings = Settings { protocol: Protocol::named("can"), ..Settings::default() };
        Tap { bitrate: 125_000, samples, settings, is_inverted: false }
    }

    fn bus(&self) -> Bus {
        let ticks_per_second = (f64::from(self.bitrate) * self.samples) as u64;
        let sampling = Sampling { ticks_per_second, uncertainty: 1, origin: Moment::from_ns(0) };
        let facts = WireFacts { sampling: Some(sampling), ..WireFacts::default() };
        let info = BusInfo::new("RX", Some(Clock::Sample));
        Bus::new(info, facts, self.settings.clone())
    }

    fn hear_edges(&self, edges: &[u64], cuts: &[u64]) -> (Heard, Bus) {
        let mut bus = self.bus();
        let (mut heard, mut last) = (Heard::default(), 0);
        for cut in cuts.windows(2) {
            let range =
                edges.partition_point(|e| *e < cut[0])..edges.partition_point(|e| *e < cut[1]);
            let level = range.start.is_multiple_of(2) != self.is_inverted;
            let levels = Levels { edges: &edges[range], level, from: cut[0], until: cut[1] };
            bus.hear(Event::Levels(levels), &mut Output::new(&mut last, &mut heard));
        }
        bus.finish(Moment::UNKNOWN, &mut Output::new(&mut last, &mut heard));
        (heard, bus)
    }

    /// Hears a wire whose sender's clock is off by so many percent.
    fn hear_off(&self, wire: &Wire, percent: f64, phase: f64) -> Heard {
        let edges = wire.edges(self.samples * (1.0 + percent / 100.0), phase);
        let end = (wire.bits.len() as f64 * self.samples * (1.0 + percent / 100.0)) as u64;
        self.hear_edges(&edges, &[0, end]).0
    }

    fn hear(&self, wire: &Wire) -> Heard {
        self.hear_off(wire, 0.0, 0.3)
    }
}

/// The worked frames of other programs: most bits of stuffing, none, either identifier, remote.
fn worked() -> Vec<(Sent, u16)> {
    let extended = Sent {
        id: Identifier::Extended(0x18EB_FF00),
        ..Sent::data(0, &[0x01, 0xA0, 0x0F, 0xA6, 0x60, 0x3B, 0xD1, 0x40])
    };
    let remote = Sent { is_remote: true, dlc: 4, ..Sent::data(0x123, &[]) };
    vec![
        (Sent::data(0x40D, &[]), 49),
        (Sent::data(0x3C1, &[0xF9, 0x7E, 0x1E, 0, 0]), 93),
        (Sent::data(0x000, &[0; 8]), 127),
        (Sent::data(0x7FF, &[0xFF; 8]), 126),
        (Sent::data(0x555, &[0x55; 8]), 112),
        (extended, 141),
        (remote, 47),
        (Sent { dlc: 15, ..Sent::data(0x34A, &[1, 2, 3, 4, 5, 6, 7, 8]) }, 0),
    ]
}

fn assert_heard(heard: &Heard, sent: &[(Sent, u16)], context: &str) {
    assert_eq!(heard.frames.len(), sent.len(), "{context}: {:?}", heard.told());
    for ((frame, codes), (sent, bits)) in heard.frames.iter().zip(sent) {
        let kind = if sent.is_remote { FrameKind::Remote } else { FrameKind::Data };
        assert_eq!((frame.kind, frame.id, frame.dlc), (kind, sent.id, sent.dlc), "{context}");
        assert_eq!(frame.bytes(), sent.data, "{context}");
        assert_eq!((frame.crc, frame.is_acknowledged), (Some(true), Some(true)), "{context}");
        assert!(codes.is_empty(), "{context}: {codes:?}");
        if *bits > 0 {
            assert_eq!(frame.measured_bits, Some(*bits), "{context}");
        }
    }
}

#[test]
fn frames_of_every_kind_at_every_sampling_by_clocks_that_are_off() {
    let sent = worked();
    let wire = sent.iter().fold(Wire::default().idle(12), |wire, (sent, _)| wire.frame(sent));
    let wire = wire.idle(5);
    for samples in [2.0, 2.5, 3.0, 4.0, 5.3, 8.0, 16.0, 32.0, 100.0] {
        for percent in [0.0_f64, 0.2, -0.2, 0.5, -0.5, 1.0, -1.0] {
            for phase in [0.05, 0.5, 0.95] {
                let heard = Tap::new(samples).hear_off(&wire, percent, phase);
                let context = format!("{samples} samples, {percent} %, phase {phase}");
                assert_heard(&heard, &sent, &context);
            }
        }
    }
}

#[test]
fn a_frame_begins_with_its_start_bit_and_may_begin_in_the_last_bit_of_the_intermission() {
    let sent = Sent::data(0x40D, &[]);
    let mut wire = Wire::default().idle(20).frame(&sent);
    wire.bits.pop();
    let heard = Tap::new(10.0).hear(&wire.frame(&sent).idle(2));
    // 8 µs a bit: 20 bits are 160 µs, the frame without one bit 48 x 8 = 384 µs.
    let starts: Vec<_> = heard.frames.iter().map(|(frame, _)| frame.start.ns()).collect();
    assert_eq!(starts, [Some(160_800), Some(544_800)]);
}

#[test]
fn rate_and_polarity_are_found_whatever_they_are() {
    let frames = (0..30_u8).map(|n| Sent::data(0x3C0 + u16::from(n), &[n, 0, 0x80 ^ n]));
    let wire = frames.fold(Wire::default().idle(30), |wire, sent| wire.frame(&sent).idle(9));
    for bitrate in [125_000, 250_000, 500_000, 1_000_000, 62_500] {
        for is_inverted in [false, true] {
            let settings = Settings::default();
            let tap = Tap { bitrate, settings, is_inverted, ..Tap::new(8.0) };
            let edges = wire.edges(8.02, 0.4);
            let (heard, bus) = tap.hear_edges(&edges, &[0, edges[edges.len() - 1] + 1_000]);
            assert_eq!(heard.frames.len(), 30, "{bitrate} {is_inverted}");
            assert_eq!(bus.protocol().map(|protocol| protocol.medium), Some(Medium::Can));
            assert_eq!(bus.is_inverted(), is_inverted);
            let found = bus.conclusions().into_iter().find(|it| it.subject == "bitrate").unwrap();
            assert_eq!(found.evidence, "30 of the first 30 frames have a good checksum");
            let rate = bus.wire().baud().unwrap().get();
            assert_eq!(found.value, Some(rate.to_string()));
            // 62,500 is none of the usual rates: it is measured, 8 / 8.02 of that.
            let is_near =
                if bitrate == 62_500 { rate.abs_diff(62_344) < 30 } else { rate == bitrate };
            assert!(is_near, "{rate}");
        }
    }
}

#[test]
fn settings_that_the_line_contradicts_are_doubted_once() {
    let frames = (0..40_u8).map(|n| Sent::data(0x3C0, &[n, 1, 2, 3]));
    let wire = frames.fold(Wire::default().idle(30), |wire, sent| wire.frame(&sent).idle(9));
    for (bitrate, inverted, doubt) in [
        (Some(125_000), None, None),
        (Some(126_000), Some(false), None),
        (Some(250_000), None, Some((Some(125_000), Some(250_000)))),
        (Some(500_000), Some(false), Some((Some(125_000), Some(500_000)))),
        (Some(100_000), None, Some((Some(125_000), Some(100_000)))),
        (None, Some(true), Some((Some(125_000), Some(125_000)))),
    ] {
        let mut tap = Tap::new(32.0);
        tap.settings.can.bitrate = bitrate.and_then(Baud::new);
        tap.settings.line.inverted = inverted;
        let heard = tap.hear(&wire);
        let told =
            heard.frames.iter().flat_map(|(_, codes)| codes).filter(|c| **c == "can.wrong-bitrate");
        assert_eq!(told.count(), 0, "{bitrate:?} {inverted:?}");
        let expected: Vec<_> =
            doubt.into_iter().map(|(found, set)| ("can.wrong-bitrate", found, set)).collect();
        assert_eq!(heard.events, expected, "{bitrate:?} {inverted:?}");
    }
}

#[test]
fn every_error_is_named_and_the_very_next_frame_is_received() {
    let sent = Sent::data(0x42C, &[0x01, 0x0E, 0x01]);
    let after = Sent::data(0x3C1, &[7]);
    let body = sent.body(0);
    let wire = || Wire::default().idle(12);
    let end = |wire: Wire| wire.idle(8 + 3).frame(&after).idle(4);
    let all = || wire().bits(&body).idle(1).dominant(1);
    for (what, wire, told) in [
        (
            "an error flag in the data",
            end(wire().bits(&body[..30]).dominant(6)),
            vec!["can.error-frame can.stuff", "3C1"],
        ),
        (
            "an error flag that others join",
            end(wire().bits(&body[..30]).dominant(12)),
            vec!["can.error-frame can.stuff", "3C1"],
        ),
        (
            "a sender that stops",
            wire().bits(&body[..30]).idle(6 + 8 + 3).frame(&after).idle(4),
            vec!["can.error-frame can.stuff", "3C1"],
        ),
        (
            "a checksum that does not fit, and the flag behind the delimiter",
            end(wire().bits(&sent.body(0x10)).idle(3).dominant(6)),
            vec!["42C can.crc", "can.error-frame", "3C1"],
        ),
        (
            "a checksum that does not fit to us alone",
            wire().bits(&sent.body(0x10)).idle(1).dominant(1).idle(11).frame(&after).idle(4),
            vec!["42C can.crc", "3C1"],
        ),
        (
            "a dominant checksum delimiter",
            end(wire().bits(&body).dominant(7)),
            vec!["can.error-frame can.form", "3C1"],
        ),
        (
            "a dominant acknowledge delimiter",
            end(all().dominant(1 + 6)),
            vec!["can.error-frame can.form", "3C1"],
        ),
        (
            "a flag in the end of frame",
            end(all().idle(1 + 3).dominant(7)),
            vec!["can.error-frame can.form", "3C1"],
        ),
        (
            "nobody acknowledges, and the sender flags it",
            end(wire().bits(&body).idle(2).dominant(6)),
            vec!["42C can.not-acknowledged", "can.error-frame", "3C1"],
        ),
        (
            "nobody acknowledges an error-passive sender",
            wire().bits(&body).idle(2 + 6 + 8 + 3).frame(&after).idle(4),
            vec!["42C can.not-acknowledged", "3C1"],
        ),
        (
            "overload in the intermission",
            end(all().idle(1 + 7 + 1).dominant(6)),
            vec!["42C", "can.overload", "3C1"],
        ),
        (
            "overload from the last bit of the end of frame on, twice",
            end(all().idle(1 + 6).dominant(7).idle(8 + 1).dominant(6)),
            vec!["42C", "can.overload", "can.overload", "3C1"],
        ),
        (
            "a line that is stuck for a while",
            end(wire().dominant(1_000)),
            vec!["can.error-frame can.stuff", "3C1"],
        ),
    ] {
        // A frame before, so that the tap is not taken to be set up wrongly.
        let wire = Wire::default().idle(12).frame(&after).bits(&wire.bits);
        let told: Vec<&str> = [vec!["3C1"], told].concat();
        for samples in [2.0, 4.0, 32.0] {
            assert_eq!(Tap::new(samples).hear(&wire).told(), told, "{what}, {samples} samples");
        }
    }
}

#[test]
fn a_flag_of_an_error_ends_the_bits_of_what_it_destroyed() {
    let sent = Sent::data(0x40D, &[]);
    let wire =
        Wire::default().idle(12).frame(&sent).bits(&sent.body(1)).idle(3).dominant(6).idle(14);
    let heard = Tap::new(8.0).hear(&wire);
    let bad = heard.frames[1].0;
    // 34 bits, 2 or 3 stuff bits, then delimiter, slot, delimiter.
    assert_eq!(bad.measured_bits, Some(sent.body(1).len() as u16 + 3));
    assert_eq!((bad.crc, bad.is_acknowledged), (Some(false), None));
}

#[test]
fn a_capture_that_begins_or_ends_in_a_frame_invents_none() {
    let sent = worked();
    let wire = sent.iter().fold(Wire::default().idle(12), |wire, (sent, _)| wire.frame(sent));
    let starts: Vec<usize> = {
        let lengths = sent.iter().map(|(sent, _)| sent.body(0).len() + 13);
        lengths.scan(12, |start, length| Some(std::mem::replace(start, *start + length))).collect()
    };
    for from in 0..wire.bits.len() - 60 {
        let rest = Wire { bits: wire.bits[from..].to_vec() };
        // A frame is behind eleven recessive bits, or ten where the edge before them was seen.
        let whole = starts.iter().filter(|start| **start >= from + 11).count();
        let mut tap = Tap::new(8.0);
        tap.settings.can.bitrate = Baud::new(125_000);
        tap.is_inverted = !rest.bits[0];
        tap.settings.line.inverted = Some(false);
        let edges = rest.edges(8.0, 0.0);
        let (heard, _) = tap.hear_edges(&edges, &[0, rest.bits.len() as u64 * 8]);
        assert!(
            heard.frames.iter().all(|(frame, codes)| frame.crc == Some(true) && codes.is_empty()),
            "from {from}: {:?}",
            heard.told()
        );
        assert!(
            (whole.saturating_sub(1)..=whole + 1).contains(&heard.frames.len()),
            "from {from}: {:?}",
            heard.told()
        );
    }
    for until in 0..wire.bits.len() {
        let part = Wire { bits: wire.bits[..until].to_vec() };
        let mut tap = Tap::new(8.0);
        tap.settings.can.bitrate = Baud::new(125_000);
        let heard = tap.hear(&part);
        // Valid one bit before the end of frame is over, which three bits of intermission follow.
        let ends = starts.iter().skip(1).copied().chain([wire.bits.len()]);
        let whole = ends.filter(|end| until + 4 >= *end);
        assert_eq!(heard.frames.len(), whole.count(), "until {until}: {:?}", heard.told());
    }
}

#[test]
fn short_pulses_are_dropped_and_counted() {
    let sent = Sent::data(0x555, &[0x55; 8]);
    let wire = Wire::default().idle(20).frame(&sent).idle(20).frame(&sent).idle(20);
    let mut edges = wire.edges(32.0, 0.0);
    let end = wire.bits.len() as u64 * 32;
    // Of 32 ticks a bit, up to seven are shorter than a quarter: in idle and in the middle of bits.
    for (at, length) in
        [(100, 7), (32 * 30 + 14, 5), (32 * 60 + 3, 4), (32 * 140, 1), (32 * 200 + 20, 7)]
    {
        edges.extend([at, at + length]);
    }
    edges.sort_unstable();
    let mut tap = Tap::new(32.0);
    tap.settings.can.bitrate = Baud::new(125_000);
    let (heard, bus) = tap.hear_edges(&edges, &[0, end]);
    assert_eq!(heard.told(), ["555", "555"]);
    // The first came before the bus was known to be idle: there, any pulse is traffic.
    assert_eq!(bus.counts().glitches, 4);
    // A quarter of a bit is none, but no start of frame either.
    let mut edges = wire.edges(32.0, 0.0);
    edges.splice(0..0, [500, 508]);
    assert_eq!(tap.hear_edges(&edges, &[0, end]).0.told(), ["555", "555"]);
}

/// ISO 11898-1:2015: SOF, identifier, RRS 0, IDE 0, FDF 1, res 0, BRS 1, ESI 0, and then bits that
/// are four times as fast.
#[test]
fn can_fd_frames_are_skipped_without_errors() {
    let classic = Sent::data(0x42C, &[1, 2, 3]);
    let mut head = vec![false];
    head.extend((0..11).rev().map(|bit| 0x2A5 >> bit & 1 == 1));
    head.extend([false, false, true, false, true]);
    let fast: Vec<u64> = (0..90).map(|n| 8 * n).collect();
    let before = Wire::default().idle(12).frame(&classic).bits(&stuff(&head));
    let mut edges = before.edges(32.0, 0.0);
    let begin = before.bits.len() as u64 * 32;
    assert!(*before.bits.last().unwrap(), "BRS is recessive");
    edges.extend(fast.iter().map(|tick| begin + tick));
    // The level is recessive behind an even number of edges; acknowledge, and the end of frame.
    let behind = begin + 720;
    let after = Wire::default().idle(2).dominant(1).idle(11).frame(&classic).idle(5);
    edges.extend(after.edges(32.0, behind as f64));
    let end = behind + after.bits.len() as u64 * 32;
    let (heard, bus) = Tap::new(32.0).hear_edges(&edges, &[0, end]);
    assert_eq!(heard.told(), ["42C", "2A5", "42C"]);
    assert_eq!(heard.frames[1].0.kind, FrameKind::Fd);
    assert_eq!(bus.counts().glitches, 0);
}

#[test]
fn a_line_without_frames_is_silent() {
    for edges in [vec![], vec![100, 101], (0..5_000).map(|n| n * 7).collect()] {
        let (heard, bus) = Tap::new(8.0).hear_edges(&edges, &[0, 100_000]);
        assert_eq!(heard, Heard::default(), "{edges:?}");
        assert_eq!(bus.protocol().map(|it| it.name), Some(can::PROTOCOL.name));
    }
}

fn frames() -> impl Strategy<Value = Vec<(Sent, usize)>> {
    let id = prop_oneof![
        (0..0x800_u16).prop_map(Identifier::Standard),
        (0..0x2000_0000_u32).prop_map(Identifier::Extended),
    ];
    let byte = prop_oneof![any::<u8>(), Just(0), Just(0xFF)];
    let sent =
        (id, vec(byte, 0..=8), any::<bool>(), 0..16_u8).prop_map(|(id, data, is_remote, dlc)| {
            if is_remote {
                Sent { id, is_remote, dlc, data: Vec::new() }
            } else {
                let dlc = if data.len() == 8 { dlc.max(8) } else { data.len() as u8 };
                Sent { id, is_remote, dlc, data }
            }
        });
    vec((sent, 0..30_usize), 1..20)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Whatever is sent is heard, at any sampling, by a clock that is off.
    #[test]
    fn what_is_sent_is_heard(
        frames in frames(),
        samples in 5.0..40.0_f64,
        percent in -0.9..0.9_f64,
        phase in 0.0..1.0_f64,
    ) {
        let wire = frames.iter().fold(Wire::default().idle(12), |wire, (sent, pause)| wire.frame(sent).idle(*pause));
        let heard = Tap::new(samples).hear_off(&wire.idle(3), percent, phase);
        let sent: Vec<(Sent, u16)> = frames.into_iter().map(|(sent, _)| {
            let bits = sent.body(0).len() as u16 + 13;
            (sent, bits)
        }).collect();
        assert_heard(&heard, &sent, &format!("{samples} {percent} {phase}"));
    }

    /// Characters with even parity are not taken for frames, whatever their rate and spacing.
    #[test]
    fn characters_are_no_frames(
        characters in vec((any::<u8>(), 0..40_usize), 1..400),
        samples in 4.0..40.0_f64,
    ) {
        let send = |wire: Wire, (byte, pause): &(u8, usize)| {
            let parity = byte.count_ones() % 2 == 1;
            let data: Vec<bool> = (0..8).map(|bit| byte >> bit & 1 == 1).collect();
            wire.dominant(1).bits(&data).put(parity, 1).idle(1 + pause / 4 * (pause % 4))
        };
        let wire = characters.iter().fold(Wire::default().idle(30), send);
        let tap = Tap { settings: Settings::default(), ..Tap::new(samples) };
        let edges = wire.edges(samples, 0.2);
        let (_, bus) = tap.hear_edges(&edges, &[0, (wire.bits.len() as f64 * samples) as u64 + 9]);
        prop_assert!(bus.protocol().is_none_or(|protocol| protocol != &can::PROTOCOL));
    }

    /// However a line is divided into pieces, be it inside a bit or a glitch, and however damaged it
    /// is, the same is heard.
    #[test]
    fn the_division_of_the_line_does_not_matter(
        frames in frames(),
        samples in 2.0..40.0_f64,
        noise in vec((any::<prop::sample::Index>(), 1..60_u64), 0..12),
        cuts in vec(any::<prop::sample::Index>(), 0..100),
        is_told in any::<bool>(),
    ) {
        let wire = frames.iter().fold(Wire::default().idle(12), |wire, (sent, pause)| wire.frame(sent).idle(*pause));
        let mut edges = wire.edges(samples, 0.2);
        let end = (wire.bits.len() as f64 * samples) as u64 + 200;
        for (at, length) in &noise {
            let at = at.index(end as usize - 100) as u64;
            edges.extend([at, at + length]);
        }
        edges.sort_unstable();
        edges.dedup();
        let mut tap = Tap::new(samples);
        if is_told {
            tap.settings.can.bitrate = Baud::new(125_000);
            tap.settings.line.inverted = Some(false);
        }
        let (whole, _) = tap.hear_edges(&edges, &[0, end]);
        let mut cuts: Vec<u64> = cuts.iter().map(|cut| cut.index(end as usize) as u64).collect();
        cuts.extend([0, end]);
        cuts.sort_unstable();
        prop_assert_eq!(&tap.hear_edges(&edges, &cuts).0, &whole);
        let mut each: Vec<u64> = [0].iter().chain(&edges).copied().chain([end]).collect();
        each.dedup();
        prop_assert_eq!(&tap.hear_edges(&edges, &each).0, &whole);
    }
}
