//! The encoders of a bus: which stations are some, and what their messages mean.
//!
//! A profile is bound by the user, by the product code together with a successful access to the
//! profile's class, or by an EDS. Nothing is read as an encoder's that is not bound.

use super::cip::service::GET_ATTRIBUTES_ALL;
use super::cip::{DeviceIdentity, Path, class as object};
use super::codes;
use super::eds::{self, Eds};
use super::encoder::codes as encoder_codes;
use super::encoder::{Assembly, Led, NodeState, Profile, Reading, Watch, baumer};
use super::identifier::{MAC_IDS, MacId};
use super::layer::{Facts, kind};
use super::message::{Service, Target, service};
use crate::event::Moment;
use crate::finding::Finding;
use crate::protocol::{Conclusion, Settings};
use crate::station::Resolution;
use alloc::vec::Vec;
use alloc::{borrow::ToOwned, boxed::Box, format, string::String, string::ToString, sync::Arc};

/// The attribute of an assembly that holds its data.
const ASSEMBLY_DATA: u16 = 3;

/// The attribute of a connection that says what it produces.
const PRODUCED_PATH: u16 = 14;

/// Why a station has two LEDs: the one that is on line stays there (manual §9.2; CIP Vol. 3,
/// chapter 6).
const DOUBLED: &str = "its MAC ID is assigned twice: the node that came second stays off line";

/// What is known of each station as a device.
pub(super) struct Encoders {
    stations: Vec<Station>,
    files: Arc<[Eds]>,
}

#[derive(Clone, Default)]
struct Station {
    identity: Identity,
    /// Positions that it has, as the user says.
    positions: Option<u32>,
    /// The position class answered.
    has_position_class: bool,
    bound: Option<Box<Bound>>,
    /// Where its description is in the list of files.
    eds: Option<usize>,
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
#[derive(Clone, Copy, PartialEq, Eq, Default)]
struct Identity {
    vendor: Option<u16>,
    device_type: Option<u16>,
    product_code: Option<u16>,
    major_revision: Option<u8>,
}

impl Identity {
    /// Takes what an answer of the Identity object tells.
    fn learn(&mut self, code: u8, attribute: Option<u16>, data: &[u8]) {
        match (code, attribute, data) {
            (service::GET, Some(1), [low, high]) => self.vendor = Some(word(*low, *high)),
            (service::GET, Some(2), [low, high]) => self.device_type = Some(word(*low, *high)),
            (service::GET, Some(3), [low, high]) => self.product_code = Some(word(*low, *high)),
            (service::GET, Some(4), [major, _]) => self.major_revision = Some(*major & 0x7F),
            (GET_ATTRIBUTES_ALL, ..) => {
                let Ok((_, all)) = DeviceIdentity::parse(data) else { return };
                (self.vendor, self.device_type) = (Some(all.vendor), Some(all.device_type));
                self.product_code = Some(all.product_code);
                self.major_revision = Some(all.revision.major);
            }
            _ => {}
        }
    }
}

impl Encoders {
    pub fn new(settings: &Settings) -> Self {
        let mut stations = alloc::vec![Station::default(); MAC_IDS];
        for (number, station) in (0..).zip(&mut stations) {
            let resolution = settings.stations.get(&number).and_then(|known| known.resolution);
            station.positions = resolution.map(Resolution::positions);
        }
        for (station, profile) in &settings.devices {
            let place = stations.get_mut(usize::from(*station));
            if let Some((station, profile)) = place.zip(profile.on_devicenet()) {
                station.bind(profile, "--device says so".to_owned());
            }
        }
        Encoders { stations, files: Arc::clone(&settings.eds) }
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
            if !asked.is_response {
                station.asked(asked, facts.target, data.unwrap_or_default(), now, findings);
            } else if facts.error.is_none() {
                let before = station.identity;
                station.answered(asked, facts, data.unwrap_or_default(), now, findings);
                if station.identity != before {
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
            station.produced = Moment::UNKNOWN;
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
            let mut conclude = |subject, value: &str, evidence: &str| {
                let (value, evidence) = (Some(value.to_owned()), evidence.to_owned());
                all.push(Conclusion { subject, station: Some(number), value, evidence });
            };
            if let Some(eds) = station.eds.and_then(|place| self.files.get(place)) {
                conclude("EDS", &eds.device.product_name, "vendor and product as the device says");
            }
            let Some(bound) = &station.bound else { continue };
            conclude("device", bound.watch.profile().name(), &bound.evidence);
            let mac = MacId::new(number as u8);
            let led = Led::of(mac.map_or(NodeState::Absent, &state));
            match station.is_doubled {
                true => conclude("DUO LED", &format!("{led}, red at the second node"), DOUBLED),
                false => conclude("DUO LED", &led.to_string(), led.meaning()),
            }
            let mut unsaved = bound.watch.unsaved().peekable();
            if unsaved.peek().is_some() {
                let names: Vec<&str> = unsaved.collect();
                conclude("not saved", &names.join(", "), "written or reset, and no Save since");
            }
        }
        let is_used = |place| self.stations.iter().any(|station| station.eds == Some(place));
        for (_, file) in self.files.iter().enumerate().filter(|(place, _)| !is_used(*place)) {
            let value = format!("{} of no station", file.device.product_name);
            // Whose file it is was told by nobody, or all who told are others.
            let is_told = |station: &Station| {
                station.identity.vendor.zip(station.identity.product_code).is_some()
            };
            let evidence = match self.stations.iter().any(is_told) {
                true => {
                    "vendor, product code, type or revision that stations told are not those of it"
                }
                false => "nobody told its vendor, product code, type and revision",
            };
            let evidence = evidence.to_owned();
            all.push(Conclusion { subject: "EDS", station: None, value: Some(value), evidence });
        }
        all
    }
}

impl Station {
    fn bind(&mut self, profile: Profile, evidence: String) {
        let kind = self.identity.product_code.and_then(baumer::kind_of_product);
        self.bound =
            Some(Box::new(Bound { watch: Watch::new(profile, kind, self.positions), evidence }));
    }

