//! Files put together block by block (draft-ietf-opsawg-pcapng, section 4), and what is read.

use super::super::InputFormat;
use super::super::damage::survive;
use super::super::transcript::transcript;
use super::*;

/// A file in one byte order.
struct File {
    is_big: bool,
    bytes: Vec<u8>,
}

impl File {
    /// A file with one section.
    fn new(is_big: bool) -> Self {
        let mut file = File { is_big, bytes: Vec::new() };
        file.section();
        file
    }

    fn u16(&self, value: u16) -> [u8; 2] {
        if self.is_big { value.to_be_bytes() } else { value.to_le_bytes() }
    }

    fn u32(&self, value: u32) -> [u8; 4] {
        if self.is_big { value.to_be_bytes() } else { value.to_le_bytes() }
    }

    fn u64(&self, value: u64) -> [u8; 8] {
        if self.is_big { value.to_be_bytes() } else { value.to_le_bytes() }
    }

    fn ticks(&self, ticks: u64) -> [u8; 8] {
        let (high, low) = ((ticks >> 32) as u32, ticks as u32);
        [self.u32(high), self.u32(low)].concat().try_into().unwrap()
    }

    fn block(&mut self, kind: u32, body: &[u8]) {
        let padding = body.len().next_multiple_of(4) - body.len();
        let length = self.u32(u32::try_from(12 + body.len() + padding).unwrap());
        let kind = self.u32(kind);
        self.bytes.extend([&kind[..], &length, body, &vec![0; padding], &length].concat());
    }

    fn options(&self, options: &[(u16, &[u8])]) -> Vec<u8> {
        let mut bytes = Vec::new();
        for (code, value) in options {
            bytes.extend(self.u16(*code));
            bytes.extend(self.u16(u16::try_from(value.len()).unwrap()));
            bytes.extend(*value);
            bytes.resize(bytes.len().next_multiple_of(4), 0);
        }
        bytes.extend([0; 4]);
        bytes
    }

    fn section(&mut self) {
        let body =
            [&self.u32(0x1A2B_3C4D)[..], &self.u16(1), &self.u16(0), &self.u64(u64::MAX)].concat();
        self.block(0x0A0D_0D0A, &body);
    }

    fn interface(&mut self, link_type: u16, options: &[(u16, &[u8])]) {
        let head = [self.u16(link_type), [0; 2], [0; 2], [0; 2]].concat();
        self.block(1, &[head, self.options(options)].concat());
    }

    /// A serial interface with ns stamps at 1 MBd, so that a character takes 11 µs.
    fn serial(&mut self, name: &str, note: &str) {
        let speed = self.u64(1_000_000);
        let note = format!("fieldtap-tap: {note}");
        let options: [(u16, &[u8]); 4] =
            [(2, name.as_bytes()), (8, &speed), (9, &[9]), (1, note.as_bytes())];
        self.interface(250, &options);
    }

    fn enhanced(&mut self, interface: u32, ticks: u64, bytes: &[u8], options: &[(u16, &[u8])]) {
        let length = self.u32(u32::try_from(bytes.len()).unwrap());
        let padding = vec![0; bytes.len().next_multiple_of(4) - bytes.len()];
        let head = [self.u32(interface)[..].to_vec(), self.ticks(ticks).to_vec()].concat();
        let body = [&head[..], &length, &length, bytes, &padding, &self.options(options)].concat();
        self.block(6, &body);
    }

    fn read(&self) -> Vec<String> {
        transcript(InputFormat::Pcapng, &self.bytes, &SourceOptions::default())
    }
}

fn serial(event: u8, characters: &[u8]) -> Vec<u8> {
    [&[0, 0, 0, 0, 0, 0, 0, 0, event, 0, 0, 0], characters].concat()
}

