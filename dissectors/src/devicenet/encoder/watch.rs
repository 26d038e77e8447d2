//! One encoder over time: what is known of its parameters, and what was wrong with their use.

use super::baumer::{self, Command, attribute as id};
use super::rules::{AT_REST, Known, Turns, Violation, check_position, check_set, distance};
use super::{Flags, Kind, Profile, Reading, codes};
use crate::devicenet::cip::Attribute;
use crate::event::Moment;
use crate::finding::{Code, Finding, State};
use alloc::vec::Vec;

/// Attributes of class 2Fh: 1 to 95.
const ATTRIBUTES: usize = 96;

/// Positions that are further apart in time, in ns, tell no motion.
const MOTION_NS: i64 = 1_000_000_000;

/// How far back motion is looked for, in ns.
const LOOK_BACK_NS: i64 = 250_000_000;

/// By how much two positions may be stamped apart more than they were taken, in ns.
const STAMPING_NS: i64 = 10_000_000;

/// What was heard of one encoder.
#[derive(Clone, Debug)]
pub struct Watch {
    profile: Profile,
    kind: Option<Kind>,
    /// How many positions it has, as the user says: after the last comes the first. What the encoder
    /// says itself comes first, and nothing else is judged by this.
    positions: Option<u32>,
    /// Values of the position class as they were last read or written.
    values: [Option<i64>; ATTRIBUTES],
    /// Attributes written since the last Save: bit *n* is attribute *n*.
    unsaved: u128,
    last: Option<(u32, Moment)>,
    /// A position of up to a quarter of a second ago.
    before: Option<(u32, Moment)>,
    /// By how many steps the shaft moved last, and until when it is taken to move.
    motion: Option<(u32, Moment)>,
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
    /// Of an encoder with this profile of which nothing was heard yet. `positions`: how many it has,
    /// as the user says.
    #[must_use]
    pub const fn new(profile: Profile, kind: Option<Kind>, positions: Option<u32>) -> Self {
        Watch {
            profile,
            kind,
            positions,
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

    /// Its product code stands for this kind: attribute 95 is believed first.
    pub fn suppose(&mut self, kind: Kind) {
        self.kind = self.kind.or(Some(kind).filter(|_| self.is_baumer()));
    }

    /// How its objects are read.
    #[must_use]
    pub const fn profile(&self) -> Profile {
        self.profile
    }

    /// What parameters are called that a restart would undo: written or reset, and not saved.
    pub fn unsaved(&self) -> impl Iterator<Item = &'static str> + use<> {
        let unsaved = self.unsaved;
        let is_unsaved = move |it: &&Attribute| unsaved >> it.id & 1 == 1;
        baumer::ATTRIBUTES.iter().filter(is_unsaved).map(|attribute| attribute.name)
    }

    /// The COS delta in steps, if it was seen.
    #[must_use]
    pub fn delta(&self) -> Option<u32> {
        let delta = self.value(id::COS_DELTA).filter(|_| self.is_baumer())?;
        u32::try_from(delta).ok()
    }

    /// An attribute of the position class was read: the response's data.
    pub fn read(&mut self, attribute: u8, data: &[u8], now: Moment, findings: &mut Vec<Finding>) {
        let Some(value) = self.decode(attribute, data) else { return };
        self.learn(attribute, value);
        let Some(attribute) = self.profile.as_baumer(attribute) else { return };
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
        if self.is_baumer() {
            findings.extend(check_set(attribute, data, self.known()).err().map(finding));
        }
        let is_preset = self.profile.as_baumer(attribute) == Some(id::PRESET);
        let motion = self.motion.filter(|(_, until)| now.is_known() && !now.is_after(*until));
        if let (true, Some((steps, _))) = (is_preset, motion) {
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
        let changed = if self.is_baumer() { baumer::changed_by(attribute) } else { &[] };
        for stale in changed {
            if let Some(value) = self.values.get_mut(usize::from(*stale)) {
                *value = None;
            }
        }
        // Positions before and after do not compare.
        self.interrupt();
        if let Some(value) = written.actual {
            self.learn(attribute, value);
        }
        // Others may save at once.
        if usize::from(attribute) < ATTRIBUTES && self.is_baumer() {
            self.unsaved |= 1 << attribute;
        }
        if let Some(id::STEPS_PER_TURN | id::TOTAL_RESOLUTION) = self.profile.as_baumer(attribute) {
            self.judge_turns(findings);
        }
    }

    /// A service that concerns all parameters succeeded.
    pub fn command(&mut self, command: Command, findings: &mut Vec<Finding>) {
        findings.push(Finding::new(&codes::WRITTEN));
        match command {
            Command::Save => self.unsaved = 0,
            Command::Restore => self.forget_parameters(),
            Command::Reset => self.reset(),
        }
    }

    /// The defaults are in effect, and not saved.
    fn reset(&mut self) {
        self.forget_parameters();
        if !self.is_baumer() {
            return;
        }
        let settable = baumer::ATTRIBUTES.iter().filter(|attribute| attribute.is_settable());
        for attribute in settable.map(|attribute| attribute.id) {
            self.unsaved |= 1 << attribute;
            if let Some(value) = baumer::default_value(attribute, self.kind) {
                self.learn(attribute, value);
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
        Some(distance(before, position, self.known().total_resolution.or(self.positions)))
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
        self.motion = self.motion_to(position, now);
        let age = |at: Moment| now.since(at).unwrap_or(i64::MAX);
        if self.before.is_none_or(|(_, at)| age(at) > LOOK_BACK_NS) {
            self.before = Some((position, now));
        }
        self.last = Some((position, now));
    }

    /// What a position tells of motion. Fast polls see a slow shaft move by less than it may flicker:
    /// hence a look further back, if it moved then no faster than it does now. In change of state mode a shaft that
    /// stopped sends nothing: it moves no longer than the next position would have taken to come.
    fn motion_to(&self, position: u32, now: Moment) -> Option<(u32, Moment)> {
        let round = self.known().total_resolution.or(self.positions);
        let since = |(then, at): (u32, Moment)| {
            let gap = now.since(at).filter(|gap| *gap <= MOTION_NS)?;
            // Where the last position is, nobody said: near zero a shaft at rest may flicker there.
            let may_pass_zero = round.is_none() && then.min(position) <= AT_REST;
            (!may_pass_zero).then(|| (distance(then, position, round), gap))
        };
        let (last, gap) = self.last.and_then(since)?;
        let goes_on = |steps: u32, age: i64| {
            i64::from(steps).saturating_mul(gap) <= i64::from(last + 1).saturating_mul(age)
        };
        let earlier = self.before.and_then(since).filter(|(steps, age)| goes_on(*steps, *age));
        let earlier = earlier.map_or(0, |(steps, _)| steps);
        let steps = if last > 0 { last.max(earlier) } else { 0 };
        (steps > AT_REST).then(|| (steps, now.plus(2 * gap + STAMPING_NS)))
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

    fn is_baumer(&self) -> bool {
        self.profile == Profile::BaumerEncoder
    }

    fn known(&self) -> Known {
        let total = self.value(id::TOTAL_RESOLUTION).filter(|_| self.is_baumer());
        let total = total.and_then(|total| u32::try_from(total).ok());
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
        if attribute == id::ENCODER_TYPE && self.is_baumer() {
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
        Watch::new(Profile::BaumerEncoder, Some(Kind::Multiturn), None)
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
        assert_eq!(encoder.unsaved().collect::<Vec<_>>(), ["Preset value"]);
        raised(|told| encoder.command(Command::Save, told));
        assert_eq!(encoder.unsaved().count(), 0);
        assert_eq!(encoder.restart(), None);
    }

    #[test]
    fn a_reset_brings_the_manuals_defaults_back_until_the_next_restart() {
        let mut encoder = baumer();
        raised(|told| encoder.write(7, &3600_u32.to_le_bytes(), told));
        raised(|told| encoder.command(Command::Reset, told));
        // Manual §4: 8192 steps per turn. What was written before is told as the old value.
        let mut findings = Vec::new();
        encoder.write(7, &4096_u32.to_le_bytes(), &mut findings);
        assert_eq!((findings[0].expected, findings[0].actual), (Some(8192), Some(4096)));
        // Attributes 3, 7, 8, 10 and 11 have their defaults, which nobody saved.
        assert_eq!(encoder.restart().map(|finding| finding.actual), Some(Some(5)));
    }

    #[test]
    fn what_has_another_number_in_another_profile_is_not_mistaken() {
        let mut sensor = Watch::new(Profile::PositionSensor, None, None);
        // Class 23h: 0Bh is the sensor type, 0Ch the sense of rotation, 0Ah the position. In class
        // 2Fh these are the COS delta, the position and the preset.
        raised(|told| sensor.read(0x0B, &[2, 0], at(0), told));
        assert_eq!(sensor.delta(), None);
        raised(|told| sensor.read(0x0A, &1000_u32.to_le_bytes(), at(0), told));
        raised(|told| sensor.read(0x0C, &[1], at(5), told));
        raised(|told| sensor.read(0x0A, &1000_u32.to_le_bytes(), at(10), told));
        let preset = 0_u32.to_le_bytes();
        assert_eq!(raised(|told| sensor.ask_to_write(0x13, &preset, at(20), told)), []);
        raised(|told| sensor.read(0x03, &1100_u32.to_le_bytes(), at(30), told));
        let moving = [("encoder.preset-while-moving", Some(100))];
        assert_eq!(raised(|told| sensor.ask_to_write(0x13, &preset, at(40), told)), moving);
        assert_eq!(raised(|told| sensor.read(0x2E, &[1], at(0), told)), [("encoder.alarm", None)]);
        // That a Set wants a Save is said by Baumer's manual only.
        raised(|told| sensor.write(0x10, &4096_u32.to_le_bytes(), told));
        assert_eq!(sensor.restart(), None);
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
    fn a_shaft_that_stopped_is_at_rest() {
        let preset = 0_u32.to_le_bytes();
        let told = |positions: &[(i64, u32)], ms| {
            let mut encoder = baumer();
            for (ms, position) in positions {
                raised(|told| encoder.hear(reading(*position, false, false), at(*ms), told));
            }
            raised(|told| encoder.ask_to_write(10, &preset, at(ms), told)).len()
        };
        // Polled every 20 ms: it stood still since the last poll but one.
        assert_eq!(told(&[(0, 1000), (20, 1500), (40, 1600), (60, 1600)], 65), 0);
        // The last bit flickers where it stopped.
        assert_eq!(told(&[(0, 1000), (20, 1500), (40, 1600), (60, 1600), (80, 1601)], 85), 0);
        // The position before 0 is the highest, whatever that is: it was not said.
        assert_eq!(told(&[(0, 0), (20, 8191), (40, 0)], 45), 0);
        // By change of state, every 20 ms while it turned: nothing came for 100 ms.
        assert_eq!(told(&[(0, 1000), (20, 1500), (40, 1600)], 50), 1);
        assert_eq!(told(&[(0, 1000), (20, 1500), (40, 1600)], 140), 0);
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
