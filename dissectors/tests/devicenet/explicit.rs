//! Requests, answers and fragments as a technician meets them. Master 0, encoder 23: 4BCh asks,
//! 4BBh answers (400h + 8 * 23 + 4 and 3).

use crate::bus::{findings, read};

#[test]
fn an_answer_names_its_request_and_takes_its_time() {
    let told = read(&[(0.0, "4BC#000E2F010C"), (1.2, "4BB#008E78563412")], 5_000.0);
    assert_eq!(findings(&told), [""; 0]);
    let answer = &told[1];
    assert_eq!((answer.get("request"), answer.get("response_time_ns")), ("1", "1200000"));
    assert_eq!(
        (answer.station, answer.get("class"), answer.get("data")),
        (Some(23), "47", "78563412")
    );
    assert_eq!(
        answer.summary,
        "23 answers 0: Get attribute 12 class 2Fh instance 1: 78 56 34 12 in 1.20 ms"
    );
    assert_eq!(told[0].summary, "0 asks 23: Get attribute 12 class 2Fh instance 1");
}

#[test]
fn late_and_missing_answers() {
    // 500 ms is late, 1 s is no answer; what comes later still is the answer.
    let told = read(
        &[
            (0.0, "4BC#000E2F010C"),
            (501.0, "4BB#008E00000000"),
            (1_000.0, "4BC#000E2F010C"),
            (2_500.0, "4BB#008E00000000"),
        ],
        5_000.0,
    );
    assert_eq!(
        findings(&told),
        [
            "2 explicit-response late-response",
            "4 event no-response",
            "5 explicit-response late-response"
        ]
    );
    let event = &told[3];
    assert_eq!((event.ns, event.about, event.station), (Some(2_000_000_000), Some(3), Some(23)));
    assert_eq!(event.summary, "node 23 did not answer within 1.00 s");
    assert_eq!(told[4].get("request"), "3");
}

#[test]
fn nothing_is_judged_beyond_the_end_or_a_gap() {
    assert_eq!(findings(&read(&[(0.0, "4BC#000E2F010C")], 999.0)), [""; 0]);
    let told = read(&[(0.0, "4BC#000E2F010C"), (999.0, "lost"), (3_000.0, "4BD#")], 5_000.0);
    assert_eq!(findings(&told), ["2 lost can.dropped"]);
    // The tap's controller was overrun: the answer may have been lost.
    let told = read(&[(0.0, "4BC#000E2F010C"), (999.0, "overrun"), (3_000.0, "4BD#")], 5_000.0);
    assert_eq!(findings(&told), ["2 can-error can.error-frame can.dropped"]);
}

#[test]
fn the_third_silence_in_a_row_is_a_state() {
    let ask = |second: i64| (second as f64 * 2_000.0, "4BC#000E2F010C");
    let mut lines: Vec<(f64, &str)> = (0..5).map(ask).collect();
    lines.push((10_000.0, "4BC#000E2F010C"));
    lines.push((10_001.0, "4BB#008E00000000"));
    let told = read(&lines, 20_000.0);
    assert_eq!(
        findings(&told),
        [
            "2 event no-response",
            "4 event no-response",
            "6 event no-response+",
            "10 explicit-response no-response-",
        ]
    );
}

#[test]
fn answers_to_nothing() {
    let told = read(
        &[
            // Its request may have been before the capture.
            (0.0, "4BB#008E00000000"),
            (10.0, "4BB#008E00000000"),
            (20.0, "4BC#000E2F010C"),
            // Another transaction, another service.
            (21.0, "4BB#408E00000000"),
            (22.0, "4BB#0090"),
            (23.0, "4BB#008E00000000"),
        ],
        100.0,
    );
    assert_eq!(told[0].get("assumed"), "start");
    assert_eq!(
        findings(&told),
        ["2 explicit-response unsolicited-response", "5 explicit-response unsolicited-response"]
    );
    assert_eq!(told[3].get("assumed"), "start");
    assert_eq!(told[5].get("request"), "3");
}

#[test]
fn two_clients_and_two_transactions_at_once() {
    let told = read(
        &[
            (0.0, "4BC#000E2F010C"),
            (1.0, "4BC#400E2F0107"),
            (2.0, "4BC#050E2F0108"),
            (3.0, "4BB#058E03000000"),
            (4.0, "4BB#008E01000000"),
            (5.0, "4BB#408E02000000"),
        ],
        3_000.0,
    );
    assert_eq!(findings(&told), [""; 0]);
    let requests: Vec<&str> = told[3..].iter().map(|told| told.get("request")).collect();
    assert_eq!(requests, ["3", "1", "2"]);
}

