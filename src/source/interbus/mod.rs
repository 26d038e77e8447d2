//! Logs of an INTERBUS ring, as controllers, masters and commissioning tools write them.

pub mod diagnostic;
pub mod identification;
pub mod log;

/// How the user says that a log is written.
#[derive(Clone, Default, Debug)]
pub struct Layout {}
