//! Plain CAN frames: what `--protocol can` shows, and `auto` where nothing speaks for DeviceNet.

use super::{ErrorClasses, ErrorDetail, Frame, FrameKind, Load, Watch, codes};
use crate::event::{Event, Loss, LossCause, Moment};
use crate::field::{FieldId, Kind, Roles, Value, fields};
use crate::finding::Finding;
use crate::protocol::{Conclusion, Dissector, Medium, Protocol, Speaks};
use crate::record::{BusInfo, Layer, Output, Record};
use crate::uart::Wire;
use alloc::{boxed::Box, string::String, vec::Vec};
use core::fmt;

/// Plain frames in the list of protocols.
pub static PROTOCOL: Protocol = Protocol {
    name: "can",
    title: "CAN frames",
    kinds: &[FRAME, ERROR, "lost", "event"],
    fields: FIELDS,
    roles: Roles::of(FIELDS),
    codes: &codes::CODES,
    limits: &[],
    medium: Medium::Can,
    wires: &[],
    speaks: |_| Speaks::Yes(String::from("nothing speaks for another protocol")),
    dissector: |wire, _| Box::new(Can::new(wire)),
};

const FRAME: &str = "frame";
/// The kind of error frames in every protocol on CAN.
pub const ERROR: &str = "can-error";

fields! {
    /// The fields of a frame.
    pub static FIELDS of FrameFields {
        "can.id" (Kind::Int(0, 0x1FFF_FFFF), "", Plain)
            "identifier; the error classes of an error frame"
            => |t| t.of(|frame| Some(i64::from(frame.id.value())));
        "can.extended" (Kind::Bool, "", Plain) "true for a 29-bit identifier"
            => |t| t.mark(|frame| frame.id.is_extended() && frame.kind != FrameKind::Error);
        "can.remote" (Kind::Bool, "", Plain) "true for a remote frame"
            => |t| t.mark(|frame| frame.kind == FrameKind::Remote);
        "can.error" (Kind::Bool, "", Plain) "true for an error frame"
            => |t| t.mark(|frame| frame.kind == FrameKind::Error);
        "can.fd" (Kind::Bool, "", Plain) "true for a CAN FD frame"
            => |t| t.mark(|frame| frame.kind == FrameKind::Fd);
        "can.dlc" (Kind::Int(0, 64), "", Plain) "data length code as sent"
            => |t| t.of(|frame| Some(i64::from(frame.dlc)));
        "can.data" (Kind::Hex, "", Plain) "the data bytes"
            => |t| t.frame.map_or(Value::Absent, |frame| Value::Hex(frame.bytes()));
        "can.bits" (Kind::Int(0, 65_535), "bit", Plain)
            "time on the wire: exact, with stuff bits and intermission"
            => |t| t.of(|frame| frame.bits().map(i64::from));
        "can.direction" (Kind::OneOf(&["rx", "tx"]), "", Plain)
            "whether the capturing host sent it, if known"
            => |t| t.frame.and_then(|frame| frame.direction).map(|side| side.name()).into();
        "can.crc" (Kind::OneOf(&["ok", "bad"]), "", Plain) "checksum, in captures of the line"
            => |t| t.frame
                .and_then(|frame| frame.crc)
                .map(|fits| if fits { "ok" } else { "bad" })
                .into();
        "can.original_length" (Kind::Int(0, i64::MAX), "byte", Plain)
            "data bytes that the frame had, where the capture has fewer"
            => |t| t.of(|frame| frame.original_length.map(i64::from));
        "can.error_classes" (Kind::List(&Kind::Text), "", Plain) "what an error frame reports"
            => |t| if t.classes == ErrorClasses::default() {
                Value::Absent
            } else {
                Value::List(&t.classes)
            };
        "can.tx_errors" (Kind::Int(0, 255), "", Plain)
            "transmit error counter of the tap's controller"
            => |t| t.counters.map(|(tx, _)| i64::from(tx)).into();
        "can.rx_errors" (Kind::Int(0, 255), "", Plain)
            "receive error counter of the tap's controller"
            => |t| t.counters.map(|(_, rx)| i64::from(rx)).into();
    }
}

/// What is known of a frame by itself; or of nothing, in an event.
pub struct FrameFields<'a> {
    frame: Option<&'a Frame>,
    classes: ErrorClasses,
    counters: Option<(u8, u8)>,
}

impl<'a> FrameFields<'a> {
    /// Of this frame.
    #[must_use]
    pub fn new(frame: Option<&'a Frame>) -> Self {
        let is_error = frame.filter(|frame| frame.kind == FrameKind::Error);
        FrameFields {
            frame,
            classes: is_error.map(ErrorClasses::of).unwrap_or_default(),
            counters: is_error.and_then(ErrorDetail::of).and_then(|detail| detail.counters()),
        }
    }

    fn of(&self, ask: impl Fn(&Frame) -> Option<i64>) -> Value<'_> {
        self.frame.and_then(ask).into()
    }

    /// True, or nothing.
    fn mark(&self, ask: impl Fn(&Frame) -> bool) -> Value<'_> {
        if self.frame.is_some_and(ask) { Value::Bool(true) } else { Value::Absent }
    }
}

