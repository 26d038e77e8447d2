//! `--stations FILE`: names and resolutions of stations, as TOML.
//!
//! ```toml
//! [station.3]
//! name = "slide"
//! singleturn_bits = 13
//! multiturn_bits = 12
//! direction = "ccw"
//! ```

use crate::config;
use anyhow::{Context, bail};
use dissectors::station::{Direction, MAX_POSITION_BITS, Resolution, Station, Stations};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fs;
use std::io::Read;
use std::path::Path;

/// Bytes of a file of stations that are believed.
const LONGEST_FILE: u64 = 1 << 20;

/// The highest number of a station on any bus.
const LAST_STATION: u16 = 255;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    station: BTreeMap<String, Entry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: Option<String>,
    singleturn_bits: Option<u8>,
    #[serde(default)]
    multiturn_bits: u8,
    #[serde(default)]
    direction: Turning,
}

#[derive(Deserialize, Default, Clone, Copy)]
#[serde(rename_all = "lowercase")]
enum Turning {
    /// Positions grow clockwise.
    #[default]
    Cw,
    /// Positions grow counter-clockwise.
    Ccw,
}

/// Reads a file of stations.
///
/// # Errors
/// It cannot be read, is no TOML, or says something that cannot be.
pub fn read(path: &Path) -> anyhow::Result<Stations> {
    let file = path.display();
    let mut text = String::new();
    let read = fs::File::open(path)
        .and_then(|file| file.take(LONGEST_FILE).read_to_string(&mut text))
        .with_context(|| format!("{file}: cannot be read"))?;
    if read as u64 == LONGEST_FILE {
        bail!("{file}: this is larger than any file of stations");
    }
    let parsed: File = config::parse(&text).with_context(|| format!("{file}: not understood"))?;
    let mut stations = Stations::new();
    for (number, entry) in parsed.station {
        let station = number.parse::<u16>().ok().filter(|number| *number <= LAST_STATION);
        let Some(station) = station else {
            bail!(
                "{file}: [station.{number}]: a station is a number up to {LAST_STATION}, as in \
                 [station.3]"
            );
        };
        let known = entry.known().with_context(|| format!("{file}: [station.{number}]"))?;
        stations.insert(station, known);
    }
    Ok(stations)
}

impl Entry {
    fn known(self) -> anyhow::Result<Station> {
        let direction = match self.direction {
            Turning::Cw => Direction::Clockwise,
            Turning::Ccw => Direction::CounterClockwise,
        };
        let resolution = match (self.singleturn_bits, self.multiturn_bits) {
            (None, 0) => None,
            (None, _) => bail!("multiturn_bits mean nothing without singleturn_bits"),
            (Some(single), multi) => match Resolution::new(single, multi, direction) {
                Some(resolution) => Some(resolution),
                None => bail!(
                    "{single} singleturn_bits and {multi} multiturn_bits: there must be at least \
                     one of the former and at most {MAX_POSITION_BITS} in all"
                ),
            },
        };
        Ok(Station { name: self.name, resolution })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> anyhow::Result<Stations> {
        let file = tempfile::NamedTempFile::new()?;
        fs::write(file.path(), text)?;
        read(file.path())
    }

    #[test]
    fn names_and_resolutions_are_read() {
        let stations = parse(
            "[station.3]\nname = \"slide\"\nsingleturn_bits = 13\nmultiturn_bits = 12\n\
             direction = \"ccw\"\n[station.0]\nname = \"turret\"\n",
        )
        .unwrap();
        let slide = &stations[&3];
        assert_eq!(slide.name.as_deref(), Some("slide"));
        assert_eq!(slide.resolution, Resolution::new(13, 12, Direction::CounterClockwise));
        assert_eq!(stations[&0].resolution, None);
    }

    #[test]
    fn what_cannot_be_is_said_with_its_place() {
        for (text, what) in [
            ("[station.x]\n", "a station is a number"),
            ("[station.1]\nsingleturn_bits = 20\nmultiturn_bits = 10\n", "at most 29 in all"),
            ("[station.1]\nmultiturn_bits = 12\n", "without singleturn_bits"),
            ("[station.1]\nbits = 12\n", "unknown field \"bits\""),
            ("[station.1\n", "not understood"),
        ] {
            let error = format!("{:#}", parse(text).unwrap_err());
            assert!(error.contains(what), "{text:?}: {error}");
        }
    }
}
