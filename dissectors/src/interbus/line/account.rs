//! What was found out about a line, told: every question with its answer and the evidence.

use super::checksum::Account;
use super::crc::CCITT;
use super::cycle::WIRES;
use super::identify::Identifier;
use super::loopback::{MOST_TOLD, Place};
use super::profile::Flag;
use super::receiver::StatusFlag;
use super::ring::Ring;
use super::select::Reason;
use super::{CONTROL_BYTES, Line, SILENCE_MS};
use crate::finding::Span;
use crate::protocol::Conclusion;
use crate::setting::{Origin, Setting};
use alloc::{format, string::String, string::ToString, vec::Vec};
use core::fmt::Write;

const SAME_BITS: &str = "another answer gives the same bits";

/// Collects answers.
struct Answers(Vec<Setting>);

impl Answers {
    fn add(
        &mut self,
        key: &'static str,
        value: Option<String>,
        origin: Origin,
        evidence: impl Into<String>,
    ) {
        // What has no answer comes from nowhere.
        let origin = if value.is_none() { Origin::Default } else { origin };
        self.0.push(Setting { key, value, origin, evidence: evidence.into() });
    }
}

/// Every question about the line's format.
pub fn settings(line: &Line) -> Vec<Setting> {
    let mut answers = Answers(Vec::new());
    wire(line, &mut answers);
    flags(line, &mut answers);
    let identifier = &*line.identifier;
    let (order, origin, evidence) = identifier.order;
    answers.add("data_bit_order", Some(order.name().into()), origin, evidence);
    loopback(identifier, &mut answers);
    checksum(identifier, &mut answers);
    let given = &identifier.given;
    let number = |number: Option<u32>, usual: u32| {
        let origin = if number.is_some() { Origin::Given } else { Origin::Default };
        (Some(number.unwrap_or(usual).to_string()), origin)
    };
    let (value, origin) = number(given.cntr_bytes.map(u32::from), u32::from(CONTROL_BYTES));
    answers.add("cntr_bytes", value, origin, "");
    let (value, origin) = number(given.silence_reset_ms, SILENCE_MS);
    answers.add("silence_reset_ms", value, origin, "");
    ring(identifier, &mut answers);
    answers.0
}

fn wire(line: &Line, answers: &mut Answers) {
    let given = &line.identifier.given;
    let found = line.found().next();
    let evidence = found.map_or_else(
        || String::from("no rate and polarity give telegrams with their stop bits"),
        |found| found.evidence(),
    );
    let origin = |is_given: bool| if is_given { Origin::Given } else { Origin::Found };
    let rate = given.bitrate.or(found.map(|found| found.bitrate));
    let rate = rate.map(|rate| rate.to_string());
    answers.add("bitrate", rate, origin(given.bitrate.is_some()), evidence.clone());
    let level = |is_inverted: bool| u8::from(!is_inverted);
    let levels: Vec<u8> = line.found().map(|found| level(found.shape.is_inverted)).collect();
    let value = match levels[..] {
        [] => None,
        [first, ref rest @ ..] if rest.iter().all(|other| *other == first) => {
            Some(first.to_string())
        }
        _ => Some(String::from("different")),
    };
    answers.add("idle_level", value, origin(line.given.inverted.is_some()), evidence);
    let stop = given.stop_bits_min;
    let origin = if stop.is_some() { Origin::Given } else { Origin::Default };
    answers.add("stop_bits_min", Some(stop.unwrap_or(1).to_string()), origin, "");
}

/// What the three flags are, as far as anything tells.
struct Flags {
    order: [Flag; 3],
    is_sure: bool,
    status: Option<bool>,
}

fn flags_of(line: &Line) -> Flags {
    let check = line.check().map(|check| check.place);
    let select = line.identifier.chosen.map(|chosen| chosen.place);
    let status = line.status();
    let mut types = (0..StatusFlag::ALL.len())
        .filter(|number| status >> number & 1 == 1)
        .map(|number| StatusFlag::ALL[number])
        .filter(|flag| Some(flag.place) != check && Some(flag.place) != select);
    let kind = types.next();
    let is_type_sure = types.all(|other| Some(other.place) == kind.map(|kind| kind.place));
    let taken = kind.map(|kind| kind.place);
    // The third is what is left.
    let left = |known: [Option<u8>; 2]| (0..3).find(|place| !known.contains(&Some(*place)));
    let check_place = check.or_else(|| left([taken, select]));
    let select_place = select.or_else(|| left([taken, check_place]));
    let mut order = Flag::USUAL;
    for (place, flag) in [
        (select_place, Flag::Select),
        (check_place, Flag::Control),
        (taken.or_else(|| left([check_place, select_place])), Flag::Type),
    ] {
        if let Some(place) = place {
            order[usize::from(place)] = flag;
        }
    }
    let is_sure = check.is_some() && kind.is_some() && (is_type_sure || select.is_some());
    Flags { order, is_sure, status: kind.map(|kind| kind.value) }
}

