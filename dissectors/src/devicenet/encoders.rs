//! The encoders of a bus: which stations are some, and what their messages mean.
//!
//! A profile is bound by the user, by the product code together with a successful access to the
//! profile's class, or by an EDS. Nothing is read as an encoder's that is not bound.

use super::cip::class as object;
use super::codes;
use super::eds::{self, Eds};
use super::encoder::codes as encoder_codes;
use super::encoder::{Assembly, Devices, Led, NodeState, Profile, Reading, Watch, baumer};
use super::identifier::{MAC_IDS, MacId};
use super::layer::{Facts, kind};
use super::message::{Service, Target, service};
use crate::event::Moment;
use crate::finding::Finding;
use crate::protocol::Conclusion;
use alloc::vec::Vec;
use alloc::{borrow::ToOwned, boxed::Box, format, string::String, string::ToString, sync::Arc};

/// The attribute of an assembly that holds its data.
const ASSEMBLY_DATA: u16 = 3;

/// The attribute of a connection that says what it produces.
const PRODUCED_PATH: u16 = 14;

/// Bytes of a Set request that are kept until its answer comes.
const KEPT: usize = 8;

/// What is known of each station as a device.
pub(super) struct Encoders {
    stations: Vec<Station>,
    files: Arc<[Eds]>,
}

#[derive(Clone, Default)]
struct Station {
    identity: Identity,
    /// The position class answered.
    has_position_class: bool,
    bound: Option<Box<Bound>>,
    /// Where its description is in the list of files.
    eds: Option<usize>,
    /// The Set request that waits for its answer.
    set: Option<(Target, [u8; KEPT], usize)>,
    /// When it last produced by change of state.
    produced: Moment,
    /// Another node has its MAC ID.
    is_doubled: bool,
}

/// A profile, why it is believed, and what was heard since.
#[derive(Clone)]
struct Bound {
    watch: Watch,
    evidence: String,
}

/// What the Identity object told: vendor, device type, product code, major revision.
#[derive(Clone, Copy, Default)]
struct Identity {
    vendor: Option<u16>,
    device_type: Option<u16>,
    product_code: Option<u16>,
    major_revision: Option<u8>,
}

impl Encoders {
    pub fn new(devices: &Devices, files: &Arc<[Eds]>) -> Self {
        let mut stations = alloc::vec![Station::default(); MAC_IDS];
        for (station, profile) in devices {
            if let Some(station) = stations.get_mut(usize::from(*station)) {
                station.bind(*profile, "--device says so".to_owned());
            }
        }
        Encoders { stations, files: Arc::clone(files) }
    }

    /// How the objects of a station are read.
    pub fn profile(&self, station: Option<MacId>) -> Option<Profile> {
        Some(self.stations[station?.index()].bound.as_ref()?.watch.profile())
    }

    /// The maker's description of a station.
    pub fn eds(&self, station: Option<MacId>) -> Option<&Eds> {
        self.files.get(self.stations[station?.index()].eds?)
    }

    /// What the I/O data of a bound station says.
    pub fn reading(&self, facts: &Facts, data: Option<&[u8]>) -> Option<(Assembly, Reading)> {
        let is_production = matches!(
            facts.kind,
            kind::POLL_RESPONSE | kind::STROBE_RESPONSE | kind::COS | kind::CYCLIC
        );
        let slave = facts.source.filter(|_| is_production && facts.fragment.is_none())?;
        let (profile, data) = (self.profile(Some(slave))?, data?);
        let assembly = profile.assembly_of_size(data.len())?;
        Some((assembly, assembly.read(data).ok()?))
    }

