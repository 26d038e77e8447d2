//! What a terminal shows, and what a pipe gets.

use crate::harness::{argument, fieldtap, here};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{Winsize, tcsetwinsize};
use std::fs::File;
use std::io::Read;
use std::process::{Command, Stdio};

/// What a terminal of so many columns shows of a capture.
fn shown(columns: u16, said: Option<&str>, options: &[&str]) -> Vec<String> {
    let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
    let master = openpt(flags).expect("a pseudo terminal");
    grantpt(&master).expect("it is ours");
    unlockpt(&master).expect("it opens");
    let name = ptsname(&master, Vec::new()).expect("a name").into_string().expect("UTF-8");
    let other = File::options().read(true).write(true).open(name).expect("its other side");
    let size = Winsize { ws_row: 24, ws_col: columns, ws_xpixel: 0, ws_ypixel: 0 };
    tcsetwinsize(&other, size).expect("it has a size");
    let mut command = Command::new(env!("CARGO_BIN_EXE_fieldtap"));
    command
        .args(["read", "-q", "--color", "never"])
        .args(options)
        .arg(here(CAPTURE))
        .stdin(Stdio::null());
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
    let whole = fieldtap(["read", "-q", argument(&here(CAPTURE))]).good().stdout;
    assert!(whole.contains("node 23 started anew, one written parameter was not saved"), "{whole}");
    let longest = whole.lines().map(|line| line.chars().count()).max().expect("lines");
    assert!(longest > 120 && !whole.contains('…'), "{whole}");
    for (columns, said, width) in [(100, None, 100), (80, None, 80), (200, Some("90"), 90)] {
        let shown = shown(columns, said, &[]);
        let most = shown.iter().map(|line| line.chars().count()).max();
        assert_eq!(most, Some(width), "{shown:?}");
        assert_eq!(shown.len(), whole.lines().count());
        // What was found stands there all the same, by name.
        let last = shown.iter().find(|line| line.contains(" 22 ")).expect("record 22");
        assert!(last.ends_with("; node-restart, unsaved-parameter"), "{last}");
    }
    let can = shown(100, None, &["--protocol", "can", "-v"]);
    assert!(can.len() > 22 && can.iter().all(|line| line.chars().count() <= 100), "{can:?}");
    assert_eq!(shown(300, None, &[]), whole.lines().collect::<Vec<_>>());
}
