//! What was found out instead of being told.

use dissectors::bus::Bus;
use dissectors::protocol::Conclusion;
use std::fmt;

/// What was found out about one question: for the bus, or for the stations where it is the same.
pub struct Learned {
    /// What it is about.
    pub subject: &'static str,
    /// What was concluded; `None` while undecided.
    pub value: Option<String>,
    /// The stations, each with the evidence; no station for the bus as a whole.
    pub evidence: Vec<(Option<u16>, String)>,
}

impl Learned {
    /// Everything a bus found out, stations with the same conclusion put together.
    pub fn of(bus: &Bus) -> Vec<Learned> {
        let mut all: Vec<Learned> = Vec::new();
        for Conclusion { subject, station, value, evidence } in bus.conclusions() {
            let same =
                |learned: &&mut Learned| learned.subject == subject && learned.value == value;
            match all.iter_mut().find(same) {
                Some(learned) => learned.evidence.push((station, evidence)),
                None => {
                    all.push(Learned { subject, value, evidence: vec![(station, evidence)] });
                }
            }
        }
        all
    }

    /// What was asked and answered, without the evidence.
    pub fn question(&self) -> String {
        let value = self.value.as_deref().unwrap_or("undecided");
        let stations = self.evidence.iter().filter_map(|(station, _)| *station);
        let stations: Vec<String> = stations.map(|station| station.to_string()).collect();
        let whose = if stations.is_empty() { "" } else { " for " };
        format!("{} {value}{whose}{}", self.subject, stations.join(" "))
    }
}

impl fmt::Display for Learned {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.subject, self.value.as_deref().unwrap_or("undecided"))?;
        // Stations with the same evidence stand together.
        for (index, alike) in self.evidence.chunk_by(|(_, a), (_, b)| a == b).enumerate() {
            let stations = alike.iter().filter_map(|(station, _)| *station);
            let stations: Vec<String> = stations.map(|station| station.to_string()).collect();
            match (stations.is_empty(), index) {
                (true, _) => write!(f, " ")?,
                (false, 0) => write!(f, ": {} ", stations.join(" "))?,
                (false, _) => write!(f, ", {} ", stations.join(" "))?,
            }
            write!(f, "({})", alike[0].1)?;
        }
        Ok(())
    }
}
