//! Logs of an INTERBUS ring, as controllers and commissioning tools write them.

use crate::harness::{Scratch, argument, fieldtap, here};
use serde_json::Value;

/// The records of a log, read with more options.
fn records(name: &str, content: &str, options: &[&str]) -> Vec<Value> {
    let scratch = Scratch::new();
    let log = scratch.file(name, content);
    let arguments = ["read", "--format", "json", argument(&log)];
    fieldtap(arguments.iter().chain(options)).good().records()
}

/// What one record says of each key.
fn values<'a>(records: &'a [Value], key: &str) -> Vec<&'a Value> {
    records.iter().map(|record| &record["interbus"][key]).collect()
}

/// Every form of the same two rows: measuring length 5000 (1388h) written, and acknowledged.
#[test]
fn the_same_words_in_every_form() {
    let plain = "time,out,in\n0.50,C2001388,00000100\n0.52,C2001388,C2001388\n";
    let expected = records("plain.csv", plain, &[]);
    assert_eq!(values(&expected, "out"), ["C2001388", "C2001388"]);
    assert_eq!(values(&expected, "in"), ["00000100", "C2001388"]);
    assert_eq!(expected[1]["time_ns"], 520_000_000);
    assert_eq!(expected[1]["uncertainty_ns"], 10_000_000);
    let split = "Zeit;QW10;QW12;IW10;IW12\n0,50;C200;1388;0000;0100\n0,52;C200;1388;C200;1388\n";
    // C200h = 49664, or -15872 as a signed word; 1388h = 5000, 0100h = 256.
    let decimal = "500,49664,5000,0,256\n520,-15872,5000,49664,5000\n";
    let same = |content: &str, options: &[&str]| {
        let mut same = records("same.csv", content, options);
        same.iter_mut().zip(&expected).for_each(|(record, expected)| {
            // Hundredths or thousandths: the stamp is the same.
            record["uncertainty_ns"] = expected["uncertainty_ns"].clone();
        });
        assert_eq!(same, expected, "{content}");
    };
    same(split, &["--columns", "time=Zeit,out1=QW10,out2=QW12,in1=IW10,in2=IW12"]);
    same(split, &["--ring-map", "1=QW10+QW12/IW10+IW12", "--columns", "time=1"]);
    let by_number = "time=1,out1=2,out2=3,in1=4,in2=5";
    same(decimal, &["--words", "decimal", "--columns", by_number, "--time-unit", "ms"]);
}

#[test]
fn what_the_master_sends_in_one_file_and_what_it_receives_in_the_other() {
    let scratch = Scratch::new();
    let sent = scratch.file("sent.csv", "time,out\n0.1,C2001388\n0.3,42001388\n");
    let received = scratch.file("received.csv", "time,in\n0.1,00000100\n0.2,C2001388\n");
    let run =
        fieldtap(["read", "--format", "json", argument(&sent), "--join", argument(&received)]);
    let records = run.good().records();
    assert_eq!(values(&records, "out"), ["C2001388", "C2001388", "42001388"]);
    assert_eq!(values(&records, "in"), ["00000100", "C2001388", "C2001388"]);
}

/// The log of IN is over when the request comes: that nobody answers it cannot be known.
#[test]
fn a_side_that_is_not_logged_is_not_silent() {
    let scratch = Scratch::new();
    let word = |n: u32| if (20..80).contains(&n) { "81000000" } else { "01000000" };
    let lines = (0..100).map(|n| format!("{:.2},{}\n", f64::from(n) * 0.05, word(n)));
    let sent = scratch.file("sent.csv", format!("time,out\n{}", lines.collect::<String>()));
    let received = scratch.file("received.csv", "time,in\n0.00,00000005\n0.05,00000005\n");
    for join in [&[][..], &["--join", argument(&received)]] {
        let run = fieldtap(["read", "--format", "json", argument(&sent)].iter().chain(join)).good();
        assert!(run.records().iter().all(|it| it["findings"] == Value::Array(Vec::new())));
    }
    let run = fieldtap(["read", argument(&sent)]).good();
    assert!(run.stderr.contains("no-acknowledge not judged 1 x"), "{}", run.stderr);
    assert!(!run.stderr.contains("never"), "{}", run.stderr);
}