/// Reads what `build` puts into a file of either byte order, which must say the same.
fn read(build: impl Fn(&mut File)) -> Vec<String> {
    let [big, little] = [true, false].map(|is_big| {
        let mut file = File::new(is_big);
        build(&mut file);
        file.read()
    });
    assert_eq!(big, little);
    big
}

#[test]
fn an_exchange_with_all_that_an_interface_tells() {
    let said = read(|file| {
        file.serial("ttyUSB0", "clock=read pm_ns=16000000 parity=packet format=8E1");
        file.enhanced(0, 1_700_000_000_000_000_000, &serial(2, &[0x84]), &[]);
        file.enhanced(0, 1_700_000_000_000_212_000, &serial(2, &[0x15, 0x17]), &[]);
        file.enhanced(0, 1_700_000_000_000_234_000, &serial(8, &[0x9A]), &[]);
        let end = file.ticks(1_700_000_000_000_300_000);
        let statistics = [[0; 12].to_vec(), file.options(&[(3, &end)])].concat();
        file.block(5, &statistics);
    });
    assert_eq!(
        said,
        [
            "bus ttyUSB0 read 1000000 8E1",
            "0: 84 @1700000000000000000±16000000",
            "0: 15 @1700000000000212000±16000000, 17 @1700000000000223000±16000000",
            "0: 9A parity suspect @1700000000000234000±16000000",
            "0: end @1700000000000300000",
        ]
    );
}

#[test]
fn an_interface_that_tells_nothing() {
    // Microseconds; 11 bits at 115200 Bd are 95486 ns.
    let said = read(|file| {
        file.interface(250, &[]);
        file.enhanced(0, 1_000, &serial(2, b"ab"), &[]);
        file.enhanced(0, 2_000, &serial(8, b"c"), &[]);
    });
    assert_eq!(
        said,
        [
            "bus if0 log assumed",
            "0: 61 @1000000±1000, 62 @1095486±1000",
            "0: 63 parity error @2000000±1000",
        ]
    );
}

#[test]
fn interfaces_are_buses_and_sections_go_on_with_them() {
    let said = read(|file| {
        file.serial("A", "");
        file.interface(250, &[(9, &[0x83]), (14, &file.u64(100))]);
        // 12 eighths of a second after second 100.
        file.enhanced(1, 12, &serial(2, b"x"), &[]);
        file.section();
        file.serial("B", "");
        file.serial("A", "");
        file.enhanced(0, 1, &serial(2, b"b"), &[]);
        file.enhanced(1, 2, &serial(2, b"a"), &[]);
    });
    assert_eq!(
        said,
        [
            "bus A log 1000000",
            "bus if1 log assumed",
            "1: 78 @101500000000±125000000",
            "bus B log 1000000",
            "2: 62 @1±1",
            "0: 61 @2±1",
        ]
    );
}

#[test]
fn sections_may_differ_in_byte_order() {
    let mut file = File::new(true);
    file.serial("A", "");
    file.is_big = false;
    file.section();
    file.serial("A", "");
    file.enhanced(0, 7, &serial(2, b"a"), &[]);
    assert_eq!(file.read(), ["bus A log 1000000", "0: 61 @7±1"]);
}

#[test]
fn comments_of_others_are_kept_and_our_own_left_out() {
    let said = read(|file| {
        file.serial("A", "");
        file.enhanced(
            0,
            7,
            &serial(2, b"a"),
            &[
                (1, b"fieldtap: 3 answers 154"),
                (1, b"[error slin.checksum] sum"),
                (1, b"[warning x] y"),
                (1, b"[info x] y"),
                (1, b"replaced the plug here"),
                (1, b"\xFF no UTF-8"),
            ],
        );
    });
    assert_eq!(
        said[1..],
        [
            "0: comment @7 \"replaced the plug here\"",
            "0: comment @7 \"\u{FFFD} no UTF-8\"",
            "0: 61 @7±1",
        ]
    );
}

