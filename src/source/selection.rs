//! Which channels are decoded of a source that tells them one by one.

use super::{Place, SourceError, SourceOptions};

/// Most names that are listed where another was asked for.
const MOST_TOLD: usize = 64;

/// The channels the user asked for by name; all of them if none was named.
pub struct Selection {
    options: SourceOptions,
    there: Vec<String>,
}

impl Selection {
    /// Nothing is known of the source yet.
    pub fn new(options: &SourceOptions) -> Self {
        Selection { options: options.clone(), there: Vec::new() }
    }

    /// What the user says about the source.
    pub fn options(&self) -> &SourceOptions {
        &self.options
    }

    /// Whether a channel is to be decoded. To be asked for every channel there is.
    pub fn takes(&mut self, name: &str) -> bool {
        let is_wanted = self.options.channels.iter().any(|wanted| wanted == name);
        let is_worth_telling = is_wanted || self.there.len() < MOST_TOLD;
        if is_worth_telling && !self.there.iter().any(|known| known == name) {
            self.there.push(name.to_owned());
        }
        is_wanted || self.options.channels.is_empty()
    }

    /// Whether every channel that was asked for was there. To be asked once all are known.
    ///
    /// # Errors
    /// One was not.
    pub fn check(&self, source: &str) -> Result<(), SourceError> {
        match self.options.chosen(self.there.iter().collect(), |name| name) {
            Ok(_) => Ok(()),
            Err(what) => Err(SourceError::new(source, Place::Whole, what)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_channel_that_is_not_there_is_told_with_those_that_are() {
        let channels = vec!["B".to_owned(), "C".to_owned()];
        let mut selection = Selection::new(&SourceOptions { channels, ..SourceOptions::default() });
        assert!(!selection.takes("A"));
        assert!(selection.takes("B"));
        assert_eq!(
            selection.check("x.csv").unwrap_err().to_string(),
            "x.csv: there is no channel C: there is A, B"
        );
        assert!(selection.takes("C"));
        assert!(selection.check("x.csv").is_ok());
        assert!(Selection::new(&SourceOptions::default()).takes("anything"));
    }
}
