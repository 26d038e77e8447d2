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

/// Characters of a station's name that a sentence shows at most: a line of 100 columns then has the
/// position, too.
const NAME: usize = 8;

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
        self.say_time(out)
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

    /// Of I/O there is most: nothing that is in every sentence is formatted.
    fn say_io(&self, frame: &can::Frame, out: &mut dyn Write) -> fmt::Result {
        let (from, to) = (self.facts.source, self.facts.destination);
        let answers = self.facts.request.is_some();
        let (from, what, to) = match self.facts.kind {
            kind::POLL_COMMAND if from.is_some() => (Some(from), " polls ", Some(to)),
            kind::POLL_COMMAND => (None, "poll of ", Some(to)),
            kind::POLL_RESPONSE if !answers => (Some(from), " sends a poll response", None),
            kind::POLL_RESPONSE => (Some(from), " answers the poll", None),
            kind::STROBE_COMMAND => (Some(from), " strobes its slaves", None),
            kind::STROBE_RESPONSE if !answers => (Some(from), " sends a strobe response", None),
            kind::STROBE_RESPONSE => (Some(from), " answers a strobe", None),
            kind::MULTICAST_POLL_COMMAND => (None, "multicast poll", None),
            kind::MULTICAST_POLL_RESPONSE if !answers => {
                (Some(from), " sends a multicast poll response", None)
            }
            kind::MULTICAST_POLL_RESPONSE => (Some(from), " answers the multicast poll", None),
            kind::COS => (Some(from), " tells a change", None),
            kind::CYCLIC => (Some(from), " tells cyclically", None),
            kind::IO_ACK if from.is_some() => (Some(from), " acknowledges", None),
            kind::IO_ACK => (None, "acknowledged to ", Some(to)),
            _ => {
                write!(out, "I/O {:03X}h", frame.id.value())?;
                (None, "", None)
            }
        };
        from.map_or(Ok(()), |from| self.who(from).say(out))?;
        out.write_str(what)?;
        to.map_or(Ok(()), |to| self.who(to).say(out))?;
        let Some((_, reading)) = self.reading else {
            self.say_layout(out)?;
            return self.say_time(out);
        };
        out.write_str(": position ")?;
        out.write_str(itoa::Buffer::new().format(reading.position))?;
        if let Some((resolution, position)) = self.place() {
            write!(out, " {}", resolution.place(position))?;
        }
        self.say_time(out)?;
        out.write_str(", ")?;
        out.write_str(reading.flags.words())
    }

    /// How long the answer took. A line is short: what was said comes first.
    fn say_time(&self, out: &mut dyn Write) -> fmt::Result {
        let Some(ns) = self.facts.response_time else { return Ok(()) };
        out.write_str(" in ")?;
        Span(ns).say(out)
    }

    /// I/O data as its maker's file lays it out.
    fn say_layout(&self, out: &mut dyn Write) -> fmt::Result {
        match self.laid_out {
            Some(LaidOut { members: Some(members), .. }) => return write!(out, ": {members}"),
            Some(LaidOut { name, .. }) => write!(out, ": {name}")?,
            None => {}
        }
        self.say_data(self.io, out)
    }

    fn say_data(&self, data: Option<&[u8]>, out: &mut dyn Write) -> fmt::Result {
        let data = data.unwrap_or_default();
        let mut digits = [b' '; 3 * SHOWN];
        for (place, byte) in digits.chunks_exact_mut(3).zip(data) {
            (place[0], place[1]) = (digit(byte >> 4), digit(byte & 0xF));
        }
        let shown = &digits[..(3 * data.len().min(SHOWN)).saturating_sub(1)];
        if !shown.is_empty() {
            out.write_str(": ")?;
            // They always are text.
            out.write_str(str::from_utf8(shown).unwrap_or_default())?;
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

impl Who<'_> {
    fn say(&self, out: &mut dyn Write) -> fmt::Result {
        match self.mac {
            Some(mac) => out.write_str(itoa::Buffer::new().format(mac.get()))?,
            None => out.write_str("somebody")?,
        }
        match self.name {
            Some(name) if name.chars().count() > NAME => {
                let begin = name.char_indices().nth(NAME - 1).map_or(name.len(), |(end, _)| end);
                write!(out, " ({}…)", &name[..begin])
            }
            Some(name) => write!(out, " ({name})"),
            None => Ok(()),
        }
    }
}

impl fmt::Display for Who<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.say(f)
    }
}

const fn digit(nibble: u8) -> u8 {
    b"0123456789ABCDEF"[(nibble & 0xF) as usize]
}

const fn word(low: u8, high: u8) -> u16 {
    u16::from_le_bytes([low, high])
}
