//! Whether the traffic on a line is SLIN at all.

use super::codes;
use crate::finding::Finding;

/// Characters it takes to say that a line does not speak SLIN.
const ENOUGH: u64 = 16;

/// The request of Baumer's other RS485 protocol is `01 80 address 80 04`.
const OTHER_REQUEST: u64 = 0x01_80_00_80_04;
const BUT_ITS_ADDRESS: u64 = 0xFF_FF_00_FF_FF;

/// What the traffic so far speaks for.
#[derive(Clone, Default, Debug)]
pub struct Signature {
    /// Characters heard.
    characters: u64,
    /// Of them, those that are part of a plain request or of an answer to one.
    explained: u64,
    damaged: u64,
    /// Exchanges whose footer names the station that was asked and whose checksum fits.
    complete: u64,
    /// Requests of Baumer's other protocol.
    other_requests: u64,
    /// The last bytes, the newest in the low eight bits.
    last_bytes: u64,
    /// Control words: bytes with bit 7.
    control_words: u64,
    /// Those that name the same address as the one before, with other bytes in between: footers,
    /// whatever bit 3 and the checksum should be.
    alike: u64,
    last_control: Option<u8>,
    has_data: bool,
}

impl Signature {
    /// Takes a character as it comes.
    pub fn hear(&mut self, byte: u8, is_damaged: bool) {
        self.characters += 1;
        self.damaged += u64::from(is_damaged);
        self.last_bytes = self.last_bytes << 8 | u64::from(byte);
        self.other_requests += u64::from(self.last_bytes & BUT_ITS_ADDRESS == OTHER_REQUEST);
        if byte & 0x80 == 0 {
            self.has_data = true;
            return;
        }
        let is_alike = self.last_control.is_some_and(|last| last & 7 == byte & 7);
        self.control_words += 1;
        self.alike += u64::from(is_alike && self.has_data);
        (self.last_control, self.has_data) = (Some(byte), false);
    }

    /// Whether it looks like SLIN, be it with other settings than those it was read with: of every
    /// four control words one at least is a footer. By chance it would be one of sixteen.
    const fn looks_like_slin(&self) -> bool {
        self.alike > 0 && self.alike * 4 >= self.control_words
    }

    /// So many characters turned out to be a plain request or an answer to one.
    pub fn explain(&mut self, characters: usize) {
        self.explained += characters as u64;
    }

    /// An exchange was right in every way.
    pub fn complete(&mut self) {
        self.complete += 1;
    }

    /// Requests of Baumer's other protocol, if that is what is spoken. Read as SLIN with bit 3
    /// low, the middle of such a request is a complete exchange.
    #[must_use]
    pub fn other_protocol(&self) -> Option<u64> {
        (self.other_requests > 0 && self.other_requests * 2 >= self.complete)
            .then_some(self.other_requests)
    }

    /// Complete exchanges, if the traffic speaks for SLIN: at least half of it is requests and
    /// answers.
    #[must_use]
    pub fn speaks_for_slin(&self) -> Option<u64> {
        let speaks = self.explained > 0
            && self.explained * 2 >= self.characters
            && self.other_protocol().is_none();
        speaks.then_some(self.complete)
    }

    /// What there is to say at the end of a capture that was read as SLIN. A wrong set-up of the tap
    /// explains a lack of exchanges.
    #[must_use]
    pub fn verdict(&self, is_set_up_wrong: bool) -> Option<Finding> {
        let not_slin = Finding::new(&codes::NOT_SLIN).limit(self.characters.cast_signed());
        if let Some(requests) = self.other_protocol() {
            return Some(not_slin.actual(requests.cast_signed()));
        }
        let is_foreign = !is_set_up_wrong
            && self.complete == 0
            && !self.looks_like_slin()
            && self.characters >= ENOUGH
            && self.explained * 2 < self.characters
            && self.damaged * 2 < self.characters;
        is_foreign.then_some(not_slin)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn baumers_other_protocol_is_recognised() {
        let mut signature = Signature::default();
        for byte in [0x01, 0x80, 0x02, 0x80, 0x04, 0x01, 0x02, 0x00, 0x10, 0x0F, 0x33, 0x2F, 0x04] {
            signature.hear(byte, false);
        }
        // 80 02 80 is also a complete exchange with bit 3 low.
        signature.explain(3);
        signature.complete();
        assert_eq!(signature.speaks_for_slin(), None);
        let finding = signature.verdict(false).unwrap();
        assert_eq!(
            (finding.actual, finding.limit),
            (Some(1), Some(13)),
            "1 request in 13 characters"
        );
    }

    #[test]
    fn slin_read_with_another_profile_is_still_slin() {
        let mut signature = Signature::default();
        for address in [0, 1, 2, 3].repeat(4) {
            for byte in [0x80 | address, 0x1A, 0x01, 0x90 | address] {
                signature.hear(byte, false);
            }
        }
        assert_eq!(signature.verdict(false), None);
    }

    #[test]
    fn text_is_not_slin_and_vain_requests_are() {
        let mut text = Signature::default();
        b"Hello World, here I am".iter().for_each(|byte| text.hear(*byte, false));
        assert!(text.speaks_for_slin().is_none() && text.verdict(false).is_some());
        let mut requests = Signature::default();
        for address in 0..20 {
            requests.hear(0x80 | (address % 8), false);
            requests.explain(1);
        }
        assert!(requests.speaks_for_slin() == Some(0) && requests.verdict(false).is_none());
    }
}
