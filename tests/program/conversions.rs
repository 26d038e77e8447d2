//! Conversions: what one container holds, the next one holds too, as far as it can.

use crate::harness::{Scratch, argument, fieldtap, here};
use serde_json::Value;
use std::path::Path;

fn records(path: &Path) -> Vec<Value> {
    fieldtap(["read", "--format", "json", argument(path)]).good().records()
}

/// What a record says, apart from times, which containers hold with different resolution.
fn meaning(record: &Value) -> (Value, Value, Value, Value, Vec<String>) {
    let slin = &record["slin"];
    (
        record["kind"].clone(),
        record["station"].clone(),
        record["raw"].clone(),
        slin["position"].clone(),
        crate::harness::codes(record),
    )
}

fn same_meaning(capture: &str, ending: &str) {
    let scratch = Scratch::new();
    let original = here("captures").join(capture);
    let converted = scratch.path(&format!("converted.{ending}"));
    fieldtap(["convert", "-q", argument(&original), argument(&converted)]).good();
    let (before, after) = (records(&original), records(&converted));
    assert_eq!(before.len(), after.len(), "{capture} as {ending}");
    for (before, after) in before.iter().zip(&after) {
        assert_eq!(meaning(before), meaning(after), "{capture} as {ending}");
    }
}

#[test]
fn what_was_said_is_said_again_of_the_conversion() {
    for capture in [
        "good/tr.sr",
        "good/tr.vcd",
        "good/tr.chars",
        "good/tr-345594.pcapng",
        "slin-parity/parity.sr",
        "slin-glitch/glitch.sr",
        "uart-break/break.pcapng",
        "slin-missing-footer/missing-footer.chars",
    ] {
        same_meaning(capture, "pcapng");
        same_meaning(capture, "chars");
    }
    same_meaning("uart-lost/lost.pcapng", "pcapng");
    same_meaning("uart-overrun/overrun.pcapng", "pcapng");
    same_meaning("uart-framing/framing.sr", "pcapng");
}

/// A block's stamp is that of its first character; the others follow at the frame's length, off by
/// the stamp's ± at most.
#[test]
fn times_stay_within_their_uncertainty() {
    let scratch = Scratch::new();
    for capture in ["good/tr.sr", "good/baumer-9600.pcapng", "good/tr.chars"] {
        let original = here("captures").join(capture);
        let converted = scratch.path("converted.pcapng");
        fieldtap(["convert", "-q", argument(&original), argument(&converted)]).good();
        let (before, after) = (records(&original), records(&converted));
        assert_eq!(before.len(), after.len());
        for (before, after) in before.iter().zip(&after) {
            let number = |record: &Value, key: &str| record[key].as_i64().expect("a number");
            let off = (number(before, "time_ns") - number(after, "time_ns")).abs();
            assert!(off <= number(before, "uncertainty_ns"), "{before} {after}");
            assert_eq!(before["uncertainty_ns"], after["uncertainty_ns"]);
            assert_eq!(before["clock"], after["clock"]);
        }
    }
}

#[test]
fn our_comments_are_replaced_and_those_of_others_kept() {
    let scratch = Scratch::new();
    let (once, twice) = (scratch.path("once.pcapng"), scratch.path("twice.pcapng"));
    let capture = here("captures/slin-checksum/checksum.pcapng");
    fieldtap(["convert", "-q", argument(&capture), argument(&once)]).good();
    fieldtap(["convert", "-q", argument(&once), argument(&twice)]).good();
    let read = |path: &Path| std::fs::read(path).expect("it was written");
    assert!(read(&once) == read(&twice), "converting again changes nothing");
}

#[test]
fn what_a_form_cannot_hold_is_refused_with_a_message() {
    let scratch = Scratch::new();
    let bytes = scratch.file("capture.bin", [0x80, 0x1A, 0x01, 0x98]);
    for ending in ["pcapng", "chars"] {
        let out = scratch.path(&format!("out.{ending}"));
        let arguments = ["convert", "--input-format", "bytes", argument(&bytes), argument(&out)];
        let run = fieldtap(arguments);
        assert_eq!(run.status, 3, "{}", run.stderr);
        assert!(run.stderr.contains("no times"), "{}", run.stderr);
        assert!(!out.exists(), "half a file is no file");
    }
    let out = scratch.path("out.csv");
    fieldtap(["convert", "--input-format", "bytes", argument(&bytes), argument(&out)]).good();
    assert!(std::fs::read_to_string(out).expect("written").contains("0 answers 154"));
}

