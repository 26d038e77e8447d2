//! Encoders as a technician meets them: station 23, bound to Baumer's profile. 4BCh asks it, 4BBh
//! answers; the first byte says which master it is.

use crate::bus::{Told, decode_with, script};
use fieldtap_dissectors::devicenet::encoder::Profile;
use fieldtap_dissectors::protocol::Settings;

fn encoder() -> Settings {
    Settings { devices: [(23, Profile::BaumerEncoder)].into(), ..Settings::default() }
}

fn read(settings: Settings, lines: &[(f64, &str)]) -> Vec<Told> {
    decode_with(settings, &script(lines), None)
}

#[test]
fn a_write_is_told_whoever_asks_meanwhile() {
    let told = read(
        encoder(),
        &[
            (0.0, "4BC#00102F010301"),
            (1.0, "4BC#3F0E2F0103"),
            (2.0, "4BB#0090"),
            (3.0, "4BB#3F8E01"),
        ],
    );
    assert_eq!(told[2].codes, ["encoder.written"]);
    assert_eq!(told[2].messages, ["0 set Sense of rotation to 1, not saved yet"]);
}

#[test]
fn the_assembly_that_is_selected_is_saved_at_once() {
    // Manual §6: the path of class 5, attribute 14. Nine bytes go in two fragments.
    let told = read(
        encoder(),
        &[
            (0.0, "4BC#80001005020E2004"),
            (1.0, "4BB#80C000"),
            (2.0, "4BC#80812402"),
            (3.0, "4BB#80C100"),
            (4.0, "4BB#0090"),
        ],
    );
    assert_eq!(told[4].messages, ["0 set Produced connection path to assembly 2, saved at once"]);
}
