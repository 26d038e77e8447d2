//! What a terminal shows, and what a pipe gets.

use crate::harness::{Scratch, argument, fieldtap, here};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{Winsize, tcsetwinsize};
use std::fs::File;
use std::io::Read;
use std::process::{Command, Stdio};

/// What a terminal of so many columns shows.
fn shown(columns: u16, said: Option<&str>, arguments: &[&str]) -> Vec<String> {
    let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
    let master = openpt(flags).expect("a pseudo terminal");
    grantpt(&master).expect("it is ours");
    unlockpt(&master).expect("it opens");
    let name = ptsname(&master, Vec::new()).expect("a name").into_string().expect("UTF-8");
    let other = File::options().read(true).write(true).open(name).expect("its other side");
    let size = Winsize { ws_row: 24, ws_col: columns, ws_xpixel: 0, ws_ypixel: 0 };
    tcsetwinsize(&other, size).expect("it has a size");
    let mut command = Command::new(env!("CARGO_BIN_EXE_fieldtap"));
    command.args(["read", "-q", "--color", "never"]).args(arguments).stdin(Stdio::null());
    match said {
        Some(said) => command.env("COLUMNS", said),
        None => command.env_remove("COLUMNS"),
    };
    let mut child = command.stdout(other).stderr(Stdio::null()).spawn().expect("it starts");
    // The child alone has the other side: once it ends, reading does.
    drop(command);
    let mut text = Vec::new();
    let _ = File::from(master).read_to_end(&mut text);
    assert!(child.wait().expect("it ends").success());
    String::from_utf8(text).expect("UTF-8").lines().map(str::to_owned).collect()
}

const CAPTURE: &str = "tests/program/story/commissioning.log";

#[test]
fn lines_are_cut_to_a_terminal_and_nowhere_else() {
    let capture = here(CAPTURE);
    let capture = argument(&capture);
    let whole = fieldtap(["read", "-q", capture]).good().stdout;
    assert!(whole.contains("node 23 started anew, one written parameter was not saved"), "{whole}");
    let longest = whole.lines().map(|line| line.chars().count()).max().expect("lines");
    assert!(longest > 120 && !whole.contains('…'), "{whole}");
    for (columns, said, width) in [(100, None, 100), (80, None, 80), (200, Some("90"), 90)] {
        let shown = shown(columns, said, &[capture]);
        let most = shown.iter().map(|line| line.chars().count()).max();
        assert_eq!(most, Some(width), "{shown:?}");
        assert_eq!(shown.len(), whole.lines().count());
        // What was found stands there all the same, by name.
        let last = shown.iter().find(|line| line.contains(" 22 ")).expect("record 22");
        assert!(last.ends_with("; node-restart, unsaved-parameter"), "{last}");
    }
    let can = shown(100, None, &["--protocol", "can", "-v", capture]);
    assert!(can.len() > 22 && can.iter().all(|line| line.chars().count() <= 100), "{can:?}");
    assert_eq!(shown(300, None, &[capture]), whole.lines().collect::<Vec<_>>());
}

#[test]
fn a_line_with_a_long_name_fits_a_terminal() {
    let scratch = Scratch::new();
    let name = "a name that is much too long for any table that a person would want to read";
    let stations = scratch.file("stations.toml", format!("[station.3]\nname = \"{name}\"\n"));
    let capture = here("captures/slin-parity/one-station.pcapng");
    let options = ["--stations", argument(&stations), argument(&capture)];
    let whole = fieldtap(["read", "-q"].iter().chain(&options)).good().stdout;
    assert!(whole.contains(name), "{whole}");
    let shown = shown(100, None, &options);
    assert_eq!(shown.len(), whole.lines().count(), "a header and a line a record");
    assert!(shown.iter().all(|line| line.chars().count() <= 100), "{shown:?}");
}
