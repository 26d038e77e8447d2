//! One encoder over time: what is known of its parameters, and what was wrong with their use.

use super::baumer::{self, Command, attribute as id};
use super::rules::{AT_REST, Known, Turns, Violation, check_position, check_set, distance};
use super::{Flags, Kind, Profile, Reading, codes};
use crate::event::Moment;
use crate::finding::{Code, Finding, State};
use alloc::vec::Vec;

/// Attributes of class 2Fh: 1 to 95.
const ATTRIBUTES: usize = 96;

/// Positions that are further apart in time, in ns, tell no motion.
const MOTION_NS: i64 = 1_000_000_000;

/// How far back motion is looked for, in ns.
const LOOK_BACK_NS: i64 = 250_000_000;

/// What was heard of one encoder.
#[derive(Clone, Debug)]
pub struct Watch {
    profile: Profile,
    kind: Option<Kind>,
    /// Values of the position class as they were last read or written.
    values: [Option<i64>; ATTRIBUTES],
    /// Attributes written since the last Save: bit *n* is attribute *n*.
    unsaved: u128,
    last: Option<(u32, Moment)>,
    /// A position of up to a quarter of a second ago.
    before: Option<(u32, Moment)>,
    /// Steps between the last two positions, if they tell of motion.
    motion: Option<u32>,
    /// The position that was produced last, unasked.
    produced: Option<u32>,
    alarm: Lasting,
    warning: Lasting,
    told_turns: Option<(u32, u32)>,
}

/// A flag, and since when it is set.
#[derive(Clone, Copy, Default, Debug)]
struct Lasting {
    since: Option<Moment>,
}

impl Lasting {
    fn see(&mut self, is_set: bool, now: Moment, code: &'static Code) -> Option<Finding> {
        match (self.since, is_set) {
            (None, true) => {
                self.since = Some(now);
                Some(Finding::new(code).state(State::Begin))
            }
            (Some(since), false) => {
                self.since = None;
                Some(Finding::new(code).state(State::End(now.since(since))))
            }
            _ => None,
        }
    }
}

impl Watch {
    /// Of an encoder with this profile of which nothing was heard yet.
    #[must_use]
    pub const fn new(profile: Profile, kind: Option<Kind>) -> Self {
        Watch {
            profile,
            kind,
            values: [None; ATTRIBUTES],
            unsaved: 0,
            produced: None,
            last: None,
            before: None,
            motion: None,
            alarm: Lasting { since: None },
            warning: Lasting { since: None },
            told_turns: None,
        }
    }

    /// How its objects are read.
    #[must_use]
    pub const fn profile(&self) -> Profile {
        self.profile
    }

    /// The COS delta in steps, if it was seen.
    #[must_use]
    pub fn delta(&self) -> Option<u32> {
        u32::try_from(self.value(id::COS_DELTA)?).ok()
    }

    /// An attribute of the position class was read: the response's data.
    pub fn read(&mut self, attribute: u8, data: &[u8], now: Moment, findings: &mut Vec<Finding>) {
        let Some(value) = self.decode(attribute, data) else { return };
        self.learn(attribute, value);
        match attribute {
            id::POSITION => self.see_position(value as u32, now, findings),
            id::ALARMS | id::ALARM_FLAG => {
                findings.extend(self.alarm.see(value & 1 != 0, now, &codes::ALARM));
            }
            id::WARNING_FLAG => {
                findings.extend(self.warning.see(value & 1 != 0, now, &codes::WARNING));
            }
            id::WARNINGS => {
                findings.extend(self.warning.see(value & 0x10 != 0, now, &codes::WARNING));
            }
            id::STEPS_PER_TURN | id::TOTAL_RESOLUTION => self.judge_turns(findings),
            _ => {}
        }
    }

