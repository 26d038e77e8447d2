//! Packets of serial characters: link type 250, `LINKTYPE_RTAC_SERIAL` (tcpdump.org/linktypes).
//!
//! A packet begins with twelve bytes, big-endian: u32 seconds, u32 microseconds, u8 event, u8
//! control lines, u16 zero. Characters follow. Its time is the container's stamp, which may have
//! nanoseconds: the start bit of the first character. The others follow without a pause.

use super::SourceOptions;
use super::link::Packet;
use super::outbox::Outbox;
use super::tap_note::TapNote;
use dissectors::bus::WireFacts;
use dissectors::event::{Break, Clock, Loss, LossCause, Moment};
use dissectors::uart::{Baud, Character, Format, Parity, ParityMarks, ParityRule};
use nom::IResult;
use nom::error::{Error, ErrorKind};

/// The link type.
pub const LINK_TYPE: u16 = 250;

/// Bytes before the characters.
const HEADER: usize = 12;

/// How fast characters are taken to follow each other where nobody tells the rate, in Bd.
const ASSUMED_BAUD: u32 = 115_200;

// Events, as the link type's page names them. All that announce data carry it.
const STATUS_CHANGE: u8 = 0x00;
const DATA_TX_START: u8 = 0x01;
const DATA_RX_END: u8 = 0x04;
const CAPTURE_DATA_LOST: u8 = 0x05;
const CAPTURE_COMPLETE: u8 = 0x06;
const FRAMING_ERROR: u8 = 0x07;
const PARITY_ERROR: u8 = 0x08;
const SERIAL_BREAK: u8 = 0x09;
const SERIAL_OVERFLOW: u8 = 0x0A;

/// One serial interface of a packet capture.
#[derive(Debug)]
pub struct Tap {
    bus: usize,
    told_baud: Option<Baud>,
    told_format: Option<Format>,
    has_all_stamps: bool,
    /// A character's length and rate, told or assumed.
    bits: u32,
    baud: u32,
    uncertainty: u32,
    is_interpolated: bool,
    /// What is known of the parity of a good character, of one with a parity error, and of one
    /// with a framing error.
    unmarked: Parity,
    marked: Parity,
    unframed: Parity,
}

impl Tap {
    /// An interface of a bus that has no number yet. Its stamps are worth `resolution` ns, unless its
    /// note says more; where it does not tell rate or format, the user's word counts.
    pub fn new(note: &TapNote, resolution: u32, baud: Option<Baud>, user: &SourceOptions) -> Self {
        let format = note.format.or(user.frame).unwrap_or(Format::FT12);
        let has_parity = format.parity() != ParityRule::None;
        Tap {
            bus: 0,
            told_baud: baud,
            told_format: note.format,
            has_all_stamps: note.has_all_stamps,
            bits: format.bits(),
            baud: baud.or(user.baud).map_or(ASSUMED_BAUD, Baud::get),
            uncertainty: resolution.max(note.uncertainty),
            // Such stamps were taken when a read returned, and put back to the start bit.
            is_interpolated: note.clock == Clock::Read,
            unmarked: match note.parity {
                _ if !has_parity => Parity::None,
                ParityMarks::None => Parity::Unknown,
                ParityMarks::Character | ParityMarks::Packet => Parity::Ok,
            },
            marked: match note.parity {
                ParityMarks::Packet => Parity::Suspect,
                ParityMarks::Character | ParityMarks::None => Parity::Error,
            },
            // The packet has room for one mark only.
            unframed: if has_parity { Parity::Unknown } else { Parity::None },
        }
    }

    /// The same, heard on this bus.
    pub fn on(self, bus: usize) -> Self {
        Tap { bus, ..self }
    }

    /// The number of its bus.
    pub fn bus(&self) -> usize {
        self.bus
    }

    /// What the capture says about the wire.
    pub fn facts(&self) -> WireFacts {
        WireFacts {
            baud: self.told_baud,
            format: self.told_format,
            spacing_is_assumed: self.told_baud.is_none() && !self.has_all_stamps,
            sampling: None,
            medium: None,
        }
    }

