//! Wireshark's DeviceNet dissector and we agree on identifiers, duplicate MAC ID checks, and groups
//! 3 and 4, over all CAN captures of the project. Where we differ, we say why, and count it.

use crate::harness::{Scratch, argument, fieldtap, here, say};
use crate::peers::ask;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// What Wireshark shows of a frame. It dissects each for itself.
const FIELDS: [&str; 13] = [
    "can.id",
    "devicenet.grp_msg1.id",
    "devicenet.grp_msg2.id",
    "devicenet.grp_msg3.id",
    "devicenet.grp_msg4.id",
    "devicenet.src_mac_id",
    "devicenet.dest_mac_id",
    "devicenet.dup_mac_id.rr",
    "devicenet.dup_mac_id.physical_port_number",
    "devicenet.dup_mac_id.vendor",
    "devicenet.dup_mac_id.serial_number",
    "devicenet.service",
    "devicenet.invalid_can_id",
];

/// A line of Wireshark's: numbers, in decimal or hex, where there are such.
struct Theirs(Vec<Option<u64>>);

impl Theirs {
    fn of(line: &str) -> Self {
        let number = |cell: &str| match cell.strip_prefix("0x") {
            Some(hex) => u64::from_str_radix(hex, 16).ok(),
            None => cell.parse().ok(),
        };
        Theirs(line.split(',').map(number).collect())
    }

    fn get(&self, name: &str) -> Option<u64> {
        let place = FIELDS.iter().position(|field| *field == name).expect("it is asked for");
        self.0.get(place).copied().flatten()
    }

    fn group(&self) -> Option<(u64, u64)> {
        let ids = (1..=4).map(|group| (group, self.get(FIELDS[group as usize])));
        ids.into_iter().find_map(|(group, id)| Some((group, id?)))
    }
}

/// Frames of all captures, as we read them: whole ones, as each was meant on its own bus.
fn our_frames() -> Vec<Value> {
    let entries = |path: PathBuf| {
        let entries = std::fs::read_dir(path).expect("captures are there");
        let mut paths: Vec<PathBuf> = entries.map(|it| it.expect("an entry").path()).collect();
        paths.sort();
        paths
    };
    let mut frames = Vec::new();
    for file in entries(here("captures")).into_iter().filter(|it| it.is_dir()).flat_map(entries) {
        let name = file.to_str().expect("UTF-8");
        if ["/slin-", "/uart-", "/good/", "tr-slin"].iter().any(|other| name.contains(other)) {
            continue;
        }
        let read = ["read", "-q", "--protocol", "devicenet", "--format", "json", argument(&file)];
        let run = fieldtap(read);
        for line in run.stdout.lines() {
            let record: Value = serde_json::from_str(line).expect(line);
            let can = &record["can"];
            let is_whole = can["id"].is_u64() && can["error"].is_null();
            let is_good = can["original_length"].is_null() && can["crc"] != "bad";
            frames.extend((is_whole && is_good).then_some(record));
        }
    }
    frames
}

/// A frame as candump logs it, at some time.
fn logged(n: usize, record: &Value) -> String {
    let can = &record["can"];
    let id = can["id"].as_u64().expect("a number");
    let id = if can["extended"] == true { format!("{id:08X}") } else { format!("{id:03X}") };
    let data = if can["remote"] == true { "R" } else { can["data"].as_str().unwrap_or("") };
    format!("({}.{:06}) can0 {id}#{data}\n", n / 1_000, n % 1_000 * 1_000)
}

