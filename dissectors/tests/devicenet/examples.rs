//! The worked frames of vendor manuals and public captures. Where they come from stands with each:
//! expectations are what those sources say about their own frames.

use crate::bus::{Heard, Told, decode, frame_ns};
use std::collections::BTreeMap;

/// A worked frame: `group:message id/MAC ID`, kind, service (`!` behind a response),
/// `class.instance.attribute` in hex, codes.
struct Row {
    frame: &'static str,
    place: &'static str,
    kind: &'static str,
    service: &'static str,
    target: &'static str,
    codes: &'static str,
}

const fn row(
    frame: &'static str,
    place: &'static str,
    kind: &'static str,
    service: &'static str,
    target: &'static str,
    codes: &'static str,
) -> Row {
    Row { frame, place, kind, service, target, codes }
}

const ASKS: &str = "explicit-request";
const ANSWERS: &str = "explicit-response";
const ALLOCATES: &str = "unconnected-request";
const ALLOCATED: &str = "unconnected-response";
const POLLS: &str = "poll-command";
const POLLED: &str = "poll-response";

/// Each example is a bus of its own.
static EXAMPLES: &[(&str, &str, &[Row])] = &[
    (
        "X01",
        "MKS Baratron DMA manual p. 112-115",
        &[
            row("42C#010E010101", "2:4/5", ASKS, "0E", "1.1.1", ""),
            row("42B#018E3600", "2:3/5", ANSWERS, "0E!", "1.1.1", ""),
        ],
    ),
    (
        "X02",
        "MKS Baratron DMA manual p. 116-117",
        &[row("42B#019408FF", "2:3/5", ANSWERS, "14!", "", "error-response")],
    ),
    (
        "X03",
        "MKS Baratron DMA manual p. 118-120; printed identifier 42B corrected",
        &[row("42D#", "2:5/5", POLLS, "", "", ""), row("3C5#80FF3F", "1:15/5", POLLED, "", "", "")],
    ),
    (
        "X04",
        "BEI MHK5 encoder manual p. 8",
        &[
            row("41E#0A4B0301030A", "2:6/3", ALLOCATES, "4B", "3.1", ""),
            row("41C#0A100501090000", "2:4/3", ASKS, "10", "5.1.9", "xid-busy"),
            row("41C#0A100502090000", "2:4/3", ASKS, "10", "5.2.9", "xid-busy"),
        ],
    ),
    (
        "X05",
        "BEI MHK5 encoder manual p. 9",
        &[row("41E#0A4C030103", "2:6/3", ALLOCATES, "4C", "3.1", "")],
    ),
    (
        "X06",
        "BEI MHK5 encoder manual p. 9-10",
        &[
            row("41E#0A4B0301510A", "2:6/3", ALLOCATES, "4B", "3.1", ""),
            row("41C#0A100501090000", "2:4/3", ASKS, "10", "5.1.9", "xid-busy"),
            row("41C#0A100504090000", "2:4/3", ASKS, "10", "5.4.9", "xid-busy"),
            row("41E#0A4C030151", "2:6/3", ALLOCATES, "4C", "3.1", "allocation-invalid xid-busy"),
        ],
    ),
    (
        "X07",
        "BEI MHK5 encoder manual p. 11",
        &[row("41C#0A322301", "2:4/3", ASKS, "32", "23.1", "")],
    ),
    (
        "X08",
        "BEI MHK5 encoder manual p. 14, value filled in",
        &[
            row("41C#0A1023017001", "2:4/3", ASKS, "10", "23.1.70", ""),
            row("41B#0A90", "2:3/3", ANSWERS, "10!", "23.1.70", ""),
        ],
    ),
    (
        "X09",
        "BEI MHK5 encoder manual p. 14-15, value filled in",
        &[
            row("41C#0A102301710010", "2:4/3", ASKS, "10", "23.1.71", ""),
            row("41B#0A90", "2:3/3", ANSWERS, "10!", "23.1.71", ""),
        ],
    ),
    (
        "X10",
        "BEI MHK5 encoder manual p. 15, value filled in",
        &[
            row("41C#8A00102301720000", "2:4/3", ASKS, "10", "23.1.72", ""),
            row("41B#8AC000", "2:3/3", ASKS, "", "", ""),
            row("41C#8A810001", "2:4/3", ASKS, "10", "23.1.72", ""),
            row("41B#8AC100", "2:3/3", ASKS, "", "", ""),
            row("41B#0A90", "2:3/3", ANSWERS, "10!", "23.1.72", ""),
        ],
    ),
    (
        "X11",
        "BEI MHK5 encoder manual p. 16, value filled in",
        &[
            row("41C#8A00102301734523", "2:4/3", ASKS, "10", "23.1.73", ""),
            row("41B#8AC000", "2:3/3", ASKS, "", "", ""),
            row("41C#8A810100", "2:4/3", ASKS, "10", "23.1.73", ""),
            row("41B#8AC100", "2:3/3", ASKS, "", "", ""),
            row("41B#0A90", "2:3/3", ANSWERS, "10!", "23.1.73", ""),
        ],
    ),
    (
        "X12",
        "Rockwell Pico manual 1760-UM003A p. 4-11/12; frame 3 is printed as first fragment",
        &[
            row("41C#8000326401930500", "2:4/3", ASKS, "32", "64.1", ""),
            row("41B#80C000", "2:3/3", ASKS, "", "", ""),
            row("41C#800100000000", "2:4/3", ASKS, "", "", "fragment-sequence"),
            row("41B#80C100", "2:3/3", ASKS, "", "", ""),
            row("41B#8000B2C205000509", "2:3/3", ANSWERS, "32!", "", ""),
            row("41C#80C000", "2:4/3", ANSWERS, "", "", ""),
            row("41B#80810D0504", "2:3/3", ANSWERS, "32!", "64.1", ""),
            row("41C#80C100", "2:4/3", ANSWERS, "", "", ""),
        ],
    ),
    (
        "X13",
        "ICP DAS I-7242D manual p. 74; printed message id of frame 2 corrected",
        &[
            row("44E#0A4B0301030A", "2:6/9", ALLOCATES, "4B", "3.1", ""),
            row("44B#0ACB00", "2:3/9", ALLOCATED, "4B!", "3.1", ""),
        ],
    ),
    (
        "X14",
        "ICP DAS I-7242D manual p. 83",
        &[
            row("44C#0A100504090A0E", "2:4/9", ASKS, "10", "5.4.9", ""),
            row("44B#0A90100E", "2:3/9", ANSWERS, "10!", "5.4.9", ""),
            row("349#FFDF", "1:13/9", "cos", "", "", ""),
            row("349#FFDF", "1:13/9", "cos", "", "", ""),
        ],
    ),
    (
        "X15",
        "ICP DAS I-7242D manual p. 95",
        &[
            row("44D#0001020304050607", "2:5/9", POLLS, "", "", ""),
            row("44D#8108090A", "2:5/9", POLLS, "", "", ""),
        ],
    ),
    (
        "X16",
        "ICP DAS I-7242D manual p. 93",
        &[
            row("7ED#3F4B02", "4:45/", "comm-fault-request", "4B", "", ""),
            row("7EC#00230301000000", "4:44/", "comm-fault-response", "", "", ""),
        ],
    ),
    (
        "X17",
        "ICP DAS I-7242D manual p. 89/91; printed identifier of frame 2 corrected",
        &[
            row("44E#0A4B0301010A", "2:6/9", ALLOCATES, "4B", "3.1", ""),
            row("44B#0ACB00", "2:3/9", ALLOCATED, "4B!", "3.1", ""),
        ],
    ),
    (
        "X18",
        "ICP DAS I-7242D manual p. 101; printed identifier of frame 2 corrected",
        &[
            row("44C#0A10650101014600", "2:4/9", ASKS, "10", "65.1.1", ""),
            row("44B#0A90", "2:3/9", ANSWERS, "10!", "65.1.1", ""),
        ],
    ),
    (
        "X19",
        "Balluff LRP830 manual p. 178: a real capture",
        &[
            row("5FD#00AA060064000407", "2:5/63", POLLS, "", "", ""),
            row("5FD#41D0005200460049", "2:5/63", POLLS, "", "", ""),
            row("5FD#420044FFFF000000", "2:5/63", POLLS, "", "", ""),
            row("5FD#4300000000000000", "2:5/63", POLLS, "", "", ""),
            row("5FD#840000", "2:5/63", POLLS, "", "", ""),
            row("3FF#00AA06FFFF000000", "1:15/63", POLLED, "", "", ""),
            row("3FF#4100000000000000", "1:15/63", POLLED, "", "", ""),
            row("3FF#4200000000000000", "1:15/63", POLLED, "", "", ""),
            row("3FF#4300000000000000", "1:15/63", POLLED, "", "", ""),
            row("3FF#840000", "1:15/63", POLLED, "", "", ""),
        ],
    ),
    (
        "X20",
        "start of a Rockwell scanner, from a public Arduino sketch; no answers",
        &[
            row("407#00010092396060", "2:7/0", "dup-mac-request", "", "", ""),
            row("407#00010092396060", "2:7/0", "dup-mac-request", "", "", ""),
            row("780#024B0234", "3:6/0", "ucmm-request", "4B", "", ""),
            row("780#024B0234", "3:6/0", "ucmm-request", "4B", "", ""),
            row("416#004B03010100", "2:6/2", ALLOCATES, "4B", "3.1", ""),
            row("414#004B03010200", "2:4/2", ASKS, "4B", "3.1", "xid-busy"),
            row("414#000E010101", "2:4/2", ASKS, "0E", "1.1.1", "xid-busy"),
            row("414#000E010102", "2:4/2", ASKS, "0E", "1.1.2", "xid-busy"),
            row("414#000E010103", "2:4/2", ASKS, "0E", "1.1.3", "xid-busy"),
            row("414#000E010104", "2:4/2", ASKS, "0E", "1.1.4", "xid-busy"),
            row("414#001005010C03", "2:4/2", ASKS, "10", "5.1.C", "xid-busy"),
            row("414#00100502090001", "2:4/2", ASKS, "10", "5.2.9", "xid-busy"),
            row("414#000E050207", "2:4/2", ASKS, "0E", "5.2.7", "xid-busy"),
            row("414#000E050208", "2:4/2", ASKS, "0E", "5.2.8", "xid-busy"),
            row("415#04", "2:5/2", POLLS, "", "", ""),
        ],
    ),
    (
        "X21",
        "Rockwell AdaptaScan manual p. 12-32; identifiers filled in, body format 8/16",
        &[
            row("5FC#000ECC000014", "2:4/63", ASKS, "0E", "CC.0.14", ""),
            row("5FB#008E040030323030", "2:3/63", ANSWERS, "0E!", "CC.0.14", ""),
            row("5FC#0010CE00000B01", "2:4/63", ASKS, "10", "CE.0.B", ""),
            row("5FB#0090", "2:3/63", ANSWERS, "10!", "CE.0.B", ""),
            row("5FC#0043CB0100", "2:4/63", ASKS, "43", "CB.1", ""),
        ],
    ),
    (
        "X22",
        "test vector of another decoder: frame 3 is too short for its body format",
        &[
            row("780#054B0210", "3:6/0", "ucmm-request", "4B", "", ""),
            row("745#00CB02450200", "3:5/5", "ucmm-response", "4B!", "", ""),
            row("42C#000E010101", "2:4/5", ASKS, "0E", "", "malformed"),
            row("42D#008EAA", "2:5/5", ANSWERS, "0E!", "", ""),
            row("780#054C0200", "3:6/0", "ucmm-request", "4C", "", ""),
            row("745#00CC", "3:5/5", "ucmm-response", "4C!", "", ""),
        ],
    ),
    (
        "X23",
        "test vector of another decoder",
        &[
            row("780#054B0234", "3:6/0", "ucmm-request", "4B", "", ""),
            row("745#00CB02000200", "3:5/5", "ucmm-response", "4B!", "", ""),
            row("700#050E0100020007", "3:4/0", ASKS, "0E", "1.2.7", ""),
            row("605#008EAA", "3:0/5", ANSWERS, "0E!", "1.2.7", ""),
        ],
    ),
    (
        "X24",
        "test vectors of another decoder",
        &[
            row("457#80060008070605", "2:7/10", "dup-mac-response", "", "", "duplicate-mac"),
            row("41B#03CD010003053412", "2:3/3", "heartbeat", "4D!", ".1", "device-fault+"),
            row("41B#03CE040002000102", "2:3/3", "shutdown", "4E!", "4.2", "shutdown"),
            row("41B#0A940203", "2:3/3", ANSWERS, "14!", "", "error-response"),
        ],
    ),
    (
        "X25",
        "test vector of another decoder: body format 4, no acknowledgements",
        &[
            row("41E#0A4B0301010A", "2:6/3", ALLOCATES, "4B", "3.1", ""),
            row("41B#0ACB04", "2:3/3", ALLOCATED, "4B!", "3.1", ""),
            row("41C#8A000E0320012401", "2:4/3", ASKS, "0E", "", ""),
            row("41C#8A813001", "2:4/3", ASKS, "0E", "1.1.1", ""),
            row("41B#0A8E1507", "2:3/3", ANSWERS, "0E!", "1.1.1", ""),
        ],
    ),
    (
        "X26",
        "test vector of another decoder",
        &[row("7EF#004B010002000000", "4:47/", "offline-ownership-request", "4B", "", "")],
    ),
];

