//! `bytes`: nothing but the bytes, as `cat` writes them. No times, and parity is not known.

use super::outbox::{Outbox, Reader};
use super::stream::Stream;
use super::{Input, SourceError, SourceOptions};
use dissectors::bus::WireFacts;
use dissectors::event::Moment;
use dissectors::record::BusInfo;
use dissectors::uart::{Character, Parity};

/// The bus of sources that name none.
pub const BUS: &str = "serial";

/// Characters handed over at once at most.
pub const BATCH: usize = 4096;

/// A source of bytes.
pub struct Bytes {
    stream: Stream,
    is_announced: bool,
}

impl Bytes {
    /// Reads bytes from this input.
    ///
    /// # Errors
    /// The user asked for another channel than the one there is.
    pub fn new(input: Input, options: &SourceOptions) -> Result<Self, SourceError> {
        options.choose_only(BUS, &input.name)?;
        Ok(Bytes { stream: Stream::new(input), is_announced: false })
    }
}

impl Reader for Bytes {
    fn read_on(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
        if !std::mem::replace(&mut self.is_announced, true) {
            announce(out);
        }
        let there = self.stream.ahead(1)?;
        let batch = &there[..there.len().min(BATCH)];
        out.characters(0, batch.iter().map(|byte| character(u16::from(*byte), Parity::Unknown)));
        let count = batch.len();
        self.stream.take(count);
        Ok(count > 0)
    }
}

/// The one bus of a source without times appears.
pub fn announce(out: &mut Outbox) {
    out.bus(BusInfo::new(BUS, None), WireFacts::default());
}

/// A character without a time.
pub fn character(value: u16, parity: Parity) -> Character {
    Character::new(Moment::UNKNOWN, 0, value, parity)
}

#[cfg(test)]
mod tests {
    use super::super::InputFormat;
    use super::super::transcript::transcript;
    use super::*;

    #[test]
    fn every_byte_is_a_character_of_unknown_parity() {
        let said = transcript(InputFormat::Bytes, b"\x84\xFF\0", &SourceOptions::default());
        assert_eq!(
            said,
            ["bus serial", "0: 84 parity unknown, FF parity unknown, 00 parity unknown"]
        );
    }
}
