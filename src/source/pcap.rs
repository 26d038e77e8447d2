//! pcap: packets of one interface, with stamps in microseconds or nanoseconds.

use super::bytes::BUS;
use super::outbox::{Outbox, Reader};
use super::rtac::{self, Packet, Tap};
use super::stream::Stream;
use super::tap_note::TapNote;
use super::{Input, SourceError, SourceOptions};
use byteorder_slice::{BigEndian, LittleEndian};
use dissectors::event::Moment;
use dissectors::record::BusInfo;
use pcap_file::pcap::{PcapHeader, PcapParseError, PcapTsResolution, RawPcapPacket};
use pcap_file::{DataLink, Endianness};

const FILE_HEADER: usize = 24;
const PACKET_HEADER: usize = 16;

/// Longest packet that is believed, in bytes: what capture programs write, and Wireshark takes.
pub const LONGEST_PACKET: u32 = 256 * 1024;

/// Whether a source begins like a pcap file.
pub fn is_pcap(head: &[u8]) -> bool {
    let magics = [[0xA1, 0xB2, 0xC3, 0xD4], [0xA1, 0xB2, 0x3C, 0x4D]];
    magics.into_iter().any(|magic: [u8; 4]| {
        let mut swapped = magic;
        swapped.reverse();
        head.starts_with(&magic) || head.starts_with(&swapped)
    })
}

/// A link type as messages name it.
pub fn link_name(link_type: u16) -> String {
    format!("{link_type} ({:?})", DataLink::from(u32::from(link_type)))
}

/// What to do about packets that are not serial characters.
pub fn wrong_link(link_type: u16) -> String {
    format!(
        "the packets have link type {}, and characters of a serial line have {}",
        link_name(link_type),
        link_name(rtac::LINK_TYPE)
    )
}

/// A pcap source.
pub struct Pcap {
    stream: Stream,
    options: SourceOptions,
    opened: Option<Opened>,
    packets: u64,
    has_warned: bool,
}

/// What the file header tells.
struct Opened {
    endianness: Endianness,
    /// What the fraction of a stamp counts, in ns.
    unit: u32,
    tap: Tap,
}

impl Pcap {
    /// Reads packets from this input.
    ///
    /// # Errors
    /// The user asked for another channel than the one there is.
    pub fn new(input: Input, options: &SourceOptions) -> Result<Self, SourceError> {
        options.choose_only(BUS, &input.name)?;
        let (stream, options) = (Stream::new(input), options.clone());
        Ok(Pcap { stream, options, opened: None, packets: 0, has_warned: false })
    }

    fn open(&mut self, out: &mut Outbox) -> Result<Opened, SourceError> {
        let Ok((_, header)) = PcapHeader::from_slice(self.stream.ahead(FILE_HEADER)?) else {
            return Err(self.stream.error("the file ends inside its header: it was cut"));
        };
        // Above the link type stand flags of frame check sequences.
        let [low, high, ..] = u32::from(header.datalink).to_le_bytes();
        let link_type = u16::from_le_bytes([low, high]);
        if link_type != rtac::LINK_TYPE {
            return Err(self.stream.error(wrong_link(link_type)));
        }
        self.stream.take(FILE_HEADER);
        let unit = match header.ts_resolution {
            PcapTsResolution::MicroSecond => 1_000,
            PcapTsResolution::NanoSecond => 1,
        };
        let note = TapNote::default();
        let tap = Tap::new(0, &note, unit, None, &self.options);
        out.bus(BusInfo::new(BUS, Some(note.clock)), tap.facts());
        Ok(Opened { endianness: header.endianness, unit, tap })
    }

    fn cut(&self) -> SourceError {
        self.stream.error(format!("the file ends inside packet {}: it was cut", self.packets))
    }
}

