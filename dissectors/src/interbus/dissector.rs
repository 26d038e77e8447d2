//! Rows and cycles in, records out.

use super::PROTOCOL;
use super::codes;
use super::device::Known;
use super::judge::Judgement;
use super::layer::{Facts, kind};
use super::line::{Crc, Cycle, Direction, Select, Trouble};
use super::profile::Profile;
use super::report::Report;
use super::row::{Content, Device, Row};
use super::settings::Settings;
use super::word::Word;
use crate::event::{Event, Moment, Silence};
use crate::finding::Finding;
use crate::motion::Jump;
use crate::protocol::{self, Conclusion, Dissector};
use crate::record::{BusInfo, Output, Record, Turn};
use crate::uart::Wire;
use alloc::{boxed::Box, collections::BTreeMap, format, string::String, vec::Vec};

/// A ring that is being listened to.
pub struct Interbus {
    wire: Wire,
    settings: Settings,
    /// Devices that the user named.
    profiles: BTreeMap<u16, Profile>,
    /// The devices that were heard, by number: 512 at most. None stands at 0, where rows are put
    /// that name no device.
    devices: Vec<Option<Box<Known>>>,
    /// What the master, at 0, and couplers of each device report of the line.
    reported: BTreeMap<u16, u8>,
    judgement: Judgement,
    at_end: Vec<Finding>,
}

impl Interbus {
    /// A ring of which nothing was heard yet.
    #[must_use]
    pub fn new(wire: Wire, settings: &protocol::Settings) -> Self {
        let named = settings.devices.iter();
        let profiles = named.filter_map(|(station, it)| Some((*station, it.on_interbus()?)));
        Interbus {
            wire,
            settings: settings.interbus.clone(),
            profiles: profiles.collect(),
            devices: Vec::new(),
            reported: BTreeMap::new(),
            judgement: Judgement::default(),
            at_end: Vec::new(),
        }
    }

    /// A row of a log, or what a cycle of that number carried for one device.
    fn row(&mut self, bus: &BusInfo, row: &Row, of_cycle: Option<u64>, out: &mut Output<'_>) {
        let kind = match row.content {
            Content::Process { out: sent, input } => {
                let words = (sent.map(Word::new), input.map(Word::new));
                return self.process(bus, row, words, of_cycle, out);
            }
            Content::Identification(_) => kind::ID_WORD,
            Content::Diagnostic { .. } | Content::SlaveDiagnostic(_) | Content::Message => {
                kind::DIAGNOSTIC
            }
        };
        self.judgement.clear();
        let report = Report::of(row, self.settings.master);
        if let Some(bits) = report.and_then(|report| report.line_trouble()) {
            let reported = self.reported.entry(row.device.map_or(0, Device::number)).or_default();
            if bits & !core::mem::replace(reported, bits) != 0 {
                self.judgement.find(Finding::new(&codes::LINE));
            }
        }
        let facts = Facts { row: Some(row), report, ..Facts::default() };
        self.tell(bus, row, kind, Turn::Neither, &facts, out);
    }

    /// A row of process data: where the handshake of its device stands, and the position.
    fn process(
        &mut self,
        bus: &BusInfo,
        row: &Row,
        words: (Option<Word>, Option<Word>),
        of_cycle: Option<u64>,
        out: &mut Output<'_>,
    ) {
        self.judgement.clear();
        let n = out.next_number();
        let Interbus { devices, profiles, settings, judgement, .. } = self;
        let device = known(devices, profiles, row.device);
        let (told, jump) = device.hear(row, words, n, (settings, bus.is_unit_guessed), judgement);
        let process = Some(told);
        let facts = Facts { row: Some(row), process, of_cycle, ..Facts::default() };
        self.tell(bus, row, told.state.kind(), told.turn, &facts, out);
        if let Some(jump) = jump {
            self.tell_jump(bus, row, jump, out);
        }
    }

