//! Messages between a controller and its master, as words of 16 bits: a code, how many words
//! follow, and these. Those of PCP, the channel for parameters, go on to a device.
//!
//! ```text
//! 0081 0003 0002 2116 0000              read, communication reference 2, index 2116h
//! 8081 0005 0002 0000 0004 0000 07D0    it was read: 4 bytes, 2000
//! ```
//!
//! Codes: ABB NIBA-01 p. 25, SEW MOVIDRIVE compact p. 386, and pierre-quelin/ibsdrv, which names
//! those that are not of PCP. How PCP goes over the ring is not published.

use super::diagnostic::Generation;
use super::row::MAX_BYTES;
use core::fmt;
use nom::combinator::rest;
use nom::number::complete::be_u16;
use nom::{IResult, Parser};

/// Most words of a message that a sentence shows.
const SHOWN: usize = 8;

/// What a code says besides its service (ibsdrv).
const TURN: u16 = 0xC000;
const UNCONFIRMED: u16 = 0x0800;

/// A message.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Message<'a> {
    /// What it is.
    pub code: u16,
    /// How many words follow, as it says.
    pub count: u16,
    /// The words that follow.
    words: &'a [u8],
}

/// A message: code, count, and the words behind them.
///
/// # Errors
/// There are fewer than two words.
pub fn message(input: &[u8]) -> IResult<&[u8], Message<'_>> {
    (be_u16, be_u16, rest).map(|(code, count, words)| Message { code, count, words }).parse(input)
}

/// Who speaks.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Turn {
    Request,
    Indication,
    Confirmation,
    Response,
    /// A confirmation that it failed.
    Failure,
}

impl Turn {
    const fn name(self) -> &'static str {
        match self {
            Turn::Request => "request",
            Turn::Indication => "indication",
            Turn::Confirmation => "confirmation",
            Turn::Response => "response",
            Turn::Failure => "error",
        }
    }
}

/// Services of PCP, by the code of their request.
const READ: u16 = 0x0081;
const PCP: [(u16, &str); 7] = [
    (READ, "Read"),
    (0x0082, "Write"),
    (0x0086, "Status"),
    (0x0087, "Identify"),
    (0x0088, "Get-OD"),
    (0x008B, "Initiate"),
    (0x008D, "Abort"),
];

/// Services of the master itself (ibsdrv).
const MASTER: [(u16, &str); 11] = [
    (0x030F, "Control_Statistics"),
    (0x0316, "Get_Error_Info"),
    (0x032B, "Get_Diag_Info"),
    (0x0341, "Fault"),
    (0x0701, "Start_Data_Transfer"),
    (0x0702, "Stop_Data_Transfer"),
    (0x0711, "Activate_Configuration"),
    (0x0760, "Confirm_Diagnostics"),
    (0x1303, "Alarm_Stop"),
    (0x1340, "Device_Fail"),
    (0x2342, "Bus_Error"),
];

