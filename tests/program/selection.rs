//! Which records are shown, and how: times, counts, changes, columns, stations.

use crate::harness::{Scratch, argument, fieldtap_fed};

/// Three exchanges with a Baumer encoder 3, one a second, positions 154, 154 and 155. Sums: 1A + 01
/// = 1Bh and 1B + 01 = 1Ch; bits 4 to 6 of both are 1.
fn capture() -> String {
    let mut text = "time,byte,parity\n".to_owned();
    for (second, low) in [(1, 0x1A), (2, 0x1A), (3, 0x1B)] {
        for (ns, byte) in [(0, 0x83), (345_486, low), (440_972, 0x01), (536_458, 0x9B)] {
            text += &format!("{second}.{ns:09},{byte:02X},ok\n");
        }
    }
    text
}

fn numbers(options: &[&str]) -> Vec<i64> {
    let arguments = ["read", "--format", "json", "-"].into_iter().chain(options.iter().copied());
    let records = fieldtap_fed(arguments, capture().as_bytes()).good().records();
    records.iter().map(|record| record["n"].as_i64().expect("records are numbered")).collect()
}

#[test]
fn records_keep_their_numbers_whatever_is_selected() {
    assert_eq!(numbers(&[]), [1, 2, 3, 4, 5, 6]);
    assert_eq!(numbers(&["--from", "2"]), [3, 4, 5, 6]);
    assert_eq!(numbers(&["--from", "2", "--to", "2.0001"]), [3]);
    assert_eq!(numbers(&["--count", "4"]), [1, 2, 3, 4]);
    assert_eq!(numbers(&["--changes"]), [2, 6]);
}

#[test]
fn columns_are_fields_by_name() {
    let run = fieldtap_fed(
        ["read", "--format", "csv", "-e", "slin.address", "-e", "slin.position", "-e", "raw", "-"],
        capture().as_bytes(),
    );
    assert_eq!(
        run.good().stdout,
        "slin.address,slin.position,raw\n3,,83\n3,154,1A019B\n3,,83\n3,154,1A019B\n3,,83\n\
         3,155,1B019B\n"
    );
    let wrong = fieldtap_fed(["read", "--format", "csv", "-e", "slin.shoe", "-"], b"");
    assert!(wrong.status == 2 && wrong.stderr.contains("slin.shoe"), "{}", wrong.stderr);
}

#[test]
fn stations_have_names_and_angles() {
    let scratch = Scratch::new();
    // 154 of 128 steps a turn: one turn and 26 steps, 26 / 128 * 360° = 73.125°.
    let stations = scratch.file(
        "stations.toml",
        "[station.3]\nname = \"slide\"\nsingleturn_bits = 7\nmultiturn_bits = 5\n",
    );
    let run = fieldtap_fed(
        ["read", "--format", "json", "--stations", argument(&stations), "-"],
        capture().as_bytes(),
    );
    let answer = &run.good().records()[1];
    let slin = &answer["slin"];
    assert_eq!((&slin["turns"], &slin["angle"]), (&1.into(), &73.125.into()));
    assert_eq!(slin["name"], "slide");
    assert_eq!(answer["summary"], "3 (slide) answers 154 = 1 turn 73.125° in 250 µs");
    let absent = fieldtap_fed(["read", "--stations", "/absent.toml", "-"], b"");
    assert!(absent.status == 2 && absent.stderr.contains("/absent.toml"), "{}", absent.stderr);
}

#[test]
fn names_from_outside_steer_no_terminal_and_no_spreadsheet() {
    let scratch = Scratch::new();
    let stations = scratch.file("stations.toml", "[station.3]\nname = \"=1+\\u001B[2J\"\n");
    let read = |form: &str, more: &[&str]| {
        let fixed = ["read", "--stations", argument(&stations), "--format", form, "-"];
        fieldtap_fed(fixed.iter().chain(more), capture().as_bytes()).good().stdout
    };
    assert!(!read("text", &[]).contains('\u{1B}'));
    assert!(read("csv", &["-e", "slin.name"]).contains("'=1+"));
}

#[test]
fn colour_is_for_severities_and_only_where_it_is_wanted() {
    let late = "time,byte,parity\n0.000000000,80,ok\n0.001445486,1A,ok\n0.001540972,01,ok\n\
                0.001636458,98,ok\n";
    let read = |when: &str| {
        fieldtap_fed(["read", "--profile", "baumer", "--color", when, "-"], late.as_bytes()).stdout
    };
    assert!(read("always").contains("\u{1B}[33m") && !read("auto").contains('\u{1B}'));
    assert!(!read("never").contains('\u{1B}'));
}