/// Rows every 4 ms or every 50 ms of a healthy ring, their times written in ms.
#[test]
fn times_in_a_wrong_unit_raise_no_alarm() {
    let scratch = Scratch::new();
    for (name, is_fine) in [("every-cycle.csv", true), ("50ms.csv", false)] {
        let log =
            std::fs::read_to_string(here("captures/good-interbus").join(name)).expect("a log");
        let in_ms = log.lines().enumerate().map(|(index, line)| match line.split_once(',') {
            Some((time, words)) if index > 0 => {
                let ms = time.parse::<f64>().expect("seconds") * 1_000.0;
                format!("{ms:.0},{words}\n")
            }
            _ => format!("{line}\n"),
        });
        let log = scratch.file(name, in_ms.collect::<String>());
        for unit in ["s", "us"] {
            let run = fieldtap(["read", argument(&log), "--time-unit", unit]).good();
            assert!(run.stderr.contains("WRONG  nothing found"), "{name} {unit}: {}", run.stderr);
            assert!(run.stderr.contains("(is --time-unit right?)"), "{}", run.stderr);
            assert!(run.stderr.contains("time unit undecided"), "{}", run.stderr);
            let is_withheld = run.stderr.contains("no-acknowledge not judged");
            assert_eq!(is_withheld, is_fine && unit == "s", "{}", run.stderr);
        }
        let run = fieldtap(["read", argument(&log), "--time-unit", "ms"]).good();
        assert!(!run.stderr.contains("time-unit"), "{}", run.stderr);
    }
}

/// A device that never answers is told, be the rows seconds apart: of dates the unit is known, and
/// 4000 rows last a second whatever the unit is.
#[test]
fn a_slow_log_still_tells_a_device_that_never_answers() {
    let scratch = Scratch::new();
    let row = |n: u32, time: String| {
        let out = if n > 30 { "81000000" } else { "00000000" };
        format!("{time},{out},00000005\n")
    };
    let log = |count, time: &dyn Fn(u32) -> String| {
        let rows: String = (0..count).map(|n| row(n, time(n))).collect();
        scratch.file("slow.csv", format!("time,out,in\n{rows}"))
    };
    let date = |n: u32| format!("2026-05-03 10:{:02}:{:02}", n / 60, n % 60);
    let run = fieldtap(["read", argument(&log(60, &date))]).good();
    assert!(run.stderr.contains("1 x no-acknowledge"), "{}", run.stderr);
    let number = |n: u32| n.to_string();
    let run = fieldtap(["read", argument(&log(60, &number))]).good();
    assert!(run.stderr.contains("no-acknowledge not judged 1 x"), "{}", run.stderr);
    let run = fieldtap(["read", argument(&log(4_050, &number))]).good();
    assert!(run.stderr.contains("1 x no-acknowledge"), "{}", run.stderr);
}

/// A log in decimal, with the words of a healthy ring: as numbers with and without a sign.
#[test]
fn decimal_words_are_read_as_such_where_hex_makes_no_sense() {
    let scratch = Scratch::new();
    let hex = here("captures/good-interbus/every-cycle.csv");
    let expected = fieldtap(["read", "--format", "json", argument(&hex)]).good().records();
    let words = std::fs::read_to_string(&hex).expect("a log");
    let written = |say: &dyn Fn(u32) -> String| {
        let lines = words.lines().skip(1).map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            let word = |at: usize| say(u32::from_str_radix(cells[at], 16).expect("hex"));
            format!("{},{},{}\n", cells[0], word(1), word(2))
        });
        scratch.file("decimal.csv", format!("time,out,in\n{}", lines.collect::<String>()))
    };
    let unsigned = |word: u32| word.to_string();
    let signed = |word: u32| word.cast_signed().to_string();
    for say in [&unsigned as &dyn Fn(u32) -> String, &signed] {
        let run = fieldtap(["read", "--format", "json", argument(&written(say))]).good();
        assert!(run.stderr.contains("its words are read as decimal"), "{}", run.stderr);
        assert_eq!(run.records(), expected);
    }
}

/// Positions alone, of digits up to 9: 100 may be 100 or 256.
#[test]
fn words_that_may_be_hex_or_decimal_are_not_called_healthy() {
    let scratch = Scratch::new();
    // 999 and 1000 are one apart, 999h and 1000h 1639: that is a jump only if they are hex.
    let lines = (0..60).map(|n| format!("0.{n:02},0,{}\n", 970 + n));
    let log = scratch.file("jumps.csv", format!("time,out,in\n{}", lines.collect::<String>()));
    let run = fieldtap(["read", argument(&log), "--every-cycle"]).good();
    assert!(run.stderr.contains("WRONG  only if words are hex: "), "{}", run.stderr);
    let lines = (0..50).map(|n| format!("0.{n:02},0,{}\n", 100 + n % 10));
    let log = scratch.file("open.csv", format!("time,out,in\n{}", lines.collect::<String>()));
    let run = fieldtap(["read", argument(&log)]).good();
    assert!(run.stderr.contains("WRONG  not judged: the words may be hex or decimal"));
    assert!(!run.stderr.contains("nothing found"), "{}", run.stderr);
    for radix in ["hex", "decimal"] {
        let run = fieldtap(["read", argument(&log), "--words", radix]).good();
        assert!(run.stderr.contains("WRONG  nothing found in 50 records"), "{}", run.stderr);
    }
}