    fn tell(
        &self,
        bus: &BusInfo,
        row: &Row,
        kind: &'static str,
        turn: Turn,
        facts: &Facts<'_>,
        out: &mut Output<'_>,
    ) {
        let mut record = Record::new(&PROTOCOL, kind, (bus, self.wire), facts).of_row(row);
        record.station = row.device.map(Device::number);
        record.turn = turn;
        record.findings = &self.judgement.findings;
        record.ongoing = &self.judgement.ongoing;
        record.withheld = &self.judgement.withheld;
        out.emit(record);
    }

    /// The position before this row's was a jump: an event about its record. To preset value 1 it
    /// jumps when somebody uses the external preset input, which is what that is for.
    fn tell_jump(&self, bus: &BusInfo, row: &Row, jump: Jump, out: &mut Output<'_>) {
        let place = usize::from(row.device.map_or(0, Device::number));
        let preset = self.devices.get(place).and_then(Option::as_ref).and_then(|it| it.preset());
        // The axis may have moved on by one step since.
        let reach = jump.step_before.abs() + 2;
        let is_there = |preset: u32| (i64::from(preset) - i64::from(jump.position)).abs() <= reach;
        let is_preset = !jump.is_spike && preset.is_some_and(is_there);
        let preset_to = is_preset.then_some(jump.position);
        let facts = Facts { preset_to, ..Facts::default() };
        let findings = [Finding::new(&codes::POSITION_JUMP)
            .expected(i64::from(jump.expected))
            .actual(i64::from(jump.position))];
        let record = Record::new(&PROTOCOL, "event", (bus, self.wire), &facts);
        let mut record = record.of_event(row.start, if is_preset { &[] } else { &findings });
        record.uncertainty = row.uncertainty;
        record.station = row.device.map(Device::number);
        record.about = Some(jump.record);
        out.emit(record);
    }

    fn cycle(&mut self, bus: &BusInfo, cycle: &Cycle, out: &mut Output<'_>) {
        let kind = match cycle.select {
            Select::Identification => kind::ID_CYCLE,
            Select::Data => kind::DATA_CYCLE,
        };
        let facts = Facts { cycle: Some(cycle), ..Facts::default() };
        let mut findings = [Finding::new(&codes::LINE); 2];
        let mut count = 0;
        let crc = cycle.crc();
        if let Crc::Bad { expected, actual } = crc {
            let [expected, actual] = [expected, actual].map(i64::from);
            findings[0] = Finding::new(&codes::CRC).expected(expected).actual(actual);
            count = 1;
        }
        count += usize::from(cycle.trouble.is_some());
        let mut record = Record::new(&PROTOCOL, kind, (bus, self.wire), &facts).of_cycle(cycle);
        record.findings = findings.get(..count).unwrap_or_default();
        out.emit(record);
        // What a damaged cycle carried is nobody's process data: the devices drop it too.
        let is_changed = matches!(cycle.trouble, Some(Trouble::Loopback { .. }));
        if cycle.is_damaged() || is_changed || matches!(crc, Crc::Bad { .. }) {
            return;
        }
        let named: Vec<Device> = self.profiles.keys().filter_map(|it| Device::new(*it)).collect();
        for device in named {
            let word = |direction| {
                let data = cycle.data(device, direction)?;
                data.first_chunk().map(|word| u32::from_be_bytes(*word))
            };
            let content =
                Content::Process { out: word(Direction::Out), input: word(Direction::In) };
            if content != (Content::Process { out: None, input: None }) {
                let row = Row::new(Some(device), content).at(cycle.start, cycle.uncertainty);
                self.row(bus, &row, Some(cycle.number), out);
            }
        }
    }

