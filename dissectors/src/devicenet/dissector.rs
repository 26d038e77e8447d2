//! The DeviceNet bus: frames in, a record for each at once, and events for what did not come.

use super::alarms::Told;
use super::codes;
use super::connection::Mark;
use super::encoders::Encoders;
use super::identifier::{MacId, Port};
use super::layer::{Bytes, Facts, Link, Message, kind};
use super::ledger::{Ledger, Now, is_foreign};
use super::members::{LaidOut, carried};
use super::names::Names;
use super::{PROTOCOL, Settings};
use crate::can::{self, ErrorDetail, Frame, FrameFields, FrameKind, Identifier, Load, Watch};
use crate::event::{Event, Loss, Moment};
use crate::finding::Finding;
use crate::measure::Measurement;
use crate::protocol::{self, Conclusion, Dissector};
use crate::record::{BusInfo, Output, Record};
use crate::station::Stations;
use crate::uart::Wire;
use alloc::vec::Vec;

/// The state of one DeviceNet bus.
pub struct DeviceNet {
    wire: Wire,
    watch: Watch,
    ledger: Ledger,
    encoders: Encoders,
    stations: Stations,
    /// The last stamp that was told, and its ±.
    last: (Moment, u32),
    at_end: Vec<Finding>,
}

impl DeviceNet {
    /// A bus that nothing was heard of.
    #[must_use]
    pub fn new(wire: Wire, settings: &protocol::Settings) -> Self {
        DeviceNet {
            wire,
            watch: Watch::new(wire),
            ledger: Ledger::new(wire, settings.devicenet),
            encoders: Encoders::new(settings),
            stations: settings.stations.clone(),
            last: (Moment::UNKNOWN, 0),
            at_end: Vec::new(),
        }
    }

    /// The limits that traffic is judged by.
    #[must_use]
    pub const fn settings(&self) -> &Settings {
        &self.ledger.settings
    }

    fn frame(&mut self, bus: &BusInfo, frame: &Frame, out: &mut Output<'_>) {
        if self.runs_backwards(frame) {
            self.forget();
        }
        self.pass(bus, frame.start, out);
        if ErrorDetail::of(frame).is_some_and(|detail| detail.is_gap()) {
            self.forget();
        }
        self.restart_encoders(bus, frame.start, out);
        let id = match (frame.kind, frame.id) {
            (FrameKind::Data, Identifier::Standard(id)) if frame.crc != Some(false) => Some(id),
            _ => None,
        };
        if let Some(Port::StrobeCommand(master)) = id.map(Port::of) {
            self.miss_strobes(bus, master, frame.start, out);
        }
        self.ledger.judgement.clear();
        let bits = self.watch.hear(frame, &mut self.ledger.judgement.findings);
        let n = out.next_number();
        let mark = Mark { n, start: frame.start, uncertainty: frame.uncertainty };
        let facts = match id {
            Some(id) => {
                let is_repeating = self.watch.is_repeating();
                let now = Now { frame, id, data: frame.bytes(), mark, bits, is_repeating };
                self.look(&now)
            }
            None => self.glance(frame),
        };
        self.tell(bus, (frame, bits), facts, out);
        self.last = (frame.start, frame.uncertainty);
    }

    /// Whether time jumped back by more than the stamps' ±.
    fn runs_backwards(&self, frame: &Frame) -> bool {
        let (last, uncertainty) = self.last;
        let stamps = i64::from(uncertainty) + i64::from(frame.uncertainty);
        frame.start.since(last).is_some_and(|ns| ns < -stamps)
    }

    fn look(&mut self, now: &Now<'_>) -> Facts {
        let mut facts = self.ledger.look(now);
        if let Some(eds) = self.encoders.eds(facts.station) {
            self.ledger.judge_by_description(now, &mut facts, eds);
        }
        if now.frame.is_cut() {
            // The frame on the wire was longer: what is missing is not its sender's fault.
            let blamed = [&codes::MALFORMED, &codes::SIZE_MISMATCH, &codes::FRAGMENT_SEQUENCE];
            self.ledger.judgement.findings.retain(|finding| !blamed.contains(&finding.code));
            self.ledger.lose_message(now.id, &facts);
        }
        facts
    }