#[test]
fn a_log_that_is_written_is_read_back_as_it_was() {
    let scratch = Scratch::new();
    let logs = [
        "time,device,out,in\n0,1,C2001388,00000100\n0.010,2,,00000007\n0.0105,1,42001388,\n",
        "time;in\n03.05.2024 10:41:07,5;5\n03.05.2024 10:41:08,0;6\n",
    ];
    for log in logs {
        let before = scratch.file("before.csv", log);
        let after = scratch.path("after.csv");
        let form = ["--output-format", "interbus-log"];
        fieldtap(["convert", "-q", argument(&before), argument(&after)].iter().chain(&form)).good();
        let read = |path| fieldtap(["read", "--format", "json", argument(path)]).good().records();
        assert_eq!(read(&after), read(&before), "{log}");
    }
    let ids = scratch.file("ids.csv", "device,id\n1,0233\n");
    let out = scratch.path("out.csv");
    let run =
        fieldtap(["convert", argument(&ids), argument(&out), "--output-format", "interbus-log"]);
    assert_eq!(run.status, 3);
    assert!(run.stderr.contains("interbus-log holds these"), "{}", run.stderr);
}

/// 02h is two words, 32 bits; 06h is eight words, 128 bits; 0Ah is reserved.
#[test]
fn id_words_say_what_they_can_prove() {
    let records = records("ring.csv", "device,id\n1,0233\n2,8633\n3,0A37\n", &[]);
    assert!(records.iter().all(|record| record["kind"] == "id-word"));
    assert_eq!(values(&records, "id"), ["0233", "8633", "0A37"]);
    assert_eq!(values(&records, "ident"), [51, 51, 55]);
    assert_eq!(values(&records, "length_bits"), [&Value::from(32), &128.into(), &Value::Null]);
    assert_eq!(values(&records, "device"), [1, 2, 3]);
    let summary = records[0]["summary"].as_str().expect("text");
    assert!(summary.contains("may be an LA-66, which no ID word proves"), "{summary}");
    assert!(records[2]["summary"].as_str().expect("text").contains("reported, unverified"));
    assert!(records.iter().all(|record| record["findings"] == Value::Array(Vec::new())));
}

#[test]
fn diagnostics_are_told_in_words() {
    let summary = |content: &str, options: &[&str]| {
        let records = records("diagnostic.csv", content, options);
        assert_eq!(records[0]["kind"], "diagnostic");
        records[0]["summary"].as_str().expect("text").to_owned()
    };
    let register = "time,status,parameter\n0.5,00E2,0301\n";
    assert_eq!(
        summary(register, &[]),
        "peripheral fault, the bus runs on; device 3.1 (PF RUN ACTIVE READY)"
    );
    let third = ["--generation", "3"];
    assert!(summary("time,status\n0,0004\n", &third).contains("order of bits assumed"));
    let bits = ["--generation-3-bits", "READY,MOD,LB,RB,CTRL,BSA,RUN,BASP"];
    assert_eq!(
        summary("time,status\n0,0004\n", &[&third[..], &bits].concat()),
        "local bus error (LB)"
    );
    assert_eq!(summary("time,device,slave\n0,3,01\n", &[]), "device 3: reconfiguration requested");
    let message = "time,message\n0,8081 0003 0002 2116 0000\n";
    assert_eq!(summary(message, &third), "Read request: CR 2, index 2116h");
}

#[test]
fn what_cannot_be_read_is_told_with_what_to_do() {
    let scratch = Scratch::new();
    let log = scratch.file("plc.csv", "Timestamp;QD10;ID10\n0,1;0;0\n");
    let run = fieldtap(["read", argument(&log)]);
    assert!(run.status == 3 && run.stderr.contains("--columns time=1,out=2"), "{}", run.stderr);
    let run = fieldtap(["read", argument(&log), "--columns", "out=QD11"]);
    assert_eq!(run.status, 3);
    assert!(
        run.stderr.contains("there is no column QD11: the columns are \"Timestamp\" \"QD10\""),
        "{}",
        run.stderr
    );
    let run = fieldtap(["read", argument(&log), "--columns", "output=QD10"]);
    assert!(run.status == 2 && run.stderr.contains("names are time, date"), "{}", run.stderr);
    let bad = scratch.file("bad.csv", "time,out,in\n0.1,0,5\n0.2,?,5\n0.3,0,5\n");
    let run = fieldtap(["read", argument(&bad)]).good();
    assert!(run.stderr.contains("line 3: a word is no hex digits"), "{}", run.stderr);
    assert_eq!(run.stdout.lines().count(), 3, "a header and two records");
}
