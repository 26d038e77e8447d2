//! What slaves and masters send by change of state or cyclically: pace, acknowledgements, floods.
//! Master 0, encoder 23: 357h tells changes, 4BAh acknowledges them; 4BDh is what the master sends,
//! 3D7h acknowledges that.

use crate::bus::{Told, decode_at, findings, read, script};
use crate::io::with;

#[test]
fn the_rate_is_what_the_slave_answers() {
    // Asked for 75 ms (4Bh), told 100 ms (64h): late after 150 ms, timed out after 400 ms.
    let allocate = [
        (0.0, "4BE#004B03015100"),
        (1.0, "4BB#00CB00"),
        (2.0, "4BC#00100504094B00"),
        (3.0, "4BB#00906400"),
    ];
    let told = with(
        &allocate,
        &[(10.0, "357#01000000"), (150.0, "357#02000000"), (310.0, "357#03000000")],
        320.0,
    );
    assert_eq!(findings(&told), ["7 cos late-production"]);
    let told = with(&allocate, &[(10.0, "357#01000000")], 411.0);
    assert_eq!(findings(&told), ["6 event connection-timeout+"]);
    assert_eq!(told[5].ns, Some(410_000_000));
    // Too early for the time-out, too late for the production.
    let told = with(&allocate, &[(10.0, "357#01000000")], 300.0);
    assert_eq!(findings(&told), ["6 event late-production"]);
    assert_eq!((told[5].ns, told[5].about), (Some(160_000_000), Some(5)));
}

#[test]
fn productions_are_acknowledged() {
    let allocate = [
        (0.0, "4BE#004B03011100"),
        (1.0, "4BB#00CB00"),
        (2.0, "4BC#00100504090000"),
        (3.0, "4BB#00900000"),
    ];
    let told = with(
        &allocate,
        &[
            (10.0, "357#01000000"),
            (11.0, "4BA#"),
            (20.0, "357#02000000"),
            (36.0, "357#02000000"),
            (37.0, "4BA#"),
            (50.0, "357#03000000"),
        ],
        100.0,
    );
    assert_eq!(findings(&told), ["8 cos io-unacknowledged", "11 event io-unacknowledged"]);
    assert_eq!((told[5].kind, told[5].get("request")), ("io-ack", "5"));
    assert_eq!(told[8].get("request"), "8");
    assert_eq!((told[10].ns, told[10].about), (Some(74_000_000), Some(10)));
    // Choice bit 6: no acknowledgement is due, and one is worth a note.
    let allocate = [(0.0, "4BE#004B03015100"), (1.0, "4BB#00CB00")];
    let told = with(&allocate, &[(10.0, "357#01000000"), (11.0, "4BA#"), (20.0, "4BA#")], 100.0);
    assert_eq!(findings(&told), ["4 io-ack unexpected-ack", "5 io-ack unexpected-ack"]);
}

#[test]
fn a_shaft_that_moves_on_does_not_hide_that_the_master_is_gone() {
    // A change every 10 ms, none acknowledged: told 24 ms after the first, and so again.
    let allocate = [
        (0.0, "4BE#004B03011100"),
        (1.0, "4BB#00CB00"),
        (2.0, "4BC#00100504090000"),
        (3.0, "4BB#00900000"),
    ];
    let told = with(
        &allocate,
        &[(10.0, "357#01"), (20.0, "357#02"), (30.0, "357#03"), (40.0, "357#04"), (41.0, "4BA#")],
        100.0,
    );
    assert_eq!(findings(&told), ["8 event io-unacknowledged"]);
    assert_eq!((told[7].ns, told[7].about), (Some(34_000_000), Some(5)));
    assert_eq!(
        told[7].summary,
        "cos connection of 23: the master did not acknowledge within 24.0 ms"
    );
    // 24 ms less 1 µs, with stamps of ± 1 µs each: undecided.
    let told = with(&allocate, &[(10.0, "357#01"), (33.999, "4BA#")], 100.0);
    assert_eq!(told[5].withheld, ["devicenet.io-unacknowledged"]);
}

