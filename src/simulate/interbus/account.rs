//! Takes account of a log: what each row means to somebody who sees the rows and nothing else.

use super::ring::Data;
use super::truth::Told;
use super::word::{DATA, ERROR, SERVICE, WRITE, service};

/// What is known of an encoder from the rows so far.
#[derive(Clone, Copy, Default, Debug)]
pub struct Account {
    /// OUT without its service bit, when that was 1 last.
    asked: u32,
    /// OUT was another one since.
    has_changed: bool,
    /// The acknowledgement in the row before.
    acknowledged: Option<u32>,
}

impl Account {
    /// What a row means.
    pub fn tell(&mut self, data: &Data) -> Told {
        let (out, input) = (word(&data.out), word(&data.input));
        let mut told = Told {
            device: data.device,
            out: format!("{out:08X}"),
            input: format!("{input:08X}"),
            is_preset: data.is_preset,
            ..Told::default()
        };
        told.kind = self.kind(out, input);
        match told.kind {
            "service-request" => {
                told.name(out);
                told.data = (out & WRITE != 0).then_some(out & DATA);
            }
            "service-acknowledge" => {
                told.name(input);
                told.data = Some(input & DATA);
                let is_done = input & (WRITE | ERROR) == WRITE;
                if is_done && self.acknowledged != Some(input) {
                    told.expect = vec!["interbus.written"];
                }
            }
            _ => {}
        }
        let is_shown = input & !(ERROR | DATA) == 0;
        told.position = is_shown.then_some(input & DATA);
        self.acknowledged = Some(input).filter(|input| input & SERVICE != 0);
        told
    }

    /// The kind of a row, by the two service bits; and laid out is what is not 0 and not what
    /// was asked for last.
    fn kind(&mut self, out: u32, input: u32) -> &'static str {
        let (is_asked, is_done) = (out & SERVICE != 0, input & SERVICE != 0);
        let rest = out & !SERVICE;
        self.has_changed = !is_asked && (self.has_changed || rest != self.asked);
        if is_asked {
            self.asked = rest;
        }
        match (is_asked, is_done) {
            (true, false) => "service-request",
            (true, true) => "service-acknowledge",
            (false, true) => "release",
            (false, false) if rest != 0 && self.has_changed => "prepared",
            (false, false) => "normal",
        }
    }
}

impl Told {
    /// The service that a word names.
    fn name(&mut self, word: u32) {
        self.service = Some(service(word));
        self.access = Some(if word & WRITE == 0 { "read" } else { "write" });
    }
}

/// Four bytes as a word, high byte first.
pub fn word(bytes: &[u8]) -> u32 {
    bytes.iter().take(4).fold(0, |word, byte| word << 8 | u32::from(*byte))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Kinds, positions and data of these rows.
    fn told(rows: &[(u32, u32)]) -> Vec<(&'static str, Option<u32>, Option<u32>)> {
        let mut account = Account::default();
        let row = |(out, input): &(u32, u32)| {
            let (out, input) = (out.to_be_bytes().to_vec(), input.to_be_bytes().to_vec());
            let told = account.tell(&Data { device: 1, out, input, ..Data::default() });
            (told.kind, told.position, told.data)
        };
        rows.iter().map(row).collect()
    }

    #[test]
    fn the_words_of_the_manual() {
        // The handshake of the LA-66 manual §4, writing 5000 steps, 1388h.
        assert_eq!(
            told(&[
                (0, 0x12345),
                (0x4200_1388, 0x12345),
                (0xC200_1388, 0x12345),
                (0xC200_1388, 0xC200_1388),
                (0x4200_1388, 0xC200_1388),
                (0x4200_1388, 0x100),
                (0, 0x2001_2345),
            ]),
            [
                ("normal", Some(0x12345), None),
                ("prepared", Some(0x12345), None),
                ("service-request", Some(0x12345), Some(5_000)),
                ("service-acknowledge", None, Some(5_000)),
                ("release", None, None),
                // Left standing: nothing was laid out.
                ("normal", Some(0x100), None),
                ("normal", Some(0x12345), None),
            ]
        );
    }

    #[test]
    fn a_write_is_told_once() {
        let mut account = Account::default();
        let mut written = |input: u32| {
            let (out, input) = (vec![0xC4, 0, 0, 1], input.to_be_bytes().to_vec());
            let data = Data { device: 1, out, input, ..Data::default() };
            account.tell(&data).expect
        };
        assert!(written(0x100).is_empty());
        assert_eq!(written(0xC400_0001), ["interbus.written"]);
        assert!(written(0xC400_0001).is_empty());
        // Refused.
        assert!(written(0xE400_0001).is_empty());
    }
}
