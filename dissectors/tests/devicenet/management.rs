//! Who is there: checks, restarts, heartbeats, and what does not belong on the bus.

use crate::bus::{
    Heard, concluded, decode, decode_at, findings, frame_ns, learned, protocol_of, read, script,
};
use fieldtap_dissectors::can::{Frame, FrameKind, Identifier};
use fieldtap_dissectors::event::Moment;
use fieldtap_dissectors::uart::Baud;

/// Vendor 468, serial 1, MAC ID 23.
const CHECK: &str = "4BF#00D40101000000";

#[test]
fn a_node_that_is_switched_on_is_nothing_to_tell() {
    let told = read(&[(0.0, CHECK), (1_000.0, CHECK), (3_000.0, "4BE#004B03010100")], 4_500.0);
    assert_eq!(findings(&told), ["4 event no-response"]);
    let told = read(&[(0.0, CHECK), (1_000.0, CHECK)], 4_500.0);
    assert_eq!(findings(&told), [""; 0]);
}

#[test]
fn a_node_that_was_on_line_restarts() {
    // The second request comes before a second is over: told there. Its connections are gone.
    let told = read(
        &[
            (0.0, "4BE#004B03010300"),
            (1.0, "4BB#00CB00"),
            (500.0, CHECK),
            (1_490.0, CHECK),
            (2_000.0, "4BD#"),
        ],
        2_500.0,
    );
    assert_eq!(findings(&told), ["4 dup-mac-request node-restart", "5 poll-command not-allocated"]);
    // It asks once only.
    let told = read(&[(0.0, "4BB#008E00"), (500.0, CHECK)], 2_500.0);
    assert_eq!(findings(&told), ["3 event node-restart"]);
    assert_eq!((told[2].ns, told[2].about), (Some(1_500_000_000), Some(2)));
    // Long after it was heard.
    assert_eq!(findings(&read(&[(0.0, "4BB#008E00"), (10_500.0, CHECK)], 12_500.0)), [""; 0]);
}

#[test]
fn error_frames_before_a_restart_make_bus_off_likely() {
    // A bus error that says nothing more (linux/can/error.h: class 80h).
    let error = |ms: i64| {
        let (start, id) = (Moment::from_ns(ms * 1_000_000), Identifier::Extended(0x80));
        Heard::Frame(Frame::new(start, 1_000, FrameKind::Error, id, 8).with(&[0; 8]))
    };
    let frame = |ms: i64, text| Heard::Frame(frame_ns(ms * 1_000_000, text));
    let heard = [
        error(0),
        frame(10, "4BB#008E00"),
        error(20),
        error(21),
        frame(500, CHECK),
        frame(1_490, CHECK),
    ];
    let told = decode(&heard, Some(4_000_000_000));
    assert_eq!(told[5].codes, ["node-restart"]);
    assert_eq!(
        told[5].messages,
        ["node 23 started anew after 2 error frames: it may have been bus-off"]
    );
    let told = decode(&heard[..2].iter().chain(&heard[4..]).cloned().collect::<Vec<_>>(), None);
    assert_eq!(told[3].messages, ["node 23 started anew"]);
}

#[test]
fn a_master_that_was_on_line_restarts() {
    let check = "407#00010092396060";
    let told = read(&[(0.0, "4BC#000E010101"), (1.0, "4BB#008ED401"), (500.0, check)], 2_500.0);
    assert_eq!(findings(&told), ["4 event node-restart"]);
}

#[test]
fn two_nodes_with_one_mac_id() {
    let told = read(&[(0.0, "4BB#008E00"), (500.0, CHECK), (501.0, "4BF#80D40102000000")], 2_500.0);
    assert_eq!(findings(&told), ["3 dup-mac-response duplicate-mac"]);
    assert_eq!(told[2].messages, ["MAC ID 23 is taken: a second node is kept off the bus"]);
    let told = read(&[(0.0, CHECK), (5_000.0, "4BF#00D40102000000")], 8_500.0);
    assert_eq!(findings(&told), ["2 dup-mac-request duplicate-mac"]);
    assert_eq!(told[1].messages, ["another node than before asks for MAC ID 23"]);
}

