//! LINE: is the line all right?

use super::names::together;
use super::{Cut, counted};
use dissectors::bus::{Bus, LineCounts};
use dissectors::can::Load;
use dissectors::protocol::{Conclusion, Medium};
use dissectors::uart::{Baud, Wire};
use std::fmt::Write;

pub fn line(buses: &[Bus], several: bool, cut: Option<Cut>) -> String {
    match cut {
        _ if !buses.is_empty() => {}
        Some(Cut::Failure) => return "not known: the source failed".to_owned(),
        Some(Cut::Interruption) | None => return "silent: nothing was heard".to_owned(),
    }
    if !several {
        return buses.iter().map(line_of).collect();
    }
    // Silent channels stand together, and so do those that cannot be read.
    let mut texts: Vec<(String, Vec<&str>)> = Vec::new();
    let (unread, read): (Vec<&Bus>, Vec<&Bus>) = buses.iter().partition(|bus| is_unread(bus));
    for bus in read {
        let (text, name) = (line_of(bus), bus.info().name.as_str());
        let is_same = |(known, _): &&mut (String, _)| *known == text && text.starts_with("silent");
        match texts.iter_mut().find(is_same) {
            Some((_, names)) => names.push(name),
            None => texts.push((text, vec![name])),
        }
    }
    let texts = texts.iter().map(|(text, names)| format!("{} {text}", together(names)));
    texts.chain(unreadable(&unread)).collect::<Vec<_>>().join("; ")
}

/// Whether levels changed there, but no setting makes characters of it.
pub fn is_unread(bus: &Bus) -> bool {
    let LineCounts { characters, damaged, frames, rows, cycles, .. } = bus.counts();
    let is_open = |it: &Conclusion| it.subject == "baud" && it.value.is_none();
    frames + rows + cycles == 0
        && (characters == 0 || damaged.saturating_mul(2) > characters)
        && bus.conclusions().iter().any(is_open)
}

/// What is said of these, if there are any.
pub fn unreadable(unread: &[&Bus]) -> Option<String> {
    let names: Vec<&str> = unread.iter().map(|bus| bus.info().name.as_str()).collect();
    (!names.is_empty()).then(|| format!("{}: nothing that can be read", together(&names)))
}

fn line_of(bus: &Bus) -> String {
    match bus.protocol().map(|protocol| protocol.medium) {
        Some(Medium::Words) => line_of_words(bus),
        _ if is_can(bus) => line_of_can(bus.counts(), bus.wire(), bus.load()),
        _ => {
            let is_inverted = if bus.is_inverted() { ", upside down" } else { "" };
            line_of_characters(bus.counts(), bus.wire()) + is_inverted
        }
    }
}

/// The line of a bus of which nothing is known but what was counted on it.
pub fn line_of_counts(counts: LineCounts, wire: Wire, is_can: bool) -> String {
    if is_can { line_of_can(counts, wire, None) } else { line_of_characters(counts, wire) }
}

fn line_of_words(bus: &Bus) -> String {
    let LineCounts { rows, cycles, bad_cycles, losses, strange_edges, .. } = bus.counts();
    let losses = if losses > 0 { format!(", losses: {losses}") } else { String::new() };
    if cycles > 0 {
        let state = if bad_cycles * 100 > cycles { "bad" } else { "ok" };
        let rate = bus.wire().baud().map_or("rate not known".to_owned(), bitrate);
        let share = bad_cycles as f64 * 100.0 / cycles as f64;
        let cycles = counted(cycles, "cycle");
        return format!("{state}: {rate}, {cycles}, {bad_cycles} damaged ({share:.2} %){losses}");
    }
    if rows == 0 && strange_edges > 0 {
        let edges = counted(strange_edges, "level change");
        return format!("not this protocol's: {edges}, and no telegram fits them");
    }
    if rows == 0 {
        return "silent: no rows and no cycles".to_owned();
    }
    format!("ok: {}{losses}", counted(rows, "row"))
}

/// Whether frames were heard on it, or would be.
pub fn is_can(bus: &Bus) -> bool {
    bus.counts().frames > 0 || bus.protocol().is_some_and(|protocol| protocol.medium == Medium::Can)
}

fn line_of_can(counts: LineCounts, wire: Wire, load: Option<Load>) -> String {
    let LineCounts { frames, error_frames, losses, deaf, .. } = counts;
    if frames == 0 && losses > deaf {
        let plural = if losses == 1 { "" } else { "es" };
        return format!("bad: no frames that can be read, {losses} loss{plural}");
    }
    if frames == 0 {
        return "silent: no frames".to_owned();
    }
    let state = if error_frames * 100 > frames { "bad" } else { "ok" };
    let rate = match wire.baud() {
        Some(rate) => bitrate(rate),
        None => "bit rate not known".to_owned(),
    };
    let plural = if frames == 1 { "" } else { "s" };
    let share = error_frames as f64 * 100.0 / frames as f64;
    let errors = counted(error_frames, "error frame");
    let mut text = format!("{state}: {rate}, {frames} frame{plural}, {errors} ({share:.2} %)");
    let percent = |permille: u16| f64::from(permille) / 10.0;
    // A String takes any text.
    if let Some(mean) = load.as_ref().and_then(Load::mean) {
        let _ = write!(text, ", load {:.1} %", percent(mean));
    }
    if let Some(peak) = load.as_ref().and_then(Load::peak) {
        let _ = write!(text, ", peak {:.1} %", percent(peak));
    }
    if losses > 0 {
        let _ = write!(text, ", {losses} loss{}", if losses == 1 { "" } else { "es" });
    }
    text
}

/// A bit rate as people say it.
fn bitrate(rate: Baud) -> String {
    match rate.get() {
        rate if rate.is_multiple_of(1_000) => format!("{} kbit/s", rate / 1_000),
        rate => format!("{rate} bit/s"),
    }
}

fn line_of_characters(counts: LineCounts, wire: Wire) -> String {
    let state = match counts {
        LineCounts { characters: 0, breaks: 0, .. } => return "silent: no characters".to_owned(),
        LineCounts { characters, damaged, glitches, .. }
            if damaged * 100 > characters || glitches > characters =>
        {
            "bad"
        }
        _ => "ok",
    };
    let rate = match wire.baud() {
        Some(baud) => baud.to_string(),
        None => "rate not known,".to_owned(),
    };
    let plural = if counts.characters == 1 { "" } else { "s" };
    let mut text =
        format!("{state}: {rate} {}, {} character{plural}", wire.format(), counts.characters);
    let share = counts.damaged as f64 * 100.0 / counts.characters.max(1) as f64;
    // A String takes any text.
    let _ = write!(text, ", {} damaged ({share:.2} %)", counts.damaged);
    for (count, what) in
        [(counts.breaks, "break"), (counts.losses, "loss"), (counts.glitches, "glitch")]
    {
        if count > 0 {
            let plural = match (count, what) {
                (1, _) => "",
                (_, "break") => "s",
                _ => "es",
            };
            let _ = write!(text, ", {count} {what}{plural}");
        }
    }
    text
}