/// The records of several files are those of one stream: state goes on, numbers go on.
#[test]
fn several_sources_are_one_stream() {
    let scratch = Scratch::new();
    let text = std::fs::read_to_string(here("captures/good/baumer.chars")).expect("it is there");
    let lines: Vec<&str> = text.lines().collect();
    let (first, second) = lines[1..].split_at(101);
    let file = |name: &str, rows: &[&str]| {
        scratch.file(name, format!("{}\n{}\n", lines[0], rows.join("\n")))
    };
    let parts = [file("1.chars", first), file("2.chars", second)];
    let read = |paths: &[&Path]| {
        let files = paths.iter().map(|path| argument(path));
        fieldtap(["read", "--format", "json"].into_iter().chain(files)).good().stdout
    };
    let whole = here("captures/good/baumer.chars");
    assert!(read(&[&parts[0], &parts[1]]) == read(&[&whole]));
}

/// What is sent to the maker is one file.
#[test]
fn several_captures_become_one() {
    let scratch = Scratch::new();
    let tape = scratch.path("tape");
    let capture = here("captures/good/baumer.chars");
    let ring = ["--ring", "size=4kB", "-w", argument(&tape)];
    fieldtap(["record", "-q", argument(&capture)].into_iter().chain(ring)).good();
    let entries = std::fs::read_dir(&tape).expect("it is there");
    let mut files: Vec<_> = entries.map(|entry| entry.expect("readable").path()).collect();
    files.sort();
    assert!(files.len() > 1, "{files:?}");
    let bytes = |files: &[std::path::PathBuf]| -> Vec<Vec<u8>> {
        files.iter().map(|file| std::fs::read(file).expect("it is there")).collect()
    };
    let before = bytes(&files);
    let names = || files.iter().map(|file| argument(file));
    let one = scratch.path("all.pcapng");
    fieldtap(["convert"].into_iter().chain(names()).chain([argument(&one)])).good();
    let read = |more: &mut dyn Iterator<Item = &str>| {
        fieldtap(["read", "--format", "csv"].into_iter().chain(more)).good().stdout
    };
    assert_eq!(read(&mut [argument(&one)].into_iter()), read(&mut names()));
    // A part of it, by time.
    let part = scratch.path("part.csv");
    let cut = ["--from", "0.1", "--to", "0.2", argument(&part)];
    fieldtap(["convert"].into_iter().chain(names()).chain(cut)).good();
    let lines = |path: &Path| std::fs::read_to_string(path).expect("written").lines().count();
    assert!((2..lines(&capture)).contains(&lines(&part)), "{}", lines(&part));

    // Nothing is written over what may be meant to be read.
    let forgotten = fieldtap(["convert"].into_iter().chain(names()));
    assert!(forgotten.status == 2 && forgotten.stderr.contains("the last name is where to write"));
    let two = fieldtap(["convert", argument(&files[0]), argument(&files[1])]);
    assert_eq!(two.status, 2, "{}", two.stderr);
    assert!(bytes(&files) == before);
}

#[test]
fn what_is_there_is_lost_only_to_a_whole_conversion() {
    let scratch = Scratch::new();
    let capture = here("captures/good/tr.chars");
    let whole = std::fs::read(&capture).expect("it is there");
    let cut = scratch.file("cut.chars", &whole[..whole.len() / 2]);
    let there = scratch.file("out.csv", "precious\n");
    let kept = || std::fs::read_to_string(&there).expect("it is there") == "precious\n";
    for source in [argument(&scratch.path("absent.chars")), argument(&cut)] {
        let run = fieldtap(["convert", source, argument(&there)]);
        assert!(run.status == 3 && kept(), "{source}: {}", run.stderr);
    }
    assert!(fieldtap(["convert", argument(&cut), argument(&there)]).stderr.contains("left as it"));
    // Where nothing is, what could be decoded is better than nothing.
    let new = scratch.path("new.csv");
    assert_eq!(fieldtap(["convert", argument(&cut), argument(&new)]).status, 3);
    assert!(std::fs::read_to_string(&new).expect("it is there").lines().count() > 50);
    fieldtap(["convert", argument(&capture), argument(&there)]).good();
    assert!(!kept());
}

