//! The limits that DeviceNet traffic is judged by.

/// Limits; the defaults are those of the specification, or of the devices where it has none.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Settings {
    /// An explicit answer is late after this, in ns.
    pub late_response_ns: i64,
    /// Masters reckon with an answer to a poll within this, in ns: counted, not judged.
    pub poll_response_ns: i64,
    /// An explicit request is given up after this, in ns.
    pub no_response_ns: i64,
    /// A fragment is to be acknowledged within this, in ns; then it is sent once more.
    pub fragment_acknowledge_ns: i64,
    /// A change-of-state or cyclic message is to be acknowledged within this, in ns, where the
    /// slave's own timer (class 2Bh attribute 1) was not read. Devices come with 16 to 24 ms.
    pub io_acknowledge_ns: i64,
    /// A production is late after so many percent of its expected packet rate.
    pub late_production_percent: i64,
    /// Change-of-state and cyclic messages flood the bus above this, in permille of its rate.
    pub flood_permille: i64,
    /// A duplicate MAC ID check is over after this, in ns.
    pub check_ns: i64,
    /// Requests of one check follow each other within this, in ns.
    pub check_spacing_ns: i64,
    /// A node that was heard within this, in ns, restarts when it checks its MAC ID.
    pub restart_ns: i64,
    /// A slave whose rate was just set may be left out of its master's strobe for this long, in ns.
    pub settle_ns: i64,
    /// A connection times out after this at the earliest while it waits for its first message, in
    /// ns.
    pub first_timeout_ns: i64,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            late_response_ns: 500_000_000,
            no_response_ns: 1_000_000_000,
            poll_response_ns: 2_000_000,
            fragment_acknowledge_ns: 1_000_000_000,
            io_acknowledge_ns: 24_000_000,
            late_production_percent: 150,
            flood_permille: 300,
            check_ns: 1_000_000_000,
            check_spacing_ns: 1_500_000_000,
            restart_ns: 10_000_000_000,
            settle_ns: 2_000_000,
            first_timeout_ns: 10_000_000_000,
        }
    }
}

/// A limit that the user can set.
#[derive(Debug)]
pub struct Limit {
    /// Its name on the command line.
    pub name: &'static str,
    /// The unit of its number.
    pub unit: &'static str,
    /// What it limits.
    pub meaning: &'static str,
    /// How many of the unit a setting holds.
    scale: i64,
    place: fn(&mut Settings) -> &mut i64,
}

/// All of them.
pub static LIMITS: [Limit; 11] = [
    milliseconds("late-response", "an explicit answer is late", |it| &mut it.late_response_ns),
    milliseconds("no-response", "an explicit request is given up", |it| &mut it.no_response_ns),
    milliseconds("poll-response", "answers to polls are counted as slow", |it| {
        &mut it.poll_response_ns
    }),
    milliseconds("fragment-acknowledge", "a fragment is to be acknowledged", |it| {
        &mut it.fragment_acknowledge_ns
    }),
    milliseconds("io-acknowledge", "a change-of-state message is to be acknowledged", |it| {
        &mut it.io_acknowledge_ns
    }),
    milliseconds("first-timeout", "a new connection times out at the earliest", |it| {
        &mut it.first_timeout_ns
    }),
    milliseconds("check", "a duplicate MAC ID check is over", |it| &mut it.check_ns),
    milliseconds("check-spacing", "requests of one check follow each other", |it| {
        &mut it.check_spacing_ns
    }),
    milliseconds("restart", "a node that was heard restarts when it checks", |it| {
        &mut it.restart_ns
    }),
    Limit {
        name: "late-production",
        unit: "%",
        meaning: "of its packet rate, a production is late",
        scale: 1,
        place: |it| &mut it.late_production_percent,
    },
    Limit {
        name: "flood",
        unit: "%",
        meaning: "of the bit rate, productions flood the bus",
        scale: 10,
        place: |it| &mut it.flood_permille,
    },
];

const fn milliseconds(
    name: &'static str,
    meaning: &'static str,
    place: fn(&mut Settings) -> &mut i64,
) -> Limit {
    Limit { name, unit: "ms", meaning, scale: 1_000_000, place }
}

impl Limit {
    /// The limit of that name.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Limit> {
        LIMITS.iter().find(|limit| limit.name == name)
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
        for (name, number) in [("late-response", 800), ("flood", 45), ("late-production", 200)] {
            Limit::named(name).unwrap().set(&mut settings, number);
        }
        assert_eq!(settings.late_response_ns, 800_000_000);
        assert_eq!((settings.flood_permille, settings.late_production_percent), (450, 200));
        assert!(Limit::named("patience").is_none());
    }
}
