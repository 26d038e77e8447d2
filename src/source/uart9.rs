//! `uart9`: 16-bit words, little-endian, as a microcontroller's UART in 9-bit mode gives them. Bits 0
//! to 7 are the data, bit 8 is the parity bit as it was received. No times.

use super::bytes::{BATCH, BUS, announce, character};
use super::outbox::{Outbox, Reader};
use super::stream::Stream;
use super::{Input, SourceError, SourceOptions};
use dissectors::uart::{Character, Format, Parity};

const PARITY_BIT: u16 = 0x100;

/// Whether bytes may be of this format: every second one is 0 or 1, and both occur.
pub fn fits(head: &[u8]) -> bool {
    let (words, _) = head.as_chunks::<2>();
    let has = |high| words.iter().any(|word| word[1] == high);
    words.iter().all(|word| word[1] <= 1) && has(0) && has(1)
}

/// A source of 9-bit words.
pub struct Uart9 {
    stream: Stream,
    is_announced: bool,
    format: Format,
}

impl Uart9 {
    /// Reads words from this input. Their parity is judged by the format the user gives, else by
    /// 8E1.
    ///
    /// # Errors
    /// The user asked for another channel than the one there is.
    pub fn new(input: Input, options: &SourceOptions) -> Result<Self, SourceError> {
        options.choose_only(BUS, &input.name)?;
        let format = options.frame.unwrap_or(Format::FT12);
        Ok(Uart9 { stream: Stream::new(input), is_announced: false, format })
    }
}

impl Reader for Uart9 {
    fn read_on(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
        if !std::mem::replace(&mut self.is_announced, true) {
            announce(out);
        }
        let there = self.stream.ahead(size_of::<u16>())?;
        if there.is_empty() {
            return Ok(false);
        }
        let (words, _) = there.as_chunks();
        let words = &words[..words.len().min(BATCH)];
        let is_nine_bits = |word: &&[u8; 2]| u16::from_le_bytes(**word) <= 0x1FF;
        let good = words.iter().take_while(is_nine_bits).count();
        let (format, is_cut, has_wrong) = (self.format, words.is_empty(), good < words.len());
        out.characters(
            0,
            words[..good].iter().map(|word| heard(u16::from_le_bytes(*word), format)),
        );
        self.stream.take(good * size_of::<u16>());
        if is_cut {
            return Err(self.stream.error("the file ends inside a word: it was cut"));
        }
        if has_wrong {
            let what = "a word of more than nine bits: uart9 has 16-bit words, low byte first";
            return Err(self.stream.error(what));
        }
        Ok(true)
    }
}

fn heard(word: u16, format: Format) -> Character {
    if format.data_bits() == 9 {
        return character(word, Parity::None);
    }
    let data = word & (PARITY_BIT - 1);
    let parity = match format.parity().bit(data) {
        None => Parity::None,
        Some(bit) if bit == (word & PARITY_BIT != 0) => Parity::Ok,
        Some(_) => Parity::Error,
    };
    character(data, parity)
}

#[cfg(test)]
mod tests {
    use super::super::InputFormat;
    use super::super::damage::survive;
    use super::super::transcript::transcript;
    use super::*;

    fn read(bytes: &[u8], frame: &str) -> Vec<String> {
        let options = SourceOptions { frame: frame.parse().ok(), ..SourceOptions::default() };
        transcript(InputFormat::Uart9, bytes, &options)
    }

    #[test]
    fn the_parity_bit_is_held_against_the_rule() {
        // 80h has one 1, 15h has three, 00h none: even parity bits 1, 1, 0.
        let words = [0x80, 1, 0x15, 1, 0x15, 0, 0x00, 0];
        assert_eq!(read(&words, ""), ["bus serial", "0: 80, 15, 15 parity error, 00"]);
        assert_eq!(
            read(&words, "8O1")[1],
            "0: 80 parity error, 15 parity error, 15, 00 parity error"
        );
        assert_eq!(read(&words, "8M1")[1], "0: 80, 15, 15 parity error, 00 parity error");
        assert_eq!(read(&words, "8N1")[1], "0: 80, 15, 15, 00");
        assert_eq!(read(&words, "9N1")[1], "0: 180, 115, 15, 00");
    }

    #[test]
    fn an_odd_byte_at_the_end_is_a_cut() {
        let said = read(&[0x80, 1, 0x15], "");
        assert_eq!(
            said[1..],
            ["0: 80", "test: at byte 2: the file ends inside a word: it was cut"]
        );
    }

    #[test]
    fn words_the_other_way_round_are_refused() {
        let said = read(&[0x00, 1, 0x01, 0x80], "");
        assert_eq!(
            said[1..],
            [
                "0: 00 parity error",
                "test: at byte 2: a word of more than nine bits: uart9 has 16-bit words, low byte \
                 first"
            ]
        );
    }

    #[test]
    fn no_damage_stops_the_reader_for_good() {
        survive(InputFormat::Uart9, &[0x80, 1, 0x15, 1, 0x15, 0, 0x00, 0]);
    }
}
