//! What is judged of every frame, whatever protocol it carries.

use super::{ErrorClasses, ErrorDetail, Frame, FrameKind, Load, codes};
use crate::event::{Loss, Moment};
use crate::finding::Finding;
use crate::uart::{Baud, Wire};
use alloc::vec::Vec;
use core::ops::RangeInclusive;

/// A bus is highly loaded above this, in permille, and no more below the other.
const HIGH: u16 = 800;
const NO_LONGER_HIGH: u16 = 700;

/// The same frame so often without a pause was not acknowledged: a controller sends it again at
/// once, for ever.
const REPEATS: u32 = 8;

/// The rates at which frames may be repeated where the rate is not known: those of DeviceNet.
const RATES: [u32; 3] = [125_000, 250_000, 500_000];

/// Bits by which a repeat begins later than the frame is long: after the acknowledge slot come six
/// of the error flag and eight of its delimiter instead of eight of the frame's end; and eight more
/// if the sender is error passive (CAN 2.0, part A §3.1.1, §3.1.3 and §8). And two for the stamps.
const ERROR_BITS: RangeInclusive<u32> = 4..=16;

/// So many error frames, and not one good frame, mean that the tap listens at another rate.
const ERRORS_ALONE: u32 = 16;

/// Looks at every frame of a bus.
pub struct Watch {
    wire: Wire,
    load: Load,
    is_loaded: bool,
    last: Option<Frame>,
    repeats: u32,
    errors_alone: u32,
    has_good: bool,
    is_rate_doubted: bool,
}

impl Watch {
    /// Of a bus on which nothing was heard yet.
    #[must_use]
    pub const fn new(wire: Wire) -> Self {
        Watch {
            wire,
            load: Load::new(),
            is_loaded: false,
            last: None,
            repeats: 0,
            errors_alone: 0,
            has_good: false,
            is_rate_doubted: false,
        }
    }

    /// The rate is known from now on, or the tap was set to another one. At that, nothing good was
    /// heard yet.
    pub fn learn_rate(&mut self, wire: Wire) {
        if self.wire.baud().is_some() {
            (self.has_good, self.errors_alone, self.is_rate_doubted) = (false, 0, false);
        }
        self.wire = wire;
    }

    /// How busy the bus was.
    #[must_use]
    pub const fn load(&self) -> &Load {
        &self.load
    }

    /// Whether the frame that was heard last is sent over and over for want of an acknowledge.
    #[must_use]
    pub const fn is_repeating(&self) -> bool {
        self.repeats > 0
    }

    /// Takes note of a finding about the bus that was made by other means: its cause is not told
    /// again.
    pub fn note(&mut self, finding: &Finding) {
        self.is_rate_doubted |= finding.code == &codes::WRONG_BITRATE;
    }

    /// Takes the next frame and adds what is wrong with it. Returns its bits on the wire, if known.
    pub fn hear(&mut self, frame: &Frame, findings: &mut Vec<Finding>) -> Option<u16> {
        self.judge_errors(frame, findings);
        if frame.is_cut() {
            let had = frame.original_length.unwrap_or(u32::from(frame.dlc));
            let finding = Finding::new(&codes::TRUNCATED).expected(i64::from(had));
            findings.push(finding.actual(frame.bytes().len() as i64));
        }
        if frame.crc == Some(false) {
            findings.push(Finding::new(&codes::CRC));
        }
        let bits = frame.bits();
        self.judge_repeats(frame, bits, findings);
        if let (Some(bits), Some(rate)) = (bits, self.wire.baud()) {
            let load = self.load.add(frame.start, bits, rate);
            findings.extend(load.and_then(|load| self.judge_load(load)));
        }
        bits
    }