    fn silence(&mut self, bus: &BusInfo, silence: Silence, out: &mut Output<'_>) {
        let nothing = Facts::default();
        let limit = silence.deadline.since(silence.start).unwrap_or(0);
        let findings = [Finding::new(&codes::RESET).limit(limit)];
        let blank = Record::new(&PROTOCOL, kind::DATA_CYCLE, (bus, self.wire), &nothing);
        let mut record = blank.of_event(silence.deadline, &findings);
        record.uncertainty = silence.uncertainty;
        out.emit(record);
    }

    fn interrupt(&mut self) {
        self.devices.iter_mut().flatten().for_each(|device| device.interrupt());
    }
}

/// What is known of a device.
fn known<'a>(
    devices: &'a mut Vec<Option<Box<Known>>>,
    profiles: &BTreeMap<u16, Profile>,
    device: Option<Device>,
) -> &'a mut Known {
    let number = device.map_or(0, Device::number);
    let place = usize::from(number);
    if devices.len() <= place {
        devices.resize_with(place + 1, || None);
    }
    devices[place].get_or_insert_with(|| {
        let length = profiles.get(&number).and_then(|profile| match profile {
            Profile::La66 { measuring_length_um } => *measuring_length_um,
        });
        Box::new(Known::new(length))
    })
}

impl Dissector for Interbus {
    fn hear(&mut self, bus: &BusInfo, event: Event<'_>, out: &mut Output<'_>) {
        match event {
            Event::Rows(rows) => rows.iter().for_each(|row| self.row(bus, row, None, out)),
            Event::Cycle(cycle) => self.cycle(bus, cycle, out),
            Event::Silence(silence) => self.silence(bus, silence, out),
            Event::Lost(loss) => {
                self.interrupt();
                let nothing = Facts::default();
                let blank = Record::new(&PROTOCOL, kind::NORMAL, (bus, self.wire), &nothing);
                out.emit(blank.of_loss(loss));
            }
            Event::Characters(_)
            | Event::Frames(_)
            | Event::Levels(_)
            | Event::Break(_)
            | Event::Advance(_) => {}
        }
    }

    fn finish(&mut self, bus: &BusInfo, end: Moment, out: &mut Output<'_>) {
        let nothing = Facts::default();
        for finding in self.at_end.drain(..) {
            let blank = Record::new(&PROTOCOL, kind::NORMAL, (bus, self.wire), &nothing);
            out.emit(blank.of_event(end, &[finding]));
        }
    }

    fn deadline(&self) -> Moment {
        Moment::UNKNOWN
    }

    fn note(&mut self, finding: Finding) {
        self.at_end.push(finding);
    }

    fn conclusions(&self) -> Vec<Conclusion> {
        let heard = (0_u16..).zip(&self.devices);
        let heard = heard.filter_map(|(number, device)| Some((number, device.as_deref()?)));
        let mut conclusions = Vec::new();
        for (number, device) in heard {
            let station = Some(number).filter(|number| *number > 0);
            let mut conclude = |subject, value: Option<String>, evidence| {
                conclusions.push(Conclusion { subject, station, value, evidence });
            };
            if !self.profiles.contains_key(&number) {
                let evidence = "assumed, as a ring tells no device: --device NUMBER=la66:500mm";
                conclude("device", Some(String::from("LA-66")), String::from(evidence));
            }
            if let Some((um, steps)) = device.resolution() {
                let value = format!("{} mm", f64::from(um) / f64::from(steps) / 1_000.0);
                let length = f64::from(um) / 1_000.0;
                conclude("resolution", Some(value), format!("{length} mm in {steps} steps"));
            }
            if let Some(complaint) = device.complaint() {
                conclude("time unit", None, complaint);
            }
            let grain = device.grain();
            if grain.is_decided() && !self.settings.every_cycle {
                let (in_order, skipping) = grain.steps();
                let value = if grain.is_fine(None) { "state by state" } else { "with gaps" };
                let steps = in_order + skipping;
                let evidence = format!("{skipping} of {steps} steps of handshakes skip a state");
                conclude("handshakes", Some(String::from(value)), evidence);
            }
        }
        conclusions
    }
}