/// Why we say something else than Wireshark does, if we do.
fn difference(ours: &Value, theirs: &Theirs) -> Option<&'static str> {
    let told = &ours["devicenet"];
    let number = |name: &str| told[name].as_u64();
    let context = || format!("{ours}\n{:?}", theirs.0);
    if ours["kind"] == "foreign" {
        assert_eq!((theirs.group(), number("group")), (None, None), "{}", context());
        return None;
    }
    let id = theirs.get("can.id").expect("every frame has one");
    assert_eq!(Some(id), ours["can"]["id"].as_u64(), "{}", context());
    if id >= 0x7F0 {
        assert!(theirs.get("devicenet.invalid_can_id").is_some(), "{}", context());
        assert_eq!((number("group"), ours["kind"].as_str()), (None, Some("reserved")));
        return None;
    }
    assert_eq!(theirs.group(), number("group").zip(number("message_id")), "{}", context());
    if number("group") != Some(4) {
        assert_eq!(theirs.get("devicenet.src_mac_id"), number("mac"), "{}", context());
    }
    for (theirs_is, ours_is) in [
        ("devicenet.dup_mac_id.vendor", "vendor"),
        ("devicenet.dup_mac_id.serial_number", "serial"),
        ("devicenet.dup_mac_id.physical_port_number", "port"),
    ] {
        let value = theirs.get(theirs_is);
        let is_check = ours["kind"].as_str().is_some_and(|kind| kind.starts_with("dup-mac"));
        assert_eq!(value.is_some(), is_check, "{theirs_is}: {}", context());
        assert!(value.is_none() || value == number(ours_is), "{theirs_is}: {}", context());
    }
    if let Some(response) = theirs.get("devicenet.dup_mac_id.rr") {
        assert_eq!(response == 1, ours["kind"] == "dup-mac-response", "{}", context());
    }
    compare_roles(ours).or_else(|| compare_services(ours, theirs))
}

fn compare_roles(ours: &Value) -> Option<&'static str> {
    let told = &ours["devicenet"];
    let number = |name: &str| told[name].as_u64();
    let mac = number("mac");
    // An identifier of group 2 holds the source or the destination; Wireshark calls it the source.
    match (number("group"), number("message_id")) {
        (Some(2), Some(2 | 4 | 5 | 6)) if number("source") != mac => {
            assert_eq!(number("destination"), mac, "{ours}");
            Some("a destination taken for the source")
        }
        (Some(4), _) => None,
        _ => {
            assert_eq!(number("source"), mac, "{ours}");
            None
        }
    }
}

fn compare_services(ours: &Value, theirs: &Theirs) -> Option<&'static str> {
    let told = &ours["devicenet"];
    let number = |name: &str| told[name].as_u64();
    let group = number("group")?;
    if !matches!(group, 3 | 4) {
        // Wireshark does not look into messages of groups 1 and 2.
        assert_eq!(theirs.get("devicenet.service"), None, "{ours}");
        return told["service_code"].is_u64().then_some("a service in group 2 is not dissected");
    }
    let service = theirs.get("devicenet.service").map(|service| service & 0x7F);
    let destination = theirs.get("devicenet.dest_mac_id");
    if group == 3 {
        assert_eq!(destination, number("destination"), "{ours}");
    }
    match (service, number("service_code")) {
        (theirs, ours) if theirs == ours => None,
        // It shows services of group 4 in fields of their own.
        (None, Some(_)) if group == 4 => Some("a service in group 4 has a field of its own"),
        (one, other) => panic!("{one:?} {other:?}: {ours}"),
    }
}

#[test]
fn wireshark_and_we_agree_on_identifiers_checks_and_groups() {
    let frames = our_frames();
    let scratch = Scratch::new();
    let log: String = frames.iter().enumerate().map(|(n, it)| logged(n, it)).collect();
    let (log, capture) = (scratch.file("all.log", log), scratch.path("all.pcapng"));
    fieldtap(["convert", "-q", argument(&log), argument(&capture)]).good();
    let named = FIELDS.iter().flat_map(|field| ["-e", field]);
    let arguments = ["-r", argument(&capture), "-d", "can.subdissector,devicenet", "-T", "fields"];
    let arguments: Vec<&str> =
        arguments.into_iter().chain(["-E", "separator=,"]).chain(named).collect();
    let Some(shown) = ask("tshark", "tshark", &arguments) else { return };
    assert_eq!(shown.lines().count(), frames.len());
    let mut differences: BTreeMap<&str, usize> = BTreeMap::new();
    for (record, line) in frames.iter().zip(shown.lines()) {
        if let Some(why) = difference(record, &Theirs::of(line)) {
            *differences.entry(why).or_default() += 1;
        }
    }
    say(&format!("{} frames, different from Wireshark: {differences:?}", frames.len()));
    assert!(frames.len() > 30_000);
}