#[test]
fn losses_are_told_where_they_were_counted() {
    let said = read(|file| {
        file.serial("A", "");
        let five = file.u64(5);
        file.enhanced(0, 7, &serial(2, b"a"), &[(4, &five)]);
        file.enhanced(0, 8, &serial(5, b""), &[(4, &five)]);
        file.block(5, &[[0; 12].to_vec(), file.options(&[(5, &five), (7, &five)])].concat());
    });
    assert_eq!(
        said[1..],
        [
            "0: lost 5 Capture @7",
            "0: 61 @7±1",
            "0: lost 5 Capture @8",
            // Blocks of 28, 72, 64 and 60 bytes before it.
            "warning: test: at byte 224: block 5: 10 packets of interface 0 were lost in the \
             capture, nobody knows where",
        ]
    );
}

#[test]
fn a_cut_packet_and_the_obsolete_form() {
    let said = read(|file| {
        file.serial("A", "");
        let bytes = serial(2, b"abcd");
        let head =
            [&file.u16(0)[..], &file.u16(2), &file.ticks(9), &file.u32(16), &file.u32(18), &bytes]
                .concat();
        file.block(2, &head);
    });
    assert_eq!(
        said[1..],
        [
            "0: lost 2 Capture @9",
            "0: 61 @9±1, 62 @11009±1, 63 @22009±1, 64 @33009±1",
            "0: lost 2 Capture @44009",
        ]
    );
}

#[test]
fn foreign_blocks_and_interfaces_are_left_out() {
    let said = read(|file| {
        file.interface(1, &[(2, b"eth0")]);
        file.serial("A", "");
        file.block(4, &[0; 8]);
        file.block(0x0BAD, &[1, 2, 3, 4]);
        file.block(3, &[0, 0, 0, 0]);
        file.block(3, &[0, 0, 0, 0]);
        file.enhanced(0, 1, &[0; 60], &[]);
        file.enhanced(0, 2, &[0; 60], &[]);
        file.enhanced(1, 3, &serial(2, b"a"), &[]);
    });
    assert_eq!(
        said,
        [
            "bus A log 1000000",
            "warning: test: at byte 168: block 6: packets without a time are left out",
            "warning: test: at byte 200: block 8: interface 0 has link type 1 (ETHERNET): its \
             packets are left out",
            "0: 61 @3±1",
        ]
    );
}

#[test]
fn a_file_without_an_interface_of_use_is_refused() {
    let expected = "the packets have link type 1 (ETHERNET): characters of a serial line have 250 \
                    (RTAC_SERIAL), frames of a CAN bus 227 (CAN_SOCKETCAN), or 113 or 276 with a \
                    protocol of CAN";
    let said = read(|file| {
        file.interface(1, &[]);
        file.enhanced(0, 1, &[0; 16], &[]);
        file.serial("A", "");
    });
    assert_eq!(said, [format!("test: at byte 52: block 3: {expected}")]);
    assert_eq!(read(|file| file.interface(1, &[])), [format!("test: {expected}")]);
    assert_eq!(read(|_| {}), [""; 0]);
}

/// A frame of link type 227: identifier, length, flags, two reserved bytes, data.
fn can(id: u32, flags: u8, data: &[u8]) -> Vec<u8> {
    let length = u8::try_from(data.len()).unwrap();
    [&id.to_be_bytes()[..], &[length, flags, 0, 0], data].concat()
}