impl Reader for Pcap {
    fn read_on(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
        let Some(Opened { endianness, unit, tap }) = &self.opened else {
            self.opened = Some(self.open(out)?);
            return Ok(true);
        };
        let head = self.stream.ahead(PACKET_HEADER)?;
        if head.is_empty() {
            return Ok(false);
        }
        self.packets += 1;
        let Some(length) = captured_length(head, *endianness) else { return Err(self.cut()) };
        if length > LONGEST_PACKET {
            let what = format!(
                "packet {} claims to have {length} bytes: the file is damaged here",
                self.packets
            );
            return Err(self.stream.error(what));
        }
        let whole = PACKET_HEADER + length as usize;
        let Ok((_, raw)) = parse(self.stream.ahead(whole)?, *endianness) else {
            return Err(self.cut());
        };
        let packet = Packet {
            at: stamp(raw.ts_sec, raw.ts_frac, *unit),
            bytes: &raw.data,
            original_length: raw.orig_len,
            lost_before: None,
        };
        if let (Some(oddity), false) = (tap.hear(&packet, out), self.has_warned) {
            self.has_warned = true;
            out.warning(self.stream.error(format!("packet {}: {oddity}", self.packets)));
        }
        self.stream.take(whole);
        Ok(true)
    }
}

/// Length of the packet that begins here; `None` if its header is not whole.
fn captured_length(head: &[u8], endianness: Endianness) -> Option<u32> {
    let (header, _) = head.split_first_chunk::<PACKET_HEADER>()?;
    let [.., a, b, c, d, _, _, _, _] = *header;
    Some(match endianness {
        Endianness::Big => u32::from_be_bytes([a, b, c, d]),
        Endianness::Little => u32::from_le_bytes([a, b, c, d]),
    })
}

fn parse(
    bytes: &[u8],
    endianness: Endianness,
) -> Result<(&[u8], RawPcapPacket<'_>), PcapParseError> {
    match endianness {
        Endianness::Big => RawPcapPacket::from_slice::<BigEndian>(bytes),
        Endianness::Little => RawPcapPacket::from_slice::<LittleEndian>(bytes),
    }
}

/// A stamp in ns. The fraction may be more than a second: some writers do not carry it over.
fn stamp(seconds: u32, fraction: u32, unit: u32) -> Moment {
    Moment::from_ns(i64::from(seconds) * 1_000_000_000 + i64::from(fraction) * i64::from(unit))
}

#[cfg(test)]
mod tests {
    use super::super::InputFormat;
    use super::super::damage::survive;
    use super::super::transcript::transcript;
    use super::*;

    /// A file header: magic, version 2.4, two zeros, snap length, link type.
    fn file(magic: u32, link_type: u32, packets: &[Vec<u8>]) -> Vec<u8> {
        let words = [magic, 0, 0, 65_535, link_type].map(u32::to_be_bytes);
        [&words[0], &[0, 2, 0, 4], words[1..].as_flattened(), &packets.concat()].concat()
    }

    /// A packet: seconds, fraction, captured and original length, RTAC header, characters.
    fn packet(seconds: u32, fraction: u32, event: u8, characters: &[u8]) -> Vec<u8> {
        let length = 12 + u32::try_from(characters.len()).unwrap();
        let words = [seconds, fraction, length, length].map(u32::to_be_bytes);
        let header = [0, 0, 0, 0, 0, 0, 0, 0, event, 0, 0, 0];
        [words.as_flattened(), &header, characters].concat()
    }

    fn read(bytes: &[u8]) -> Vec<String> {
        transcript(InputFormat::Pcap, bytes, &SourceOptions::default())
    }

    /// Turns the headers of a big-endian file round.
    fn swapped(bytes: &[u8]) -> Vec<u8> {
        let mut bytes = bytes.to_vec();
        let swap = |bytes: &mut [u8], at: usize, size: usize| bytes[at..at + size].reverse();
        for (at, size) in [(0, 4), (4, 2), (6, 2), (8, 4), (12, 4), (16, 4), (20, 4)] {
            swap(&mut bytes, at, size);
        }
        let mut at = FILE_HEADER;
        while at < bytes.len() {
            let length = u32::from_be_bytes(bytes[at + 8..at + 12].try_into().unwrap());
            (0..4).for_each(|n| swap(&mut bytes, at + 4 * n, 4));
            at += PACKET_HEADER + length as usize;
        }
        bytes
    }

