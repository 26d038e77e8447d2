//! What the tap did not hear: nothing is judged across a gap, and nothing is taken for known.

use crate::bus::{Heard, decode, findings, read, script};
use fieldtap_dissectors::can::{Frame, FrameKind, Identifier};
use fieldtap_dissectors::event::Moment;

/// A node that restarts has no connection; but who allocates it may be in a gap.
#[test]
fn what_was_gone_before_a_gap_may_be_there_after_it() {
    let checks = [(0.0, "4BF#00D40101000000"), (1_000.0, "4BF#00D40101000000")];
    let polls = [(5_000.0, "4BD#"), (5_001.0, "3D7#45230100")];
    let told = read(&[&checks[..], &polls].concat(), 6_000.0);
    assert_eq!(findings(&told)[0], "3 poll-command not-allocated");
    let gap = [(3_000.0, "lost")];
    let told = read(&[&checks[..], &gap, &polls].concat(), 6_000.0);
    assert_eq!(findings(&told), ["3 lost can.dropped"]);
    assert_eq!(told[3].get("assumed"), "allocation");
    // So it may if it refuses: it is in the requested state already.
    let refusal = [(3_000.0, "4BE#004B03010200"), (3_002.0, "4BB#00940B02")];
    let told = read(&[&checks[..], &refusal, &polls].concat(), 6_000.0);
    assert_eq!(findings(&told), ["4 unconnected-response allocation-refused"]);
}

/// A loss is told with the frame behind it: whatever was due before may have come.
#[test]
fn nothing_that_was_due_in_a_gap_is_judged() {
    let told = read(&[(0.0, "4BC#000E2F010C"), (3_000.0, "lost"), (3_000.0, "4BD#")], 5_000.0);
    assert_eq!(findings(&told), ["2 lost can.dropped"]);
}

/// A tap's controller that was off the bus (`linux/can/error.h`) has heard nothing meanwhile.
#[test]
fn a_tap_that_was_off_the_bus_has_a_gap() {
    let mut heard = script(&[(0.0, "4BC#000E2F010C"), (200.0, "4BB#008ED401")]);
    let off = Identifier::Extended(0x40);
    let off = Frame::new(Moment::from_ns(50_000_000), 0, FrameKind::Error, off, 8).with(&[0; 8]);
    heard.insert(1, Heard::Frame(off));
    let told = decode(&heard, Some(5_000_000_000));
    assert_eq!(findings(&told), ["2 can-error can.error-frame can.bus-off"]);
    assert_eq!((told[2].get("request"), told[2].get("assumed")), ("", "start"));
}

/// A frame that the capture has cut may have been any message of its server.
#[test]
fn what_a_cut_frame_held_is_not_judged() {
    let mut heard = script(&[
        (0.0, "4BC#000E010101"),
        (2.0, "4BB#008ED401"),
        (10.0, "4BC#00"),
        (12.0, "4BB#008E2200"),
        (20.0, "4BC#8000"),
        (22.0, "4BB#80C000"),
        (24.0, "4BC#80810100"),
        (26.0, "4BB#80C100"),
        (28.0, "4BB#0090"),
    ]);
    for index in [2, 4] {
        let Heard::Frame(frame) = &mut heard[index] else { unreachable!() };
        frame.original_length = Some(8);
    }
    let told = decode(&heard, Some(5_000_000_000));
    assert_eq!(
        findings(&told),
        ["3 explicit-request can.truncated", "5 explicit-request can.truncated"]
    );
    assert_eq!((told[2].station, told[3].get("request")), (Some(23), ""));
}
