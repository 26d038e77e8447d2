//! The sentence of an INTERBUS record.

use super::handshake::State;
use super::layer::Facts;
use super::service::{LENGTH, STATUS, Service};
use super::word::{Access, Word};
use crate::record::Record;
use core::fmt::{self, Write};

/// Tells a record.
pub fn summarize(facts: &Facts<'_>, record: &Record<'_>, out: &mut dyn Write) -> fmt::Result {
    if let Some(position) = facts.preset_to {
        let who = record.station.unwrap_or(1);
        return write!(out, "{who} at {position}: external preset input (preset value 1)");
    }
    match (facts.process, record.findings.first()) {
        (Some(told), _) => say_process(&told, record.station, out),
        (None, Some(finding)) if record.kind == "event" => finding.say(record, out),
        _ => write!(out, "{}", record.kind),
    }
}

fn say_process(
    told: &super::device::Told,
    station: Option<u16>,
    out: &mut dyn Write,
) -> fmt::Result {
    let who = station.unwrap_or(1);
    match (told.state, told.service) {
        (State::Normal, _) => say_position(told, who, out),
        (State::Prepared, Some(word)) => {
            write!(out, "laid out: ")?;
            say_request(word, out)
        }
        (State::Request, Some(word)) => {
            write!(out, "master asks {who}: ")?;
            say_request(word, out)
        }
        (State::Acknowledge | State::Release, Some(word)) => {
            let verb = match (told.state, word.has_error_bit()) {
                (State::Release, _) => "still has: ",
                (_, true) => "has an error: ",
                (_, false) => "has done: ",
            };
            write!(out, "{who} {verb}")?;
            say_answer(word, told.step_mm, out)
        }
        (_, None) => write!(out, "{}", told.state.kind()),
    }
}

fn say_position(told: &super::device::Told, who: u16, out: &mut dyn Write) -> fmt::Result {
    match (told.position, told.step_mm) {
        (Some(position), Some(step)) => {
            write!(out, "{who} at {position}, {:.3} mm", f64::from(position) * step)?;
        }
        (Some(position), None) => write!(out, "{who} at {position}")?,
        (None, _) => write!(out, "nothing is asked of {who}")?,
    }
    if told.has_error == Some(true) { write!(out, ", error bit") } else { Ok(()) }
}

fn say_name(word: Word, out: &mut dyn Write) -> fmt::Result {
    write!(out, "{} ", word.access().name())?;
    match Service::numbered(word.service()) {
        Some(service) => write!(out, "{}", service.name),
        None => write!(out, "service {}", word.service()),
    }
}

fn say_request(word: Word, out: &mut dyn Write) -> fmt::Result {
    say_name(word, out)?;
    if word.access() == Access::Read { Ok(()) } else { say_value(word, out) }
}

fn say_answer(word: Word, step_mm: Option<f64>, out: &mut dyn Write) -> fmt::Result {
    say_name(word, out)?;
    if word.has_error_bit() && word.access() == Access::Write {
        return Ok(());
    }
    say_value(word, out)?;
    match step_mm.filter(|_| word.service() == LENGTH) {
        Some(step) => write!(out, " ({step} mm a step)"),
        None => Ok(()),
    }
}

fn say_value(word: Word, out: &mut dyn Write) -> fmt::Result {
    match Service::numbered(word.service()) {
        Some(service) => {
            write!(out, "{}", if service.number == STATUS { ": " } else { " " })?;
            service.say(word.data(), out)
        }
        None => write!(out, " {:06X}h", word.data()),
    }
}