#[test]
fn can_interfaces_stand_beside_serial_ones() {
    let said = read(|file| {
        file.serial("A", "");
        let speed = file.u64(125_000);
        let options: [(u16, &[u8]); 4] =
            [(2, b"A"), (8, &speed), (9, &[9]), (1, b"fieldtap-tap: clock=kernel pm_ns=1000")];
        file.interface(227, &options);
        file.enhanced(1, 7, &can(0x42C, 0, &[1, 0x0E, 1, 1, 1]), &[]);
        file.enhanced(0, 8, &serial(2, b"a"), &[]);
        let (five, unknown) = (file.u64(5), file.u64(u64::MAX));
        // epb_flags: outbound, inbound.
        let (out, into) = (file.u32(2), file.u32(1));
        file.enhanced(1, 9, &can(0x42B, 0, &[]), &[(4, &five), (2, &out), (1, b"plug 3 moved")]);
        file.enhanced(1, 10, &can(0x4000_042D, 0, &[]), &[(4, &unknown), (2, &into)]);
        let end = file.ticks(20);
        file.block(5, &[file.u32(1).to_vec(), vec![0; 8], file.options(&[(3, &end)])].concat());
    });
    assert_eq!(
        said,
        [
            "bus A log 1000000",
            "bus A kernel 125000",
            "1: 42C#010E010101 @7±1000",
            "0: 61 @8±1",
            "1: comment @9 \"plug 3 moved\"",
            "1: lost 5 Capture @9",
            "1: 42B# T @9±1000",
            "1: lost Capture @10",
            "1: 42D#R0 R @10±1000",
            "1: end @20",
        ]
    );
}

/// Cooked packets have the identifier in the byte order of the host, which is the file's.
#[test]
fn cooked_can_frames_of_several_interfaces() {
    let said = read(|file| {
        file.interface(276, &[(2, b"any"), (9, &[9])]);
        let cooked = |protocol: [u8; 2], index: u8, kind: u8, id: [u8; 4]| {
            let address = [0, 0, 0, 0, 0, 0, 0, 0];
            let head = [protocol[0], protocol[1], 0, 0, 0, 0, 0, index, 1, 0x18, kind, 0];
            [&head[..], &address, &id, &[1, 0, 0, 0, 0xAB]].concat()
        };
        let id = file.u32(0x42C);
        file.enhanced(0, 1, &cooked([0, 0x0C], 3, 1, id), &[]);
        file.enhanced(0, 2, &cooked([0, 0x0C], 4, 4, id), &[]);
        file.enhanced(0, 3, &cooked([0, 0x0D], 3, 1, id), &[]);
        // IPv4 of another interface, and CAN XL.
        file.enhanced(0, 4, &cooked([8, 0], 2, 0, id), &[]);
        file.enhanced(0, 5, &cooked([0, 0x0E], 3, 1, id), &[]);
        file.enhanced(0, 6, &[0; 19], &[]);
    });
    assert_eq!(
        said,
        [
            "bus any:3 log",
            "0: 42C#AB R @1±1",
            "bus any:4 log",
            "1: 42C#AB T @2±1",
            "0: 42C##AB R @3±1",
            "warning: test: 1 frame that is neither CAN nor CAN FD was left out",
        ]
    );
}

#[test]
fn channels_are_chosen_by_name() {
    let mut file = File::new(true);
    file.serial("A", "");
    file.serial("B", "");
    file.enhanced(0, 1, &serial(2, b"a"), &[]);
    file.enhanced(1, 2, &serial(2, b"b"), &[]);
    let read = |name: &str| {
        let channels = vec![name.to_owned()];
        let options = SourceOptions { channels, ..SourceOptions::default() };
        transcript(InputFormat::Pcapng, &file.bytes, &options)
    };
    assert_eq!(read("B"), ["bus B log 1000000", "0: 62 @2±1"]);
    assert_eq!(read("C"), ["test: there is no channel C: there is A, B"]);
}

#[test]
fn what_strict_readers_stumble_over() {
    let said = read(|file| {
        // A name in another character set, picoseconds, a reserved field that is not zero.
        let options = file.options(&[(2, b"Anschlu\xDF"), (9, &[12])]);
        file.block(1, &[file.u16(250).to_vec(), vec![1; 6], options].concat());
        file.enhanced(0, 7_999, &serial(2, b"a"), &[]);
    });
    assert_eq!(said, ["bus Anschlu\u{FFFD} log assumed", "0: 61 @7±1"]);
}

