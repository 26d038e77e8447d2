//! Logs of CAN frames: what is read of them, said of them, and kept in conversions.

use crate::harness::{Scratch, argument, codes, fieldtap, fieldtap_fed};
use serde_json::Value;
use std::path::Path;

/// A bit of everything that candump's log can hold.
const LOG: &str = "\
(1700000010.000001) can0 42C#010E010101 R
(1700000010.001000) can0 42B#018E3600 T
DROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 3)
(1700000010.002000) can1 18EBFF00#AA
(1700000010.002000) can0 123#R4
(1700000010.003000) can0 20000088#0000040800006000
(1700000010.004000) can0 123##5AABB
(1700000010.005000) can0 123#0102030405060708_C
(1700000010.006000) can0 7FF#R
";

fn records(path: &Path) -> Vec<Value> {
    fieldtap(["read", "--protocol", "can", "--format", "json", argument(path)]).good().records()
}

#[test]
fn a_log_comes_back_from_pcapng_as_it_was() {
    let scratch = Scratch::new();
    let log = scratch.file("a.log", LOG);
    let (capture, again) = (scratch.path("b.pcapng"), scratch.path("c.log"));
    fieldtap(["convert", "-q", argument(&log), argument(&capture)]).good();
    fieldtap(["convert", "-q", argument(&capture), argument(&again)]).good();
    let written = std::fs::read_to_string(&again).expect("it was written");
    // The buses of a log are decoded each at its pace: can1 with its one frame comes last.
    let sorted = |text: &str| {
        let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
        lines.sort();
        lines
    };
    assert_eq!(sorted(&written), sorted(LOG));
    let of_can0 = |text: &str| {
        let lines = text.lines().filter(|line| line.contains("can0"));
        lines.map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(of_can0(&written), of_can0(LOG));
    let (before, after) = (records(&log), records(&capture));
    assert_eq!(before.len(), 9);
    let meaning = |record: &Value| {
        let keys = ["bus", "kind", "raw", "can", "lost", "uncertainty_ns", "clock", "findings"];
        keys.map(|key| record[key].clone())
    };
    let sort = |records: &[Value]| {
        let mut all: Vec<String> = records.iter().map(|r| format!("{:?}", meaning(r))).collect();
        all.sort();
        all
    };
    assert_eq!(sort(&before), sort(&after));
}

#[test]
fn frames_are_records() {
    let records =
        fieldtap_fed(["read", "--protocol", "can", "--format", "json", "-"], LOG.as_bytes());
    let records = records.good().records();
    let first = &records[0];
    assert_eq!(first["time_ns"], 1_700_000_010_000_001_000_i64);
    assert_eq!(first["uncertainty_ns"], 1_000);
    assert_eq!((&first["clock"], &first["bus"]), (&"log".into(), &"can0".into()));
    assert_eq!(first["can"]["id"], 0x42C);
    assert_eq!(first["can"]["direction"], "rx");
    // can-utils' exact length of this frame.
    assert_eq!(first["can"]["bits"], 92);
    let kinds: Vec<&str> = records.iter().filter_map(|record| record["kind"].as_str()).collect();
    let errors = records.iter().filter(|record| record["kind"] == "can-error").count();
    assert!(kinds.contains(&"lost") && errors == 1, "{kinds:?}");
    let lost = records.iter().find(|record| record["kind"] == "lost").expect("a loss");
    assert_eq!(lost["lost"], 3);
    assert_eq!(codes(lost), ["can.dropped"]);
}

#[test]
fn the_table_shows_frames_as_candump_does() {
    let run =
        fieldtap_fed(["read", "--protocol", "can", "-v", "--bitrate", "125k", "-"], LOG.as_bytes());
    let text = run.good().stdout;
    assert!(text.contains("can0   42C#010E010101         frame 42Ch, 5 bytes\n"), "{text}");
    // 92 bits of 8 µs.
    assert!(text.contains("92 bits, 736 µs, rx\n"), "{text}");
    assert!(
        text.contains("can0   0102030405060708") || text.contains("123#010203040506070…"),
        "{text}"
    );
}

/// Ten frames of 92 bits, 1 ms apart: at 500 kbit/s 184 µs each, and the last one counts in full:
/// 1840 µs of 9000 µs.
#[test]
fn the_last_lines_tell_rate_and_load() {
    let log: String = (0..10).map(|ms| format!("(1.{ms:03}000) can0 42C#010E010101\n")).collect();
    let stats = |options: &[&str]| {
        let arguments = ["stats", "--protocol", "can", "-"];
        fieldtap_fed(arguments.iter().chain(options), log.as_bytes()).good()
    };
    let run = stats(&["--bitrate", "500000"]);
    assert!(run.stdout.contains("can0           10        0        0    20.4 %"), "{}", run.stdout);
    let line = "LINE   ok: 500 kbit/s, 10 frames, 0 error frames (0.00 %), load 20.4 %\n";
    assert!(run.stderr.contains(line), "{}", run.stderr);
    let run = stats(&[]);
    let line = "LINE   ok: bit rate not known, 10 frames, 0 error frames (0.00 %)\n";
    assert!(run.stderr.contains(line), "{}", run.stderr);
    let open = "OPEN   load and time on the wire not judged (bit rate not known: --bitrate)\n";
    assert!(run.stderr.contains(open), "{}", run.stderr);
    // Nothing is judged of the load of a bus whose rate nobody knows.
    let arguments = ["stats", "--protocol", "can", "-"];
    let run = fieldtap_fed(arguments, &log.as_bytes()[..2 * log.len() / 10]).good();
    let wrong = "WRONG  nothing found in 2 records; all judged but load\n";
    assert!(run.stderr.contains(wrong), "{}", run.stderr);
    let json: Value =
        serde_json::from_str(&stats(&["--format", "json", "--bitrate", "500k"]).stdout)
            .expect("JSON");
    let bus = &json["buses"][0];
    assert_eq!((&bus["frames"], &bus["error_frames"]), (&10.into(), &0.into()));
    assert_eq!((&bus["load"], &bus["bitrate"]), (&0.204.into(), &500_000.into()));
    assert_eq!(fieldtap(["stats", "--bitrate", "2M", "x.log"]).status, 2);
}

/// Three polls of node 23, 50 ms apart, answered after 1, 1 and 7 ms.
#[test]
fn statistics_tell_how_evenly_a_slave_is_polled() {
    let log: String = [(0, 1), (50, 51), (100, 107)]
        .iter()
        .map(|(asked, answered)| {
            format!("(1.{asked:03}000) can0 4BD#\n(1.{answered:03}000) can0 3D7#45230100\n")
        })
        .collect();
    let stats = |options: &[&str]| {
        let arguments = ["stats", "--protocol", "devicenet", "--bitrate", "125k", "-"];
        fieldtap_fed(arguments.iter().chain(options), log.as_bytes()).good().stdout
    };
    let text = stats(&[]);
    for line in [
        "can0       23 poll interval           2   50.0 ms   50.0 ms   50.0 ms       0 ns\n",
        "can0       23 poll response           3   1.00 ms   3.00 ms   7.00 ms    2.82 ms  1 x above 2.00 ms\n",
    ] {
        assert!(text.contains(line), "{text}");
    }
    assert!(!stats(&["--limit", "poll-response=6"]).contains(" x above "));
    let json: Value = serde_json::from_str(&stats(&["--format", "json"])).expect("JSON");
    let [polls, responses] = &json["measured"].as_array().expect("a list")[..] else {
        panic!("{json}")
    };
    assert_eq!((&polls["bus"], &polls["station"]), (&"can0".into(), &23.into()));
    assert_eq!(
        (&polls["subject"], &polls["mean_ns"]),
        (&"poll interval".into(), &50_000_000.into())
    );
    assert_eq!((&polls["count"], &polls["deviation_ns"]), (&2.into(), &0.into()));
    assert_eq!((&responses["limit_ns"], &responses["above_limit"]), (&2_000_000.into(), &1.into()));
}

#[test]
fn a_channel_is_chosen_by_its_interface() {
    let read = |name: &str| {
        let arguments = ["read", "--format", "json", "--channel", name, "-"];
        fieldtap_fed(arguments, LOG.as_bytes())
    };
    assert_eq!(read("can1").good().records().len(), 1);
    let run = read("can7");
    assert_eq!(run.status, 3);
    assert!(run.stderr.contains("there is no channel can7: there is can0, can1"), "{}", run.stderr);
}

#[test]
fn what_cannot_be_read_is_said_with_its_line() {
    let run = fieldtap_fed(["read", "-"], b"(1.0) can0 123#0\n(1.5) can0 123#00\nplug moved\n");
    assert_eq!(run.status, 0);
    assert!(
        run.stderr.contains("warning: standard input: line 1: the data is no hex"),
        "{}",
        run.stderr
    );
    assert!(run.stderr.contains("left out 1 line that holds no CAN"), "{}", run.stderr);
    let run = fieldtap_fed(["read", "-"], b"(1.5) can0 123#00\n(1.6) can0 123#0");
    assert_eq!(run.status, 3);
    assert!(run.stderr.contains("line 2: the file ends inside this line"), "{}", run.stderr);
    assert_eq!(run.stdout.lines().count(), 2);
}

#[test]
fn forms_for_the_other_medium_are_refused() {
    let scratch = Scratch::new();
    let log = scratch.file("a.log", LOG);
    let chars = scratch.file("b.chars", "time,byte,parity\n0.1,83,ok\n");
    let cases = [(&log, "out.chars", "is no serial line"), (&chars, "out.log", "is no CAN bus")];
    for (from, to, why) in cases {
        let out = scratch.path(to);
        let run = fieldtap(["convert", argument(from), argument(&out)]);
        assert_eq!(run.status, 3, "{}", run.stderr);
        assert!(run.stderr.contains(why) && !out.exists(), "{}", run.stderr);
    }
}

/// A serial and a CAN interface in one file stay two buses of two protocols.
#[test]
fn serial_and_can_stand_in_one_capture() {
    let scratch = Scratch::new();
    let chars = scratch.file(
        "a.chars",
        "time,byte,parity\n1.0,83,ok\n1.000345486,1A,ok\n1.000440972,01,ok\n1.000536458,9B,ok\n",
    );
    let log = scratch.file("b.log", LOG);
    let both = scratch.path("both.pcapng");
    let [one, two] = [("one.pcapng", &chars), ("two.pcapng", &log)].map(|(name, from)| {
        let path = scratch.path(name);
        fieldtap(["convert", "-q", argument(from), argument(&path)]).good();
        std::fs::read(path).expect("it was written")
    });
    // Sections of a file follow each other.
    std::fs::write(&both, [one, two].concat()).expect("it can be written");
    let records = fieldtap(["read", "--format", "json", argument(&both)]).good().records();
    let protocols: Vec<&str> = records.iter().filter_map(|r| r["protocol"].as_str()).collect();
    let cans = records.iter().filter(|r| r.get("can").is_some_and(Value::is_object)).count();
    assert_eq!((records.len() - cans - 1, cans), (protocols.len() - 9, 8), "{protocols:?}");
    assert!(protocols.iter().any(|protocol| ["slin", "uart"].contains(protocol)));
}

#[test]
fn an_interface_of_which_only_a_loss_is_known_is_a_can_bus() {
    let log = "(1700000000.000001) can0 42C#\nDROPCOUNT: dropped 1000000000 CAN frames on 'can1' \
               socket (total drops 1000000000)\n";
    let run = fieldtap_fed(["read", "--format", "json", "-"], log.as_bytes()).good();
    let lost = run.records().into_iter().find(|record| record["bus"] == "can1").expect("a loss");
    assert_eq!((&lost["kind"], &lost["lost"]), (&"lost".into(), &1_000_000_000.into()));
    assert_ne!(lost["protocol"], "uart");
}

#[test]
fn limits_are_the_users_to_set() {
    let capture = crate::harness::here("captures/devicenet-late-response/late-response.log");
    let count = |more: &[&str]| {
        let read = ["read", "--format", "json", argument(&capture)];
        let run = fieldtap(read.iter().chain(more)).good();
        let all: Vec<String> = run.records().iter().flat_map(codes).collect();
        all.iter().filter(|code| *code == "devicenet.late-response").count()
    };
    assert!(count(&[]) > 0);
    // They come after 600 to 900 ms.
    assert_eq!(count(&["--limit", "late-response=950"]), 0);
    let run = fieldtap(["read", argument(&capture), "--limit", "patience=1"]);
    assert!(run.status == 2 && run.stderr.contains("late-response"), "{}", run.stderr);
}