#[test]
fn what_is_malformed_keeps_its_kind() {
    for (frame, kind, defect) in [
        ("4BC#", "explicit-request", "the message header is missing"),
        ("4BC#00", "explicit-request", "the service is missing"),
        ("4BC#0000", "explicit-request", "the service code is reserved"),
        ("4BC#00142F01", "explicit-request", "the service code is reserved"),
        ("4BC#001E2F01", "explicit-request", "the service code is reserved"),
        ("4BC#00642F01", "explicit-request", "the service code is reserved"),
        ("4BC#008E2F01", "explicit-request", "a response on an identifier for requests"),
        ("4BC#000E2F", "explicit-request", "bytes are missing"),
        ("4BC#80", "explicit-request", "the fragment byte is missing"),
        ("4BB#000E", "explicit-response", "a request on an identifier for responses"),
        ("4BB#009408", "explicit-response", "bytes are missing"),
        ("4BE#000E010101", "unconnected-request", "a service that this port must refuse"),
        ("4BE#004B030103", "unconnected-request", "bytes are missing"),
        ("4BE#004B0301030000", "unconnected-request", "more bytes than the service has"),
        ("4BE#8000", "unconnected-request", "a fragment where none is allowed"),
        ("780#170E0101", "ucmm-request", "a service that this port must refuse"),
        ("780#174B0520", "ucmm-request", "the message body format is reserved"),
        ("4BF#000102", "dup-mac-request", "the length is not that of such a frame"),
        ("4BB#17CD01000300", "heartbeat", "the length is not that of such a frame"),
        ("400#01", "strobe-command", "the length is not that of such a frame"),
        ("7EF#004B", "offline-ownership-request", "the length is not that of such a frame"),
        ("7ED#3F4B07", "comm-fault-request", "a value is reserved"),
    ] {
        let told = read(&[(0.0, frame)], 1.0);
        assert_eq!((told[0].kind, told[0].get("defect")), (kind, defect), "{frame}");
        assert!(told[0].codes.contains(&"malformed".to_owned()), "{frame}");
    }
}

#[test]
fn lengths_are_judged_where_the_body_format_is_known() {
    let allocated = [(0.0, "4BE#004B03010100"), (1.0, "4BB#00CB00")];
    let ask = |frame| {
        let mut lines = allocated.to_vec();
        lines.push((2.0, frame));
        let told = read(&lines, 3.0);
        (told[2].get("defect").to_owned(), told[2].get("assumed").to_owned())
    };
    assert_eq!(ask("4BC#000E2F010C").0, "");
    assert_eq!(ask("4BC#000E2F010C01").0, "more bytes than the service has");
    assert_eq!(ask("4BC#00102F0107").0, "bytes are missing");
    assert_eq!(ask("4BC#000E2F010C").1, "");
    // Not known: six bytes may be 8/16 or 16/8.
    let told = read(&[(0.0, "4BC#000E2F00010C")], 1.0);
    assert_eq!((told[0].get("class"), told[0].get("instance")), ("47", "1"));
    assert_eq!((told[0].get("assumed"), told[0].codes.len()), ("body_format", 0));
}

#[test]
fn allocations_that_are_refused_or_invalid() {
    let told = read(
        &[
            (0.0, "4BE#004B03010300"),
            (1.0, "4BB#00940C01"),
            (2.0, "4BE#004B03013100"),
            (3.0, "4BB#00940902"),
            (4.0, "4BE#004B03010305"),
        ],
        10.0,
    );
    assert_eq!(
        findings(&told),
        [
            "2 unconnected-response allocation-refused",
            "3 unconnected-request allocation-invalid",
            "4 unconnected-response allocation-refused",
            "5 unconnected-request allocation-invalid",
        ]
    );
    assert_eq!(told[1].summary, "23 refuses 0: error 0Ch, object state conflict (01h) in 1.00 ms");
}

#[test]
fn a_body_format_of_5_is_reserved() {
    let told = read(&[(0.0, "4BE#004B03010100"), (1.0, "4BB#00CB05")], 10.0);
    assert_eq!((told[1].get("body_format"), told[1].codes[0].as_str()), ("5", "malformed"));
}

#[test]
fn the_answer_of_a_fragmented_request_counts_from_its_last_acknowledgement() {
    let lines = [
        (0.0, "4BC#8000102F010A4523"),
        (100.0, "4BB#80C000"),
        (101.0, "4BC#80810100"),
        (600.0, "4BB#80C100"),
        (1_000.0, "4BB#0090"),
    ];
    let told = read(&lines, 5_000.0);
    assert_eq!(findings(&told), [""; 0]);
    assert_eq!(told[4].get("request"), "1");
    // Without the answer: 1 s after the acknowledgement.
    let told = read(&lines[..4], 5_000.0);
    assert_eq!(findings(&told), ["5 event no-response"]);
    assert_eq!((told[4].ns, told[4].about), (Some(1_600_000_000), Some(1)));
}

