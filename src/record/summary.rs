//! How a recording goes, in one line, and its last four lines where nothing was decoded.

use super::Recorder;
use super::composer::Bus;
use crate::terminal::clean;
use crate::verdict::{Verdict, line_of_counts};
use dissectors::finding::Span;
use std::fmt;

/// How a recording goes.
pub struct Summary {
    lasted: i64,
    characters: u64,
    frames: u64,
    breaks: u64,
    bytes: u64,
    files: u64,
    is_open: bool,
    /// Files were finished, and none is there.
    are_gone: bool,
    /// What was heard last is in no file.
    is_cut: bool,
    /// The source could not go on.
    has_source_failed: bool,
    events: Option<u64>,
    /// Losses besides the times in which nobody listened.
    losses: u64,
    deaf: u64,
    /// Those counted: in the capture, and at the receiver.
    lost: [u64; 2],
}

impl Summary {
    /// As it is now, after so many ns.
    pub fn of(recorder: &Recorder, lasted: i64) -> Self {
        let sum = |count: fn(&Bus) -> u64| recorder.buses().iter().map(count).sum();
        let files = recorder.files();
        Summary {
            lasted,
            characters: sum(|bus| bus.counts.characters),
            frames: sum(|bus| bus.counts.frames),
            breaks: sum(|bus| bus.counts.breaks),
            bytes: files.bytes,
            files: files.finished,
            is_open: files.is_open(),
            are_gone: files.finished > 0 && !files.are_there() && files.unnamed().is_empty(),
            is_cut: files.is_cut,
            has_source_failed: false,
            events: recorder.events(),
            losses: sum(|bus| bus.counts.losses - bus.counts.deaf),
            deaf: sum(|bus| bus.counts.deaf),
            lost: [sum(|bus| bus.lost[0]), sum(|bus| bus.lost[1])],
        }
    }
}

impl Summary {
    /// The same where the source could not go on: what it would have told is not known.
    pub fn behind_failure(self, has_source_failed: bool) -> Self {
        Summary { has_source_failed, ..self }
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plural = |count: u64| if count == 1 { "" } else { "s" };
        write!(f, "recorded {}: ", Lasted(self.lasted))?;
        match (self.characters, self.frames) {
            (0, frames) if frames > 0 => write!(f, "{frames} frame{}", plural(frames))?,
            (characters, 0) => write!(f, "{characters} character{}", plural(characters))?,
            (characters, frames) => write!(f, "{characters} characters and {frames} frames")?,
        }
        if self.breaks > 0 {
            write!(f, ", {} break{}", self.breaks, plural(self.breaks))?;
        }
        if let Some(events) = self.events {
            write!(f, ", {events} event{}", plural(events))?;
        }
        let open = if self.is_open { " and one being written" } else { "" };
        let gone = if self.are_gone { ", none of which is there any more" } else { "" };
        let (bytes, files) = (self.bytes, self.files);
        write!(f, "; {bytes} bytes in {files} file{}{gone}{open}; ", plural(files))?;
        if self.is_cut {
            f.write_str("what was heard last could not be written; ")?;
        }
        match self.losses {
            0 if self.deaf > 0 => {}
            0 if self.is_cut => f.write_str("nothing lost before")?,
            0 if self.has_source_failed => f.write_str("nothing lost before the source failed")?,
            0 => f.write_str("nothing lost")?,
            1 => write!(f, "lost once{}", Counted(self.lost))?,
            times => write!(f, "lost {times} times{}", Counted(self.lost))?,
        }
        match (self.losses, self.deaf) {
            (_, 0) => Ok(()),
            (0, times) => write!(f, "nobody listened {times} x"),
            (_, times) => write!(f, "; nobody listened {times} x"),
        }
    }
}

/// How much was lost, as far as it was counted: in the capture, and at the receiver.
struct Counted([u64; 2]);

impl fmt::Display for Counted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            [0, 0] => f.write_str(", how much is not known"),
            [capture, 0] => write!(f, ": {capture} counted in the capture"),
            [0, receiver] => write!(f, ": {receiver} counted at the receiver"),
            [capture, receiver] => {
                write!(f, ": {capture} counted in the capture, {receiver} at the receiver")
            }
        }
    }
}

/// How long a recording has lasted, as people say it.
struct Lasted(i64);

impl fmt::Display for Lasted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let seconds = self.0 / 1_000_000_000;
        match seconds {
            0..60 => Span(self.0).fmt(f),
            60..3_600 => write!(f, "{} min {} s", seconds / 60, seconds % 60),
            _ => write!(f, "{} h {} min", seconds / 3_600, seconds % 3_600 / 60),
        }
    }
}

/// The last four lines of a recording that was not decoded, of a source that came to its end or
/// could not go on.
pub fn undecoded(recorder: &Recorder, has_source_failed: bool) -> Verdict {
    let lines = recorder.buses().iter().map(|bus| {
        let line = line_of_counts(bus.counts, bus.wire(), bus.is_can());
        let is_only = recorder.buses().len() == 1;
        clean(&if is_only { line } else { format!("{} {line}", bus.info.name) })
    });
    let line = lines.collect::<Vec<_>>().join("; ");
    let not_decoded = || "not decoded".to_owned();
    if line.is_empty() {
        // That is not silence: nobody listened.
        return Verdict {
            line: "not heard: no bus appeared".to_owned(),
            who: not_decoded(),
            wrong: not_decoded(),
            open: "everything: nothing was recorded".to_owned(),
        };
    }
    Verdict {
        line,
        who: not_decoded(),
        wrong: not_decoded(),
        open: open(recorder, has_source_failed),
    }
}

/// What was not judged, and where it is to be read.
fn open(recorder: &Recorder, has_source_failed: bool) -> String {
    let behind = if has_source_failed { "what comes after the source's failure; " } else { "" };
    let files = recorder.files();
    let whole = files.are_there().then(|| recorder.directory().join("*.pcapng"));
    let there = whole.iter().chain(files.unnamed());
    let there: Vec<String> = there.map(|path| clean(&path.display().to_string())).collect();
    if there.is_empty() {
        return format!("{behind}everything: no recorded file is there");
    }
    let there = there.join(" ");
    format!("{behind}everything: a recording is not decoded -> fieldtap read {there}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_summary_is_one_sentence() {
        let summary = Summary {
            lasted: 3_723_000_000_000,
            characters: 41_212,
            frames: 0,
            breaks: 1,
            bytes: 1_234_567,
            files: 2,
            is_open: true,
            are_gone: false,
            is_cut: false,
            has_source_failed: false,
            events: None,
            losses: 2,
            deaf: 1,
            lost: [7, 0],
        };
        assert_eq!(
            summary.to_string(),
            "recorded 1 h 2 min: 41212 characters, 1 break; 1234567 bytes in 2 files and one being \
             written; lost 2 times: 7 counted in the capture; nobody listened 1 x"
        );
    }

    #[test]
    fn what_was_not_counted_is_not_none() {
        let said = |lost| Counted(lost).to_string();
        assert_eq!(said([0, 0]), ", how much is not known");
        assert_eq!(said([0, 12]), ": 12 counted at the receiver");
        assert_eq!(said([7, 12]), ": 7 counted in the capture, 12 at the receiver");
    }
}
