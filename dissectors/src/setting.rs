//! Answers to what a protocol's text leaves open, each with where it comes from.

use alloc::string::String;

/// Where an answer comes from.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Origin {
    /// The user said so.
    Given,
    /// The wire says so: with the evidence.
    Found,
    /// Neither: this is what is used where nothing decides.
    Default,
}

impl Origin {
    /// The word that statistics carry.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Origin::Given => "given",
            Origin::Found => "found",
            Origin::Default => "default",
        }
    }
}

/// A question, the answer that is used, and why.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Setting {
    /// The question: dots separate the tables it stands in, such as `crc.init`.
    pub key: &'static str,
    /// The answer; `None` while undecided.
    pub value: Option<String>,
    /// Where it comes from.
    pub origin: Origin,
    /// From what it was concluded, with the counts; or why it is not.
    pub evidence: String,
}
