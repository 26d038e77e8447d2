//! The three outputs of one short story, compared whole: encoder 0 answers, nobody does at 5, a
//! parity error, a wrong checksum, a glitch with a late answer, a stray character, silence, a break,
//! and a cut. Its numbers: 154 is 1A 01h and 58 is 3Ah (TR SLIN §6), answers begin 200 or 250 µs
//! after the request, the late one after 1350 µs; a character takes 11 bits at 115200 Bd, 95.486 µs.

use crate::harness::{argument, fieldtap, here};

fn told(form: &str, more: &[&str]) -> String {
    let story = here("tests/program/story/story.chars");
    let arguments = ["read", "-q", "--profile", "baumer", "--baud", "115200", "--format", form];
    fieldtap(arguments.iter().chain(more).chain(&[argument(&story)])).good().stdout
}

/// Compares line by line, both ways.
fn compare(told: &str, expected: &str) {
    for (told, expected) in told.lines().zip(expected.lines()) {
        assert_eq!(told, expected);
    }
    assert_eq!(told.lines().count(), expected.lines().count());
    assert_eq!(told.ends_with('\n'), expected.ends_with('\n'));
}

#[test]
fn as_text() {
    compare(&told("text", &[]), include_str!("story/story.txt"));
}

#[test]
fn as_verbose_text() {
    compare(&told("text", &["-v"]), include_str!("story/story-verbose.txt"));
}

#[test]
fn as_csv() {
    compare(&told("csv", &[]), include_str!("story/story.csv"));
}

#[test]
fn as_json() {
    compare(&told("json", &[]), include_str!("story/story.jsonl"));
}

/// A scanner allocates an encoder, reads who it is, sets its preset, and polls it; the preset was
/// not saved when the supply fails. 4523 0100h is 74565, 0000 0020h is 536870912, vendor 01D4h is
/// 468; the poll's packet rate of 64h ms times out after four times that.
#[test]
fn a_commissioning() {
    let log = here("tests/program/story/commissioning.log");
    let told = fieldtap(["read", "-q", argument(&log)]).good().stdout;
    compare(&told, include_str!("story/commissioning.txt"));
}