fn read(name: &str) -> Vec<Told> {
    let (_, _, rows) = EXAMPLES.iter().find(|(other, ..)| *other == name).unwrap();
    let heard: Vec<Heard> = (0..)
        .zip(rows.iter())
        .map(|(index, row)| Heard::Frame(frame_ns(index * 10_000_000, row.frame)))
        .collect();
    decode(&heard, None)
}

fn hex(told: &Told, name: &str) -> String {
    told.number(name).map_or(String::new(), |number| format!("{number:X}"))
}

#[test]
fn every_worked_frame_is_read_as_its_source_says() {
    assert_eq!(EXAMPLES.iter().map(|(.., rows)| rows.len()).sum::<usize>(), 100);
    for (name, origin, rows) in EXAMPLES {
        let told = read(name);
        assert_eq!(told.len(), rows.len(), "{name}");
        for (told, row) in told.iter().zip(rows.iter()) {
            let place =
                format!("{}:{}/{}", told.get("group"), told.get("message_id"), told.get("mac"));
            let response = if told.get("response") == "true" { "!" } else { "" };
            let service = match told.number("service_code") {
                Some(code) => format!("{code:02X}{response}"),
                None => String::new(),
            };
            let target = ["class", "instance", "attribute"].map(|key| hex(told, key)).join(".");
            let target = target.trim_end_matches('.');
            let seen = (place.as_str(), told.kind, service.as_str(), target, told.codes.join(" "));
            let wanted = (row.place, row.kind, row.service, row.target, row.codes.to_owned());
            assert_eq!(seen, wanted, "{name} ({origin}) {}: {}", row.frame, told.summary);
        }
    }
}