    fn judge_errors(&mut self, frame: &Frame, findings: &mut Vec<Finding>) {
        if frame.kind != FrameKind::Error {
            self.has_good |= frame.crc != Some(false);
            return;
        }
        let classes = ErrorClasses::of(frame);
        let detail = ErrorDetail::of(frame);
        if detail.is_some_and(|detail| detail.is_overload_alone()) {
            findings.push(Finding::new(&codes::OVERLOAD));
            return;
        }
        if detail.as_ref().is_some_and(ErrorDetail::is_recovery) {
            return;
        }
        findings.push(Finding::new(&codes::ERROR_FRAME));
        let has = |is_it: fn(&ErrorDetail) -> bool| detail.as_ref().is_some_and(is_it);
        for (is_so, code) in [
            (classes.is_bus_off(), &codes::BUS_OFF),
            (classes.is_not_acknowledged(), &codes::NOT_ACKNOWLEDGED),
            (has(ErrorDetail::is_overrun), &codes::DROPPED),
            (has(ErrorDetail::is_overload), &codes::OVERLOAD),
            (has(ErrorDetail::is_stuff), &codes::STUFF),
            (has(ErrorDetail::is_form), &codes::FORM),
            (has(ErrorDetail::is_crc), &codes::CRC),
        ] {
            if is_so {
                findings.push(Finding::new(code));
            }
        }
        if !self.has_good && !self.is_rate_doubted {
            self.errors_alone += 1;
            if self.errors_alone == ERRORS_ALONE {
                let count = i64::from(ERRORS_ALONE);
                findings.push(Finding::new(&codes::WRONG_BITRATE).actual(count));
            }
        }
    }

    fn judge_repeats(&mut self, frame: &Frame, bits: Option<u16>, findings: &mut Vec<Finding>) {
        let was_acknowledged = self.last.and_then(|last| last.is_acknowledged);
        if frame.kind == FrameKind::Error && was_acknowledged == Some(false) {
            // The sender's own flag, for want of an acknowledge: the frame comes again.
            return;
        }
        let is_repeat = self.last.as_ref().is_some_and(|last| {
            let same = (last.kind, last.id, last.dlc) == (frame.kind, frame.id, frame.dlc)
                && frame.kind == FrameKind::Data
                && frame.is_acknowledged != Some(true)
                && last.bytes() == frame.bytes();
            same && frame.start.since(last.start).zip(bits).is_some_and(|(ns, bits)| {
                ns > 0 && self.may_repeat(ns.unsigned_abs(), u32::from(bits))
            })
        });
        self.repeats = if is_repeat { self.repeats.saturating_add(1) } else { 0 };
        self.last = Some(*frame);
        let finding = Finding::new(&codes::NOT_ACKNOWLEDGED);
        if self.repeats == REPEATS {
            findings.push(finding.actual(i64::from(REPEATS)));
        } else if frame.is_acknowledged == Some(false) {
            findings.push(finding);
        }
    }

    /// Whether a frame of so many bits may be sent again at once after so many ns. Where the rate is
    /// not known, the same may as well come once a millisecond because somebody asks for it.
    fn may_repeat(&self, ns: u64, bits: u32) -> bool {
        match self.wire.baud() {
            // And a little for the delimiter and the intermission after an error.
            Some(rate) => ns <= rate.bits_ns(bits * 3 / 2),
            None => RATES.into_iter().filter_map(Baud::new).any(|rate| {
                let [least, most] = [ERROR_BITS.start(), ERROR_BITS.end()];
                (rate.bits_ns(bits + least)..=rate.bits_ns(bits + most)).contains(&ns)
            }),
        }
    }

    fn judge_load(&mut self, load: u16) -> Option<Finding> {
        let was_loaded = self.is_loaded;
        self.is_loaded = load > if was_loaded { NO_LONGER_HIGH } else { HIGH };
        let finding = Finding::new(&codes::HIGH_LOAD);
        (self.is_loaded && !was_loaded)
            .then(|| finding.actual(i64::from(load)).limit(i64::from(HIGH)))
    }

    /// What was lost may have been anything.
    pub fn lose(&mut self, loss: &Loss) {
        (self.last, self.repeats) = (None, 0);
        if loss.cause.is_gap() {
            self.load.pause();
        }
    }

    /// When the last frame was heard.
    #[must_use]
    pub fn last_heard(&self) -> Moment {
        self.last.map_or(Moment::UNKNOWN, |frame| frame.start)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Identifier, Violation};
    use super::*;
    use crate::uart::Format;

    fn watch() -> Watch {
        Watch::new(Wire::new(Baud::new(125_000), Format::FT12))
    }

