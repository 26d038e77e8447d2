//! The table for people: one line a telegram, cut to the width of a terminal that it goes to.

use super::Export;
use super::candump::write_frame;
use crate::clock::{Clock, Exact};
use crate::terminal::push_clean;
use anstyle::{AnsiColor, Style};
use dissectors::event::Moment;
use dissectors::finding::{Finding, Severity, Span};
use dissectors::protocol::Medium;
use dissectors::record::{Heard, Record, Sink};
use dissectors::uart::{Character, Parity};
use std::fmt::Write as _;
use std::io::{self, Write};

/// Columns of the bus's name.
const BUS: usize = 6;

/// Columns of the bytes: those of the longest telegram, or of a frame with eight bytes.
const BYTES: usize = 17;
const FRAME: usize = 20;
/// Those of two words out and two in.
const WORDS: usize = 19;

/// Writes records as a table.
pub struct Text<W> {
    out: W,
    result: io::Result<()>,
    clock: Clock,
    /// Columns that a line fits in, if it must.
    width: Option<usize>,
    has_colour: bool,
    is_verbose: bool,
    has_header: bool,
    /// Columns of the bytes, as the first record has them.
    bytes: usize,
    line: String,
    /// Where the record's sentence ends in the line and its findings begin; 0 where it is one.
    ends: usize,
    sentence: String,
}

impl<W: Write> Text<W> {
    /// Writes to `out`, in lines of any length; with the characters below each telegram if verbose.
    pub fn new(out: W, clock: Clock, has_colour: bool, is_verbose: bool) -> Self {
        Text {
            out,
            result: Ok(()),
            clock,
            width: None,
            has_colour,
            is_verbose,
            has_header: false,
            bytes: BYTES,
            line: String::new(),
            ends: 0,
            sentence: String::new(),
        }
    }

    /// The same in lines that fit in so many columns.
    pub fn within(mut self, width: Option<usize>) -> Self {
        self.width = width;
        self
    }

    fn write(&mut self, record: &Record<'_>) -> io::Result<()> {
        if !self.has_header {
            self.has_header = true;
            let (n, time, bus, bytes) = ("n", "time", "bus", "bytes");
            self.bytes = match record.protocol.medium {
                Medium::Serial => BYTES,
                Medium::Can => FRAME,
                Medium::Words => WORDS,
            };
            let width = self.bytes;
            writeln!(self.out, "{n:>5} {time:>12} {bus:<BUS$} {bytes:<width$}   what")?;
        }
        self.compose(record);
        let severity = record.findings.iter().map(|finding| finding.severity()).max();
        let style = severity.filter(|_| self.has_colour).map(style);
        if let Some(width) = self.width.filter(|width| self.line.chars().count() > *width) {
            self.name_findings(record, width);
        }
        write_styled(&mut self.out, style, &self.line)?;
        if self.is_verbose {
            self.write_findings(record)?;
            self.write_characters(record)?;
            self.write_wire(record)?;
        }
        Ok(())
    }

    /// The line of a record. A String takes any text.
    fn compose(&mut self, record: &Record<'_>) {
        let (line, sentence) = (&mut self.line, &mut self.sentence);
        line.clear();
        let delta = self.clock.tick(record.start);
        let time = self.clock.show(record.start, delta).to_string();
        let _ = write!(line, "{:>5} {time:>12} ", record.n);
        sentence.clear();
        push_clean(sentence, &record.bus.name);
        shorten(sentence, BUS);
        let _ = write!(line, "{sentence:<BUS$} ");
        sentence.clear();
        for character in record.characters() {
            let separator = if sentence.is_empty() { "" } else { " " };
            let _ = write!(sentence, "{separator}{:02X}", character.value());
        }
        match record.heard {
            Heard::Frame(frame) => write_frame(frame, sentence),
            Heard::Row(row) => write_words(row.bytes(), sentence),
            Heard::Cycle(cycle) => {
                cycle.frames().take(1).for_each(|frame| write_words(frame.bytes(), sentence));
            }
            _ => {}
        }
        let width = self.bytes;
        shorten(sentence, width);
        let _ = write!(line, "{sentence:<width$} ");
        let severity = record.findings.iter().map(|finding| finding.severity()).max();
        line.push(severity.map_or(' ', mark));
        line.push(' ');
        sentence.clear();
        let _ = record.summarize(sentence);
        push_clean(line, sentence);
        self.ends = 0;
        // An event is its finding.
        if !record.has_bytes() {
            return;
        }
        self.ends = line.len();
        let mut separator = "; ";
        for finding in worst_first(record) {
            sentence.clear();
            let _ = finding.say(record, sentence);
            line.push_str(separator);
            push_clean(line, sentence);
            separator = ", ";
        }
    }

    /// Makes a line that is too long fit: what was found stands there by name, be the sentence cut.
    fn name_findings(&mut self, record: &Record<'_>, width: usize) {
        self.sentence.clear();
        for finding in worst_first(record).filter(|_| self.ends > 0) {
            let name = finding.code.name.rsplit('.').next().unwrap_or(finding.code.name);
            self.sentence.push_str(if self.sentence.is_empty() { "; " } else { ", " });
            self.sentence.push_str(name);
        }
        if self.ends > 0 {
            self.line.truncate(self.ends);
        }
        shorten(&mut self.line, width.saturating_sub(self.sentence.chars().count()).max(1));
        self.line.push_str(&self.sentence);
        shorten(&mut self.line, width);
    }