    #[test]
    fn characters_follow_the_stamp_at_the_assumed_rate() {
        // 11 bits at 115200 Bd: 95486.1 ns.
        let packets = [packet(10, 1, 2, &[0x84, 0x15, 0x17]), packet(10, 2_000_000, 1, &[0x1A])];
        let expected = [
            "bus serial log assumed",
            "0: 84 @10000001000±1000, 15 @10000096486±1000, 17 @10000191972±1000",
            // The second's fraction is more than a second.
            "0: 1A @12000000000±1000",
        ];
        let big = file(0xA1B2_C3D4, 250, &packets);
        assert_eq!(read(&big), expected);
        assert_eq!(read(&swapped(&big)), expected);
    }

    #[test]
    fn nanoseconds_and_the_users_rate_and_format() {
        // 10 bits at 9600 Bd: 1041666.7 ns. 8N1 has no parity bit.
        let options = SourceOptions {
            baud: dissectors::uart::Baud::new(9_600),
            frame: "8N1".parse().ok(),
            ..SourceOptions::default()
        };
        let big = file(0xA1B2_3C4D, 250, &[packet(0, 7, 2, b"ab")]);
        let expected = ["bus serial log assumed", "0: 61 @7±1, 62 @1041674±1"];
        assert_eq!(transcript(InputFormat::Pcap, &big, &options), expected);
        assert_eq!(transcript(InputFormat::Pcap, &swapped(&big), &options), expected);
    }

    #[test]
    fn other_link_types_are_refused_by_name() {
        let expected = "test: at byte 0: the packets have link type 1 (ETHERNET), and characters \
                        of a serial line have 250 (RTAC_SERIAL)";
        assert_eq!(read(&file(0xA1B2_C3D4, 1, &[packet(0, 0, 2, b"a")])), [expected]);
        // Flags of frame check sequences are not part of it.
        assert_eq!(read(&file(0xA1B2_C3D4, 0xF000_00FA, &[])), ["bus serial log assumed"]);
    }

    #[test]
    fn a_cut_file_is_read_as_far_as_it_goes() {
        let whole = file(0xA1B2_C3D4, 250, &[packet(1, 0, 2, b"a"), packet(2, 0, 2, b"b")]);
        for length in 1..whole.len() {
            let said = read(&whole[..length]);
            let last = said.last().unwrap().as_str();
            match length {
                ..24 => assert_eq!(
                    said,
                    ["test: at byte 0: the file ends inside its header: it was cut"]
                ),
                24 => assert_eq!(said.len(), 1),
                53 => assert_eq!(last, "0: 61 @1000000000±1000"),
                25..53 => {
                    assert_eq!(last, "test: at byte 24: the file ends inside packet 1: it was cut");
                }
                54.. => {
                    assert_eq!(said[1], "0: 61 @1000000000±1000");
                    assert_eq!(last, "test: at byte 53: the file ends inside packet 2: it was cut");
                }
            }
        }
    }

    #[test]
    fn an_absurd_length_is_damage() {
        let mut bytes = file(0xA1B2_C3D4, 250, &[packet(1, 0, 2, b"a"), packet(2, 0, 2, b"b")]);
        bytes[53 + 8..53 + 12].fill(0xFF);
        assert_eq!(
            read(&bytes).last().unwrap(),
            "test: at byte 53: packet 2 claims to have 4294967295 bytes: the file is damaged here"
        );
    }

    #[test]
    fn only_the_channel_there_is_can_be_asked_for() {
        let channels = vec!["RX".to_owned()];
        let options = SourceOptions { channels, ..SourceOptions::default() };
        assert_eq!(
            transcript(InputFormat::Pcap, &file(0xA1B2_C3D4, 250, &[]), &options),
            ["test: there is no channel RX: there is serial"]
        );
    }

    #[test]
    fn no_damage_stops_the_reader_for_good() {
        let packets = [packet(1, 0, 2, b"abc"), packet(2, 0, 8, b"d"), packet(3, 0, 5, b"")];
        survive(InputFormat::Pcap, &file(0xA1B2_C3D4, 250, &packets));
    }
}