    /// Somebody asks to write an attribute of the position class.
    pub fn ask_to_write(
        &mut self,
        attribute: u8,
        data: &[u8],
        now: Moment,
        findings: &mut Vec<Finding>,
    ) {
        // What other profiles allow to be written, no source tells.
        if self.profile == Profile::BaumerEncoder {
            findings.extend(check_set(attribute, data, self.known()).err().map(finding));
        }
        let is_recent =
            self.last.and_then(|(_, at)| now.since(at)).is_some_and(|ns| ns <= MOTION_NS);
        if let (id::PRESET, Some(steps), true) = (attribute, self.motion, is_recent) {
            let finding = Finding::new(&codes::PRESET_WHILE_MOVING).actual(i64::from(steps));
            findings.push(finding.limit(i64::from(AT_REST)));
        }
    }

    /// It was written: the encoder said so.
    pub fn write(&mut self, attribute: u8, data: &[u8], findings: &mut Vec<Finding>) {
        let mut written = Finding::new(&codes::WRITTEN);
        written.expected = self.value(attribute);
        written.actual = self.decode(attribute, data);
        findings.push(written);
        for stale in baumer::changed_by(attribute) {
            if let Some(value) = self.values.get_mut(usize::from(*stale)) {
                *value = None;
            }
        }
        // Positions before and after do not compare.
        self.interrupt();
        if let Some(value) = written.actual {
            self.learn(attribute, value);
        }
        if usize::from(attribute) < ATTRIBUTES {
            self.unsaved |= 1 << attribute;
        }
        if let id::STEPS_PER_TURN | id::TOTAL_RESOLUTION = attribute {
            self.judge_turns(findings);
        }
    }

    /// A service that concerns all parameters succeeded.
    pub fn command(&mut self, command: Command, findings: &mut Vec<Finding>) {
        findings.push(Finding::new(&codes::WRITTEN));
        match command {
            Command::Save => self.unsaved = 0,
            Command::Restore => self.forget_parameters(),
            Command::Reset => {
                self.forget_parameters();
                // The defaults are in effect, and not saved.
                self.unsaved = 1 << id::SENSE_OF_ROTATION;
            }
        }
    }

    /// It restarted, with the parameters it had saved.
    pub fn restart(&mut self) -> Option<Finding> {
        let count = self.unsaved.count_ones();
        self.forget_parameters();
        (self.alarm, self.warning) = (Lasting::default(), Lasting::default());
        let finding = Finding::new(&codes::UNSAVED_PARAMETER).actual(i64::from(count));
        (count > 0).then_some(finding)
    }

    /// I/O data came.
    pub fn hear(&mut self, reading: Reading, now: Moment, findings: &mut Vec<Finding>) {
        self.see_position(reading.position, now, findings);
        if let Flags::Told { alarm, warning, .. } = reading.flags {
            findings.extend(self.alarm.see(alarm, now, &codes::ALARM));
            findings.extend(self.warning.see(warning, now, &codes::WARNING));
        }
    }

    /// A position was produced unasked. Returns how far it is from the one that was produced before,
    /// in steps: what was read in between is none of the encoder's reasons to produce.
    pub fn produce(&mut self, position: u32) -> Option<u32> {
        let before = self.produced.replace(position)?;
        Some(distance(before, position, self.known().total_resolution))
    }

    /// Something was lost: positions before and after do not compare.
    pub fn interrupt(&mut self) {
        (self.last, self.before, self.motion) = (None, None, None);
        self.produced = None;
    }

    fn see_position(&mut self, position: u32, now: Moment, findings: &mut Vec<Finding>) {
        let total = self.known().total_resolution;
        if let Some(total) = total.filter(|total| check_position(position, *total).is_err()) {
            let finding = Finding::new(&codes::POSITION_OUT_OF_RANGE).actual(i64::from(position));
            findings.push(finding.limit(i64::from(total)));
        }
        // Fast polls see a slow shaft move by less than it may flicker: hence a look further back.
        let age = |at: Moment| now.since(at).unwrap_or(i64::MAX);
        let seen = [self.last, self.before].into_iter().flatten();
        let recent = seen.filter(|(_, at)| age(*at) <= MOTION_NS);
        let steps = recent.map(|(then, _)| distance(then, position, total)).max();
        self.motion = steps.filter(|steps| *steps > AT_REST);
        if self.before.is_none_or(|(_, at)| age(at) > LOOK_BACK_NS) {
            self.before = Some((position, now));
        }
        self.last = Some((position, now));
    }