#[test]
fn fragments_that_nobody_acknowledges() {
    let once = read(&[(0.0, "4BC#8000102F010A4523")], 5_000.0);
    assert_eq!(findings(&once), ["2 event fragment-unacknowledged"]);
    assert_eq!((once[1].ns, once[1].about), (Some(2_000_000_000), Some(1)));
    let frame = "4BC#8000102F010A4523";
    let twice = read(&[(0.0, frame), (1_000.0, frame)], 5_000.0);
    assert_eq!(
        findings(&twice),
        ["2 explicit-request fragment-retry", "3 event fragment-unacknowledged"]
    );
    assert_eq!((twice[2].ns, twice[2].about), (Some(2_000_000_000), Some(2)));
}

#[test]
fn a_slave_that_has_no_room() {
    let told = read(
        &[
            (0.0, "4BC#8000102F010A4523"),
            (1.0, "4BB#80C001"),
            (9.0, "4BC#000E2F010C"),
            (10.0, "4BB#008E00000000"),
        ],
        5_000.0,
    );
    assert_eq!(findings(&told), ["2 explicit-request fragment-rejected"]);
}

#[test]
fn a_capture_may_begin_in_the_middle_of_a_message() {
    let told = read(
        &[
            (0.0, "4BC#80420000"),
            (1.0, "4BB#80C200"),
            (2.0, "4BC#80830000"),
            (3.0, "4BB#80C300"),
            (4.0, "4BB#0090"),
        ],
        5_000.0,
    );
    assert_eq!(findings(&told), [""; 0]);
    assert_eq!((told[0].get("assumed"), told[2].get("assumed")), ("start", "start"));
    assert_eq!((told[4].get("assumed"), told[4].get("request")), ("start", ""));
}

#[test]
fn a_connection_that_nodes_opened() {
    // Group 3 on request: client 0 sends with 700h, server 5 with 605h.
    let told = read(
        &[
            (0.0, "700#050E0101"),
            (1.0, "780#054B0034"),
            (2.0, "745#00CB00000200"),
            (3.0, "700#050E010107"),
            (4.0, "605#008E0541424344"),
            (5.0, "780#054C0200"),
            (6.0, "745#00CC"),
            (7.0, "700#050E010107"),
            // Nobody has that: normal.
            (8.0, "780#094B0034"),
        ],
        5_000.0,
    );
    assert_eq!(findings(&told), [""; 0]);
    let kinds: Vec<&str> = told.iter().map(|told| told.kind).collect();
    assert_eq!(kinds[0], "io");
    assert_eq!(kinds[3..5], ["explicit-request", "explicit-response"]);
    assert_eq!(kinds[7], "io");
    assert_eq!((told[4].get("request"), told[4].station), ("4", Some(5)));
    assert_eq!((told[3].get("source"), told[3].get("destination")), ("0", "5"));
}

#[test]
fn words_are_not_taken_for_a_path() {
    // A late start, 16-bit class 2 and instance 1, attribute 1.
    let told = read(&[(0.0, "4BC#000E0200010001"), (1.0, "4BB#008E0100")], 10.0);
    let of = |name: &str| told[0].number(name);
    assert_eq!((of("class"), of("instance"), of("attribute")), (Some(2), Some(1), Some(1)));
    assert_eq!(told[0].get("assumed"), "body_format");
}

#[test]
fn answers_about_connections_have_the_length_of_the_attribute() {
    // Attribute 9, the expected packet rate, has two bytes; a Set may answer it or nothing.
    for (request, answer, is_malformed) in [
        ("4BC#000E050109", "4BB#008EC409", false),
        ("4BC#000E050109", "4BB#008E01", true),
        ("4BC#000E050109", "4BB#008E", true),
        ("4BC#00100501091027", "4BB#00901027", false),
        ("4BC#00100501091027", "4BB#0090", false),
        ("4BC#00100501091027", "4BB#00901027AA", true),
        ("4BC#00100501091027", "4BB#009010", true),
        // The state has one byte, the produced path any number.
        ("4BC#000E050101", "4BB#008E0300", true),
        ("4BC#000E05010E", "4BB#008E", false),
    ] {
        let told = read(
            &[(0.0, "4BE#004B03010100"), (1.0, "4BB#00CB00"), (10.0, request), (11.0, answer)],
            20.0,
        );
        let wanted: &[&str] = if is_malformed { &["4 explicit-response malformed"] } else { &[] };
        assert_eq!(findings(&told), wanted, "{request} {answer}");
    }
}