#[test]
fn damage_is_told_with_its_place() {
    let last = |build: fn(&mut File)| read(build).last().unwrap().clone();
    assert_eq!(
        last(|file| file.enhanced(3, 1, &serial(2, b"a"), &[])),
        "test: at byte 28: block 2: is of interface 3, and its section has 0: the file is damaged"
    );
    assert_eq!(
        last(|file| file.block(6, &[0; 16])),
        "test: at byte 28: block 2: is shorter than its fields: the file is damaged"
    );
    assert_eq!(
        last(|file| file.serial("A", "format=9N1")),
        "test: at byte 28: block 2: characters of nine data bits do not fit into bytes"
    );
    assert_eq!(
        last(|file| {
            file.interface(250, &[(9, &[0])]);
            file.enhanced(0, 1_700_000_000_000_000, &serial(2, b"a"), &[]);
        }),
        "test: at byte 60: block 3: its stamp lies after the year 2262: if_tsresol is not right"
    );
}

#[test]
fn lengths_are_not_believed_blindly() {
    for length in [0, 8, 13, 0xFFFF_FFFC_u32] {
        let mut file = File::new(true);
        file.block(4, &[0; 8]);
        file.bytes[32..36].copy_from_slice(&length.to_be_bytes());
        let expected = format!(
            "test: at byte 28: block 2: claims to have {length} bytes: the file is damaged here"
        );
        assert_eq!(file.read(), [expected]);
    }
    let mut file = File::new(true);
    file.block(4, &[0; 8]);
    *file.bytes.last_mut().unwrap() += 4;
    assert_eq!(
        file.read(),
        ["test: at byte 28: block 2: its length differs at its two ends: the file is damaged"]
    );
}

#[test]
fn a_cut_file_is_read_as_far_as_it_goes() {
    let mut file = File::new(false);
    file.serial("A", "");
    let first = file.bytes.len();
    file.enhanced(0, 1, &serial(2, b"a"), &[]);
    let second = file.bytes.len();
    file.enhanced(0, 2, &serial(2, b"b"), &[]);
    for length in 1..file.bytes.len() {
        let cut = File { is_big: false, bytes: file.bytes[..length].to_vec() };
        let said = cut.read();
        if length > second {
            assert_eq!(said[..2], ["bus A log 1000000", "0: 61 @1±1"]);
            let there = length - second;
            let wanted = if there < 12 { 12 } else { file.bytes.len() - second };
            let last = format!(
                "test: at byte {second}: the file ends inside block 4: {there} of {wanted} bytes \
                 are there, it was cut"
            );
            assert_eq!(said[2], last);
        } else if ![28, first, second].contains(&length) {
            assert!(said.last().unwrap().contains("the file ends inside block"), "{said:?}");
        }
    }
}

#[test]
fn no_damage_stops_the_reader_for_good() {
    for is_big in [true, false] {
        let mut file = File::new(is_big);
        file.serial("A", "clock=read pm_ns=16000000 parity=packet format=8E1");
        file.interface(1, &[(2, b"eth0")]);
        file.interface(276, &[(2, b"any")]);
        file.enhanced(
            2,
            1_000,
            &[&[0, 12, 0, 0][..], &[0; 16], &can(0x42C, 0, b"abc")].concat(),
            &[],
        );
        let five = file.u64(5);
        file.enhanced(0, 1_000, &serial(2, b"abc"), &[(1, b"note"), (4, &five)]);
        file.enhanced(1, 1_000, &[0; 14], &[]);
        file.block(5, &[[0; 12].to_vec(), file.options(&[(3, &five), (5, &five)])].concat());
        file.section();
        file.serial("A", "");
        file.enhanced(0, 2_000, &serial(8, b"d"), &[]);
        survive(InputFormat::Pcapng, &file.bytes);
    }
}
