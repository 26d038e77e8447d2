//! The sample captures: each raises the finding that its folder is named after, and every finding
//! has one.

use crate::harness::{argument, codes, fieldtap, here};
use std::collections::BTreeSet;
use std::path::PathBuf;

/// Folders of `captures/` and the files in them.
fn captures() -> Vec<(String, Vec<PathBuf>)> {
    let entries = |path: PathBuf| {
        let entries = std::fs::read_dir(path).expect("captures are there");
        let mut paths: Vec<PathBuf> =
            entries.map(|entry| entry.expect("an entry").path()).collect();
        paths.sort();
        paths
    };
    let folders = entries(here("captures")).into_iter().filter(|path| path.is_dir());
    folders
        .map(|folder| {
            let name = folder.file_name().and_then(|name| name.to_str()).expect("UTF-8").to_owned();
            (name, entries(folder))
        })
        .collect()
}

/// What a capture has to be told that nothing can find out: that a line which looks like an
/// inverted one is a swapped one, that a log has every bus cycle, that two channels are one ring.
fn options(capture: &str) -> &'static [&'static str] {
    // The project may lie anywhere.
    let capture = capture.rsplit_once("captures/").map_or(capture, |(_, inside)| inside);
    let is_line = capture.ends_with(".sr") || capture.ends_with(".vcd");
    if capture.ends_with("swapped-lines.sr") {
        &["--invert", "no"]
    } else if capture.contains("interbus") && is_line {
        &["--protocol", "interbus"]
    } else if capture.contains("data-with-service-bit") || capture.contains("unrequested") {
        &["--every-cycle"]
    } else {
        &[]
    }
}

/// Every code, as the program lists them.
fn all_codes() -> BTreeSet<String> {
    let list = fieldtap(["explain"]).good().stdout;
    // Behind an empty line there are words that are no findings.
    let findings = list.lines().take_while(|line| !line.is_empty());
    findings.map(|line| line.split(' ').next().expect("a name").to_owned()).collect()
}

#[test]
fn every_fault_is_raised_by_the_captures_of_its_folder() {
    let mut raised = BTreeSet::new();
    for (folder, files) in captures() {
        if folder.starts_with("good") || folder == "manuals" {
            continue;
        }
        let code = folder.replacen('-', ".", 1);
        for file in files {
            let read = ["read", "--format", "json", argument(&file)];
            let run = fieldtap(read.iter().chain(options(argument(&file)))).good();
            let found: BTreeSet<String> = run.records().iter().flat_map(codes).collect();
            assert!(found.contains(&code), "{}: {found:?}", file.display());
        }
        raised.insert(code);
    }
    assert_eq!(raised, all_codes());
}

#[test]
fn good_captures_have_no_finding_above_info() {
    for (folder, files) in captures() {
        if !folder.starts_with("good") && folder != "manuals" {
            continue;
        }
        // Excerpts of manuals hold what the manuals show, errors among it.
        let is_log = |file: &PathBuf| file.extension().is_some_and(|ending| ending == "log");
        for file in files.into_iter().filter(|file| folder != "manuals" || !is_log(file)) {
            let read = ["read", "--format", "json", argument(&file)];
            let run = fieldtap(read.iter().chain(options(argument(&file)))).good();
            let records = run.records();
            assert!(!records.is_empty(), "{}", file.display());
            for finding in records.iter().flat_map(|r| r["findings"].as_array().expect("an array"))
            {
                assert_eq!(finding["severity"], "info", "{}: {finding}", file.display());
            }
        }
    }
}

