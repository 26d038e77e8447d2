//! A line's level over time, as the spans in which it is low.

use super::time::Ps;

/// A span of time in which the line is low.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Low {
    /// Its falling edge.
    pub from: Ps,
    /// Its rising edge.
    pub to: Ps,
}