#[test]
fn values_and_roles_of_the_worked_frames() {
    let check = |name: &str, frame: usize, fields: &[(&str, &str)]| {
        let told = read(name);
        let told = &told[frame - 1];
        for (key, value) in fields {
            assert_eq!(told.get(key), *value, "{name} frame {frame}, {key}: {}", told.summary);
        }
    };
    check(
        "X01",
        1,
        &[("source", "1"), ("destination", "5"), ("xid", "0"), ("assumed", "body_format")],
    );
    check("X01", 2, &[("source", "5"), ("destination", "1"), ("data", "3600"), ("request", "1")]);
    check("X02", 1, &[("error.general", "8"), ("error.additional", "255"), ("assumed", "start")]);
    check("X03", 2, &[("io.data", "80FF3F"), ("request", "1"), ("assumed", "allocation")]);
    let allocation = [("allocation.choice", "3"), ("allocation.connections", "explicit poll")];
    check("X04", 1, &allocation);
    check("X04", 1, &[("allocation.allocator", "10"), ("connection", "unconnected")]);
    check("X06", 1, &[("allocation.connections", "explicit cos")]);
    // 00 00 01 00: the four bytes of the value, put together.
    check("X10", 3, &[("data", "00000001"), ("fragments", "1 3"), ("fragment.type", "last")]);
    check("X10", 4, &[("fragment.type", "ack"), ("fragment.status", "0"), ("source", "3")]);
    check("X10", 5, &[("request", "1")]);
    // 45 23 01 00 is 00012345h = 74565.
    check("X11", 3, &[("data", "45230100")]);
    check("X12", 7, &[("data", "C2050005090D0504"), ("fragments", "5 7"), ("request", "1")]);
    check("X13", 2, &[("body_format", "0"), ("connection", "unconnected"), ("request", "1")]);
    // Ten bytes, as the manual lists them.
    check("X15", 2, &[("io.data", "0102030405060708090A"), ("assumed", "allocation size")]);
    check("X15", 2, &[("fragment.type", "last"), ("fragments", "1 2")]);
    check("X16", 2, &[("vendor", "803"), ("serial", "1"), ("port", "0")]);
    check("X19", 5, &[("fragments", "1 2 3 4 5")]);
    assert_eq!(read("X19")[4].get("io.data").len(), 2 * 30);
    assert_eq!(read("X19")[9].get("io.data").len(), 2 * 30);
    check("X19", 10, &[("request", "1"), ("fragments", "6 7 8 9 10")]);
    check("X20", 1, &[("vendor", "1"), ("serial", "1616918930"), ("port", "0"), ("source", "0")]);
    check("X20", 3, &[("connection", "ucmm"), ("source", "0"), ("destination", "2")]);
    check("X22", 2, &[("body_format", "2")]);
    check("X22", 4, &[("source", "5"), ("destination", "0"), ("data", "AA"), ("request", "3")]);
    check("X24", 1, &[("vendor", "6"), ("serial", "84281096"), ("source", "10")]);
    check("X25", 5, &[("data", "1507"), ("request", "3")]);
    check("X26", 1, &[("vendor", "1"), ("serial", "2")]);
}

