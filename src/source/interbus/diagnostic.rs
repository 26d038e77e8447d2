//! `interbus-diagnostic`: diagnostic registers and host messages.

use super::super::outbox::{Outbox, Reader};
use super::super::{Input, Place, SourceError, SourceOptions};

/// A source of this format.
pub struct Registers {}

impl Registers {
    /// Reads this input.
    ///
    /// # Errors
    /// It is not read yet.
    pub fn new(input: Input, _: &SourceOptions) -> Result<Self, SourceError> {
        Err(SourceError::new(&input.name, Place::Whole, "this format is not read yet"))
    }
}

impl Reader for Registers {
    fn read_on(&mut self, _: &mut Outbox) -> Result<bool, SourceError> {
        Ok(false)
    }
}
