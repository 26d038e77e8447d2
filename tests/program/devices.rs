//! What the user knows of DeviceNet stations: `--eds`, `--stations`, `--device`.

use crate::harness::{Scratch, argument, fieldtap, here};
use serde_json::json;

/// The simulated encoder 23 of `errands.log` (vendor 468, type 22h, product 10, revision 1.1), as if
/// its maker's file knew no class 2Fh: then nothing but the file says what it sends.
const FILE: &str = "[Device] VendCode = 468; ProdType = 0x22; ProdCode = 10; MajRev = 1;\n\
    ProdName = \"Scale\";\n\
    [IO_Info] PollInfo = 1, 1, 0;\n\
    Input1 = 4, 0, 1, \"Weight\", 4, \"20 04 24 01\", \"\";\n\
    [Params] Param1 = 0, 6, \"20 64 24 01 30 01\", 4, 0xC7, 2, \"Net\", \"kg\", \"\", 0, 9, 0,\n\
    1, 100, 1, 0, 0, 0, 0, 0, 2;\n\
    [Assembly] Assem1 = \"Weight\", \"20 04 24 01\", 4, 0, , , 16, Param1, 16, 0;\n";

#[test]
fn an_eds_lays_out_the_data_of_its_device() {
    let scratch = Scratch::new();
    let eds = scratch.file("scale.eds", FILE);
    // Poll answers with 1234h little-endian in front: 4660 hundredths are 46.60 kg.
    let log = scratch.file(
        "scale.log",
        "(0.000000) can0 4BC#000E010101\n(0.001000) can0 4BB#008ED401\n\
         (0.002000) can0 4BC#000E010103\n(0.003000) can0 4BB#008E0A00\n\
         (0.010000) can0 4BD#\n(0.011000) can0 3D7#34120000\n\
         (0.085000) can0 4BD#\n(0.086000) can0 3D7#341200000000\n",
    );
    let arguments = ["read", "--protocol", "devicenet", "--format", "json", "--eds"];
    let run = fieldtap(arguments.iter().chain(&[argument(&eds), argument(&log)])).good();
    assert!(run.stderr.contains("EDS Scale: 23 (vendor and product"), "{}", run.stderr);
    let records = run.records();
    let member = json!([{"name": "Net", "value": 46.6, "unit": "kg"}]);
    assert_eq!(records[5]["devicenet"]["io"]["members"], member);
    assert_eq!(records[5]["summary"], "23 answers the poll: Net 46.60 kg in 1.00 ms");
    let mismatch = &records[7]["findings"][0];
    assert_eq!(mismatch["code"], "devicenet.size-mismatch");
    assert_eq!(mismatch["message"], "poll connection of 23 carries 6 bytes, per EDS 4");
}

#[test]
fn what_is_odd_about_an_eds_is_said_with_its_line_and_the_rest_is_used() {
    let scratch = Scratch::new();
    let eds = scratch.file("odd.eds", FILE.replace("MajRev = 1;", "MajRev = one;"));
    let capture = here("captures/good-devicenet/errands.log");
    let run = fieldtap(["read", "--eds", argument(&eds), argument(&capture)]).good();
    assert!(run.stderr.contains("odd.eds: line 1: field 1 is no number"), "{}", run.stderr);
    assert!(run.stderr.contains("EDS Scale: 23"), "{}", run.stderr);
    let absent = fieldtap(["read", "--eds", "/absent.eds", argument(&capture)]);
    assert_eq!(absent.status, 2, "{}", absent.stderr);
}

#[test]
fn names_and_turns_of_stations_stand_beside_their_numbers() {
    let scratch = Scratch::new();
    let stations = scratch.file(
        "stations.toml",
        "[station.23]\nname = \"lift axis\"\nsingleturn_bits = 13\nmultiturn_bits = 16\n",
    );
    let capture = here("captures/good-devicenet/errands.log");
    let arguments = ["read", "--format", "json", "--stations", argument(&stations)];
    let run = fieldtap(arguments.iter().chain(&[argument(&capture)])).good();
    let mut judged = 0;
    for record in run.records().iter().filter(|record| record["kind"] == "poll-response") {
        let (told, summary) = (&record["devicenet"], record["summary"].as_str().expect("text"));
        assert_eq!(told["name"], "lift axis");
        assert!(summary.starts_with("23 (lift ax…) answers the poll"), "{summary}");
        let Some(position) = told["io"]["position"].as_u64() else { continue };
        assert_eq!(told["io"]["turns"].as_u64(), Some(position / 8192), "{summary}");
        let angle = (position % 8192) as f64 * 360.0 / 8192.0;
        assert_eq!(told["io"]["angle"].as_f64(), Some(angle), "{summary}");
        judged += 1;
    }
    assert!(judged > 50, "{judged}");
    // A name may be long: 100 columns have the position none the less.
    let named = "[station.23]\nname = \"hoist of the north gantry\"\n";
    let stations = scratch.file("named.toml", named);
    let arguments = ["read", "--stations", argument(&stations), argument(&capture)];
    let text = fieldtap(arguments).good().stdout;
    let begins = "23 (hoist o…) answers the poll: position ";
    let first_100 = |line: &str| line.chars().take(100).collect::<String>();
    let lines: Vec<String> = text.lines().map(first_100).collect();
    let told = lines.iter().filter_map(|line| line.split_once(begins));
    let told: Vec<&str> = told.map(|(_, position)| position).collect();
    // Positions of 29 bits have up to nine digits.
    let is_whole = |it: &&str| it.bytes().position(|byte| !byte.is_ascii_digit()) == Some(9);
    assert!(told.len() > 50 && told.iter().all(is_whole), "{text}");
}