#[cfg(unix)]
#[test]
fn links_and_permissions_stay_as_they_are() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let scratch = Scratch::new();
    let capture = here("captures/good/tr.chars");
    let mode =
        |path: &Path| std::fs::metadata(path).expect("it is there").permissions().mode() & 0o777;
    let target = scratch.file("target.csv", "old\n");
    std::fs::set_permissions(&target, PermissionsExt::from_mode(0o640)).expect("it is ours");
    let link = scratch.path("link.csv");
    symlink(&target, &link).expect("links can be made");
    fieldtap(["convert", argument(&capture), argument(&link)]).good();
    assert!(link.is_symlink() && mode(&target) == 0o640);
    assert!(std::fs::read_to_string(&target).expect("it is there").starts_with("n,time"));
    // A new file is as readable as any that the test makes.
    let (new, usual) = (scratch.path("new.csv"), scratch.file("usual", ""));
    fieldtap(["convert", argument(&capture), argument(&new)]).good();
    assert_eq!(mode(&new), mode(&usual));
    // A device is written to, not replaced.
    let null = ["convert", argument(&capture), "/dev/null", "--output-format", "csv"];
    fieldtap(null).good();
    assert!(!std::fs::metadata("/dev/null").expect("it is there").is_file());
}

#[test]
fn what_the_tap_knows_of_parity_is_handed_on() {
    let scratch = Scratch::new();
    let capture = std::fs::read(here("captures/slin-parity/parity.pcapng")).expect("it is there");
    // The note of the interface, said of an adapter that marks whole packets.
    let (told, packet) = (b"parity=character", b"parity=packet   ");
    let at = capture.windows(told.len()).position(|part| part == told).expect("it is told");
    let mut bytes = capture;
    bytes[at..at + told.len()].copy_from_slice(packet);
    let first = scratch.file("first.pcapng", bytes);
    let second = scratch.path("second.pcapng");
    fieldtap(["convert", argument(&first), argument(&second)]).good();
    let suspects = first.clone();
    let (first, second) = (records(&first), records(&second));
    assert!(first.iter().any(|record| record.to_string().contains("suspect")));
    // Each character with a parity error is a packet of its own there.
    let original = here("captures/slin-parity/parity.pcapng");
    let plain = ["read", "--protocol", "uart", "--format", "json", argument(&original)];
    let is_bad = |record: &Value| record["uart"]["parity"] == "error";
    let bad = fieldtap(plain).good().records().iter().filter(|record| is_bad(record)).count();
    for protocol in ["slin", "uart"] {
        let run = fieldtap(["read", "--protocol", protocol, argument(&suspects)]).good();
        let open = format!(
            "parity of {bad} characters not judged (suspect: the adapter marks whole packets)"
        );
        assert!(bad > 1 && run.stderr.contains(&open), "{}", run.stderr);
        assert!(!run.stderr.contains("everything was judged"), "{}", run.stderr);
    }
    assert!(first.iter().map(meaning).eq(second.iter().map(meaning)));
    // Known of some characters only: that has no place there.
    let text = "time,byte,parity\n0.000000000,83,ok\n0.000345486,1A,unknown\n";
    let mixed = scratch.file("mixed.chars", text);
    let run = fieldtap(["convert", argument(&mixed), argument(&scratch.path("mixed.pcapng"))]);
    assert!(run.status == 3 && run.stderr.contains("parity is known of some"), "{}", run.stderr);
    let early = scratch.file("early.chars", "time,byte,parity\n-0.010000000,83,ok\n");
    let run = fieldtap(["convert", argument(&early), argument(&scratch.path("early.pcapng"))]);
    assert!(run.status == 3 && run.stderr.contains("1970"), "{}", run.stderr);
}

/// A limit on the size of files ends a conversion like a full disk, and not the program.
#[test]
fn a_file_that_has_no_room_is_not_left_behind() {
    let scratch = Scratch::new();
    let (source, output) = (here("captures/good/tr-115200.pcapng"), scratch.path("out/tr.json"));
    std::fs::create_dir(scratch.path("out")).expect("temporary directories can be made");
    let program = env!("CARGO_BIN_EXE_fieldtap");
    // Of 512 bytes, as POSIX has it, or of 1024.
    let (from, to) = (argument(&source), argument(&output));
    let command = format!("ulimit -f 4; exec {program} convert {from} {to}");
    let run = std::process::Command::new("sh").args(["-c", &command]).output();
    let run = run.expect("sh is there");
    let told = String::from_utf8(run.stderr).expect("UTF-8");
    assert_eq!(run.status.code(), Some(3), "{told}");
    assert!(told.contains("cannot be written"), "{told}");
    let left = std::fs::read_dir(scratch.path("out")).expect("it is there").count();
    assert_eq!(left, 0, "{told}");
}