    /// Takes a frame's meaning and adds what is wrong with it. `rate_ns` is the packet rate of the
    /// station's change-of-state production.
    pub fn hear(
        &mut self,
        facts: &Facts,
        (data, reading): (Option<&[u8]>, Option<Reading>),
        (now, rate_ns): (Moment, Option<i64>),
        findings: &mut Vec<Finding>,
    ) {
        let Some(mac) = facts.station else { return };
        let restarted = findings.iter().any(|finding| finding.code == &codes::NODE_RESTART);
        let station = &mut self.stations[mac.index()];
        station.is_doubled |= findings.iter().any(|finding| finding.code == &codes::DUPLICATE_MAC);
        if restarted {
            findings.extend(station.restart());
        }
        if let Some(reading) = reading {
            station.produce(facts.kind, reading, (now, rate_ns), findings);
        }
        let is_whole = facts.fragment.is_none_or(|_| facts.completes.is_some());
        if let (Some(asked), true) = (facts.service, is_whole) {
            match asked.is_response {
                false => {
                    station.asked(asked, facts.target, data.unwrap_or_default(), now, findings)
                }
                true if facts.error.is_some() => station.set = None,
                true => {
                    station.answered(asked, facts.target, data.unwrap_or_default(), now, findings);
                    station.describe(&self.files);
                }
            }
        }
    }

    /// A station restarted, as was found out without a frame of its own.
    pub fn restart(&mut self, station: MacId) -> Option<Finding> {
        self.stations[station.index()].restart()
    }

    /// What was lost may have been anything.
    pub fn lose(&mut self) {
        for station in &mut self.stations {
            (station.set, station.produced) = (None, Moment::UNKNOWN);
            if let Some(bound) = &mut station.bound {
                bound.watch.interrupt();
            }
        }
    }

    /// Which stations are read by a profile, and why; and what each encoder's LED should look like
    /// at the end, by the `state` of its node.
    pub fn conclusions(&self, state: impl Fn(MacId) -> NodeState) -> Vec<Conclusion> {
        let mut all = Vec::new();
        for (number, station) in (0..).zip(&self.stations) {
            let Some(bound) = &station.bound else { continue };
            let mut conclude = |subject, value: &str, evidence: &str| {
                let (value, evidence) = (Some(value.to_owned()), evidence.to_owned());
                all.push(Conclusion { subject, station: Some(number), value, evidence });
            };
            conclude("device", bound.watch.profile().name(), &bound.evidence);
            let mac = MacId::new(number as u8);
            let state = mac.map_or(NodeState::Absent, &state);
            let led = Led::of(if station.is_doubled { NodeState::Faulted } else { state });
            conclude("DUO LED", &led.to_string(), led.meaning());
        }
        all
    }
}

impl Station {
    fn bind(&mut self, profile: Profile, evidence: String) {
        let kind = self.identity.product_code.and_then(baumer::kind_of_product);
        self.bound = Some(Box::new(Bound { watch: Watch::new(profile, kind), evidence }));
    }

    fn restart(&mut self) -> Option<Finding> {
        (self.set, self.produced, self.is_doubled) = (None, Moment::UNKNOWN, false);
        self.bound.as_mut()?.watch.restart()
    }

    fn asked(
        &mut self,
        asked: Service,
        target: Target,
        data: &[u8],
        now: Moment,
        findings: &mut Vec<Finding>,
    ) {
        self.set = None;
        if asked.code != service::SET {
            return;
        }
        if let Some(kept) = data.get(..data.len().min(KEPT)) {
            let mut bytes = [0; KEPT];
            bytes[..kept.len()].copy_from_slice(kept);
            self.set = Some((target, bytes, kept.len()));
        }
        if let (Some(attribute), Some(bound)) = (self.position_attribute(target), &mut self.bound) {
            bound.watch.ask_to_write(attribute, data, now, findings);
        }
    }