#[test]
fn the_inhibit_time_holds_between_productions() {
    // Attribute 17 of instance 4: 20 ms (14h).
    let told = with(
        &[
            (0.0, "4BE#004B03015100"),
            (1.0, "4BB#00CB00"),
            (2.0, "4BC#00100504111400"),
            (3.0, "4BB#0090"),
        ],
        &[(10.0, "357#01000000"), (30.0, "357#02000000"), (45.0, "357#03000000")],
        50.0,
    );
    assert_eq!(findings(&told), ["7 cos inhibit-violated"]);
    // ± 1 µs each: 20 ms less 1 µs is undecided.
    let undecided = with(
        &[
            (0.0, "4BE#004B03015100"),
            (1.0, "4BB#00CB00"),
            (2.0, "4BC#00100504111400"),
            (3.0, "4BB#0090"),
        ],
        &[(10.0, "357#01000000"), (29.999, "357#02000000")],
        50.0,
    );
    assert_eq!(undecided[5].withheld, ["devicenet.inhibit-violated"]);
}

#[test]
fn a_flood_is_told_with_its_cure() {
    // 74 to 80 bits at 125 kbit/s every 1.5 ms: about 40 % of the bus.
    let lines: Vec<(f64, &str)> =
        (0..1_400).map(|n| (f64::from(n) * 1.5, "357#45230100")).collect();
    let told = read(&lines, 2_200.0);
    let found = findings(&told);
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].ends_with("cos io-flood"), "{found:?}");
    // The rate is not known: at 500 kbit/s they would take 10 %, which proves nothing. Every
    // 0.4 ms, they take 148 µs and more at any rate: at least 37 %.
    let end = Some(2_200_000_000);
    assert_eq!(findings(&decode_at(None, &script(&lines), end)), [""; 0]);
    let lines: Vec<(f64, &str)> =
        (0..4_000).map(|n| (f64::from(n) * 0.4, "357#45230100")).collect();
    let told = decode_at(None, &script(&lines), end);
    let floods: Vec<&Told> = told.iter().filter(|told| told.codes == ["io-flood"]).collect();
    assert_eq!(floods.len(), 1);
    assert!(floods[0].messages[0].contains("messages take at least "), "{:?}", floods[0].messages);
}

#[test]
fn what_the_master_sends_by_change_of_state_is_acknowledged() {
    // Change of state with acknowledgement, the master's connection at 1000 ms (3E8h).
    let allocate = |choice| {
        [(0.0, choice), (1.0, "4BB#00CB00"), (2.0, "4BC#0010050209E803"), (3.0, "4BB#0090E803")]
    };
    let messages = [
        (100.0, "4BD#01"),
        (200.0, "4BD#02"),
        (400.0, "4BD#03"),
        (401.0, "3D7#"),
        (500.0, "4BD#04"),
        (600.0, "3D7#"),
        (700.0, "4BD#05"),
        (710.0, "4BD#06"),
    ];
    // 24 ms are allowed: of the messages at 100, 200 and 500 ms nothing is heard by then.
    let told = with(&allocate("4BE#004B03011100"), &messages, 720.0);
    assert_eq!(
        findings(&told),
        ["6 event io-unacknowledged", "8 event io-unacknowledged", "12 event io-unacknowledged"]
    );
    let first = &told[5];
    assert_eq!((first.ns, first.about, first.station), (Some(124_000_000), Some(5), Some(23)));
    assert_eq!((first.get("source"), first.get("destination")), ("0", "23"));
    assert_eq!(
        first.summary,
        "cos connection of 23: 23 did not acknowledge its master within 24.0 ms"
    );
    // The capture ends: the last message falls due as the first did, with none after it.
    let told = with(&allocate("4BE#004B03011100"), &messages, 730.0);
    let last = told.last().unwrap();
    assert_eq!((last.ns, last.about), (Some(724_000_000), Some(14)));
    // The same data again is sent for want of an acknowledgement.
    let told = with(
        &allocate("4BE#004B03011100"),
        &[(100.0, "4BD#01"), (116.0, "4BD#01"), (117.0, "3D7#")],
        200.0,
    );
    assert_eq!(findings(&told), ["6 cos io-unacknowledged"]);
    // Choice bit 6: none is due.
    let told = with(&allocate("4BE#004B03015100"), &messages, 720.0);
    assert_eq!(findings(&told), [""; 0]);
}
