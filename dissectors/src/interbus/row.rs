//! Rows: what a controller or a commissioning tool writes down of a ring, one line a row.

use crate::event::Moment;

/// Most bytes of a row. Host messages that are longer are cut.
pub const MAX_BYTES: usize = 64;

/// A device's place in the ring, from 1: a ring has 512 at most.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Device(u16);

impl Device {
    /// The first in the ring.
    pub const FIRST: Device = Device(1);

    /// The device of that number, from 1 to 512.
    #[must_use]
    pub const fn new(number: u16) -> Option<Self> {
        if matches!(number, 1..=512) { Some(Device(number)) } else { None }
    }

    /// Its number, from 1.
    #[must_use]
    pub const fn number(self) -> u16 {
        self.0
    }
}

/// What a row holds.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Content {
    /// The process data of a device: what the master sends, what it receives, or both.
    Process {
        /// Master to device.
        out: Option<u32>,
        /// Device to master.
        input: Option<u32>,
    },
    /// The ID word of a device.
    Identification(u16),
    /// The master's diagnostic registers.
    Diagnostic {
        /// The diagnostic status register.
        status: u16,
        /// The diagnostic parameter register: an error code or a place.
        parameter: Option<u16>,
    },
    /// The diagnostic byte that a fieldbus coupler keeps of a slave.
    SlaveDiagnostic(u8),
    /// A message of the master's host interface: its words are the row's bytes.
    Message,
}

/// One row.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Row {
    /// When it was logged.
    pub start: Moment,
    /// ± of `start` in ns.
    pub uncertainty: u32,
    /// The device, where the row is about one.
    pub device: Option<Device>,
    /// What it holds.
    pub content: Content,
    length: u8,
    bytes: [u8; MAX_BYTES],
}

impl Row {
    /// A row without a time.
    #[must_use]
    pub fn new(device: Option<Device>, content: Content) -> Self {
        let mut row = Row {
            start: Moment::UNKNOWN,
            uncertainty: 0,
            device,
            content,
            length: 0,
            bytes: [0; MAX_BYTES],
        };
        match content {
            Content::Process { out, input } => {
                out.into_iter().chain(input).for_each(|words| row.push(&words.to_be_bytes()));
            }
            Content::Identification(word) => row.push(&word.to_be_bytes()),
            Content::Diagnostic { status, parameter } => {
                row.push(&status.to_be_bytes());
                parameter.into_iter().for_each(|word| row.push(&word.to_be_bytes()));
            }
            Content::SlaveDiagnostic(byte) => row.push(&[byte]),
            Content::Message => {}
        }
        row
    }

    /// A message of the host interface, cut to [`MAX_BYTES`].
    #[must_use]
    pub fn message(words: impl IntoIterator<Item = u16>) -> Self {
        let mut row = Row::new(None, Content::Message);
        words.into_iter().for_each(|word| row.push(&word.to_be_bytes()));
        row
    }

    /// The same, logged at this time.
    #[must_use]
    pub fn at(mut self, start: Moment, uncertainty: u32) -> Self {
        self.start = start;
        self.uncertainty = uncertainty;
        self
    }

    /// Its words as bytes, high byte first: what the master sends before what it receives.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.length)).unwrap_or_default()
    }

    fn push(&mut self, bytes: &[u8]) {
        let from = usize::from(self.length);
        if let Some(place) = self.bytes.get_mut(from..from + bytes.len()) {
            place.copy_from_slice(bytes);
            self.length += bytes.len() as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bytes_are_what_was_logged() {
        let process = |out, input| Row::new(Some(Device::FIRST), Content::Process { out, input });
        assert_eq!(
            process(Some(0xC200_1388), Some(0x12345)).bytes(),
            [0xC2, 0, 0x13, 0x88, 0, 1, 0x23, 0x45]
        );
        assert_eq!(process(None, Some(0x12345)).bytes(), [0, 1, 0x23, 0x45]);
        assert_eq!(Row::message([0x0081, 0x0003]).bytes(), [0, 0x81, 0, 3]);
        assert_eq!(Row::message([0; 40]).bytes().len(), MAX_BYTES);
    }
}
