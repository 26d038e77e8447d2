//! pcap: packets of one interface, serial characters or CAN frames, with stamps in microseconds or nanoseconds.

use super::buses::Buses;
use super::bytes::BUS;
use super::can::packet;
use super::link::{self, Packet, Tap};
use super::outbox::{Outbox, Reader};
use super::rtac;
use super::stream::Stream;
use super::tap_note::TapNote;
use super::{Input, Place, SourceError, SourceOptions};
use byteorder_slice::{BigEndian, LittleEndian};
use dissectors::bus::WireFacts;
use dissectors::event::{LossCause, Moment};
use dissectors::protocol::Medium;
use dissectors::record::BusInfo;
use pcap_file::Endianness;
use pcap_file::pcap::{PcapHeader, PcapParseError, PcapTsResolution, RawPcapPacket};

/// The bus of a capture of CAN frames, which has no names.
const CAN_BUS: &str = "can";

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

/// A pcap source.
pub struct Pcap {
    stream: Stream,
    buses: Buses,
    opened: Option<Opened>,
    packets: u64,
    has_warned: bool,
}

/// What the file header tells.
struct Opened {
    endianness: Endianness,
    /// What the fraction of a stamp counts, in ns.
    unit: u32,
    /// `None` where the user did not ask for it.
    tap: Option<Tap>,
}

impl Pcap {
    /// Reads packets from this input.
    pub fn new(input: Input, options: &SourceOptions) -> Self {
        let (stream, buses) = (Stream::new(input), Buses::new(options));
        Pcap { stream, buses, opened: None, packets: 0, has_warned: false }
    }

    fn open(&mut self, out: &mut Outbox) -> Result<Opened, SourceError> {
        let Ok((_, header)) = PcapHeader::from_slice(self.stream.ahead(FILE_HEADER)?) else {
            return Err(self.stream.error("the file ends inside its header: it was cut"));
        };
        // Above the link type stand flags of frame check sequences.
        let [low, high, ..] = u32::from(header.datalink).to_le_bytes();
        let link_type = u16::from_le_bytes([low, high]);
        let unit = match header.ts_resolution {
            PcapTsResolution::MicroSecond => 1_000,
            PcapTsResolution::NanoSecond => 1,
        };
        let endianness = header.endianness;
        let Some(tap) = self.tap(link_type, endianness, unit, out) else {
            return Err(self.stream.error(link::wrong(link_type)));
        };
        let tap = tap.map_err(|what| self.stream.error(what))?;
        self.stream.take(FILE_HEADER);
        Ok(Opened { endianness, unit, tap })
    }