    fn write_findings(&mut self, record: &Record<'_>) -> io::Result<()> {
        for finding in record.findings {
            self.sentence.clear();
            let _ = finding.say(record, &mut self.sentence);
            self.line.clear();
            let _ = write!(self.line, "{:24}[{} ", "", finding.severity().name());
            let _ = write!(self.line, "{}] ", finding.code.name);
            push_clean(&mut self.line, &self.sentence);
            let style = self.has_colour.then(|| style(finding.severity()));
            write_styled(&mut self.out, style, &self.line)?;
        }
        Ok(())
    }

    /// What a frame took of the wire, and who sent it, as far as that is known.
    fn write_wire(&mut self, record: &Record<'_>) -> io::Result<()> {
        let Some(frame) = record.frame() else { return Ok(()) };
        let bits = frame.bits().map(|bits| format!("{bits} bits"));
        let time = record.duration.map(|ns| Span(ns.cast_signed()).to_string());
        let side = frame.direction.map(|side| side.name().to_owned());
        let crc = frame.crc.map(|fits| if fits { "CRC ok" } else { "CRC wrong" }.to_owned());
        let known: Vec<String> = [bits, time, side, crc].into_iter().flatten().collect();
        if known.is_empty() {
            return Ok(());
        }
        writeln!(self.out, "{:26}{}", "", known.join(", "))
    }

    fn write_characters(&mut self, record: &Record<'_>) -> io::Result<()> {
        for (index, character) in record.characters().iter().enumerate() {
            self.sentence.clear();
            let _ = record.layer.name_character(index, &mut self.sentence);
            let time = self.clock.relative(character.start).map(|ns| Exact(ns).to_string());
            writeln!(
                self.out,
                "{:>21} {:<3} {:<17}  {:02X}  {}  {}",
                time.unwrap_or_default(),
                "",
                bits(character, record),
                character.value(),
                state(character),
                self.sentence,
            )?;
        }
        Ok(())
    }
}

impl<W: Write> Sink for Text<W> {
    fn record(&mut self, record: &Record<'_>) {
        if self.result.is_ok() {
            self.result = self.write(record);
        }
    }
}

impl<W: Write> Export for Text<W> {
    fn begin(&mut self, time: Moment) {
        self.clock.begin(time);
    }

    fn status(&mut self) -> io::Result<()> {
        std::mem::replace(&mut self.result, Ok(()))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

fn worst_first<'a>(record: &Record<'a>) -> impl Iterator<Item = &'a Finding> {
    let findings = record.findings;
    [Severity::Error, Severity::Warning, Severity::Info].into_iter().flat_map(move |severity| {
        findings.iter().filter(move |finding| finding.severity() == severity)
    })
}

fn write_styled(out: &mut impl Write, style: Option<Style>, text: &str) -> io::Result<()> {
    match style {
        Some(style) => writeln!(out, "{style}{text}{style:#}"),
        None => writeln!(out, "{text}"),
    }
}

/// A character's bits in the order they are sent: start bit, data bits, parity bit, stop bit.
fn bits(character: &Character, record: &Record<'_>) -> String {
    let format = record.wire.format();
    let mut text = "0 ".to_owned();
    for bit in 0..format.data_bits() {
        text.push(if character.value() >> bit & 1 == 1 { '1' } else { '0' });
    }
    let fitting = format.parity().bit(character.value());
    match (fitting, character.parity()) {
        (None, _) | (_, Parity::None) => {}
        (Some(_), Parity::Unknown | Parity::Suspect) => text.push_str(" ?"),
        (Some(bit), Parity::Ok) => text.push_str(if bit { " 1" } else { " 0" }),
        (Some(bit), Parity::Error) => text.push_str(if bit { " 0" } else { " 1" }),
    }
    text.push_str(if character.has_framing_error() { " 0" } else { " 1" });
    text
}

fn state(character: &Character) -> &'static str {
    match (character.has_framing_error(), character.parity()) {
        (true, _) => "framing error ",
        (_, Parity::Error) => "parity error  ",
        (_, Parity::Suspect) => "parity suspect",
        (_, Parity::Unknown) => "parity unknown",
        (_, Parity::Ok | Parity::None) => "ok            ",
    }
}

const fn mark(severity: Severity) -> char {
    match severity {
        Severity::Error => 'E',
        Severity::Warning => 'W',
        Severity::Info => 'i',
    }
}

/// The words of a row, in fours of hex digits.
fn write_words(bytes: &[u8], text: &mut String) {
    for (index, word) in bytes.chunks(2).enumerate() {
        text.push_str(if index == 0 { "" } else { " " });
        word.iter().for_each(|byte| {
            // A String takes any text.
            let _ = write!(text, "{byte:02X}");
        });
    }
}

const fn style(severity: Severity) -> Style {
    match severity {
        Severity::Error => AnsiColor::Red.on_default().bold(),
        Severity::Warning => AnsiColor::Yellow.on_default(),
        Severity::Info => AnsiColor::Cyan.on_default(),
    }
}

/// Leaves at most so many columns, the last one a mark where something is left out.
fn shorten(text: &mut String, columns: usize) {
    let mut ends = text.char_indices().map(|(start, _)| start).skip(columns - 1);
    if let (Some(last), Some(_)) = (ends.next(), ends.next()) {
        text.truncate(last);
        text.push('…');
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lines_end_in_a_mark() {
        for (text, short) in [("", ""), ("abc", "abc"), ("abcd", "ab…"), ("µµµµ", "µµ…")]
        {
            let mut text = text.to_owned();
            shorten(&mut text, 3);
            assert_eq!(text, short);
        }
    }
}
