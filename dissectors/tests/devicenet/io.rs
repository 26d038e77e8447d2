//! I/O connections as a technician meets them. Master 0, encoder 23: 4BDh polls, 3D7h answers,
//! 357h tells changes, 4BAh acknowledges them, 397h answers strobes, which are 400h.

use crate::bus::{Told, findings, measured, read, script};

/// Allocates poll, four bytes in, none out, every 75 ms: eight frames, 1 ms each.
const POLL: [(f64, &str); 8] = [
    (0.0, "4BE#004B03010300"),
    (1.0, "4BB#00CB00"),
    (2.0, "4BC#000E050207"),
    (3.0, "4BB#008E0400"),
    (4.0, "4BC#000E050208"),
    (5.0, "4BB#008E0000"),
    (6.0, "4BC#00100502094B00"),
    (7.0, "4BB#00904B00"),
];

/// What is told where these frames come after others.
pub fn with<'a>(before: &[(f64, &'a str)], after: &[(f64, &'a str)], end: f64) -> Vec<Told> {
    read(&[before, after].concat(), end)
}

#[test]
fn polls_and_their_answers() {
    let told = with(&POLL, &[(10.0, "4BD#"), (11.0, "3D7#45230100"), (85.0, "4BD#")], 90.0);
    assert_eq!(findings(&told), [""; 0]);
    let (command, answer) = (&told[8], &told[9]);
    assert_eq!(
        (command.kind, command.get("source"), command.get("assumed")),
        ("poll-command", "0", "")
    );
    assert_eq!((answer.get("request"), answer.get("response_time_ns")), ("9", "1000000"));
    assert_eq!((answer.station, answer.get("io.data")), (Some(23), "45230100"));
    assert_eq!(answer.summary, "23 answers the poll: 45 23 01 00 in 1.00 ms");
    assert_eq!(command.summary, "0 polls 23");
}

#[test]
fn the_pace_of_polls_is_measured() {
    // Every 50 ms, then after 60; answered after 1, 2.9 and 5 ms. Masters reckon with 2 ms besides
    // the frames, of which the poll is 48 bits and the answer 74 and more: 976 µs and more.
    let cycle = [
        (10.0, "4BD#"),
        (11.0, "3D7#45230100"),
        (60.0, "4BD#"),
        (62.9, "3D7#45230100"),
        (120.0, "4BD#"),
        (125.0, "3D7#45230100"),
        // Nothing is known of the time in between.
        (130.0, "lost"),
        (500.0, "4BD#"),
    ];
    let measured = measured(&script(&[&POLL[..], &cycle].concat()));
    let [polls, responses] = measured[..] else { panic!("{measured:?}") };
    assert_eq!((polls.subject, polls.station, polls.limit), ("poll interval", 23, None));
    assert_eq!((polls.spans.count(), polls.spans.mean()), (2, 55_000_000));
    assert_eq!((polls.spans.min(), polls.spans.max()), (50_000_000, 60_000_000));
    assert_eq!(polls.spans.deviation(), 5_000_000);
    assert_eq!((responses.subject, responses.spans.count()), ("poll response", 3));
    assert_eq!((responses.spans.min(), responses.spans.max()), (1_000_000, 5_000_000));
    assert_eq!(responses.limit, Some((2_000_000, 1)));
}

#[test]
fn a_poll_without_an_answer_is_told_on_the_next() {
    let told = with(
        &POLL,
        &[(10.0, "4BD#"), (85.0, "4BD#"), (86.0, "3D7#45230100"), (160.0, "4BD#"), (235.0, "4BD#")],
        240.0,
    );
    assert_eq!(
        findings(&told),
        ["10 poll-command no-poll-response", "13 poll-command no-poll-response"]
    );
    // A late start: nothing says that 23 answers polls at all.
    let told = read(&[(0.0, "4BD#"), (75.0, "4BD#"), (150.0, "4BD#")], 200.0);
    assert_eq!(findings(&told), [""; 0]);
    assert_eq!(told[0].get("assumed"), "allocation");
}

#[test]
fn a_connection_times_out_after_four_times_its_rate() {
    // The last poll at 10 ms; 4 x 75 ms later the slave gives up.
    let told = with(
        &POLL,
        &[
            (10.0, "4BD#"),
            (11.0, "3D7#45230100"),
            (1_000.0, "4BD#"),
            (1_075.0, "4BD#"),
            (1_150.0, "4BD#"),
            (1_151.0, "3D7#45230100"),
        ],
        1_200.0,
    );
    assert_eq!(
        findings(&told),
        [
            "11 event connection-timeout+",
            "12 poll-command not-allocated",
            "13 poll-command not-allocated",
            "14 poll-command not-allocated",
            "15 poll-response connection-timeout-",
        ]
    );
    assert_eq!(told[11].messages, ["poll connection of 23 timed out: nothing had come for 300 ms"]);
    // From 310 ms on, when it was due.
    assert_eq!(told[14].messages, ["over: poll time-out of 23, after 841 ms"]);
    let event = &told[10];
    assert_eq!((event.ns, event.about, event.station), (Some(310_000_000), Some(9), Some(23)));
    assert_eq!(event.summary, "poll connection of 23 timed out: nothing for 300 ms");
    // Nothing came at all: ten seconds.
    let told = with(&POLL, &[], 10_006.0);
    assert_eq!(findings(&told), [""; 0]);
    let told = with(&POLL, &[], 10_008.0);
    assert_eq!(findings(&told), ["9 event connection-timeout+"]);
    // A gap: nothing is known of it.
    let told = with(&POLL, &[(10.0, "4BD#"), (20.0, "lost"), (1_000.0, "4BD#")], 1_100.0);
    assert_eq!(findings(&told), ["10 lost can.dropped"]);
}

#[test]
fn a_released_connection_is_not_judged() {
    let told = with(
        &POLL,
        &[
            (10.0, "4BD#"),
            (11.0, "3D7#45230100"),
            (12.0, "4BE#004C030103"),
            (13.0, "4BB#00CC"),
            (500.0, "4BD#"),
            (600.0, "4BD#"),
        ],
        2_000.0,
    );
    assert_eq!(findings(&told), ["13 poll-command not-allocated", "14 poll-command not-allocated"]);
    assert_eq!(told[12].messages, ["poll connection of 23 is not allocated any more"]);
    // Allocated anew and released once more: another story.
    let again = [
        (600.0, "4BE#004B03010300"),
        (601.0, "4BB#00CB00"),
        (602.0, "4BE#004C030103"),
        (603.0, "4BB#00CC"),
        (700.0, "4BD#"),
        (800.0, "4BD#"),
    ];
    let release = [(12.0, "4BE#004C030103"), (13.0, "4BB#00CC"), (500.0, "4BD#")];
    let told = with(&POLL, &[&release[..], &again].concat(), 2_000.0);
    assert_eq!(findings(&told), [11, 16, 17].map(|n| format!("{n} poll-command not-allocated")));
}

#[test]
fn a_time_out_ends_where_the_connection_does() {
    // Timed out at 310 ms, released at 510 ms: what ended is the I/O connection's time-out.
    let told = with(
        &POLL,
        &[(10.0, "4BD#"), (11.0, "3D7#45230100"), (500.0, "4BE#004C030103"), (510.0, "4BB#00CC")],
        520.0,
    );
    assert_eq!(
        findings(&told),
        ["11 event connection-timeout+", "13 unconnected-response connection-timeout-"]
    );
    assert_eq!(told[12].messages, ["over: I/O time-out of 23, after 200 ms"]);
}

#[test]
fn an_explicit_connection_that_nobody_uses_goes_by_itself() {
    let explicit = [(0.0, "4BE#004B03010100"), (1.0, "4BB#00CB00")];
    let defer = [(2.0, "4BC#001005010C03"), (3.0, "4BB#0090")];
    let ask = [(100.0, "4BC#000E010101"), (101.0, "4BB#008ED401")];
    // Four times 2500 ms after the answer: nothing is wrong, and nothing is told.
    let told = with(&explicit, &ask, 20_000.0);
    assert_eq!(findings(&told), [""; 0]);
    // Used again after that.
    let later =
        [(10_100.0, "4BC#000E010101"), (20_200.0, "4BC#000E010101"), (20_300.0, "4BC#000E010101")];
    let told = with(&explicit, &[&ask[..], &later[1..]].concat(), 20_400.0);
    assert_eq!(
        findings(&told),
        ["5 explicit-request not-allocated", "6 explicit-request not-allocated xid-busy"]
    );
    assert_eq!(
        told[4].messages,
        ["explicit connection of 23 timed out: nothing had come for 10.0 s"]
    );
    assert_eq!(told[4].get("assumed"), "body_format");
    // In time; and one that waits for the I/O connections (attribute 12 is 3).
    let told = with(&explicit, &[&ask[..], &later[..1]].concat(), 10_200.0);
    assert_eq!(findings(&told), [""; 0]);
    let told = with(&explicit, &[&defer[..], &ask[..], &later[1..2]].concat(), 20_300.0);
    assert_eq!(findings(&told), [""; 0]);
}

#[test]
fn sizes_and_idle_are_states() {
    let told = with(
        &POLL,
        &[
            (10.0, "4BD#"),
            (11.0, "3D7#4523010000"),
            (30.0, "4BD#"),
            (31.0, "3D7#4523010000"),
            (50.0, "4BD#"),
            (51.0, "3D7#452301"),
            (70.0, "4BD#"),
            (71.0, "3D7#"),
            (90.0, "4BD#"),
            (91.0, "3D7#45230100"),
        ],
        100.0,
    );
    assert_eq!(
        findings(&told),
        [
            "10 poll-response size-mismatch+",
            "14 poll-response size-mismatch+",
            "16 poll-response idle+",
            "18 poll-response idle- size-mismatch-",
        ]
    );
    assert_eq!(told[9].codes.len(), 1);
}

#[test]
fn the_kind_follows_the_allocation() {
    for (allocate, production, command, answer) in [
        ("4BE#004B03011100", "cos", "cos", "io-ack"),
        ("4BE#004B03012100", "cyclic", "cyclic", "io-ack"),
        ("4BE#004B03010300", "cos", "poll-command", "poll-response"),
        ("4BE#004B03011300", "cos", "poll-command", "poll-response"),
    ] {
        let told = with(
            &[(0.0, allocate), (1.0, "4BB#00CB00")],
            &[(2.0, "357#01"), (3.0, "4BD#01"), (4.0, "3D7#01")],
            5.0,
        );
        let kinds: Vec<&str> = told[2..].iter().map(|told| told.kind).collect();
        assert_eq!(kinds, [production, command, answer], "{allocate}");
    }
}

#[test]
fn strobes_and_who_does_not_answer() {
    let strobe = "400#0000800000000000";
    let told = with(
        &[
            (0.0, "4BE#004B03010500"),
            (1.0, "4BB#00CB00"),
            (2.0, "4BC#00100503094B00"),
            (3.0, "4BB#00904B00"),
        ],
        &[
            (10.0, strobe),
            (11.0, "397#01"),
            (60.0, strobe),
            (110.0, strobe),
            (111.0, "397#02"),
            (112.0, "397#02"),
        ],
        120.0,
    );
    assert_eq!(
        findings(&told),
        ["8 event no-strobe-response", "11 strobe-response unsolicited-response"]
    );
    assert_eq!((told[7].about, told[7].station), (Some(7), Some(23)));
    // A strobe is for all slaves; its master is none.
    assert_eq!((told[4].station, told[4].get("source")), (None, "0"));
    assert_eq!((told[5].get("request"), told[5].get("destination")), ("5", "0"));
}

#[test]
fn multicast_polls_need_an_allocation() {
    let told = with(
        &[(0.0, "401#01"), (1.0, "4BE#004B03010900"), (2.0, "4BB#00CB00")],
        &[(3.0, "401#01"), (4.0, "317#02")],
        10.0,
    );
    assert_eq!(findings(&told), [""; 0]);
    assert_eq!((told[0].kind, told[3].kind), ("io", "multicast-poll-command"));
    assert_eq!((told[4].kind, told[4].get("request")), ("multicast-poll-response", "4"));
    // Instance 5 at 75 ms: the master looks away for more than 300 ms.
    let told = with(
        &[
            (0.0, "4BE#004B03010900"),
            (1.0, "4BB#00CB00"),
            (2.0, "4BC#00100505094B00"),
            (3.0, "4BB#00904B00"),
        ],
        &[(10.0, "401#01"), (11.0, "317#02"), (400.0, "401#01"), (401.0, "317#02")],
        450.0,
    );
    assert_eq!(
        findings(&told),
        ["7 event connection-timeout+", "9 multicast-poll-response connection-timeout-"]
    );
    assert_eq!((told[6].ns, told[6].about), (Some(310_000_000), Some(5)));
    assert_eq!(told[6].summary, "multicast connection of 23 timed out: nothing for 300 ms");
}

#[test]
fn fragmented_io_with_a_size_that_was_read() {
    // Produced size 10: two fragments.
    let allocate = [
        (0.0, "4BE#004B03010300"),
        (1.0, "4BB#00CB00"),
        (2.0, "4BC#000E050207"),
        (3.0, "4BB#008E0A00"),
    ];
    let told = with(
        &allocate,
        &[
            (10.0, "4BD#"),
            (11.0, "3D7#0001020304050607"),
            (12.0, "3D7#8108090A"),
            (20.0, "4BD#"),
            (21.0, "3D7#0001020304050607"),
            (30.0, "4BD#"),
            (31.0, "3D7#0001020304050607"),
            (32.0, "3D7#82080900"),
            (40.0, "4BD#"),
            (41.0, "3D7#0001020304050607"),
            (42.0, "3D7#810809"),
        ],
        50.0,
    );
    assert_eq!(told[6].get("io.data"), "0102030405060708090A");
    assert_eq!((told[6].get("fragments"), told[6].get("request")), ("6 7", "5"));
    assert_eq!((told[5].get("request"), told[5].get("io.data")), ("5", ""));
    assert_eq!(
        findings(&told),
        [
            // The last fragment of the second answer is missing, and then one in the middle.
            "11 poll-response fragment-sequence",
            "12 poll-response fragment-sequence",
            "15 poll-response size-mismatch+",
        ]
    );
}

#[test]
fn another_assembly_has_another_size() {
    // Produced path (attribute 14) to assembly 2: 20 04 24 02, in two fragments.
    let told = with(
        &POLL,
        &[
            (10.0, "4BD#"),
            (11.0, "3D7#00100000"),
            (20.0, "4BC#80001005020E2004"),
            (21.0, "4BB#80C000"),
            (22.0, "4BC#80812402"),
            (23.0, "4BB#80C100"),
            (24.0, "4BB#0090"),
            (30.0, "4BD#"),
            (31.0, "3D7#0010000000"),
        ],
        40.0,
    );
    assert_eq!(findings(&told), [""; 0]);
}

#[test]
fn what_was_not_seen_stays_assumed() {
    // A late start: poll and strobe were allocated before. Change of state comes to it.
    let told = read(
        &[
            (0.0, "4BD#"),
            (1.0, "3D7#00100000"),
            (100.0, "4BC#004B03011000"),
            (101.0, "4BB#00CB00"),
            (200.0, "4BD#"),
            (201.0, "3D7#00100000"),
            (300.0, "4BD#"),
            (400.0, "4BD#"),
            (410.0, "397#0010"),
            (420.0, "357#0010"),
        ],
        500.0,
    );
    let of = |n: usize| (told[n].kind, told[n].get("assumed"));
    assert_eq!(of(4), ("poll-command", "allocation"));
    assert_eq!(of(5), ("poll-response", "allocation"));
    assert_eq!(told[5].get("request"), "5");
    assert_eq!(findings(&told)[0], "8 poll-command no-poll-response");
    assert_eq!(of(8), ("strobe-response", "allocation"));
    assert_eq!(of(9), ("cos", ""));
    // The poll connection is given back; nothing is known of the others.
    let told = read(
        &[
            (0.0, "357#0011"),
            (100.0, "4BC#004C030102"),
            (101.0, "4BB#00CC"),
            (200.0, "357#0012"),
            (210.0, "397#0011"),
        ],
        300.0,
    );
    for n in [0, 3, 4] {
        assert_eq!(told[n].get("assumed"), "allocation", "{n}");
    }
}

#[test]
fn a_second_response_answers_nothing() {
    let told = with(
        &POLL,
        &[
            (10.0, "4BD#"),
            (11.0, "3D7#45230100"),
            (18.0, "3D7#46230100"),
            (85.0, "4BD#"),
            (86.0, "3D7#45230100"),
        ],
        90.0,
    );
    assert_eq!(findings(&told), ["11 poll-response unsolicited-response"]);
    assert_eq!((told[10].get("request"), told[10].get("response_time_ns")), ("", ""));
    assert_eq!(told[10].summary, "23 sends a poll response: 46 23 01 00");
    assert_eq!((told[12].get("request"), told[12].get("response_time_ns")), ("12", "1000000"));
    // The same for strobes.
    let strobe = "400#0000800000000000";
    let told = read(&[(0.0, strobe), (1.0, "397#01"), (2.0, "397#02")], 10.0);
    assert_eq!(findings(&told), ["3 strobe-response unsolicited-response"]);
    assert_eq!((told[1].get("request"), told[2].get("request")), ("1", ""));
    assert_eq!(told[2].get("response_time_ns"), "");
}

#[test]
fn eight_bytes_are_no_fragment_because_they_count() {
    // A value whose first byte runs 00, 81, 82; change of state, without acknowledgement.
    let allocate = [(0.0, "4BE#004B03015100"), (1.0, "4BB#00CB00")];
    let values =
        [(100.0, "357#0011223344556677"), (200.0, "357#8111223344556677"), (300.0, "357#82")];
    let told = with(&allocate, &values, 400.0);
    assert_eq!(findings(&told), [""; 0]);
    assert_eq!(told[3].get("io.data"), "8111223344556677");
    assert_eq!((told[3].get("fragments"), told[3].get("assumed")), ("", ""));
    // What follows at once is a fragment.
    let pieces = [(100.0, "357#0001020304050607"), (101.0, "357#8108")];
    let told = with(&allocate, &pieces, 200.0);
    assert_eq!((told[3].get("io.data"), told[3].get("assumed")), ("0102030405060708", "size"));
}