fn flags(line: &Line, answers: &mut Answers) {
    let identifier = &line.identifier;
    let given = &identifier.given;
    if line.found().next().is_none() {
        for key in ["flag_order", "status_value", "check_value", "id_value"] {
            answers.add(key, None, Origin::Default, "no telegrams were found");
        }
        return;
    }
    let flags = flags_of(line);
    let order = given.flag_order.unwrap_or(flags.order).map(Flag::name).join(" ");
    let cycles: u32 = line.found().map(|found| found.cycles).sum();
    let (origin, evidence) = match given.flag_order {
        Some(_) => (Origin::Given, String::new()),
        None if flags.is_sure => (
            Origin::Found,
            format!(
                "one differs in the last characters of {cycles} of the first cycles, one between status and data telegrams"
            ),
        ),
        None => (Origin::Default, String::from(SAME_BITS)),
    };
    answers.add("flag_order", Some(order), origin, evidence);
    let digit = |value: bool| Some(u8::from(value).to_string());
    let status = given.status_value.or(flags.status);
    let kind = if given.status_value.is_some() { Origin::Given } else { origin };
    answers.add("status_value", status.and_then(digit), kind, "that of status telegrams");
    match line.check() {
        Some(check) => {
            let is_given = line.given.check.is_some();
            let origin = if is_given { Origin::Given } else { Origin::Found };
            let evidence = format!("the last characters of {cycles} of the first cycles");
            answers.add("check_value", digit(check.value), origin, evidence);
        }
        None => answers.add(
            "check_value",
            None,
            Origin::Default,
            "no flag tells the check phase: cycles end where status telegrams begin, and the last characters are taken for it",
        ),
    }
    let (value, origin, evidence) = match identifier.chosen {
        None => (
            given.id_value,
            Origin::Given,
            String::from("cycles of one kind only: taken for data cycles"),
        ),
        Some(chosen) => match chosen.reason {
            Reason::Given => (Some(chosen.id_value), Origin::Given, String::new()),
            Reason::Lengths => (
                Some(chosen.id_value),
                Origin::Found,
                String::from("the lengths in the ID words add up to that of the other cycles"),
            ),
            Reason::AfterReset(count) => (
                Some(chosen.id_value),
                Origin::Found,
                format!("the first cycle behind a reset, {count} x",),
            ),
            Reason::Rarer => (
                None,
                Origin::Default,
                String::from("cycles of two kinds, and nothing tells which are ID cycles"),
            ),
        },
    };
    answers.add("id_value", value.and_then(digit), origin, evidence);
}

fn loopback(identifier: &Identifier, answers: &mut Answers) {
    let given = identifier.given.loopback;
    let (place, evidence) = match &identifier.place {
        Place::Found { offset, cycles, .. } => {
            let evidence = match identifier.wires {
                2 => format!(
                    "it ends the one wire and stands here on the other, in {cycles} cycles of equal length"
                ),
                _ => format!(
                    "the one word that stays, or counts, in {cycles} cycles of equal length"
                ),
            };
            (Some((8 * offset).to_string()), evidence)
        }
        Place::Unknown => (None, format!("only {} cycles of equal length", identifier.cycles())),
        Place::Ambiguous(places, cycles) if places.is_empty() => {
            (None, format!("no word fits in {cycles} cycles"))
        }
        Place::Ambiguous(places, cycles) => {
            let mut text = String::from("it may be at bit");
            for place in places.iter().take(MOST_TOLD) {
                // A String takes any text.
                let _ = write!(text, " {}", 8 * place);
            }
            let more = if places.len() > MOST_TOLD { " and more" } else { "" };
            let _ = write!(text, "{more}, by {cycles} cycles");
            (None, text)
        }
    };
    let is_known = place.is_some();
    let value = identifier.loopback.filter(|_| is_known || given.is_some());
    let origin = match identifier.order.1 {
        _ if given.is_some() => Origin::Given,
        // Read from the other end it is another word.
        Origin::Default => Origin::Default,
        _ => Origin::Found,
    };
    let hex = |word: u16| format!("{word:04X}");
    answers.add("lbw", value.map(|it| hex(it.value)), origin, evidence.clone());
    answers.add("lbw_mask", value.map(|it| hex(it.mask)), origin, "the bits that stay");
    answers.add("lbw_bit", place, Origin::Found, evidence);
}