    /// What a frame is that says nothing about the bus's state.
    fn glance(&mut self, frame: &Frame) -> Facts {
        if frame.kind == FrameKind::Error {
            let findings = &self.ledger.judgement.findings;
            let is_error = findings.iter().any(|finding| finding.code == &can::ERROR_FRAME);
            self.ledger.errors += u64::from(is_error);
            return Facts::new(kind::CAN_ERROR);
        }
        if is_foreign(frame) {
            self.ledger.judgement.find(Finding::new(&codes::FOREIGN_FRAME));
            return Facts::new(kind::FOREIGN);
        }
        self.ledger.glance(frame)
    }

    fn tell(
        &mut self,
        bus: &BusInfo,
        (frame, bits): (&Frame, Option<u16>),
        facts: Facts,
        out: &mut Output<'_>,
    ) {
        let assembly = |place: Option<usize>| place.and_then(|it| self.ledger.assemblies.get(it));
        let bytes = |at: Bytes| {
            let all = match at.assembly {
                Some(place) => assembly(Some(place)).map_or(&[][..], |it| it.data()),
                None => frame.bytes(),
            };
            all.get(at.start..)
        };
        let (data, io) = (facts.data.and_then(bytes), facts.io.and_then(bytes));
        let reading = self.encoders.reading(&facts, io);
        let rate = facts.station.and_then(|mac| self.ledger.production_rate(mac));
        let said = (data, reading.map(|(_, reading)| reading));
        let findings = &mut self.ledger.judgement.findings;
        self.encoders.hear(&facts, said, (frame.start, rate), findings);
        let names = Names {
            profile: self.encoders.profile(facts.station),
            eds: self.encoders.eds(facts.station),
        };
        let laid_out = io.and_then(|io| self.laid_out(&facts, io));
        let message = Message {
            frame: FrameFields::new(Some(frame)),
            data,
            value: facts.value(data, &names),
            io,
            reading,
            laid_out,
            names,
            stations: &self.stations,
            fragments: assembly(facts.completes).map_or(&[], |it| it.numbers()),
            facts,
        };
        let mut record =
            Record::new(&PROTOCOL, facts.kind, (bus, self.wire), &message).of_frame(frame);
        record.duration = can::duration(bits, self.wire);
        record.station = facts.station.map(|mac| u16::from(mac.get()));
        record.turn = facts.turn;
        record.findings = &self.ledger.judgement.findings;
        record.withheld = &self.ledger.judgement.withheld;
        out.emit(record);
    }

    /// What I/O data is by the maker's description of its station.
    fn laid_out<'a>(&'a self, facts: &Facts, data: &'a [u8]) -> Option<LaidOut<'a>> {
        let eds = self.encoders.eds(facts.station)?;
        let (slave, instance, direction, mode) = carried(facts)?;
        let assembly = self.ledger.assembly_of((slave, instance, direction));
        LaidOut::of(eds, (direction, mode), assembly, data)
    }

    /// Tells what was due before `now`.
    fn pass(&mut self, bus: &BusInfo, now: Moment, out: &mut Output<'_>) {
        while let Some(told) = self.ledger.alarm(now) {
            self.event(bus, told, out);
        }
    }

    /// Encoders that restarted after a longer time, which is no finding of its own, have lost what
    /// was not saved as well.
    fn restart_encoders(&mut self, bus: &BusInfo, now: Moment, out: &mut Output<'_>) {
        while self.ledger.restarted != 0 {
            let mac = MacId::of(self.ledger.restarted.trailing_zeros() as u8);
            self.ledger.restarted &= !mac.bit();
            if let Some(finding) = self.encoders.restart(mac) {
                self.ledger.judgement.clear();
                self.ledger.judgement.find(finding);
                let told = Told { station: Some(mac), ..Told::at(now) };
                self.event(bus, told, out);
            }
        }
    }

