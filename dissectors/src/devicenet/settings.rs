//! The limits that DeviceNet traffic is judged by.

/// Limits; the defaults are those of the specification, or of the devices where it has none.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Settings {
    /// An explicit answer is late after this, in ns.
    pub late_response_ns: i64,
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
    pub flood_permille: u64,
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
