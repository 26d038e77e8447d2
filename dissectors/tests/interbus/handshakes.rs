//! The states, keys and values of handshakes.

use crate::listener::{Told, codes, device, every_cycle, hear, hear_rows, told};
use fieldtap_dissectors::event::Moment;
use fieldtap_dissectors::interbus::{Content, Device, ReadEcho, Row};
use fieldtap_dissectors::protocol::Settings;
use fieldtap_dissectors::record::Turn;

/// The worked example of the LA-66 manual: write measuring length 5000 (1388h), a row each state.
const WRITE: [(u32, u32); 7] = [
    (0x0000_0000, 0x0001_2345),
    (0x4200_1388, 0x0001_2345),
    (0xC200_1388, 0x0001_2345),
    (0xC200_1388, 0x0001_2346),
    (0xC200_1388, 0xC200_1388),
    (0x4200_1388, 0xC200_1388),
    (0x4200_1388, 0x0000_0100),
];

#[test]
fn a_write_goes_through_every_state() {
    let told = told(&WRITE, every_cycle());
    let row = |it: &Told| (it.kind, it.position, it.service, it.data);
    assert_eq!(
        told.iter().map(row).collect::<Vec<_>>(),
        [
            ("normal", Some(0x12345), None, None),
            ("prepared", Some(0x12345), Some(2), Some(5_000)),
            ("service-request", Some(0x12345), Some(2), Some(5_000)),
            ("service-request", Some(0x12346), Some(2), Some(5_000)),
            ("service-acknowledge", None, Some(2), Some(5_000)),
            ("release", None, Some(2), Some(5_000)),
            // OUT stands as it was when it was withdrawn: nothing is laid out.
            ("normal", Some(0x100), None, None),
        ]
    );
    assert_eq!(codes(&told), [(5, "interbus.written")]);
    // From row 3 to row 5, a ms each.
    assert_eq!((told[4].request, told[4].response_time), (Some(3), Some(2_000_000)));
    let turns = told.iter().map(|it| it.turn).filter(|turn| *turn != Turn::Neither);
    assert_eq!(turns.collect::<Vec<_>>(), [Turn::Asks, Turn::Answers]);
    assert_eq!(
        [&told[1].summary, &told[2].summary, &told[4].summary],
        [
            "laid out: write measuring length in steps 5000",
            "master asks 1: write measuring length in steps 5000",
            "1 has done: write measuring length in steps 5000",
        ]
    );
    assert_eq!(
        told[4].messages,
        ["measuring length in steps of 1 (not known before) to 5000, kept in the EEPROM"]
    );
}

#[test]
fn reads_tell_values_in_words() {
    let read = |out: u32, input: u32| {
        let rows = [(0, 7), (out & 0x7FFF_FFFF, 7), (out, 7), (out, input), (0, input), (0, 7)];
        let told = told(&rows, every_cycle());
        (codes(&told), told[3].summary.clone())
    };
    let healthy = |out, input| {
        let (codes, summary) = read(out, input);
        assert_eq!(codes, []);
        summary
    };
    assert_eq!(
        healthy(0x8100_0000, 0x8100_0001),
        "1 has done: read counting direction 1, decreasing to the end of the rod"
    );
    assert_eq!(
        healthy(0x8200_0000, 0x8200_1388),
        "1 has done: read measuring length in steps 5000"
    );
    assert_eq!(healthy(0x8400_0000, 0x84FF_FFFF), "1 has done: read preset value 1 16777215");
    assert_eq!(healthy(0x8800_0000, 0x8800_0000), "1 has done: read error status: no error");
    let (codes, summary) = read(0x8800_0000, 0x8800_0020);
    assert_eq!(codes, [(4, "interbus.magnet")]);
    assert_eq!(summary, "1 has done: read error status: magnet outside the measuring range");
}

#[test]
fn a_written_value_that_was_read_before_is_told_as_the_old_one() {
    let mut rows = vec![(0, 5), (0x0200_0000, 5), (0x8200_0000, 5), (0x8200_0000, 0x8200_C350)];
    rows.extend([(0, 0x8200_C350), (0, 5)]);
    rows.extend(WRITE);
    let told = told(&rows, every_cycle());
    let written = told.iter().find(|it| it.codes == ["interbus.written"]).unwrap();
    assert_eq!(
        written.messages,
        ["measuring length in steps of 1 from 50000 to 5000, kept in the EEPROM"]
    );
}