fn named(list: &[(u16, &'static str)], code: u16) -> Option<&'static str> {
    list.iter().find(|(known, _)| *known == code).map(|(_, name)| *name)
}

/// A service of PCP, and who speaks.
fn pcp(code: u16, generation: Generation) -> Option<(&'static str, Turn)> {
    match (code, generation) {
        (0x018C, _) => return Some(("Initiate", Turn::Failure)),
        (0x01AD, _) => return Some(("Abort", Turn::Indication)),
        (0x0181..=0x018B, _) => return Some((named(&PCP, code - 0x0100)?, Turn::Confirmation)),
        // Generation 3 writes its requests as generation 4 its confirmations.
        (0x8080..=0x80FF, Generation::Three) => {
            return Some((named(&PCP, code & 0x00FF)?, Turn::Request));
        }
        (_, Generation::Three) => return None,
        (_, Generation::Four) => {}
    }
    Some((named(&PCP, code & !TURN & !UNCONFIRMED)?, turn(code)))
}

const fn turn(code: u16) -> Turn {
    match code & TURN {
        0x0000 => Turn::Request,
        0x4000 => Turn::Indication,
        0x8000 => Turn::Confirmation,
        _ => Turn::Response,
    }
}

impl Message<'_> {
    /// The name of what it is; `None` where the code has none.
    #[must_use]
    pub fn name(&self, generation: Generation) -> Option<&'static str> {
        self.service(generation).map(|(name, _)| name)
    }

    fn service(&self, generation: Generation) -> Option<(&'static str, Turn)> {
        let of_master =
            || Some((named(&MASTER, self.code & !TURN & !UNCONFIRMED)?, turn(self.code)));
        pcp(self.code, generation).or_else(of_master)
    }

    /// Whether it is as long as it says, as far as it was kept.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        let (there, kept) = (self.words.len(), MAX_BYTES - 4);
        (usize::from(self.count) * 2).min(kept) == there
    }

    fn words(&self) -> impl Iterator<Item = u16> + Clone {
        self.words.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]]))
    }

    /// Writes what it says. Of generation 4 if the user did not say.
    ///
    /// # Errors
    /// Only where `out` fails.
    pub fn say(&self, generation: Option<Generation>, out: &mut dyn fmt::Write) -> fmt::Result {
        let assumed = generation.unwrap_or(Generation::Four);
        match self.service(assumed) {
            Some((name, turn)) => write!(out, "{name} {}", turn.name())?,
            None => write!(out, "message {:04X}h", self.code)?,
        }
        let is_pcp = pcp(self.code, assumed);
        match is_pcp {
            Some((_, turn)) => self.say_pcp(turn, out)?,
            None => say_words(": ", self.words(), out)?,
        }
        if !self.is_whole() {
            write!(out, "; it says {} words and has {}", self.count, self.words.len() / 2)?;
        }
        if generation.is_none() && is_pcp.is_some() && self.code & 0xFF00 == 0x8000 {
            out.write_str(" (of generation 3: a request)")?;
        }
        Ok(())
    }

    /// Invoke and communication reference; of a read, what is read and what came of it.
    fn say_pcp(&self, turn: Turn, out: &mut dyn fmt::Write) -> fmt::Result {
        let mut words = self.words();
        let Some([invoke, reference]) = words.next().map(u16::to_be_bytes) else { return Ok(()) };
        write!(out, ": CR {reference}")?;
        if invoke != 0 {
            write!(out, ", invoke {invoke}")?;
        }
        let is_read = self.code & 0x00FF == READ;
        let mut rest = words.clone();
        match (turn, rest.next(), rest.next()) {
            (Turn::Request, Some(index), subindex) if is_read => {
                write!(out, ", index {index:04X}h")?;
                say_words(", ", subindex.into_iter().filter(|word| *word != 0).chain(rest), out)
            }
            (Turn::Confirmation, Some(0), Some(length)) if is_read => {
                write!(out, ", {length} bytes")?;
                say_words(": ", rest.clone(), out)?;
                match (length, rest.next(), rest.next(), rest.next()) {
                    (2, Some(word), None, None) => write!(out, " ({word})"),
                    (4, Some(high), Some(low), None) => {
                        write!(out, " ({})", u32::from(high) << 16 | u32::from(low))
                    }
                    _ => Ok(()),
                }
            }
            (Turn::Confirmation, Some(result), additional) if is_read && result != 0 => {
                let [class, code] = result.to_be_bytes();
                write!(out, ", error class {class} code {code}")?;
                if let Some(additional) = additional {
                    write!(out, " additional {additional:04X}h")?;
                }
                say_words(", ", rest, out)
            }
            _ => say_words(", ", words, out),
        }
    }
}