#[test]
fn one_device_at_two_mac_ids_has_moved_or_is_two() {
    // Vendor 468, serial 1 at MAC ID 63, then at 23.
    let moved = [(0.0, "5FF#00D40101000000"), (500.0, "5FB#3FCD010003000000"), (3_000.0, CHECK)];
    let wanted = |evidence: &str| {
        [63, 23].map(|mac| format!("serial number 00000001h of vendor 468 {mac} ({evidence})"))
    };
    let mut told = concluded(&script(&moved));
    told.reverse();
    let has_moved =
        "the first was not heard after the last came: a device that has another MAC ID now";
    assert_eq!(told, wanted(has_moved));
    // 63 answers while 23 is there.
    let two = [&moved[..], &[(4_000.0, "5FB#3FCD010003000000")]].concat();
    let mut told = concluded(&script(&two));
    told.reverse();
    let are_two = "the first was heard after the last came: two devices with one serial number";
    assert_eq!(told, wanted(are_two));
    assert_eq!(findings(&read(&two, 9_000.0)), [""; 0]);
    // Numbers that a master reads, where the check was before the capture.
    let read_from = |mac: u32| {
        let get = |attribute: u8| format!("{:03X}#000E0101{attribute:02X}", 0x404 | mac << 3);
        let tell = |data: &str| format!("{:03X}#008E{data}", 0x403 | mac << 3);
        [get(1), tell("D401"), get(6), tell("01000000")]
    };
    let lines: Vec<String> = [63, 23].into_iter().flat_map(read_from).collect();
    let mut asked: Vec<(f64, &str)> =
        (0..).map(|n| f64::from(n) * 10.0).zip(lines.iter().map(String::as_str)).collect();
    let mut told = concluded(&script(&asked));
    told.reverse();
    assert_eq!(told, wanted(has_moved));
    asked.push((100.0, "5FB#3FCD010003000000"));
    let mut told = concluded(&script(&asked));
    told.reverse();
    assert_eq!(told, wanted(are_two));
    // Another serial number.
    let others = [(0.0, "5FF#00D40102000000"), (3_000.0, CHECK)];
    assert_eq!(concluded(&script(&others)), [""; 0]);
}

#[test]
fn a_lone_node_is_not_acknowledged_and_does_not_restart() {
    // 110 bits take 880 µs at 125 kbit/s: the request is sent again at once, for ever.
    let lines: Vec<(f64, &str)> = (0..5_000).map(|n| (f64::from(n) * 0.9, CHECK)).collect();
    let mut found = findings(&read(&lines, 6_000.0));
    found.retain(|found| !found.ends_with("can.high-load"));
    assert_eq!(found, ["9 dup-mac-request can.not-acknowledged"]);
}

#[test]
fn a_lone_node_does_not_restart_whatever_the_stamps_are_worth() {
    // The same, read every 16 ms by a computer; the node was heard before.
    let lone = |n: u32| (f64::from(n / 18) * 16.0 + f64::from(n % 18) * 0.005, CHECK);
    let lines: Vec<(f64, &str)> =
        [(0.0, "4BB#17CD010003000000")].into_iter().chain((18..5_000).map(lone)).collect();
    for rate in [Baud::new(125_000), None] {
        let told = decode_at(rate, &script(&lines), Some(5_000_000_000));
        let restarts = told.iter().filter(|it| it.codes.iter().any(|code| code == "node-restart"));
        // It is told once, a second after the first request, as nobody objected.
        let restarts: Vec<_> = restarts.map(|it| (it.kind, it.about)).collect();
        assert_eq!(restarts, [("event", Some(2))]);
    }
}

#[test]
fn a_fault_lasts_from_heartbeat_to_heartbeat() {
    let [well, ill] = ["4BB#17CD010003000000", "4BB#17CD010004000000"];
    let told = read(&[(0.0, well), (1_000.0, ill), (2_000.0, ill), (3_000.0, well)], 4_000.0);
    assert_eq!(findings(&told), ["2 heartbeat device-fault+", "4 heartbeat device-fault-"]);
    assert_eq!((told[1].get("source"), told[1].get("destination")), ("23", ""));
    assert_eq!(told[1].summary, "23 is in a major recoverable fault");
}