    fn judge_turns(&mut self, findings: &mut Vec<Finding>) {
        let number = |attribute| u32::try_from(self.value(attribute)?).ok();
        let both = number(id::TOTAL_RESOLUTION).zip(number(id::STEPS_PER_TURN));
        let Some(turns) = both.and_then(|(total, steps)| Turns::of(total, steps)) else { return };
        if turns.is_power_of_two() || self.told_turns == both {
            return;
        }
        self.told_turns = both;
        let mut finding = Finding::new(&codes::TURNS_NOT_POWER_OF_TWO);
        finding.actual = turns.whole().map(i64::from);
        findings.push(finding);
    }

    fn known(&self) -> Known {
        let total = self.value(id::TOTAL_RESOLUTION).and_then(|total| u32::try_from(total).ok());
        Known { total_resolution: total.filter(|total| *total > 0), kind: self.kind }
    }

    fn decode(&self, attribute: u8, data: &[u8]) -> Option<i64> {
        let entry = self.profile.attribute(self.profile.position_class(), 1, attribute)?;
        entry.decode(data).ok()?.number()
    }

    fn value(&self, attribute: u8) -> Option<i64> {
        *self.values.get(usize::from(attribute))?
    }

    fn learn(&mut self, attribute: u8, value: i64) {
        if let Some(known) = self.values.get_mut(usize::from(attribute)) {
            *known = Some(value);
        }
        if attribute == id::ENCODER_TYPE {
            self.kind = u16::try_from(value).ok().and_then(Kind::of_encoder_type).or(self.kind);
        }
    }

    fn forget_parameters(&mut self) {
        self.values = [None; ATTRIBUTES];
        self.unsaved = 0;
        self.told_turns = None;
        self.interrupt();
    }
}