    /// Puts what a packet says in the outbox. Returns what is wrong with it, if something is.
    pub fn hear(&self, packet: &Packet<'_>, out: &mut Outbox) -> Option<String> {
        let Packet { at, bytes, original_length, loss_cause, .. } = *packet;
        let missing = u64::from(original_length).saturating_sub(bytes.len() as u64);
        let lost = packet.lost_before.filter(|count| *count > 0);
        let parsed = event(bytes).ok();
        let is_loss = matches!(parsed, Some((_, CAPTURE_DATA_LOST | SERIAL_OVERFLOW)));
        if lost.is_some() && !is_loss {
            self.lose(at, lost, loss_cause, out);
        }
        let Some((bytes, event)) = parsed else {
            self.lose(at, None, LossCause::Capture, out);
            let length = bytes.len();
            let what =
                || format!("a packet of {length} bytes: serial packets have {HEADER} or more");
            return (missing == 0).then(what);
        };
        match event {
            STATUS_CHANGE => {}
            DATA_TX_START..=DATA_RX_END => self.characters(at, bytes, |good| good, out),
            PARITY_ERROR => self.characters(at, bytes, |c| c.with_parity(self.marked), out),
            FRAMING_ERROR => {
                let unframed = |c: Character| c.with_parity(self.unframed).with_framing_error();
                self.characters(at, bytes, unframed, out);
            }
            CAPTURE_DATA_LOST => self.lose(at, lost, loss_cause, out),
            SERIAL_OVERFLOW => self.lose(at, lost, LossCause::Overrun, out),
            SERIAL_BREAK => {
                let event = Break { start: at, uncertainty: self.uncertainty, duration: None };
                out.line_break(self.bus, event);
            }
            CAPTURE_COMPLETE => out.end(self.bus, at),
            event => return Some(format!("serial event {event:02X}h is not known: left out")),
        }
        if missing > 0 {
            self.lose(self.start(at, bytes.len()), Some(missing), LossCause::Capture, out);
        }
        None
    }

    fn characters(
        &self,
        at: Moment,
        bytes: &[u8],
        mark: impl Fn(Character) -> Character,
        out: &mut Outbox,
    ) {
        out.characters(
            self.bus,
            (0..).zip(bytes).map(|(number, byte)| {
                let start = self.start(at, number);
                let unmarked =
                    Character::new(start, self.uncertainty, u16::from(*byte), self.unmarked);
                mark(if self.is_interpolated { unmarked.interpolated() } else { unmarked })
            }),
        );
    }

    /// When the character of that number began in a packet stamped `at`.
    fn start(&self, at: Moment, number: usize) -> Moment {
        // Packets have less than 2^20 characters of at most 13 bits.
        let bits = number as u64 * u64::from(self.bits);
        let baud = u64::from(self.baud);
        at.plus(((bits * 1_000_000_000 + baud / 2) / baud).cast_signed())
    }

    fn lose(&self, start: Moment, count: Option<u64>, cause: LossCause, out: &mut Outbox) {
        out.lost(self.bus, Loss { start, count, cause });
    }
}

/// The event of a packet; what is left are the characters.
fn event(packet: &[u8]) -> IResult<&[u8], u8> {
    match packet.split_first_chunk::<HEADER>() {
        Some(([.., event, _lines, _, _], characters)) => Ok((characters, *event)),
        None => Err(nom::Err::Error(Error::new(packet, ErrorKind::Eof))),
    }
}

#[cfg(test)]
mod tests {
    use super::super::outbox::{Reader, Reading};
    use super::super::transcript::of_source;
    use super::super::{Place, SourceError};
    use super::*;

    /// One packet at 1 ms, and what came of it.
    struct Once(Tap, Vec<u8>, u32, Option<u64>);

    impl Reader for Once {
        fn read_on(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
            let Once(tap, bytes, original_length, lost_before) = self;
            let at = Moment::from_ns(1_000_000);
            let (original_length, lost_before) = (*original_length, *lost_before);
            let loss_cause = LossCause::Capture;
            let (direction, bytes) = (None, &bytes[..]);
            let packet = Packet { at, bytes, original_length, lost_before, loss_cause, direction };
            if let Some(oddity) = tap.hear(&packet, out) {
                out.warning(SourceError::new("test", Place::Whole, oddity));
            }
            Ok(false)
        }
    }

    fn packet(event: u8, characters: &[u8]) -> Vec<u8> {
        [&[0, 0, 0, 0, 0, 0, 0, 0, event, 0, 0, 0], characters].concat()
    }