fn checksum(identifier: &Identifier, answers: &mut Answers) {
    let given = identifier.given.crc;
    let Some(account) = identifier.checksum.account(identifier.order.0) else {
        let evidence = undecided(identifier);
        for key in CRC {
            answers.add(key, None, Origin::Default, evidence.clone());
        }
        return;
    };
    let origin = |is_given: bool, is_sure: bool| match () {
        () if is_given || account.is_given => Origin::Given,
        () if is_sure => Origin::Found,
        () => Origin::Default,
    };
    let form = account.form;
    let truth = |value: bool| Some(value.to_string());
    let order = if form.is_low_first { "lo-hi" } else { "hi-lo" };
    let evidence = &account.evidence;
    let poly = Some(format!("{:04X}", form.polynomial));
    answers.add("crc.poly", poly, origin(false, true), evidence.clone());
    // With bytes read from the other end, another form gives the same bits.
    let is_sure = account.is_form_sure && identifier.order.1 != Origin::Default;
    let refin = origin(given.refin.is_some(), is_sure);
    answers.add("crc.refin", truth(form.refin), refin, evidence.clone());
    let refout = origin(given.refout.is_some(), is_sure);
    answers.add("crc.refout", truth(form.refout), refout, evidence.clone());
    let byte_order = origin(given.is_low_first.is_some(), is_sure);
    answers.add("crc.byte_order", Some(order.into()), byte_order, evidence.clone());
    let covers = origin(given.covers_loopback.is_some(), account.is_coverage_sure);
    let why = if covers == Origin::Default { SAME_BITS } else { evidence };
    answers.add("crc.covers_lbw", truth(account.covers_loopback), covers, why);
    start_values(&account, answers);
}

const CRC: [&str; 7] = [
    "crc.poly",
    "crc.refin",
    "crc.refout",
    "crc.byte_order",
    "crc.covers_lbw",
    "crc.init",
    "crc.xorout",
];

fn start_values(account: &Account, answers: &mut Answers) {
    let mut constants = String::new();
    for (length, value) in &account.constants {
        let separator = if constants.is_empty() { "" } else { ", " };
        // A String takes any text.
        let _ = write!(constants, "{separator}{value:04X} for {length} bytes");
    }
    let hex = |word: u16| Some(format!("{word:04X}"));
    let (init, xorout, origin, evidence) = match (account.separated, account.named) {
        (Some((init, xorout)), _) if account.is_given => {
            (hex(init), hex(xorout), Origin::Given, String::new())
        }
        (Some((init, xorout)), _) => (
            hex(init),
            hex(xorout),
            Origin::Default,
            format!("two lengths separate them, {constants}, and another pair gives the same bits"),
        ),
        (None, Some((name, init, xorout))) => (
            hex(init),
            hex(xorout),
            Origin::Default,
            format!("those of CRC-16/{name}, which give {constants}; so do others"),
        ),
        (None, None) => (
            None,
            None,
            Origin::Default,
            format!("frames of one length do not separate them: {constants}"),
        ),
    };
    answers.add("crc.init", init, origin, evidence.clone());
    answers.add("crc.xorout", xorout, origin, evidence);
}

fn undecided(identifier: &Identifier) -> String {
    let tested = identifier.checksum.tested();
    match tested {
        _ if identifier.checksum.is_given_up() => String::from("no form fits: CRC unverified"),
        0 => String::from("frames do not differ: CRC unverified"),
        _ => format!("{tested} independent pairs of frames are too few: CRC unverified"),
    }
}

fn ring(identifier: &Identifier, answers: &mut Answers) {
    let told = identifier.ring.as_deref().map(describe);
    let (origin, evidence) = match (&told, identifier.is_ring_given) {
        (Some(_), true) => (Origin::Given, String::new()),
        (Some(_), false) => (Origin::Found, String::from("the ID words of an ID cycle")),
        (None, _) if identifier.chosen.is_none() => {
            (Origin::Default, String::from("no ID cycle was heard"))
        }
        (None, _) => (Origin::Default, String::from("no ID words were understood")),
    };
    answers.add("ring", told, origin, evidence);
}