#[test]
fn prepared_is_what_changed_since_the_service_bit() {
    let kinds = |rows: &[(u32, u32)]| {
        told(rows, Settings::default()).iter().map(|it| it.kind).collect::<Vec<_>>()
    };
    // A log that begins with OUT laid out, and one that lays the same out once more.
    assert_eq!(kinds(&[(0x4200_1388, 1)]), ["prepared"]);
    let mut rows = WRITE.to_vec();
    rows.extend([(0, 1), (0x4200_1388, 1)]);
    assert_eq!(kinds(&rows)[6..], ["normal", "normal", "prepared"]);
}

#[test]
fn the_rod_gives_resolution_and_millimetres() {
    let rows: Vec<_> = (0..).zip(WRITE).map(|(n, (out, input))| (n * 1_000, out, input)).collect();
    let (told, conclusions) = hear(&rows, device("la66:500mm"));
    // 500 mm in 5000 steps: 0.1 mm; position 100h = 256 is 25.6 mm.
    let resolution = conclusions.iter().find(|it| it.subject == "resolution").unwrap();
    assert_eq!(resolution.value.as_deref(), Some("0.1 mm"));
    assert_eq!(resolution.evidence, "500 mm in 5000 steps");
    assert_eq!(told[6].summary, "1 at 256, 25.600 mm");
    assert_eq!(told[4].summary, "1 has done: write measuring length in steps 5000 (0.1 mm a step)");
    assert!(conclusions.iter().all(|it| it.subject != "device"));
    // Nobody said what it is.
    let (_, conclusions) = hear(&rows, Settings::default());
    let device = conclusions.iter().find(|it| it.subject == "device").unwrap();
    assert!(device.evidence.starts_with("assumed"), "{}", device.evidence);
}

#[test]
fn a_read_that_returns_the_out_data_is_a_setting() {
    let rows = [(0, 7), (0x0100_0000, 7), (0x8100_0000, 7), (0x8100_0000, 0x8100_0001)];
    let mut settings = every_cycle();
    assert_eq!(codes(&told(&rows, settings.clone())), []);
    settings.interbus.read_echo = ReadEcho::Echo;
    assert_eq!(codes(&told(&rows, settings)), [(4, "interbus.echo-mismatch")]);
}

/// OUT and IN in rows of their own, as two logs have them.
#[test]
fn rows_of_one_side_take_the_other_as_it_was() {
    let row = |ms: i64, out, input| {
        Row::new(Some(Device::FIRST), Content::Process { out, input })
            .at(Moment::from_ns(ms * 1_000_000), 0)
    };
    let rows = [
        row(0, None, Some(7)),
        row(1, Some(0x4200_1388), None),
        row(2, None, Some(8)),
        row(3, Some(0xC200_1388), None),
        row(4, None, Some(0xC200_1388)),
        row(5, Some(0), None),
        row(6, None, Some(9)),
    ];
    let (told, _) = hear_rows(&rows, Settings::default());
    assert_eq!(
        told.iter().map(|it| (it.kind, it.position)).collect::<Vec<_>>(),
        [
            ("normal", Some(7)),
            ("prepared", None),
            ("prepared", Some(8)),
            ("service-request", None),
            ("service-acknowledge", None),
            ("release", None),
            ("normal", Some(9)),
        ]
    );
    assert_eq!(codes(&told), [(5, "interbus.written")]);
    assert_eq!(told[4].request, Some(4));
}

#[test]
fn devices_are_followed_each_on_its_own() {
    let rows: Vec<Row> = WRITE
        .into_iter()
        .zip(0..)
        .flat_map(|((out, input), ms)| {
            [1, 512].map(|number| {
                let content = Content::Process { out: Some(out), input: Some(input) };
                Row::new(Device::new(number), content).at(Moment::from_ns(ms * 1_000_000), 0)
            })
        })
        .collect();
    let (told, _) = hear_rows(&rows, every_cycle());
    assert_eq!(codes(&told), [(9, "interbus.written"), (10, "interbus.written")]);
    assert_eq!((told[9].station, told[9].request), (Some(512), Some(6)));
}