impl Layer for FrameFields<'_> {
    fn get(&self, field: FieldId) -> Value<'_> {
        self.value(field)
    }

    fn summarize(&self, record: &Record<'_>, out: &mut dyn fmt::Write) -> fmt::Result {
        let Some(frame) = self.frame else {
            return match record.findings.first() {
                Some(finding) => finding.say(record, out),
                None => write!(out, "nothing"),
            };
        };
        summarize(frame, out)
    }
}

/// Says what a frame is by itself.
///
/// # Errors
/// Only where `out` fails.
pub fn summarize(frame: &Frame, out: &mut dyn fmt::Write) -> fmt::Result {
    if frame.kind == FrameKind::Error {
        let classes = ErrorClasses::of(frame);
        write!(out, "error frame")?;
        let names = (0..).map_while(|index| match crate::field::List::get(&classes, index) {
            Value::Text(name) => Some(name),
            _ => None,
        });
        for (index, name) in names.enumerate() {
            write!(out, "{}{name}", if index == 0 { ": " } else { ", " })?;
        }
        return Ok(());
    }
    let kind = match frame.kind {
        FrameKind::Remote => "remote frame ",
        FrameKind::Fd => "CAN FD frame ",
        FrameKind::Data | FrameKind::Error => "frame ",
    };
    match frame.id.is_extended() {
        true => write!(out, "{kind}{:08X}h", frame.id.value())?,
        false => write!(out, "{kind}{:03X}h", frame.id.value())?,
    }
    write!(out, ", {} byte{}", frame.bytes().len(), if frame.bytes().len() == 1 { "" } else { "s" })
}

/// A bus whose frames are shown as they are.
struct Can {
    wire: Wire,
    watch: Watch,
    findings: Vec<Finding>,
    at_end: Vec<Finding>,
}

impl Can {
    fn new(wire: Wire) -> Self {
        Can { wire, watch: Watch::new(wire), findings: Vec::new(), at_end: Vec::new() }
    }

    fn frame(&mut self, bus: &BusInfo, frame: &Frame, out: &mut Output<'_>) {
        self.findings.clear();
        let bits = self.watch.hear(frame, &mut self.findings);
        let fields = FrameFields::new(Some(frame));
        let kind = if frame.kind == FrameKind::Error { ERROR } else { FRAME };
        let mut record = Record::new(&PROTOCOL, kind, (bus, self.wire), &fields).of_frame(frame);
        record.duration = duration(bits, self.wire);
        record.findings = &self.findings;
        out.emit(record);
    }
}

/// Time on the wire of so many bits, in ns.
#[must_use]
pub fn duration(bits: Option<u16>, wire: Wire) -> Option<u64> {
    Some(wire.baud()?.bits_ns(u32::from(bits?)))
}

/// The finding of a loss.
static LOST: [Finding; 1] = [Finding::new(&codes::DROPPED)];

/// The finding of a time in which nobody listened.
static DEAF: [Finding; 1] = [Finding::new(&codes::DROPPED).cured_by(&codes::LISTEN_AGAIN)];

impl Dissector for Can {
    fn hear(&mut self, bus: &BusInfo, heard: Event<'_>, out: &mut Output<'_>) {
        match heard {
            Event::Frames(frames) => {
                frames.iter().for_each(|frame| self.frame(bus, frame, out));
            }
            Event::Lost(loss) => {
                self.watch.lose(&loss);
                lose(&PROTOCOL, (bus, self.wire), loss, out);
            }
            Event::Characters(_)
            | Event::Rows(_)
            | Event::Cycle(_)
            | Event::Silence(_)
            | Event::Break(_)
            | Event::Advance(_)
            | Event::Levels(_) => {}
        }
    }

    fn finish(&mut self, bus: &BusInfo, end: Moment, out: &mut Output<'_>) {
        let nothing = FrameFields::new(None);
        for finding in self.at_end.drain(..) {
            let blank = Record::new(&PROTOCOL, FRAME, (bus, self.wire), &nothing);
            out.emit(blank.of_event(end, &[finding]));
        }
    }

    fn deadline(&self) -> Moment {
        Moment::UNKNOWN
    }

    fn note(&mut self, finding: Finding) {
        self.watch.note(&finding);
        self.at_end.push(finding);
    }

    fn conclusions(&self) -> Vec<Conclusion> {
        Vec::new()
    }

    fn load(&self) -> Option<Load> {
        Some(*self.watch.load())
    }

    fn learn_rate(&mut self, wire: Wire) {
        self.wire = wire;
        self.watch.learn_rate(wire);
    }
}

/// Tells a loss as a record of its own.
pub fn lose(
    protocol: &'static Protocol,
    (bus, wire): (&BusInfo, Wire),
    loss: Loss,
    out: &mut Output<'_>,
) {
    let nothing = FrameFields::new(None);
    let mut record = Record::new(protocol, FRAME, (bus, wire), &nothing).of_loss(loss);
    record.findings = match loss.cause {
        LossCause::Capture | LossCause::Overrun => &LOST,
        LossCause::Deaf => &DEAF,
        LossCause::NotKept | LossCause::Sought(_) => &[],
    };
    out.emit(record);
}
