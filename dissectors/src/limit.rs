//! Limits of judgement that the user can set, in any protocol.

use crate::protocol::{PROTOCOLS, Settings};

/// A limit that the user can set.
#[derive(Debug)]
pub struct Limit {
    /// Its name on the command line.
    pub name: &'static str,
    /// The unit of its number.
    pub unit: &'static str,
    /// What it limits.
    pub meaning: &'static str,
    /// How many of its unit a setting holds.
    pub scale: i64,
    /// The setting.
    pub place: fn(&mut Settings) -> &mut i64,
}

/// Every limit of every protocol, in the order of the list.
pub fn limits() -> impl Iterator<Item = &'static Limit> {
    PROTOCOLS.into_iter().flat_map(|protocol| protocol.limits)
}

impl Limit {
    /// A limit in ms whose setting is in ns.
    #[must_use]
    pub const fn milliseconds(
        name: &'static str,
        meaning: &'static str,
        place: fn(&mut Settings) -> &mut i64,
    ) -> Limit {
        Limit { name, unit: "ms", meaning, scale: 1_000_000, place }
    }

    /// The limit of that name.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Limit> {
        limits().find(|limit| limit.name == name)
    }

    /// Sets it to so many of its unit.
    pub fn set(&self, settings: &mut Settings, number: u32) {
        *(self.place)(settings) = i64::from(number) * self.scale;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_set_by_name_in_their_unit() {
        let mut settings = Settings::default();
        for (name, number) in
            [("late-response", 800), ("flood", 45), ("late-production", 200), ("no-release", 20)]
        {
            Limit::named(name).unwrap().set(&mut settings, number);
        }
        assert_eq!(settings.devicenet.late_response_ns, 800_000_000);
        assert_eq!(
            (settings.devicenet.flood_permille, settings.devicenet.late_production_percent),
            (450, 200)
        );
        assert_eq!(settings.interbus.no_release_ns, 20_000_000);
        assert!(Limit::named("patience").is_none());
    }

    #[test]
    fn no_two_limits_bear_the_same_name() {
        for limit in limits() {
            assert_eq!(limits().filter(|other| other.name == limit.name).count(), 1);
        }
    }
}
