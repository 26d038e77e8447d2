//! I/O data in the words of the maker: station 23 is no encoder but a speed sensor, whose file tells
//! what stands in its data. 4BDh polls it, 3D7h answers, 357h is its change of state.

use crate::bus::{Told, conclusions, decode_with, findings, script};
use crate::encoders::IDENTITY;
use fieldtap_dissectors::devicenet::eds::{Eds, parse};
use fieldtap_dissectors::protocol::Settings;

/// Polled it sends four bytes, assembly 100; its change of state has five, assembly 101.
const SENSOR: &str = r#"
[Device] VendCode = 468; ProdType = 0x22; ProdCode = 10; MajRev = 1; ProdName = "Sensor";
[IO_Info]
    Default = 1;  PollInfo = 0x0D, 1, 1;  COSInfo = 0x0D, 2, 0;
    Input1 = 4, 0, 0x0D, "Speed", 4, "20 04 24 64", "";
    Input2 = 5, 0, 0x0D, "Speed and state", 4, "20 04 24 65", "";
    Output1 = 1, 0, 0x0D, "Lamp", 4, "20 04 24 6E", "";
[Params]
    Param1 = 0, 6, "20 64 24 01 30 01", 0x0004, 0xC7, 2, "Speed", "rpm", "", 0, 60000, 0,
        1, 10, 1, 0, 0, 0, 0, 0, 1;
    Param2 = 0, 6, "20 64 24 01 30 02", 0, 0xC3, 2, "Slip", "", "", -99, 99, 0;
    Param3 = 0, 6, "20 64 24 01 30 03", 2, 0xC6, 1, "State", "", "", 0, 3, 0;
    Enum3 = 0, "stopped", 1, "turning";
[Assembly]
    Assem100 = "Speed", "20 04 24 64", 4, 0, , , 16, Param1, 16, Param2;
    Assem101 = "Speed and state", "20 04 24 65", 5, 0, , , 16, Param1, 16, Param2, 6, 0, 2, Param3;
"#;

fn settings(file: &str) -> Settings {
    let (eds, warnings): (Eds, _) = parse(file.as_bytes());
    assert_eq!(warnings, []);
    Settings { eds: [eds].into(), ..Settings::default() }
}

fn read(file: &str, lines: &[(f64, &str)]) -> Vec<Told> {
    let lines = [&IDENTITY[..], lines].concat();
    decode_with(settings(file), &script(&lines), None).split_off(IDENTITY.len())
}

#[test]
fn members_have_their_names_units_and_words() {
    // 0FA0h is 4000, a tenth of which are rpm; FFFEh is -2; 40h is 1 in its two highest bits.
    let told = read(SENSOR, &[(20.0, "4BD#07"), (21.0, "3D7#A00FFEFF"), (30.0, "357#A00FFEFF40")]);
    assert_eq!(told[1].summary, "23 answers the poll: Speed 400.0 rpm, Slip -2 in 1.00 ms");
    assert_eq!(told[1].get("io.members"), "Speed/400/rpm/ Slip/-2//");
    assert_eq!((told[1].get("io.name"), told[1].get("io.data")), ("Speed", "A00FFEFF"));
    assert_eq!(told[2].summary, "23 tells a change: Speed 400.0 rpm, Slip -2, State 1 (turning)");
    // The lamp has a name, and the file does not tell what stands in its byte.
    assert_eq!((told[0].get("io.name"), told[0].get("io.members")), ("Lamp", ""));
    assert_eq!(told[0].summary, "poll of 23: Lamp: 07");
}

#[test]
fn the_path_that_was_read_tells_the_assembly() {
    // Both assemblies have four bytes: by default it is 100, by its path 101.
    let file = SENSOR.replace("Input2 = 5", "Input2 = 4").replace("65\", 5,", "65\", 4,");
    let poll = [(20.0, "4BD#"), (21.0, "3D7#A00FFEFF")];
    assert_eq!(read(&file, &poll)[1].get("io.name"), "Speed");
    // Get of class 5, instance 2, attribute 14.
    let path = [(10.0, "4BC#000E05020E"), (11.0, "4BB#008E20042465")];
    assert_eq!(read(&file, &[path, poll].concat())[3].get("io.name"), "Speed and state");
}

#[test]
fn only_a_size_that_the_file_does_not_list_at_all_is_wrong() {
    // Five bytes are not what polls carry by default, but the file knows them.
    let five = [(20.0, "4BD#07"), (21.0, "3D7#A00FFEFF40")];
    assert_eq!(findings(&read(SENSOR, &five)), [""; 0]);
    let six =
        [(20.0, "4BD#07"), (21.0, "3D7#A00FFEFF4000"), (40.0, "4BD#07"), (41.0, "3D7#A00FFEFF")];
    let told = read(SENSOR, &six);
    assert_eq!(
        findings(&told),
        ["11 poll-response size-mismatch+", "13 poll-response size-mismatch-"]
    );
    assert!(told[1].messages[0].contains("per EDS"), "{:?}", told[1].messages);
    assert_eq!(told[1].get("assumed"), "allocation size");
    // A file that lists no sizes, or what goes in fragments, judges nothing.
    assert_eq!(findings(&read("[Device] VendCode=468; ProdCode=10;", &six)), [""; 0]);
    let long = SENSOR.replace("Input2 = 5", "Input2 = 12");
    assert_eq!(findings(&read(&long, &six)), [""; 0]);
}

#[test]
fn what_the_slave_says_itself_comes_first() {
    // It says that it produces six bytes: Get of class 5, instance 2, attribute 7.
    let told = read(
        SENSOR,
        &[
            (10.0, "4BC#000E050207"),
            (11.0, "4BB#008E0600"),
            (20.0, "4BD#07"),
            (21.0, "3D7#A00FFEFF4000"),
            (41.0, "3D7#A00FFEFF"),
        ],
    );
    let with: Vec<_> = told.iter().flat_map(|told| &told.codes).collect();
    assert_eq!(with, ["unsolicited-response", "size-mismatch+"]);
}

#[test]
fn a_file_is_matched_with_its_station_or_said_to_be_of_none() {
    let of = |lines: &[(f64, &str)]| {
        let all = conclusions(settings(SENSOR), &script(lines));
        let eds = all.into_iter().find(|it| it.subject == "EDS").unwrap();
        (eds.station, eds.value.unwrap())
    };
    assert_eq!(of(&IDENTITY), (Some(23), "Sensor".to_owned()));
    assert_eq!(of(&IDENTITY[..4]), (None, "Sensor of no station".to_owned()));
}
