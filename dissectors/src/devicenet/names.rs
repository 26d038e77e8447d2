//! What the numbers of CIP are called: the one place where messages look up names.

/// A service of a class.
#[must_use]
pub fn service(_code: u8, _class: Option<u16>) -> Option<&'static str> {
    None
}

/// A class.
#[must_use]
pub fn class(_class: u16) -> Option<&'static str> {
    None
}

/// An attribute of a class.
#[must_use]
pub fn attribute(_class: u16, _attribute: u16) -> Option<&'static str> {
    None
}

/// A general status code.
#[must_use]
pub fn status(_general: u8) -> Option<&'static str> {
    None
}