/// The same frames, as the file that they were collected in has them: `FIELDTAP_VECTORS` names its
/// folder.
#[test]
fn the_collected_vectors_agree() {
    let Some(folder) = std::env::var_os("FIELDTAP_VECTORS") else {
        eprintln!("skipped: FIELDTAP_VECTORS names no folder with devicenet-examples.csv");
        return;
    };
    let path = std::path::Path::new(&folder).join("devicenet-examples.csv");
    let text = std::fs::read_to_string(&path).unwrap();
    let mut places: BTreeMap<(String, usize), (String, String)> = BTreeMap::new();
    for line in text.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let [example, frame, id, _, data, group, message_id, mac, ..] = cells[..] else { panic!() };
        let place = format!("{group}:{message_id}/{mac}");
        let frame = frame.parse().unwrap();
        let text = format!("{id}#{}", data.replace(' ', ""));
        places.insert((example.to_owned(), frame), (text, place));
    }
    assert_eq!(places.len(), 100);
    for (name, _, rows) in EXAMPLES {
        for (frame, row) in (1..).zip(rows.iter()) {
            let (text, place) = &places[&((*name).to_owned(), frame)];
            assert_eq!((text.as_str(), place.as_str()), (row.frame, row.place), "{name} {frame}");
        }
    }
}
