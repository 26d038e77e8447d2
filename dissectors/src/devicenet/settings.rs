//! The limits that DeviceNet traffic is judged by.

use crate::limit::Limit;

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

/// Those that the user can set.
pub static LIMITS: [Limit; 11] = [
    Limit::milliseconds("late-response", "an explicit answer is late", |it| {
        &mut it.devicenet.late_response_ns
    }),
    Limit::milliseconds("no-response", "an explicit request is given up", |it| {
        &mut it.devicenet.no_response_ns
    }),
    Limit::milliseconds("poll-response", "answers to polls are counted as slow", |it| {
        &mut it.devicenet.poll_response_ns
    }),
    Limit::milliseconds("fragment-acknowledge", "a fragment is to be acknowledged", |it| {
        &mut it.devicenet.fragment_acknowledge_ns
    }),
    Limit::milliseconds(
        "io-acknowledge",
        "a change-of-state message is to be acknowledged",
        |it| &mut it.devicenet.io_acknowledge_ns,
    ),
    Limit::milliseconds("first-timeout", "a new connection times out at the earliest", |it| {
        &mut it.devicenet.first_timeout_ns
    }),
    Limit::milliseconds("check", "a duplicate MAC ID check is over", |it| {
        &mut it.devicenet.check_ns
    }),
    Limit::milliseconds("check-spacing", "requests of one check follow each other", |it| {
        &mut it.devicenet.check_spacing_ns
    }),
    Limit::milliseconds("restart", "a node that was heard restarts when it checks", |it| {
        &mut it.devicenet.restart_ns
    }),
    Limit {
        name: "late-production",
        unit: "%",
        meaning: "of its packet rate, a production is late",
        scale: 1,
        place: |it| &mut it.devicenet.late_production_percent,
    },
    Limit {
        name: "flood",
        unit: "%",
        meaning: "of the bit rate, productions flood the bus",
        scale: 10,
        place: |it| &mut it.devicenet.flood_permille,
    },
];