    fn codes(watch: &mut Watch, frame: &Frame) -> Vec<&'static str> {
        let mut findings = Vec::new();
        watch.hear(frame, &mut findings);
        findings.iter().map(|finding| finding.code.name).collect()
    }

    /// One of a row at 125 kbit/s: 55 bits without stuffing are 440 µs.
    fn frame(n: i64, is_acknowledged: Option<bool>) -> Frame {
        let start = Moment::from_ns(n * 500_000);
        let mut frame = Frame::data(start, 250, Identifier::Standard(0x40F), &[0]);
        frame.is_acknowledged = is_acknowledged;
        frame
    }

    #[test]
    fn a_frame_is_not_acknowledged_if_the_line_says_so_or_if_it_is_repeated_for_ever() {
        let told = |is_acknowledged| {
            let mut watch = watch();
            (0..10).map(|n| codes(&mut watch, &frame(n, is_acknowledged)).len()).sum::<usize>()
        };
        assert_eq!([told(Some(true)), told(None), told(Some(false))], [0, 1, 10]);
    }

    #[test]
    fn where_the_rate_is_not_known_a_fast_cycle_is_no_repeat() {
        // A poll of four bytes, 89 bits, every millisecond: 500 kbit/s, which nobody knows. And the
        // same sent again at once at 125 kbit/s: an error flag makes that 6 bits more.
        let told = |apart_ns: i64| {
            let mut watch = Watch::new(Wire::new(None, Format::FT12));
            let poll = |n: i64| {
                let start = Moment::from_ns(n * apart_ns);
                Frame::data(start, 1_000, Identifier::Standard(0x3C0), &[0; 4])
            };
            (0..10).map(|n| codes(&mut watch, &poll(n)).len()).sum::<usize>()
        };
        assert_eq!(
            [1_000_000, 500_000, (89 + 6) * 8_000, (89 + 6) * 2_000].map(told),
            [0, 0, 1, 1]
        );
    }

    #[test]
    fn the_flag_of_a_sender_that_nobody_acknowledges_does_not_interrupt_its_repeats() {
        let mut watch = watch();
        for n in 0..3 {
            codes(&mut watch, &frame(n, Some(false)));
            let flag = Violation::Flag.report(0x1B, Moment::from_ns(n * 500_000 + 400_000), 250);
            assert_eq!(codes(&mut watch, &flag), ["can.error-frame"]);
        }
        assert!(watch.is_repeating());
    }

    #[test]
    fn errors_alone_are_doubted_anew_at_another_rate() {
        let mut watch = watch();
        codes(&mut watch, &frame(0, None));
        let error = Violation::Stuff.report(0x08, Moment::UNKNOWN, 0);
        let doubts = |watch: &mut Watch| {
            (0..ERRORS_ALONE)
                .filter(|_| codes(watch, &error).contains(&"can.wrong-bitrate"))
                .count()
        };
        assert_eq!(doubts(&mut watch), 0, "there was a good frame");
        watch.learn_rate(Wire::new(Baud::new(250_000), Format::FT12));
        assert_eq!(doubts(&mut watch), 1);
    }

    #[test]
    fn what_the_line_shows_has_its_code() {
        for (violation, place, told) in [
            (Violation::Stuff, 0x08, &["can.error-frame", "can.stuff"][..]),
            (Violation::Form, 0x18, &["can.error-frame", "can.form"]),
            (Violation::Flag, 0x1A, &["can.error-frame"]),
            (Violation::Overload, 0x12, &["can.overload"]),
        ] {
            let frame = violation.report(place, Moment::UNKNOWN, 0);
            assert_eq!(codes(&mut watch(), &frame), told, "{violation:?}");
        }
    }

    /// The classes and data of an error frame (`linux/can/error.h`), and the codes it raises.
    #[test]
    fn what_a_controller_reports_is_not_always_an_error() {
        for (classes, data, codes) in [
            // Passive; active again; counters alone.
            (0x204, [0, 0x20, 0, 0, 0, 0, 0, 130], &["can.error-frame"][..]),
            (0x204, [0, 0x40, 0, 0, 0, 0, 0, 90], &[]),
            (0x200, [0, 0, 0, 0, 0, 0, 3, 4], &[]),
            // A stuff error in the CRC sequence, which is none of the checksum; an overrun.
            (0x88, [0, 0, 4, 8, 0, 0, 0, 0], &["can.error-frame", "can.stuff"]),
            (0x04, [0, 1, 0, 0, 0, 0, 0, 0], &["can.error-frame", "can.dropped"]),
        ] {
            let id = Identifier::Extended(classes);
            let frame = Frame::new(Moment::from_ns(0), 1, FrameKind::Error, id, 8).with(&data);
            let mut findings = Vec::new();
            Watch::new(Wire::new(None, Format::FT12)).hear(&frame, &mut findings);
            let names: Vec<&str> = findings.iter().map(|finding| finding.code.name).collect();
            assert_eq!(names, codes);
        }
    }
}
