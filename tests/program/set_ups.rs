//! A tap that is set up wrongly: the cause is named once, with its evidence, and comes first.

use crate::harness::{argument, codes, fieldtap, here};

const CAUSES: [&str; 3] = ["uart.swapped-lines", "uart.wrong-parity", "uart.wrong-rate"];

/// The set-up causes that are told of a capture read with these options, and the line WRONG.
fn causes(capture: &str, options: &[&str]) -> (Vec<String>, String) {
    let capture = here("captures/good").join(capture);
    let run =
        fieldtap(["read", "--format", "json", argument(&capture)].iter().chain(options)).good();
    let mut told: Vec<String> = run.records().iter().flat_map(codes).collect();
    told.retain(|code| CAUSES.contains(&code.as_str()));
    let wrong = run.stderr.lines().find(|line| line.starts_with("WRONG")).expect("it is there");
    (told, wrong.to_owned())
}

#[test]
fn the_cause_is_named_once_and_first() {
    for (capture, options, cause) in [
        ("tr.sr", &["--baud", "9600"][..], "uart.wrong-rate"),
        ("tr.sr", &["--baud", "57600"], "uart.wrong-rate"),
        ("tr-115200.pcapng", &["--baud", "9600"], "uart.wrong-rate"),
        ("tr.sr", &["--baud", "230400"], "uart.wrong-rate"),
        ("tr.sr", &["--baud", "19200", "--frame", "8E1", "--invert", "no"], "uart.wrong-rate"),
        ("tr.sr", &["--frame", "8O1"], "uart.wrong-parity"),
        ("tr.sr", &["--frame", "8N1"], "uart.wrong-parity"),
        ("tr.sr", &["--baud", "115200", "--frame", "8O1", "--invert", "no"], "uart.wrong-parity"),
        ("tr.sr", &["--invert", "yes"], "uart.swapped-lines"),
        ("inverted.sr", &["--invert", "no"], "uart.swapped-lines"),
    ] {
        let (told, wrong) = causes(capture, options);
        assert_eq!(told, [cause], "{capture} {options:?}");
        let short = cause.rsplit('.').next().expect("a name");
        assert!(wrong.starts_with(&format!("WRONG  1 x {short}")), "{wrong}");
    }
}

#[test]
fn right_settings_are_not_doubted() {
    for (capture, options) in [
        ("tr.sr", &["--baud", "115200", "--frame", "8E1", "--invert", "no"][..]),
        ("tr.sr", &["--baud", "115200"]),
        ("inverted.sr", &["--invert", "yes"]),
        ("tr-345594.sr", &["--baud", "345600"]),
        ("tr-115200.pcapng", &["--baud", "115200"]),
        ("tr.vcd", &["--frame", "8E1"]),
    ] {
        assert_eq!(causes(capture, options).0, [""; 0], "{capture} {options:?}");
    }
}

#[test]
fn another_profile_is_no_other_protocol() {
    let capture = here("captures/good/tr.sr");
    let run = fieldtap(["stats", argument(&capture), "--profile", "baumer"]).good();
    assert!(run.stderr.contains("x missing-footer"), "{}", run.stderr);
    assert!(run.stderr.contains("-> leave out --profile if it was given"), "{}", run.stderr);
}