    fn answered(
        &mut self,
        answered: Service,
        target: Target,
        data: &[u8],
        now: Moment,
        findings: &mut Vec<Finding>,
    ) {
        self.learn(answered, target, data);
        let set = self.set.take().filter(|(asked, ..)| *asked == target);
        let attribute = self.position_attribute(target);
        let Some(bound) = &mut self.bound else { return };
        let is_object =
            |class, attribute| target.class == Some(class) && target.attribute == Some(attribute);
        match (answered.code, attribute, set) {
            (service::GET, Some(attribute), _) => bound.watch.read(attribute, data, now, findings),
            (service::GET, None, _) if is_object(object::ASSEMBLY, ASSEMBLY_DATA) => {
                let assembly = target.instance.and_then(|it| bound.watch.profile().assembly(it));
                let reading = assembly.and_then(|assembly| assembly.read(data).ok());
                if let Some(reading) = reading {
                    bound.watch.hear(reading, now, findings);
                }
            }
            // It selects the assembly, and is saved at once.
            (service::SET, None, Some(_)) if is_object(object::CONNECTION, PRODUCED_PATH) => {
                findings.push(Finding::new(&encoder_codes::WRITTEN));
            }
            (service::SET, Some(attribute), Some((_, bytes, length))) => {
                bound.watch.write(attribute, &bytes[..length], findings);
            }
            (code, ..) => {
                let command = target.class.and_then(|class| baumer::Command::of(class, code));
                if let Some(command) = command {
                    bound.watch.command(command, findings);
                }
            }
        }
    }

    /// The attribute of the position class that is meant.
    fn position_attribute(&self, target: Target) -> Option<u8> {
        let profile = self.bound.as_ref()?.watch.profile();
        let attribute = u8::try_from(target.attribute?).ok()?;
        profile.position_attribute(target.class?, target.instance?, attribute)
    }

    /// Takes what an answer tells of the device itself.
    fn learn(&mut self, answered: Service, target: Target, data: &[u8]) {
        let Target { class: Some(class), instance: Some(1), attribute } = target else { return };
        if class == object::IDENTITY && answered.code == service::GET {
            let identity = &mut self.identity;
            match (attribute, data) {
                (Some(1), [low, high]) => identity.vendor = Some(word(*low, *high)),
                (Some(2), [low, high]) => identity.device_type = Some(word(*low, *high)),
                (Some(3), [low, high]) => identity.product_code = Some(word(*low, *high)),
                (Some(4), [major, _]) => identity.major_revision = Some(*major & 0x7F),
                _ => {}
            }
        }
        self.has_position_class |= class == baumer::ENCODER_POSITION;
        let code = self.identity.product_code;
        let profile = code.and_then(Profile::of_product_code);
        if let (Some(profile), Some(code), None, true) =
            (profile, code, &self.bound, self.has_position_class)
        {
            self.bind(profile, format!("product code {code} and an answer of class 2Fh"));
        }
    }

    /// Finds the maker's description, once the identity is known.
    fn describe(&mut self, files: &[Eds]) {
        if files.is_empty() || self.eds.is_some() {
            return;
        }
        let Identity { vendor, device_type, product_code, major_revision } = self.identity;
        let known = vendor.zip(device_type).zip(product_code).zip(major_revision);
        let Some((((vendor, device_type), product_code), major_revision)) = known else { return };
        let identity = eds::Identity { vendor, device_type, product_code, major_revision };
        self.eds = files.iter().position(|file| file.describes(&identity));
        let file = self.eds.and_then(|place| files.get(place));
        if file.is_some_and(|file| file.has_class(baumer::ENCODER_POSITION)) && self.bound.is_none()
        {
            self.bind(Profile::BaumerEncoder, "its EDS has class 2Fh".to_owned());
        }
    }

    fn produce(
        &mut self,
        told: &'static str,
        reading: Reading,
        (now, rate_ns): (Moment, Option<i64>),
        findings: &mut Vec<Finding>,
    ) {
        let Some(bound) = &mut self.bound else { return };
        if told == kind::COS {
            let gap = now.since(self.produced);
            self.produced = now;
            // At the packet rate it produces whatever the delta is; the same again is a retry.
            let is_early = gap.zip(rate_ns).is_some_and(|(gap, rate)| gap < rate / 10 * 9);
            let step = bound.watch.produce(reading.position).filter(|step| *step > 0);
            if let (Some(step), Some(delta), true) = (step, bound.watch.delta(), is_early)
                && step < delta
            {
                let finding = Finding::new(&codes::DELTA_IGNORED).actual(i64::from(step));
                findings.push(finding.limit(i64::from(delta)));
            }
        }
        bound.watch.hear(reading, now, findings);
    }
}

const fn word(low: u8, high: u8) -> u16 {
    u16::from_le_bytes([low, high])
}