    fn restart(&mut self) -> Option<Finding> {
        (self.produced, self.is_doubled) = (Moment::UNKNOWN, false);
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
        if asked.code != service::SET {
            return;
        }
        if let (Some(attribute), Some(bound)) = (self.position_attribute(target), &mut self.bound) {
            bound.watch.ask_to_write(attribute, data, now, findings);
        }
    }

    fn answered(
        &mut self,
        answered: Service,
        facts: &Facts,
        data: &[u8],
        now: Moment,
        findings: &mut Vec<Finding>,
    ) {
        let target = facts.target;
        self.learn(answered, target, data);
        let attribute = self.position_attribute(target);
        let Some(bound) = &mut self.bound else { return };
        let is_object =
            |class, attribute| target.class == Some(class) && target.attribute == Some(attribute);
        match (answered.code, attribute, facts.written) {
            (service::GET, Some(attribute), _) => bound.watch.read(attribute, data, now, findings),
            (service::GET, None, _) if is_object(object::ASSEMBLY, ASSEMBLY_DATA) => {
                let assembly = target.instance.and_then(|it| bound.watch.profile().assembly(it));
                let reading = assembly.and_then(|assembly| assembly.read(data).ok());
                if let Some(reading) = reading {
                    bound.watch.hear(reading, now, findings);
                }
            }
            // It selects the assembly, and is saved at once.
            (service::SET, None, Some(path)) if is_object(object::CONNECTION, PRODUCED_PATH) => {
                let mut written = Finding::new(&encoder_codes::WRITTEN);
                let assembly = Path::parse(path.bytes()).and_then(Path::assembly);
                written.actual = assembly.map(i64::from);
                findings.push(written);
            }
            (service::SET, Some(attribute), Some(written)) => {
                bound.watch.write(attribute, written.bytes(), findings);
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
        if class == object::IDENTITY {
            self.identity.learn(answered.code, attribute, data);
        }
        self.has_position_class |= class == baumer::ENCODER_POSITION;
        let code = self.identity.product_code;
        let kind = code.and_then(baumer::kind_of_product);
        if let (Some(kind), Some(bound)) = (kind, &mut self.bound) {
            bound.watch.suppose(kind);
        }
        let profile = code.and_then(Profile::of_product_code);
        if let (Some(profile), Some(code), None, true) =
            (profile, code, &self.bound, self.has_position_class)
        {
            self.bind(profile, format!("product code {code} and an answer of class 2Fh"));
        }
    }

    /// Finds the maker's description, as far as the identity is known.
    fn describe(&mut self, files: &[Eds]) {
        let Identity { vendor, device_type, product_code, major_revision } = self.identity;
        let Some((vendor, product_code)) = vendor.zip(product_code) else { return };
        let identity = eds::Identity { vendor, device_type, product_code, major_revision };
        self.eds = eds::find(files, &identity);
        let file = self.eds.and_then(|place| files.get(place));
        let profile = Profile::of_product_code(product_code);
        if let (Some(profile), Some(true), None) =
            (profile, file.map(|file| file.has_class(baumer::ENCODER_POSITION)), &self.bound)
        {
            let evidence = format!("product code {product_code} and an EDS with class 2Fh");
            self.bind(profile, evidence);
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