    /// The tap of a link type that is known.
    fn tap(
        &mut self,
        link_type: u16,
        order: Endianness,
        unit: u32,
        out: &mut Outbox,
    ) -> Option<Result<Option<Tap>, &'static str>> {
        let note = TapNote::default();
        let info = |name: &str| BusInfo::new(name, Some(note.clock));
        if link_type == rtac::LINK_TYPE {
            let tap = rtac::Tap::new(&note, unit, None, self.buses.options());
            let number = self.buses.number(info(BUS), Medium::Serial, tap.facts(), out);
            return Some(number.map(|bus| Some(Tap::Serial(tap.on(bus?)))));
        }
        let facts = WireFacts::default();
        let mut tap = packet::Tap::of(link_type, order, info(CAN_BUS), facts, unit)?;
        let announced = tap.announce(&mut self.buses, out);
        Some(announced.map(|()| Some(Tap::Can(tap))))
    }

    fn finish(&self, out: &mut Outbox) -> Result<(), SourceError> {
        let tap = self.opened.as_ref().and_then(|opened| opened.tap.as_ref());
        if let Some(oddity) = tap.and_then(Tap::oddity) {
            out.warning(SourceError::new(self.stream.name(), Place::Whole, oddity));
        }
        self.buses.check(self.stream.name())
    }

    /// Reads a packet; false where there is none.
    fn packet(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
        let Some(Opened { endianness, unit, tap }) = &mut self.opened else { return Ok(false) };
        let (endianness, unit) = (*endianness, *unit);
        let head = self.stream.ahead(PACKET_HEADER)?;
        if head.is_empty() {
            return Ok(false);
        }
        self.packets += 1;
        let Some(length) = captured_length(head, endianness) else { return Err(self.cut()) };
        if length > LONGEST_PACKET {
            let what = format!(
                "packet {} claims to have {length} bytes: the file is damaged here",
                self.packets
            );
            return Err(self.stream.error(what));
        }
        let whole = PACKET_HEADER + length as usize;
        self.stream.ahead(whole)?;
        let Ok((_, raw)) = parse(self.stream.held(), endianness) else {
            return Err(self.cut());
        };
        let packet = Packet {
            loss_cause: LossCause::Capture,
            at: stamp(raw.ts_sec, raw.ts_frac, unit),
            bytes: &raw.data,
            original_length: raw.orig_len,
            lost_before: None,
            direction: None,
        };
        if let Some(tap) = tap {
            let bus = tap.bus_of(&packet, &mut self.buses, out);
            let bus = bus.map_err(|what| self.stream.error(what))?;
            let oddity = bus.and_then(|bus| tap.hear(bus, &packet, out));
            if let (Some(oddity), false) = (oddity, self.has_warned) {
                self.has_warned = true;
                out.warning(self.stream.error(format!("packet {}: {oddity}", self.packets)));
            }
        }
        self.stream.take(whole);
        Ok(true)
    }

    /// Whether the next packet need not be waited for.
    fn is_next_held(&self) -> bool {
        let Some(Opened { endianness, .. }) = &self.opened else { return false };
        let held = self.stream.held();
        captured_length(held, *endianness)
            .is_some_and(|length| held.len() - PACKET_HEADER >= length as usize)
    }

    fn cut(&self) -> SourceError {
        self.stream.error(format!("the file ends inside packet {}: it was cut", self.packets))
    }
}

impl Reader for Pcap {
    fn read_on(&mut self, out: &mut Outbox) -> Result<bool, SourceError> {
        if self.opened.is_none() {
            self.opened = Some(self.open(out)?);
            return Ok(true);
        }
        loop {
            if !self.packet(out)? {
                self.finish(out)?;
                return Ok(false);
            }
            if out.is_full() || !self.is_next_held() {
                return Ok(true);
            }
        }
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
        let said = read(&file(0xA1B2_C3D4, 1, &[packet(0, 0, 2, b"a")]));
        let expected = "test: at byte 0: the packets have link type 1 (ETHERNET): characters of a \
                        serial line have 250 (RTAC_SERIAL), frames of a CAN bus 227 \
                        (CAN_SOCKETCAN), or 113 or 276 with a protocol of CAN";
        assert_eq!(said, [expected]);
        // Flags of frame check sequences are not part of it.
        assert_eq!(read(&file(0xA1B2_C3D4, 0xF000_00FA, &[])), ["bus serial log assumed"]);
    }

    /// A capture of CAN frames, which are bytes as the kernel has them.
    fn can_file(link_type: u32, frames: &[&[u8]]) -> Vec<u8> {
        let packet = |bytes: &&[u8]| {
            let length = u32::try_from(bytes.len()).unwrap();
            [[1, 5, length, length].map(u32::to_be_bytes).as_flattened(), bytes].concat()
        };
        let packets: Vec<Vec<u8>> = frames.iter().map(packet).collect();
        file(0xA1B2_C3D4, link_type, &packets)
    }

    /// What is read of frames in a file of either byte order, without the stamp that all have.
    fn can_frames(frames: &[&[u8]]) -> Vec<String> {
        let big = can_file(227, frames);
        let said = read(&big);
        assert_eq!(said, read(&swapped(&big)));
        assert_eq!(said[0], "bus can log");
        let all = said[1..].join(", ");
        all.split(", ")
            .map(|frame| frame.trim_start_matches("0: ").replace(" @1000005000±1000", ""))
            .collect()
    }

