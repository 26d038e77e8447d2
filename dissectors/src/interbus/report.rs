//! What a row says that holds no process words: an ID word, registers, a message.

use super::diagnostic::{Flags, Generation, Order, Parameter, Registers, Slave, registers};
use super::identification::{IdWord, id_word};
use super::message::{Message, message};
use super::row::{Content, Row};
use crate::field::Value;
use core::fmt;

/// How masters' registers and messages are read.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct Master {
    /// Its generation; the fourth where the user did not say.
    pub generation: Option<Generation>,
    /// Which bit is which in the register of the third.
    pub third: Order,
}

impl Master {
    fn generation(self) -> Generation {
        self.generation.unwrap_or(Generation::Four)
    }
}

/// What a row says.
#[derive(Clone, Copy, Debug)]
pub struct Report<'a> {
    row: &'a Row,
    master: Master,
    said: Said<'a>,
    flags: Option<Flags>,
}

#[derive(Clone, Copy, Debug)]
enum Said<'a> {
    Id(IdWord),
    Registers(Registers),
    Slave(Slave),
    Message(Message<'a>),
    /// A message of less than two words.
    Torn,
}

impl<'a> Report<'a> {
    /// What this row says; `None` where it holds process words.
    #[must_use]
    pub fn of(row: &'a Row, master: Master) -> Option<Self> {
        let said = match row.content {
            Content::Process { .. } => return None,
            Content::Identification(_) => id_word(row.bytes()).map(|(_, it)| Said::Id(it)),
            Content::Diagnostic { .. } => registers(row.bytes()).map(|(_, it)| Said::Registers(it)),
            Content::SlaveDiagnostic(byte) => Ok(Said::Slave(Slave(byte))),
            Content::Message => message(row.bytes()).map(|(_, it)| Said::Message(it)),
        };
        let said = said.unwrap_or(Said::Torn);
        let flags = match said {
            Said::Registers(registers) => Some(registers.flags(master.generation(), &master.third)),
            Said::Slave(slave) => Some(slave.flags()),
            _ => None,
        };
        Some(Report { row, master, said, flags })
    }

    /// The ID word.
    #[must_use]
    pub const fn id(&self) -> Option<IdWord> {
        if let Said::Id(id) = self.said { Some(id) } else { None }
    }

    /// The bytes of a word of the row: the first, the second.
    pub(super) fn word(&self, is_it: fn(Content) -> bool, index: usize) -> Value<'_> {
        let bytes = self.row.bytes().get(2 * index..2 * index + 2);
        bytes.filter(|_| is_it(self.row.content)).map_or(Value::Absent, Value::Hex)
    }

    /// The bits that are set, by name.
    pub(super) fn flags(&self) -> Value<'_> {
        self.flags.as_ref().map_or(Value::Absent, |flags| Value::List(flags))
    }

    /// What it tells of trouble on the line, a bit for each; `None` where it tells nothing for sure
    /// of it, be it that there is none.
    pub(super) fn line_trouble(&self) -> Option<u8> {
        let is_assumed =
            self.master.generation() == Generation::Three && !self.master.third.is_known();
        match self.said {
            Said::Registers(_) if is_assumed => None,
            _ => self.flags.map(|flags| flags.line_trouble()),
        }
    }

    /// Segment and place of the device that the parameter register names for sure.
    pub(super) fn place(&self) -> Option<(u8, Option<u8>)> {
        let Said::Registers(registers) = self.said else { return None };
        match registers.parameter(self.master.generation())? {
            Parameter::Place { segment, device } => Some((segment, device)),
            Parameter::Code(_) | Parameter::Either(_) => None,
        }
    }

    /// What a message is.
    pub(super) fn message(&self) -> Option<&'static str> {
        let Said::Message(message) = self.said else { return None };
        message.name(self.master.generation())
    }

    /// Writes the sentence.
    ///
    /// # Errors
    /// Only where `out` fails.
    pub fn say(&self, out: &mut dyn fmt::Write) -> fmt::Result {
        if let Some(device) = self.row.device {
            write!(out, "device {}: ", device.number())?;
        }
        match self.said {
            Said::Id(id) => write!(out, "{id}"),
            Said::Registers(registers) => {
                registers.say(self.master.generation(), &self.master.third, out)
            }
            Said::Slave(slave) => write!(out, "{slave}"),
            Said::Message(message) => message.say(self.master.generation, out),
            Said::Torn => out.write_str("a message of less than two words"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interbus::Device;
    use alloc::string::String;

    fn said(row: &Row) -> String {
        let mut text = String::new();
        Report::of(row, Master::default()).unwrap().say(&mut text).unwrap();
        text
    }

    #[test]
    fn a_row_of_each_kind() {
        let device = Device::new(2);
        let row = Row::new(device, Content::Identification(0x0132));
        assert!(said(&row).starts_with("device 2: 1 word IN, ident 50 (32h)"));
        let row = Row::new(None, Content::Diagnostic { status: 0x00E2, parameter: Some(0x0301) });
        assert!(said(&row).contains("; device 3.1 ("));
        assert_eq!(Report::of(&row, Master::default()).unwrap().place(), Some((3, Some(1))));
        let row = Row::new(device, Content::SlaveDiagnostic(0x02));
        assert_eq!(said(&row), "device 2: module error");
        assert_eq!(said(&Row::message([0x0701, 0])), "Start_Data_Transfer request");
        assert_eq!(said(&Row::message([0x0701])), "a message of less than two words");
        let process = Row::new(device, Content::Process { out: Some(0), input: None });
        assert!(Report::of(&process, Master::default()).is_none());
    }
}