/// Widths of the registers, the first device first, with the ID words where they are known.
fn describe(ring: &Ring) -> String {
    let mut text = String::new();
    for (index, width) in ring.widths().iter().enumerate() {
        let separator = if index == 0 { "" } else { " " };
        // A String takes any text.
        let _ = write!(text, "{separator}{width}");
        if let Some(id) = ring.ids().get(index) {
            let _ = write!(text, ":{id:04X}");
        }
    }
    text
}

/// What is said on standard error: one line a matter.
pub fn conclusions(line: &Line) -> Vec<Conclusion> {
    let settings = settings(line);
    let of = |key: &str| settings.iter().find(|setting| setting.key == key);
    let mut told: Vec<Conclusion> = Vec::new();
    let mut tell = |subject, value: Option<String>, evidence: String| {
        told.push(Conclusion { subject, station: None, value, evidence });
    };
    for (subject, key) in [
        ("bitrate", "bitrate"),
        ("idle level", "idle_level"),
        ("flags", "flag_order"),
        ("ID cycles", "id_value"),
        ("data bit order", "data_bit_order"),
        ("loopback word", "lbw"),
        ("ring", "ring"),
    ] {
        let Some(setting) = of(key).filter(|setting| setting.origin != Origin::Given) else {
            continue;
        };
        let value = setting.value.clone().map(|value| match key {
            "bitrate" => format!("{value} bit/s"),
            "id_value" => format!("SL {value}"),
            "ring" => format!("{} devices: {value}", value.split(' ').count()),
            "lbw" => {
                let mask = of("lbw_mask").and_then(|mask| mask.value.clone());
                let bit = of("lbw_bit").and_then(|bit| bit.value.clone());
                format!(
                    "{value} mask {} at bit {}",
                    mask.unwrap_or_default(),
                    bit.unwrap_or_default()
                )
            }
            _ => value,
        });
        let is_default = setting.origin == Origin::Default && value.is_some();
        let mark = if is_default { "default: " } else { "" };
        tell(subject, value, format!("{mark}{}", setting.evidence));
    }
    let value = |key| of(key).and_then(|setting| setting.value.as_deref());
    let crc = value("crc.poly").map(|poly| {
        let is = |key| value(key) == Some("true");
        let reflected = match (is("crc.refin"), is("crc.refout")) {
            (true, true) => " reflected",
            (false, false) => "",
            (true, false) => " reflected in",
            (false, true) => " reflected out",
        };
        let covers = if is("crc.covers_lbw") { "loopback word and data" } else { "data" };
        let control = if poly == format!("{CCITT:04X}") { "" } else { ", not the expected 1021" };
        let order = value("crc.byte_order").unwrap_or("");
        format!("{poly}{reflected} {order} over {covers}{control}")
    });
    if let Some(setting) = of("crc.poly").filter(|it| it.origin != Origin::Given) {
        let start = of("crc.init").filter(|_| crc.is_some()).map(|it| it.evidence.as_str());
        let start = start.map(|start| format!("; {start}")).unwrap_or_default();
        tell("crc", crc, format!("{}{start}", setting.evidence));
    }
    if line.wires.len() < WIRES && line.found().next().is_some() {
        let evidence = "two channels of one capture are read as DO and DI with --protocol interbus";
        tell("wires", Some(String::from("one")), String::from(evidence));
    }
    if line.times.count > 0 {
        tell("cycle time", Some(cycle_time(line)), pace(line));
    }
    told
}

fn cycle_time(line: &Line) -> String {
    let times = line.times;
    let span = |ns: u64| Span(i64::try_from(ns).unwrap_or(i64::MAX));
    format!("{} ({} to {})", span(times.sum / times.count), span(times.least), span(times.most))
}

/// How long cycles take, in terms of their bits: 13·(6+N)·Tbit (Beckhoff).
fn pace(line: &Line) -> String {
    let Some(found) = line.found().next() else { return String::new() };
    let times = line.times;
    let bits = 13.0 * times.characters as f64;
    let measured = times.sum as f64 * f64::from(found.bitrate) / 1e9;
    format!("{} cycles, {:.2} times the bits of their telegrams", times.count, measured / bits)
}