fn say_words(
    before: &str,
    mut words: impl Iterator<Item = u16>,
    out: &mut dyn fmt::Write,
) -> fmt::Result {
    let mut separator = before;
    for word in words.by_ref().take(SHOWN) {
        write!(out, "{separator}{word:04X}")?;
        separator = " ";
    }
    if words.next().is_some() { out.write_str(" …") } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::String;
    use alloc::vec::Vec;

    fn said(words: &[u16], generation: Option<Generation>) -> String {
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_be_bytes()).collect();
        let mut text = String::new();
        message(&bytes).unwrap().1.say(generation, &mut text).unwrap();
        text
    }

    const FOUR: Option<Generation> = Some(Generation::Four);
    const THREE: Option<Generation> = Some(Generation::Three);

    /// The examples of SEW MOVIDRIVE compact p. 386.
    #[test]
    fn worked_messages() {
        assert_eq!(said(&[0x0081, 3, 0x0002, 0x2116, 0], FOUR), "Read request: CR 2, index 2116h");
        // 07D0h = 2000.
        assert_eq!(
            said(&[0x8081, 5, 0x0002, 0, 4, 0, 0x07D0], FOUR),
            "Read confirmation: CR 2, 4 bytes: 0000 07D0 (2000)"
        );
        assert_eq!(
            said(&[0x8081, 3, 0x0002, 0x0800, 0x0010], FOUR),
            "Read confirmation: CR 2, error class 8 code 0 additional 0010h"
        );
    }

    #[test]
    fn every_code_has_its_name_and_turn() {
        let name = |code, generation| said(&[code, 0], generation);
        for (request, confirmation, listed, service) in [
            (0x0081, 0x8081, 0x0181, "Read"),
            (0x0082, 0x8082, 0x0182, "Write"),
            (0x0086, 0x8086, 0x0186, "Status"),
            (0x0087, 0x8087, 0x0187, "Identify"),
            (0x0088, 0x8088, 0x0188, "Get-OD"),
            (0x008B, 0x808B, 0x018B, "Initiate"),
        ] {
            assert!(name(request, FOUR).starts_with(service));
            assert!(name(request, FOUR).ends_with("request"));
            assert!(name(confirmation, FOUR).ends_with("confirmation"));
            assert!(name(listed, FOUR).ends_with("confirmation"));
        }
        for (code, expected) in [
            (0x018C, "Initiate error"),
            (0x088D, "Abort request"),
            (0x008D, "Abort request"),
            (0x01AD, "Abort indication"),
            (0x4081, "Read indication"),
            (0xC081, "Read response"),
            (0x0711, "Activate_Configuration request"),
            (0x8701, "Start_Data_Transfer confirmation"),
            (0x0702, "Stop_Data_Transfer request"),
            (0x1303, "Alarm_Stop request"),
            (0x0760, "Confirm_Diagnostics request"),
            (0x0316, "Get_Error_Info request"),
            (0x032B, "Get_Diag_Info request"),
            (0x030F, "Control_Statistics request"),
            (0x4341, "Fault indication"),
            (0x5340, "Device_Fail indication"),
            (0x6342, "Bus_Error indication"),
            (0x1234, "message 1234h"),
        ] {
            assert_eq!(name(code, FOUR), expected);
        }
    }

    #[test]
    fn generation_3_writes_requests_as_generation_4_confirmations() {
        let words = [0x808B, 1, 0x0002];
        assert_eq!(said(&words, FOUR), "Initiate confirmation: CR 2");
        assert_eq!(said(&words, THREE), "Initiate request: CR 2");
        assert_eq!(said(&words, None), "Initiate confirmation: CR 2 (of generation 3: a request)");
    }

    #[test]
    fn a_count_that_is_wrong_is_told() {
        assert_eq!(said(&[0x0701, 1, 1], FOUR), "Start_Data_Transfer request: 0001");
        assert_eq!(
            said(&[0x0701, 3, 1], FOUR),
            "Start_Data_Transfer request: 0001; it says 3 words and has 1"
        );
        // Of long ones the beginning is kept: 32 words, 30 behind code and count.
        let mut long = [0; 32];
        long[..2].copy_from_slice(&[0x0711, 100]);
        assert_eq!(
            said(&long, FOUR),
            "Activate_Configuration request: 0000 0000 0000 0000 0000 0000 0000 0000 …"
        );
        assert!(message(&[0x00, 0x81]).is_err());
    }
}
