//! Faults as they are ordered: `parity`, `parity=0.01`, `parity@3=0.01`.

use clap::ValueEnum;
use std::fmt;
use std::str::FromStr;

/// The probability of a fault that is ordered without one.
const PROBABILITY: f64 = 0.01;

/// Something that can go wrong, named after the finding that it must raise.
pub trait Orderable: ValueEnum + PartialEq + Copy {
    /// Whether it is there all the time or not at all: no station, no probability.
    fn is_without_probability(self) -> bool;

    /// A station of the bus, as it is written behind the `@`.
    ///
    /// # Errors
    /// There is no such station; the reason in words.
    fn station(text: &str) -> Result<u8, String>;

    /// Its name.
    fn name(self) -> String {
        self.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default()
    }

    /// What happens.
    fn meaning(self) -> String {
        let value = self.to_possible_value();
        value.and_then(|value| value.get_help().map(ToString::to_string)).unwrap_or_default()
    }
}

/// A fault that was ordered.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Order<F> {
    /// Which.
    pub fault: F,
    /// Whom it strikes; everybody if not given.
    pub station: Option<u8>,
    /// How likely it strikes when it can.
    pub probability: f64,
}

impl<F: Orderable> fmt::Display for Order<F> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.fault.name())?;
        if let Some(station) = self.station {
            write!(f, "@{station}")?;
        }
        if self.fault.is_without_probability() {
            Ok(())
        } else {
            write!(f, "={}", self.probability)
        }
    }
}

impl<F: Orderable> FromStr for Order<F> {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (place, probability) = match text.split_once('=') {
            Some((place, probability)) => (place, Some(probability)),
            None => (text, None),
        };
        let (name, station) = match place.split_once('@') {
            Some((name, station)) => (name, Some(station)),
            None => (place, None),
        };
        let fault = F::from_str(name, false)
            .map_err(|_| format!("no fault is named {name}: see --list-faults"))?;
        if fault.is_without_probability() && (probability.is_some() || station.is_some()) {
            return Err(format!("{name} is there all the time: no address, no probability"));
        }
        let station = station.map(F::station).transpose()?;
        let probability = match probability.map(str::parse) {
            None => PROBABILITY,
            Some(Ok(probability)) if (0.0..=1.0).contains(&probability) => probability,
            Some(_) => return Err("a probability is a number from 0 to 1".to_owned()),
        };
        Ok(Order { fault, station, probability })
    }
}