#[test]
fn what_does_not_belong_here() {
    let at = |ms: i64| Moment::from_ns(ms * 1_000_000);
    let heard = [
        Heard::Frame(Frame::data(at(0), 0, Identifier::extended(0x1234_5678).unwrap(), &[1])),
        Heard::Frame(Frame::new(at(1), 0, FrameKind::Remote, Identifier::Standard(0x42D), 2)),
        Heard::Frame(Frame::new(at(2), 0, FrameKind::Fd, Identifier::Standard(0x42D), 12)),
        Heard::Frame(frame_ns(3_000_000, "7C5#01")),
        Heard::Frame(frame_ns(4_000_000, "7F5#01")),
        Heard::Frame(frame_ns(5_000_000, "0C5#01")),
        Heard::Frame(frame_ns(6_000_000, "605#01")),
    ];
    let told = decode(&heard, None);
    assert_eq!(
        findings(&told),
        [
            "1 foreign foreign-frame",
            "2 foreign foreign-frame",
            "3 foreign foreign-frame",
            "4 reserved reserved-id",
            "5 reserved reserved-id",
        ]
    );
    assert_eq!((told[5].kind, told[6].kind), ("io", "io"));
    assert_eq!((told[3].get("group"), told[4].get("group")), ("4", ""));
}

#[test]
fn the_protocol_is_found_from_the_frames() {
    let found = |frames: &[&str]| {
        let lines: Vec<(f64, &str)> = (0..).map(f64::from).zip(frames.iter().copied()).collect();
        protocol_of(&script(&lines))
    };
    assert_eq!(found(&["407#00010092396060", "416#004B03010100", "415#04", "0C5#01"]), "devicenet");
    assert_eq!(found(&["7DF#02010C", "7E8#04410C1AF8", "0F1#1C050240", "415#04"]), "can");
}

/// A slave is switched on, and polled from 3 s on, and another with it: what waits for the bus
/// follows without a pause, behind 48 bits of 8 µs as behind 89.
#[test]
fn the_bit_rate_may_show_itself_late() {
    let mut heard = script(&[(0.0, CHECK), (1_000.0, CHECK)]);
    for cycle in 0..300_i64 {
        let start = 3_000_000_000 + cycle * 50_000_000;
        heard.push(Heard::Frame(frame_ns(start, "42D#")));
        heard.push(Heard::Frame(frame_ns(start + 48 * 8_000, "3C0#00000000")));
        heard.push(Heard::Frame(frame_ns(start + (48 + 89) * 8_000, "3D7#45230100")));
        heard.push(Heard::Frame(frame_ns(start + 10_000_000, "4BD#")));
    }
    let (told, first) = learned(&heard);
    // Two frames are the beginning, and then 256 tell it: the next one is number 259.
    assert!(told[1].starts_with("bitrate 125000 (128 of 255 frames"), "{told:?}");
    assert!(told[1].ends_with(", among the 258 so far)"), "{told:?}");
    assert_eq!(first, Some(259));
    // However they come.
    let frames =
        heard.iter().filter_map(|it| if let Heard::Frame(it) = it { Some(*it) } else { None });
    assert_eq!(learned(&[Heard::Batch(frames.collect())]), (told, first));
    // A clock that tells nothing, never.
    heard.truncate(2);
    for cycle in 0..20_000_i64 {
        let start = 3_000_000_000 + cycle * 7_000_000 + cycle * cycle % 991 * 1_000;
        heard.push(Heard::Frame(frame_ns(start, "4BD#")));
    }
    let (told, first) = learned(&heard);
    assert_eq!((told[0].as_str(), first), ("bitrate  (nothing came without a pause)", None));
}

#[test]
fn a_cut_frame_is_not_its_senders_fault() {
    let mut cut = frame_ns(0, "4BC#000E");
    cut.dlc = 5;
    let told = decode(&[Heard::Frame(cut)], None);
    assert_eq!(findings(&told), ["1 explicit-request can.truncated"]);
}