    fn heard(note: &str, bytes: &[u8], cut: u32, lost: Option<u64>) -> Vec<String> {
        let note = TapNote::parse(&format!("fieldtap-tap: {note}")).unwrap();
        let tap = Tap::new(&note, 1, Baud::new(1_000_000), &SourceOptions::default());
        let original = u32::try_from(bytes.len()).unwrap() + cut;
        of_source(&mut Reading::new(Once(tap, bytes.to_vec(), original, lost)))
    }

    #[test]
    fn events_say_what_was_wrong_with_their_characters() {
        let heard = |event| heard("", &packet(event, &[0x15]), 0, None);
        for event in [1, 2, 3, 4] {
            assert_eq!(heard(event), ["0: 15 @1000000±1"]);
        }
        assert_eq!(heard(0), [""; 0]);
        assert_eq!(heard(5), ["0: lost Capture @1000000"]);
        assert_eq!(heard(6), ["0: end @1000000"]);
        assert_eq!(heard(7), ["0: 15 parity unknown framing error @1000000±1"]);
        assert_eq!(heard(8), ["0: 15 parity error @1000000±1"]);
        assert_eq!(heard(9), ["0: break @1000000±1"]);
        assert_eq!(heard(10), ["0: lost Overrun @1000000"]);
        assert_eq!(heard(11), ["warning: test: serial event 0Bh is not known: left out"]);
    }

    #[test]
    fn marks_are_worth_what_the_adapter_can_tell() {
        let heard = |note, event| heard(note, &packet(event, &[0x15, 0x17]), 0, None);
        // 11 bits of 1 µs.
        assert_eq!(heard("parity=packet", 2), ["0: 15 @1000000±1, 17 @1011000±1"]);
        assert_eq!(
            heard("parity=packet", 8),
            ["0: 15 parity suspect @1000000±1, 17 parity suspect @1011000±1"]
        );
        assert_eq!(
            heard("parity=character", 8),
            ["0: 15 parity error @1000000±1, 17 parity error @1011000±1"]
        );
        assert_eq!(
            heard("parity=none pm_ns=500", 2),
            ["0: 15 parity unknown @1000000±500, 17 parity unknown @1011000±500"]
        );
        // 10 bits, and no parity bit to be right or wrong.
        assert_eq!(heard("format=8N1", 2), ["0: 15 @1000000±1, 17 @1010000±1"]);
        assert_eq!(
            heard("format=8N1 parity=none", 7),
            ["0: 15 framing error @1000000±1, 17 framing error @1010000±1"]
        );
    }

    #[test]
    fn stamps_taken_on_reading_were_put_back() {
        let tap = |note: &str| {
            let note = TapNote::parse(note).unwrap();
            Tap::new(&note, 1, None, &SourceOptions::default()).is_interpolated
        };
        assert!(tap("fieldtap-tap: clock=read"));
        assert!(!tap("fieldtap-tap: clock=sample"));
    }

    #[test]
    fn losses_come_before_and_cuts_behind() {
        let data = packet(2, &[0x15, 0x17]);
        assert_eq!(
            heard("", &data, 3, Some(5)),
            [
                "0: lost 5 Capture @1000000",
                "0: 15 @1000000±1, 17 @1011000±1",
                "0: lost 3 Capture @1022000"
            ]
        );
        assert_eq!(heard("", &data, 0, Some(0)).len(), 1);
        // A loss that is told twice is one.
        assert_eq!(heard("", &packet(5, &[]), 0, Some(7)), ["0: lost 7 Capture @1000000"]);
        assert_eq!(heard("", &packet(10, &[]), 0, Some(7)), ["0: lost 7 Overrun @1000000"]);
    }

    #[test]
    fn a_packet_without_its_header_is_a_loss() {
        assert_eq!(heard("", &data_cut(11), 1, None), ["0: lost Capture @1000000"]);
        assert_eq!(
            heard("", &data_cut(11), 0, None),
            [
                "0: lost Capture @1000000",
                "warning: test: a packet of 11 bytes: serial packets have 12 or more"
            ]
        );
    }

    fn data_cut(length: usize) -> Vec<u8> {
        packet(2, &[0x15])[..length].to_vec()
    }
}
