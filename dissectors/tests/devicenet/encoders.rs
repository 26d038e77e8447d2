//! Encoders as a technician meets them: station 23, bound to Baumer's profile. 4BCh asks it, 4BBh
//! answers; the first byte says which master it is.

use crate::bus::{Told, conclusions, decode_with, script};
use fieldtap_dissectors::device::Profile;
use fieldtap_dissectors::devicenet::encoder::Profile::BaumerEncoder;
use fieldtap_dissectors::protocol::Settings;
use fieldtap_dissectors::station::{Direction, Resolution, Station};

fn encoder() -> Settings {
    Settings { devices: [(23, Profile::DeviceNet(BaumerEncoder))].into(), ..Settings::default() }
}

fn read(settings: Settings, lines: &[(f64, &str)]) -> Vec<Told> {
    decode_with(settings, &script(lines), None)
}

#[test]
fn a_write_is_told_whoever_asks_meanwhile() {
    let told = read(
        encoder(),
        &[
            (0.0, "4BC#00102F010301"),
            (1.0, "4BC#3F0E2F0103"),
            (2.0, "4BB#0090"),
            (3.0, "4BB#3F8E01"),
        ],
    );
    assert_eq!(told[2].codes, ["encoder.written"]);
    assert_eq!(told[2].messages, ["0 set Sense of rotation to 1, not saved yet"]);
}

#[test]
fn the_assembly_that_is_selected_is_saved_at_once() {
    // Manual §6: the path of class 5, attribute 14. Nine bytes go in two fragments.
    let told = read(
        encoder(),
        &[
            (0.0, "4BC#80001005020E2004"),
            (1.0, "4BB#80C000"),
            (2.0, "4BC#80812402"),
            (3.0, "4BB#80C100"),
            (4.0, "4BB#0090"),
        ],
    );
    assert_eq!(told[4].messages, ["0 set Produced connection path to assembly 2, saved at once"]);
}

/// Get_Attributes_All of the identity: vendor 468, type 22h, product 10, revision 1.1, status 0,
/// serial 017FE315h, AMG 11. Its 22 bytes come in four fragments.
pub const IDENTITY: [(f64, &str); 9] = [
    (0.0, "4BC#00010101"),
    (1.0, "4BB#800081D40122000A"),
    (2.0, "4BC#80C000"),
    (3.0, "4BB#8041000101000015"),
    (4.0, "4BC#80C100"),
    (5.0, "4BB#8042E37F0106414D"),
    (6.0, "4BC#80C200"),
    (7.0, "4BB#808347203131"),
    (8.0, "4BC#80C300"),
];

#[test]
fn all_attributes_of_the_identity_at_once_tell_who_it_is() {
    let position = [(9.0, "4BC#000E2F010C"), (10.0, "4BB#008E45230100")];
    let lines = [&IDENTITY[..], &position].concat();
    let told = read(Settings::default(), &lines);
    let (answer, position) = (&told[7], &told[10]);
    assert_eq!(
        answer.summary,
        "23 answers 0: AMG 11, vendor 468 (Baumer IVO), type 34 (encoder), product 10, \
         revision 1.1, status 0000h, serial 017FE315h in 1.00 ms"
    );
    assert_eq!(answer.get("value"), "468 34 10 1 1 0 25158421 AMG 11");
    // Product code 0Ah and an answer of class 2Fh are Baumer's (manual §1.2).
    assert_eq!(position.get("attribute_name"), "Position value");
    assert_eq!(position.summary, "23 answers 0: Position value 74565 steps in 1.00 ms");
}

#[test]
fn the_serial_number_tells_a_restart_from_a_second_node() {
    let checked = |serial: &str| {
        let check = format!("4BF#00D401{serial}");
        let lines = [&IDENTITY[..], &[(100.0, &*check), (1_100.0, &*check)]].concat();
        let told = read(Settings::default(), &lines);
        told.into_iter().flat_map(|told| told.codes).collect::<Vec<_>>()
    };
    assert_eq!(checked("15E37F01"), ["node-restart"]);
    assert_eq!(checked("16E37F01"), ["duplicate-mac", "duplicate-mac"]);
}

