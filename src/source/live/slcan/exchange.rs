//! What an adapter was told and what it answered. All that is ever written to it stands in
//! [`Command`].
//!
//! An answer does not say to what. Each command has one, and they come in order (Lawicel manual): one
//! that comes late is still that of the command that waited longest, and never confirms a later one.

use super::adapter::Rate;
use super::line::{self, Line};
use super::split::Saying;

/// Most bytes of an answer that are kept.
const LONGEST: usize = 16;

/// What an adapter is told.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Command {
    /// Leave the bus.
    Close,
    Version,
    SerialNumber,
    Rate(Rate),
    /// Stamp frames.
    Stamps,
    /// Hear, and acknowledge nothing.
    ListenOnly,
}

impl Command {
    /// As it is written.
    pub fn text(self) -> String {
        match self {
            Command::Close => "C\r".to_owned(),
            Command::Version => "V\r".to_owned(),
            Command::SerialNumber => "N\r".to_owned(),
            Command::Rate(rate) => format!("S{}\r", rate.number()),
            Command::Stamps => "Z1\r".to_owned(),
            Command::ListenOnly => "L\r".to_owned(),
        }
    }

    /// Whether a line answers it. Some tell their version without the letter.
    fn is_answered_by(self, line: &[u8]) -> bool {
        match self {
            Command::Version => !matches!(line, [b'N', ..]),
            Command::SerialNumber => !matches!(line, [b'V', ..]),
            _ => line.is_empty(),
        }
    }
}

/// How a command was answered.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Answer {
    /// Done; what was said of it.
    Done(String),
    /// Not done.
    Refused,
    /// Not at all.
    None,
}

/// Commands and their answers.
#[derive(Default)]
pub struct Exchange {
    asked: Vec<(Command, Answer)>,
    /// Answers that no command waited for.
    strays: u32,
    has_refused: bool,
}

impl Exchange {
    /// It is told this.
    pub fn ask(&mut self, command: Command) {
        self.asked.push((command, Answer::None));
        self.has_refused = false;
    }

    /// It says something: an answer, or what it heard on the bus meanwhile.
    pub fn hear(&mut self, saying: Saying<'_>) {
        let mut waiting = self.asked.iter_mut().filter(|(_, answer)| *answer == Answer::None);
        let (answer, waiting) = match saying {
            Saying::Refusal | Saying::CutRefusal => (Answer::Refused, waiting.next()),
            Saying::Line(b"") => (Answer::Done(String::new()), waiting.next()),
            Saying::Line(line) => {
                let waiting = waiting.find(|(command, _)| command.is_answered_by(line));
                let is_heard =
                    matches!(line::parse(line), Some(Line::Frame(..) | Line::Reports(_)));
                if is_heard || waiting.is_none() {
                    return;
                }
                let line = &line[..line.len().min(LONGEST)];
                (Answer::Done(String::from_utf8_lossy(line).into_owned()), waiting)
            }
            Saying::TooLong => return,
        };
        self.has_refused |= answer == Answer::Refused;
        match waiting {
            Some((_, waiting)) => *waiting = answer,
            None => self.strays = self.strays.saturating_add(1),
        }
    }

    /// Whether it refused something since it was last asked, be it that or what was before it.
    pub fn has_refused(&self) -> bool {
        self.has_refused
    }

    /// The answer to the last command.
    pub fn last(&self) -> &Answer {
        self.asked.last().map_or(&Answer::None, |(_, answer)| answer)
    }

    /// The answer to a command, if it came by now.
    pub fn answer(&self, command: Command) -> &Answer {
        let asked = self.asked.iter().rev().find(|(asked, _)| *asked == command);
        asked.map_or(&Answer::None, |(_, answer)| answer)
    }

    /// Whether some command still waits for its answer.
    pub fn is_waiting(&self) -> bool {
        self.asked.iter().any(|(_, answer)| *answer == Answer::None)
    }

    /// Whether it answered nothing that it was asked.
    pub fn is_mute(&self) -> bool {
        self.asked.iter().all(|(_, answer)| *answer == Answer::None)
    }

    /// Whether it answered more often than it was asked, or may yet answer what it was asked before:
    /// then nobody knows what its next answer is for.
    pub fn is_confused(&self) -> bool {
        let before = self.asked.len().saturating_sub(1);
        self.strays > 0 || self.asked[..before].iter().any(|(_, answer)| *answer == Answer::None)
    }

    /// What came until now was for whoever asked before.
    pub fn begin(&mut self) {
        *self = Exchange::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_late_answer_is_that_of_the_command_that_waited_longest() {
        let mut exchange = Exchange::default();
        exchange.ask(Command::Stamps);
        exchange.ask(Command::ListenOnly);
        exchange.hear(Saying::Line(b""));
        exchange.hear(Saying::Line(b"t1230"));
        assert_eq!(*exchange.answer(Command::Stamps), Answer::Done(String::new()));
        assert_eq!(*exchange.last(), Answer::None);
        exchange.hear(Saying::Refusal);
        assert_eq!(*exchange.last(), Answer::Refused);
        assert!(!exchange.is_confused());
        exchange.hear(Saying::Line(b""));
        assert!(exchange.is_confused(), "nobody asked");
    }

    #[test]
    fn a_name_is_the_answer_to_its_own_question() {
        let mut exchange = Exchange::default();
        exchange.ask(Command::Version);
        exchange.ask(Command::SerialNumber);
        exchange.hear(Saying::Line(b"NA123"));
        assert_eq!(*exchange.answer(Command::Version), Answer::None);
        assert_eq!(*exchange.last(), Answer::Done("NA123".to_owned()));
        assert!(exchange.is_confused());
        exchange.hear(Saying::Line(b"t1230"));
        exchange.hear(Saying::Line(b"Maker-b158aa7 of somewhere"));
        let name = Answer::Done("Maker-b158aa7 of".to_owned());
        assert_eq!(*exchange.answer(Command::Version), name);
    }
}