/// The contract's codes of these protocols, by severity.
#[test]
fn severities_are_those_of_the_contract() {
    let list = fieldtap(["explain"]).good().stdout;
    let with = |severity: &str| -> Vec<&str> {
        let findings = list.lines().take_while(|line| !line.is_empty());
        let words = findings.map(|line| line.split_whitespace().take(2).collect::<Vec<_>>());
        words.filter(|words| words[1] == severity).map(|words| words[0]).collect()
    };
    let mut errors = with("error");
    errors.sort_unstable();
    assert_eq!(
        errors,
        [
            "can.bus-off",
            "can.crc",
            "can.error-frame",
            "can.form",
            "can.stuff",
            "can.truncated",
            "devicenet.connection-timeout",
            "devicenet.device-fault",
            "devicenet.duplicate-mac",
            "devicenet.fragment-sequence",
            "devicenet.fragment-unacknowledged",
            "devicenet.malformed",
            "devicenet.no-poll-response",
            "devicenet.no-response",
            "devicenet.reserved-id",
            "devicenet.size-mismatch",
            "encoder.alarm",
            "interbus.access",
            "interbus.crc",
            "interbus.echo-mismatch",
            "interbus.error-bit",
            "interbus.magnet",
            "interbus.no-acknowledge",
            "interbus.no-release",
            "interbus.reserved-bits",
            "interbus.service-mismatch",
            "interbus.undefined-service",
            "interbus.unrequested-acknowledge",
            "interbus.value-out-of-range",
            "slin.address-mismatch",
            "slin.checksum",
            "slin.duplicate-address",
            "slin.missing-footer",
            "slin.no-response",
            "slin.parity",
            "slin.too-many-words",
            "uart.framing",
        ]
    );
    let mut infos = with("info");
    infos.sort_unstable();
    assert_eq!(
        infos,
        [
            "devicenet.delta-ignored",
            "devicenet.idle",
            "devicenet.not-allocated",
            "devicenet.unexpected-ack",
            "devicenet.xid-busy",
            "encoder.written",
            "interbus.written",
            "slin.ambiguous",
            "slin.glitch",
            "slin.never-answered",
            "slin.no-data-words"
        ]
    );
    let mut warnings = with("warning");
    warnings.sort_unstable();
    assert_eq!(
        warnings,
        [
            "can.dropped",
            "can.high-load",
            "can.not-acknowledged",
            "can.overload",
            "can.wrong-bitrate",
            "devicenet.allocation-invalid",
            "devicenet.allocation-refused",
            "devicenet.error-response",
            "devicenet.foreign-frame",
            "devicenet.fragment-rejected",
            "devicenet.fragment-retry",
            "devicenet.inhibit-violated",
            "devicenet.io-flood",
            "devicenet.io-unacknowledged",
            "devicenet.late-production",
            "devicenet.late-response",
            "devicenet.no-strobe-response",
            "devicenet.node-restart",
            "devicenet.shutdown",
            "devicenet.unsolicited-response",
            "encoder.not-settable",
            "encoder.position-out-of-range",
            "encoder.preset-while-moving",
            "encoder.turns-not-power-of-two",
            "encoder.unsaved-parameter",
            "encoder.value-out-of-range",
            "encoder.warning",
            "interbus.data-with-service-bit",
            "interbus.line",
            "interbus.position-jump",
            "interbus.repeated-write",
            "interbus.request-changed",
            "interbus.reset",
            "interbus.withdrawn",
            "slin.early-response",
            "slin.late-answer",
            "slin.late-response",
            "slin.not-slin",
            "slin.position-jump",
            "slin.reserved-bits",
            "slin.stray-data",
            "uart.break",
            "uart.lost",
            "uart.overrun",
            "uart.swapped-lines",
            "uart.wrong-parity",
            "uart.wrong-rate",
        ]
    );
}

#[test]
fn every_finding_is_explained() {
    for code in all_codes() {
        let text = fieldtap(["explain", &code]).good().stdout;
        for heading in ["The rule", "The evidence", "Likely causes", "What to do next"] {
            assert!(text.contains(heading), "{code}: {text}");
        }
    }
}

/// The wiring checks of the TR manual (§1, §3, §4, §5) stand where they are the cure.
#[test]
fn the_wiring_checks_of_the_manual_are_named() {
    let text = fieldtap(["explain", "slin.parity"]).good().stdout;
    for check in ["120 Ω", "60 Ω", "4.7 kΩ", "7 encoders", "±2 V", "1200 m", "600 m"] {
        assert!(text.contains(check), "{check}");
    }
    assert!(fieldtap(["explain", "slin.duplicate-address"]).good().stdout.contains("Ident"));
}

/// What the README shows of its first command.
#[test]
fn the_readme_shows_what_is_printed() {
    let readme = std::fs::read_to_string(here("README.md")).expect("it is there");
    let shown = readme.split("```").nth(3).expect("the second block");
    let run = fieldtap(["read", argument(&here("captures/slin-parity/one-station.pcapng"))]).good();
    let printed: Vec<&str> = run.stdout.lines().chain(run.stderr.lines()).collect();
    for line in shown.lines().filter(|line| !matches!(*line, "" | "…")) {
        assert!(printed.contains(&line), "{line}");
    }
}

/// The last lines put `of 23` behind the cure for a station: it must end in a word that takes that.
#[test]
fn cures_for_one_station_take_its_number() {
    let open = ["at", "of", "to", "from", "with", "around", "device", "station", "slave", "auto"];
    for code in dissectors::protocol::codes() {
        let last = code.cure.one.rsplit(' ').next().expect("it has a word");
        assert!(!open.contains(&last), "{}: {} of 23", code.name, code.cure.one);
    }
}