fn finding(violation: Violation) -> Finding {
    match violation {
        Violation::NoSuchAttribute | Violation::ReadOnly => Finding::new(&codes::NOT_SETTABLE),
        Violation::WrongLength(_) => Finding::new(&codes::VALUE_OUT_OF_RANGE),
        Violation::OutOfRange { value, lowest, highest } => {
            Finding::new(&codes::VALUE_OUT_OF_RANGE).actual(value).expected(lowest).limit(highest)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(ms: i64) -> Moment {
        Moment::from_ns(ms * 1_000_000)
    }

    fn baumer() -> Watch {
        Watch::new(Profile::BaumerEncoder, Some(Kind::Multiturn))
    }

    /// The codes that something raises.
    fn raised(act: impl FnOnce(&mut Vec<Finding>)) -> Vec<(&'static str, Option<i64>)> {
        let mut findings = Vec::new();
        act(&mut findings);
        findings.iter().map(|finding| (finding.code.name, finding.actual)).collect()
    }

    fn reading(position: u32, alarm: bool, warning: bool) -> Reading {
        Reading { position, flags: Flags::Told { alarm, warning, reserved: 0 }, velocity: None }
    }

    #[test]
    fn a_set_without_save_is_lost_with_a_restart() {
        let mut encoder = baumer();
        let preset = 74_565_u32.to_le_bytes();
        assert!(raised(|told| encoder.ask_to_write(10, &preset, at(0), told)).is_empty());
        assert_eq!(
            raised(|told| encoder.write(10, &preset, told)),
            [("encoder.written", Some(74_565))]
        );
        assert_eq!(encoder.restart().map(|finding| finding.actual), Some(Some(1)));
        raised(|told| encoder.write(10, &preset, told));
        raised(|told| encoder.command(Command::Save, told));
        assert_eq!(encoder.restart(), None);
    }

    #[test]
    fn what_the_manual_forbids_is_told_when_it_is_asked() {
        let mut encoder = baumer();
        let ask = |encoder: &mut Watch, attribute, value: u32| {
            raised(|told| encoder.ask_to_write(attribute, &value.to_le_bytes(), at(0), told))
        };
        // Steps per turn: 1 to 8192. Attribute 12 is the position.
        assert_eq!(ask(&mut encoder, 7, 8193), [("encoder.value-out-of-range", Some(8193))]);
        assert_eq!(ask(&mut encoder, 12, 0), [("encoder.not-settable", None)]);
        assert_eq!(ask(&mut encoder, 7, 3600), []);
    }

    #[test]
    fn turns_that_are_no_power_of_two_are_told_once() {
        let mut encoder = baumer();
        let read = |encoder: &mut Watch, attribute, value: u32| {
            raised(|told| encoder.read(attribute, &value.to_le_bytes(), at(0), told))
        };
        // The manual's 3600 x 256 is healthy; 3600 x 100 is not.
        assert_eq!(read(&mut encoder, 7, 3600), []);
        assert_eq!(read(&mut encoder, 8, 3600 * 256), []);
        let told = [("encoder.turns-not-power-of-two", Some(100))];
        assert_eq!(read(&mut encoder, 8, 3600 * 100), told);
        assert_eq!(read(&mut encoder, 8, 3600 * 100), []);
        // And a position beyond it.
        assert_eq!(
            raised(|told| encoder.hear(reading(360_001, false, false), at(1), told)),
            [("encoder.position-out-of-range", Some(360_001))]
        );
    }

    #[test]
    fn a_preset_wants_a_shaft_at_rest() {
        let mut encoder = baumer();
        let preset = 0_u32.to_le_bytes();
        for (second, told) in [(1002, 0), (1003, 1)] {
            raised(|told| encoder.hear(reading(1000, false, false), at(0), told));
            raised(|told| encoder.hear(reading(second, false, false), at(10), told));
            let raised = raised(|told| encoder.ask_to_write(10, &preset, at(20), told));
            assert_eq!(raised.len(), told, "{second}");
        }
        // What is old tells nothing.
        assert_eq!(raised(|told| encoder.ask_to_write(10, &preset, at(2_000), told)), []);
    }

    #[test]
    fn a_slow_shaft_moves_too() {
        let mut encoder = baumer();
        // 100 steps a second, polled every 20 ms: two steps between polls.
        for n in 0..20 {
            raised(|told| {
                encoder.hear(reading(1000 + 2 * n, false, false), at(20 * i64::from(n)), told)
            });
        }
        let preset = 0_u32.to_le_bytes();
        assert_eq!(raised(|told| encoder.ask_to_write(10, &preset, at(400), told)).len(), 1);
    }

    #[test]
    fn flags_that_are_read_count_as_well() {
        let mut encoder = baumer();
        assert_eq!(raised(|told| encoder.read(85, &[1], at(0), told)), [("encoder.alarm", None)]);
        assert_eq!(raised(|told| encoder.read(88, &[1], at(0), told)), [("encoder.warning", None)]);
    }

    #[test]
    fn alarms_and_warnings_begin_and_end() {
        let mut encoder = baumer();
        let mut findings = Vec::new();
        for (ms, alarm, warning) in
            [(0, false, false), (10, true, true), (20, true, true), (2510, false, true)]
        {
            encoder.hear(reading(5, alarm, warning), at(ms), &mut findings);
        }
        let told: Vec<_> =
            findings.iter().map(|finding| (finding.code.name, finding.state)).collect();
        assert_eq!(
            told,
            [
                ("encoder.alarm", Some(State::Begin)),
                ("encoder.warning", Some(State::Begin)),
                ("encoder.alarm", Some(State::End(Some(2_500_000_000)))),
            ]
        );
        // Assembly 1 has no flags, which ends nothing.
        let silent = Reading { position: 5, flags: Flags::NotOnThisConnection, velocity: None };
        assert_eq!(raised(|told| encoder.hear(silent, at(3_000), told)), []);
    }
}