#[test]
fn the_product_code_tells_what_a_station_that_the_user_bound_can_be_set_to() {
    // A total of 16384 steps, attribute 8: a singleturn encoder (0Bh) has 8192 (manual §4).
    let codes = |code: &str| {
        let answer = format!("4BB#008E{code}00");
        let lines = [
            (0.0, "4BC#000E010103"),
            (1.0, &*answer),
            (2.0, "4BC#8000102F01080040"),
            (3.0, "4BB#80C000"),
            (4.0, "4BC#80810000"),
        ];
        let told = read(encoder(), &lines);
        told.into_iter().flat_map(|told| told.codes).collect::<Vec<_>>()
    };
    assert_eq!(codes("0B"), ["encoder.value-out-of-range"]);
    assert_eq!(codes("0A"), [""; 0]);
}

#[test]
fn stations_have_the_names_and_the_resolution_that_the_user_gives_them() {
    let axis = Station {
        name: Some("lift axis".to_owned()),
        resolution: Resolution::new(13, 16, Direction::Clockwise),
    };
    let settings = Settings { stations: [(23, axis)].into(), ..encoder() };
    // 3 turns of 8192 steps and a quarter: 26624 is 6800h.
    let told =
        read(settings, &[(0.0, "4BC#000E2F0103"), (1.0, "4BB#008E00"), (5.0, "3D7#00680000")]);
    assert_eq!(told[0].summary, "0 asks 23 (lift ax…): Get Sense of rotation");
    let answer = &told[2];
    assert_eq!(answer.get("name"), "lift axis");
    assert_eq!((answer.get("io.turns"), answer.get("io.angle")), ("3", "90"));
    assert_eq!(
        answer.summary,
        "23 (lift ax…) sends a poll response: position 26624 = 3 turns 90.000°, \
         alarm and warning: not on this connection"
    );
}

/// What was concluded of station 23 about a subject, with the evidence.
fn concluded(subject: &str, lines: &[(f64, &str)]) -> Vec<(String, String)> {
    let of_station = conclusions(encoder(), &script(lines)).into_iter();
    let of_station = of_station.filter(|it| it.station == Some(23) && it.subject == subject);
    of_station.map(|it| (it.value.unwrap_or_default(), it.evidence)).collect()
}

#[test]
fn what_was_written_and_never_saved_is_told_at_the_end() {
    let set = [(0.0, "4BC#00102F010301"), (1.0, "4BB#0090")];
    let save = [(2.0, "4BC#00162F01"), (3.0, "4BB#0096")];
    let unsaved = concluded("not saved", &set);
    assert_eq!(unsaved[0].0, "Sense of rotation");
    assert_eq!(concluded("not saved", &[set, save].concat()), []);
}

#[test]
fn the_duo_led_follows_the_traffic() {
    let led = |lines: &[(f64, &str)]| concluded("DUO LED", lines).remove(0).0;
    // Manual §9.2.
    let check = [(0.0, "4BF#00D40115E37F01"), (1_000.0, "4BF#00D40115E37F01")];
    let allocate = [(2_100.0, "4BE#004B03010100"), (2_101.0, "4BB#00CB00")];
    assert_eq!(led(&[]), "off");
    assert_eq!(led(&check[..1]), "off");
    assert_eq!(led(&check), "green flashing");
    assert_eq!(led(&[check, allocate].concat()), "green");
    // Another one with its MAC ID comes: it answers, and that one stays off line.
    let second = [(3_000.0, "4BF#00D40116E37F01"), (3_001.0, "4BF#80D40115E37F01")];
    assert_eq!(led(&[check, allocate, second].concat()), "green, red at the second node");
}