    /// The slaves that the strobe before this one got no answer from.
    fn miss_strobes(&mut self, bus: &BusInfo, master: MacId, now: Moment, out: &mut Output<'_>) {
        for (slave, strobe) in self.ledger.missing_strobes(master) {
            self.ledger.judgement.clear();
            self.ledger.judgement.find(Finding::new(&codes::NO_STROBE_RESPONSE));
            let (about, link) = (Some(strobe.n), Some(Link::Strobe));
            self.event(bus, Told { about, station: Some(slave), link, ..Told::at(now) }, out);
        }
    }

    /// Tells what is in the judgement as an event: never before what was told last.
    fn event(&mut self, bus: &BusInfo, told: Told, out: &mut Output<'_>) {
        let findings = &mut self.ledger.judgement.findings;
        if findings.iter().any(|finding| finding.code == &codes::NODE_RESTART) {
            findings.extend(told.station.and_then(|mac| self.encoders.restart(mac)));
        }
        let (last, uncertainty) = self.last;
        let at = if last.is_after(told.at) { last } else { told.at };
        let mut facts = Facts::new("event");
        (facts.station, facts.link) = (told.station, told.link);
        (facts.source, facts.destination) = (told.source, told.destination);
        let message = Message {
            frame: FrameFields::new(None),
            facts,
            data: None,
            value: None,
            io: None,
            reading: None,
            laid_out: None,
            names: Names::default(),
            stations: &self.stations,
            fragments: &[],
        };
        let findings = &self.ledger.judgement.findings;
        let blank = Record::new(&PROTOCOL, "event", (bus, self.wire), &message);
        let mut event = blank.of_event(at, findings);
        event.uncertainty = uncertainty;
        event.about = told.about;
        event.station = told.station.map(|mac| u16::from(mac.get()));
        out.emit(event);
        self.last.0 = at;
    }

    /// What was not heard may have been anything.
    fn forget(&mut self) {
        self.ledger.lose();
        self.encoders.lose();
    }

    /// A loss is told with the frame behind it, and may have been at any time since the one before:
    /// what was due meanwhile is not judged.
    fn lose(&mut self, bus: &BusInfo, loss: Loss, out: &mut Output<'_>) {
        self.watch.lose(&loss);
        self.forget();
        can::lose(&PROTOCOL, (bus, self.wire), loss, out);
    }
}

impl Dissector for DeviceNet {
    fn hear(&mut self, bus: &BusInfo, heard: Event<'_>, out: &mut Output<'_>) {
        match heard {
            Event::Frames(frames) => {
                frames.iter().for_each(|frame| self.frame(bus, frame, out));
            }
            Event::Lost(loss) => self.lose(bus, loss, out),
            Event::Advance(now) => self.pass(bus, now, out),
            Event::Characters(_)
            | Event::Rows(_)
            | Event::Cycle(_)
            | Event::Silence(_)
            | Event::Break(_)
            | Event::Levels(_) => {}
        }
    }

    fn finish(&mut self, bus: &BusInfo, end: Moment, out: &mut Output<'_>) {
        self.pass(bus, end, out);
        while let Some(told) = self.ledger.late_at_end(end) {
            self.event(bus, told, out);
        }
        for finding in core::mem::take(&mut self.at_end) {
            self.ledger.judgement.clear();
            self.ledger.judgement.find(finding);
            self.event(bus, Told::at(end), out);
        }
    }

    fn deadline(&self) -> Moment {
        self.ledger.next
    }

    fn note(&mut self, finding: Finding) {
        self.at_end.push(finding);
    }

    fn conclusions(&self) -> Vec<Conclusion> {
        let devices = self.encoders.conclusions(|mac| self.ledger.node_state(mac));
        devices.into_iter().chain(self.ledger.twins()).collect()
    }

    fn load(&self) -> Option<Load> {
        Some(*self.watch.load())
    }

    fn learn_rate(&mut self, wire: Wire) {
        self.wire = wire;
        self.watch.learn_rate(wire);
        self.ledger.learn_rate(wire);
    }

    fn measurements(&self) -> Vec<Measurement> {
        self.ledger.measurements()
    }
}
