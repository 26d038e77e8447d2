//! WHO: who is there?

use crate::tally::{StationTally, Tally};
use std::collections::BTreeMap;
use std::fmt::Write;

pub fn who(tally: &Tally, several: bool) -> String {
    let mut buses: BTreeMap<&str, Vec<&StationTally>> = BTreeMap::new();
    for station in &tally.stations {
        buses.entry(&station.bus).or_default().push(station);
    }
    if buses.is_empty() {
        let heard: Vec<String> = tally.heard().map(|station| station.to_string()).collect();
        return match heard.is_empty() {
            true => "no stations".to_owned(),
            false => format!("heard {}", heard.join(" ")),
        };
    }
    let texts = buses.into_iter().map(|(bus, mut stations)| {
        stations.sort_by_key(|station| station.station);
        let name = if several { format!("{bus} ") } else { String::new() };
        name + &who_of(&stations)
    });
    texts.collect::<Vec<_>>().join("; ")
}

fn who_of(stations: &[&StationTally]) -> String {
    let numbers = |is_one: &dyn Fn(&StationTally) -> bool| {
        let chosen = stations.iter().filter(|station| is_one(station));
        let numbers: Vec<String> = chosen.map(|station| station.station.to_string()).collect();
        if numbers.is_empty() { "nobody".to_owned() } else { numbers.join(" ") }
    };
    let mut text = format!(
        "asked {} | answered {}",
        numbers(&|station| station.asked > 0),
        numbers(&|station| station.answered > 0)
    );
    let silent: Vec<String> = stations
        .iter()
        .filter(|station| station.asked > 0 && station.answered == 0)
        .map(|station| format!("{} (0 of {})", station.station, station.asked))
        .collect();
    if !silent.is_empty() {
        let _ = write!(text, " | never {}", silent.join(" "));
    }
    let unasked = numbers(&|station| station.asked == 0 && station.answers > 0);
    if unasked != "nobody" {
        let _ = write!(text, " | unasked {unasked}");
    }
    let heard = numbers(&|station| station.asked == 0 && station.answers == 0);
    if heard != "nobody" {
        let _ = write!(text, " | heard {heard}");
    }
    text
}