    #[test]
    fn can_identifiers_are_big_endian_in_either_byte_order() {
        let said = can_frames(&[
            &[0, 0, 4, 0x2C, 5, 0, 0, 0, 1, 0x0E, 1, 1, 1],
            // Extended, remote with DLC 4, error frame; padding to 16 bytes, and none at all.
            &[0x98, 0xEB, 0xFF, 0, 1, 0, 0, 0, 0xAA, 0, 0, 0, 0, 0, 0, 0],
            &[0x40, 0, 1, 0x23, 4, 0, 0, 0],
            &[0x20, 0, 0, 0x88, 8, 0, 0, 0, 0, 0, 4, 8, 0, 0, 0x60, 0],
            // Eight bytes with DLC 12: `len8_dlc` of newer kernels.
            &[0, 0, 1, 0x23, 8, 0, 0, 12, 1, 2, 3, 4, 5, 6, 7, 8],
        ]);
        assert_eq!(
            said,
            [
                "42C#010E010101",
                "18EBFF00#AA",
                "123#R4",
                "error 88#0000040800006000",
                "123#0102030405060708 dlc 12"
            ]
        );
    }

    /// FD by its length, its flags, or the length of its packet; but not by garbage.
    #[test]
    fn can_fd_is_told_from_garbage() {
        let long = [&[0, 0, 1, 0x23, 12, 0, 0, 0][..], &[7; 12]].concat();
        let padded = [&[0, 0, 1, 0x23, 2, 0, 0, 0, 0xAB, 0xCD][..], &[0; 62]].concat();
        let said = can_frames(&[
            &long,
            &padded,
            &[0, 0, 1, 0x23, 1, 5, 0, 0, 0xAB],
            &[0, 0, 1, 0x23, 1, 0x34, 0, 0, 0xAB],
            &[0, 0, 1, 0x23, 1, 4, 0x12, 0, 0xAB],
            &[0, 0, 1, 0x23, 1, 4, 0, 9, 0xAB],
        ]);
        let expected =
            ["123##070707070707070707070707", "123##ABCD", "123##AB", "123#AB", "123#AB", "123#AB"];
        assert_eq!(said, expected);
    }

    #[test]
    fn a_can_frame_that_was_cut_says_so() {
        let said = can_frames(&[
            &[0, 0, 4, 0x2C, 5, 0, 0, 0, 1, 0x0E],
            &[0, 0, 4, 0x2C, 100, 0, 0, 0, 1],
            // A CAN XL frame: left out and counted.
            &[0, 0, 4, 0x2C, 0x80, 0, 0, 1, 1],
        ]);
        assert_eq!(
            said,
            [
                "42C#010E dlc 5 cut of 5",
                "42C##01 cut of 100",
                "warning: test: 1 frame that is neither CAN nor CAN FD was left out"
            ]
        );
        let too_short = read(&can_file(227, &[&[0, 0, 4, 0x2C, 0]]));
        assert_eq!(
            too_short[1..],
            [
                "0: lost 1 Capture @1000005000",
                "warning: test: at byte 24: packet 1: a packet of 5 bytes, too short for a CAN frame"
            ]
        );
    }

    /// Link type 113: packet type, kind of interface, address, protocol; then the frame, with its
    /// identifier in the byte order of the file.
    #[test]
    fn cooked_can_frames_have_the_hosts_byte_order() {
        let cooked = |kind: u8, protocol: u8, frame: &[u8]| {
            let head = [0, kind, 1, 0x18, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, protocol];
            [&head[..], frame].concat()
        };
        let frames = [
            cooked(1, 0x0C, &[0, 0, 4, 0x2C, 1, 0, 0, 0, 0xAB]),
            cooked(4, 0x0D, &[0x98, 0, 4, 0x2C, 1, 0, 0, 0, 0xAB]),
        ];
        let big = can_file(113, &[&frames[0], &frames[1]]);
        let expected =
            ["bus can log", "0: 42C#AB R @1000005000±1000, 1800042C##AB T @1000005000±1000"];
        assert_eq!(read(&big), expected);
        let mut little = swapped(&big);
        for at in [24 + 16 + 16, 24 + 16 + 25 + 16 + 16] {
            little[at..at + 4].reverse();
        }
        assert_eq!(read(&little), expected);
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
        let frames: [&[u8]; 2] = [&[0, 0, 4, 0x2C, 1, 0, 0, 0, 9], &[0x20, 0, 0, 8, 0, 0, 0, 0]];
        for link_type in [227, 113, 276] {
            survive(InputFormat::Pcap, &can_file(link_type, &frames));
        }
    }
}
