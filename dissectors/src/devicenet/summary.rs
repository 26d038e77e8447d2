//! The sentence of a DeviceNet record.

use super::cip::Refusal;
use super::identifier::MacId;
use super::layer::{Link, Message, kind};
use super::members::LaidOut;
use super::message::{Fragment, Identity, Part, service};
use crate::can;
use crate::field::{FieldId, Value};
use crate::finding::Span;
use crate::record::{Heard, Layer, Record};
use core::fmt::{self, Write};

/// Bytes that a sentence shows at most.
const SHOWN: usize = 8;

impl Layer for Message<'_> {
    fn get(&self, field: FieldId) -> Value<'_> {
        match field.checked_sub(can::FIELDS.len()) {
            Some(own) => self.value(own),
            None => self.frame.get(field),
        }
    }

    fn summarize(&self, record: &Record<'_>, out: &mut dyn Write) -> fmt::Result {
        match record.heard {
            Heard::Frame(frame) => self.say_frame(frame, out),
            _ => match record.findings.first() {
                Some(finding) => finding.say(record, out),
                None => write!(out, "nothing"),
            },
        }
    }
}

impl Message<'_> {
    /// The record's station has its name beside its number. Others have not: what was said matters
    /// more, and a line is short.
    fn who(&self, mac: Option<MacId>) -> Who<'_> {
        let is_station = mac.is_some() && mac == self.facts.station;
        Who { mac, name: self.name().filter(|_| is_station) }
    }

    fn say_frame(&self, frame: &can::Frame, out: &mut dyn Write) -> fmt::Result {
        if let Some(fragment) = self.facts.fragment.filter(|it| it.part != Part::Last) {
            return self.say_fragment(fragment, out);
        }
        match self.facts.kind {
            kind::DUP_MAC_REQUEST => {
                write!(out, "{} checks that its MAC ID is free", self.who(self.facts.source))?;
                self.say_identity(out)
            }
            kind::DUP_MAC_RESPONSE => {
                write!(out, "{} says that its MAC ID is taken", self.who(self.facts.source))?;
                self.say_identity(out)
            }
            kind::EXPLICIT_REQUEST | kind::UNCONNECTED_REQUEST | kind::UCMM_REQUEST => {
                self.say_request(out)
            }
            kind::EXPLICIT_RESPONSE | kind::UNCONNECTED_RESPONSE | kind::UCMM_RESPONSE => {
                self.say_response(out)
            }
            kind::HEARTBEAT => self.say_heartbeat(frame.bytes(), out),
            kind::SHUTDOWN => {
                write!(out, "{} shuts down", self.who(self.facts.source))?;
                match frame.bytes() {
                    [.., low, high] => write!(out, ": code {:04X}h", word(*low, *high)),
                    _ => Ok(()),
                }
            }
            kind::RESERVED => write!(out, "reserved identifier {:03X}h", frame.id.value()),
            kind::FOREIGN | kind::CAN_ERROR => can::summarize(frame, out),
            kind::OWNERSHIP_REQUEST | kind::OWNERSHIP_RESPONSE => {
                match self.facts.kind {
                    kind::OWNERSHIP_REQUEST => write!(out, "a tool asks for the offline set")?,
                    _ => write!(out, "the offline set is owned")?,
                }
                self.say_identity(out)
            }
            kind::COMM_FAULT_REQUEST | kind::COMM_FAULT_RESPONSE => {
                self.say_fault(frame.bytes(), out)
            }
            _ => self.say_io(frame, out),
        }
    }

    fn say_request(&self, out: &mut dyn Write) -> fmt::Result {
        write!(out, "{} asks {}: ", self.who(self.facts.source), self.who(self.facts.destination))?;
        if let (Some(allocation), Some(asked)) = (self.facts.allocation, self.facts.service) {
            let verb = if asked.code == service::ALLOCATE { "Allocate" } else { "Release" };
            write!(out, "{verb}")?;
            for (index, name) in allocation.choice.names().enumerate() {
                write!(out, "{}{name}", if index == 0 { " " } else { ", " })?;
            }
            return Ok(());
        }
        if self.facts.link == Some(Link::Ucmm) {
            match self.facts.service.map(|asked| asked.code) {
                Some(service::ALLOCATE) => return write!(out, "Open a connection"),
                Some(service::RELEASE) => return write!(out, "Close the connection"),
                _ => {}
            }
        }
        self.service_and_target(out)?;
        match self.value {
            Some(value) => write!(out, " to {}", self.names.in_words(self.facts.target, value)),
            None => self.say_data(self.data, out),
        }
    }

    fn say_response(&self, out: &mut dyn Write) -> fmt::Result {
        let verb = if self.facts.error.is_some() { "refuses" } else { "answers" };
        write!(
            out,
            "{} {verb} {}: ",
            self.who(self.facts.source),
            self.who(self.facts.destination)
        )?;
        match (self.facts.error, self.value, self.facts.body_format) {
            (Some((general, additional)), ..) => {
                let is_of_allocation =
                    self.facts.target.is(3, 1) || self.facts.link == Some(Link::Unconnected);
                write!(out, "error {}", Refusal { general, additional, is_of_allocation })?;
            }
            (None, Some(value), _) => self.names.say_value(self.facts.target, value, out)?,
            (None, None, Some(format)) => {
                self.service_and_target(out)?;
                write!(out, ", body format {format}")?;
            }
            (None, None, None) => {
                self.service_and_target(out)?;
                self.say_data(self.data, out)?;
            }
        }
        match self.facts.response_time {
            Some(ns) => write!(out, " in {}", Span(ns)),
            None => Ok(()),
        }
    }

    fn say_fragment(&self, fragment: Fragment, out: &mut dyn Write) -> fmt::Result {
        if self.facts.source.is_some() {
            write!(out, "{} ", self.who(self.facts.source))?;
        }
        match (fragment.part, self.facts.status) {
            (Part::Acknowledge, Some(0)) => write!(out, "takes fragment {}", fragment.count)?,
            (Part::Acknowledge, Some(1)) => {
                write!(out, "rejects fragment {}: too much data", fragment.count)?;
            }
            (Part::Acknowledge, _) => write!(out, "acknowledges fragment {}", fragment.count)?,
            (part, _) => write!(out, "{} fragment {}", part.name(), fragment.count)?,
        }
        match (fragment.part, self.facts.destination) {
            (_, None) => {}
            (Part::Acknowledge, to) => write!(out, " of {}", self.who(to))?,
            (_, to) => write!(out, " to {}", self.who(to))?,
        }
        if self.facts.service.is_some() {
            write!(out, ": ")?;
            self.service_and_target(out)?;
        }
        Ok(())
    }

    fn say_identity(&self, out: &mut dyn Write) -> fmt::Result {
        match self.facts.identity {
            Some(Identity { vendor, serial }) => {
                write!(out, ": vendor {vendor}, serial {serial:08X}h")
            }
            None => Ok(()),
        }
    }

    fn say_heartbeat(&self, data: &[u8], out: &mut dyn Write) -> fmt::Result {
        write!(out, "{} is ", self.who(self.facts.source))?;
        let state = match data.get(4) {
            Some(0) => "nonexistent",
            Some(1) => "self-testing",
            Some(2) => "in standby",
            Some(3) => "operational",
            Some(4) => "in a major recoverable fault",
            Some(5) => "in a major unrecoverable fault",
            _ => "alive",
        };
        write!(out, "{state}")?;
        let flags = data.get(5).copied().unwrap_or_default();
        for (bit, name) in
            ["device fault", "user fault", "system fault", "event"].iter().enumerate()
        {
            if flags >> bit & 1 == 1 {
                write!(out, ", {name}")?;
            }
        }
        Ok(())
    }

    fn say_fault(&self, data: &[u8], out: &mut dyn Write) -> fmt::Result {
        if self.facts.kind == kind::COMM_FAULT_RESPONSE {
            write!(out, "a faulted node answers")?;
            return self.say_identity(out);
        }
        let what = match data.get(1) {
            Some(0x4B) => "who is there",
            Some(0x4C) => "identify",
            Some(0x4D) => "take another MAC ID",
            _ => "nothing known",
        };
        write!(out, "a tool asks faulted nodes: {what}")?;
        self.say_identity(out)
    }

    fn say_io(&self, frame: &can::Frame, out: &mut dyn Write) -> fmt::Result {
        let (from, to) = (self.who(self.facts.source), self.who(self.facts.destination));
        let answers = self.facts.request.is_some();
        match self.facts.kind {
            kind::POLL_COMMAND if self.facts.source.is_some() => write!(out, "{from} polls {to}")?,
            kind::POLL_COMMAND => write!(out, "poll of {to}")?,
            kind::POLL_RESPONSE if !answers => write!(out, "{from} sends a poll response")?,
            kind::POLL_RESPONSE => write!(out, "{from} answers the poll")?,
            kind::STROBE_COMMAND => write!(out, "{from} strobes its slaves")?,
            kind::STROBE_RESPONSE if !answers => write!(out, "{from} sends a strobe response")?,
            kind::STROBE_RESPONSE => write!(out, "{from} answers the strobe")?,
            kind::MULTICAST_POLL_COMMAND => write!(out, "multicast poll")?,
            kind::MULTICAST_POLL_RESPONSE if !answers => {
                write!(out, "{from} sends a multicast poll response")?;
            }
            kind::MULTICAST_POLL_RESPONSE => write!(out, "{from} answers the multicast poll")?,
            kind::COS => write!(out, "{from} tells a change of state")?,
            kind::CYCLIC => write!(out, "{from} tells cyclically")?,
            kind::IO_ACK if self.facts.source.is_some() => write!(out, "{from} acknowledges")?,
            kind::IO_ACK => write!(out, "acknowledged to {to}")?,
            _ => write!(out, "I/O {:03X}h", frame.id.value())?,
        }
        if let Some(ns) = self.facts.response_time {
            write!(out, " in {}", Span(ns))?;
        }
        let laid_out = self.laid_out;
        match (self.reading, laid_out.and_then(|it| it.members)) {
            (Some((_, reading)), _) => {
                write!(out, ": position {}", reading.position)?;
                if let Some((resolution, position)) = self.place() {
                    write!(out, " {}", resolution.place(position))?;
                }
                write!(out, ", {}", reading.flags)
            }
            (None, Some(members)) => write!(out, ": {members}"),
            (None, None) => {
                if let Some(LaidOut { name, .. }) = laid_out {
                    write!(out, ": {name}")?;
                }
                self.say_data(self.io, out)
            }
        }
    }

    fn say_data(&self, data: Option<&[u8]>, out: &mut dyn Write) -> fmt::Result {
        let data = data.unwrap_or_default();
        for (index, byte) in data.iter().take(SHOWN).enumerate() {
            out.write_str(if index == 0 { ": " } else { " " })?;
            // Formatting would take longer than all the rest of the sentence.
            out.write_char(digit(byte >> 4))?;
            out.write_char(digit(byte & 0xF))?;
        }
        match data.len() {
            length if length > SHOWN => write!(out, " … ({length} bytes)"),
            _ => Ok(()),
        }
    }
}

/// A MAC ID with its name, or somebody.
struct Who<'a> {
    mac: Option<MacId>,
    name: Option<&'a str>,
}

impl fmt::Display for Who<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.mac {
            Some(mac) => mac.get().fmt(f)?,
            None => f.write_str("somebody")?,
        }
        match self.name {
            Some(name) => write!(f, " ({name})"),
            None => Ok(()),
        }
    }
}

fn digit(nibble: u8) -> char {
    char::from(b"0123456789ABCDEF"[(nibble & 0xF) as usize])
}

const fn word(low: u8, high: u8) -> u16 {
    u16::from_le_bytes([low, high])
}
