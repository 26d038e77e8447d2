//! What the numbers of a message are called: the one place where messages ask the tables.

use super::cip;
use super::message::Target;

/// A service of a class.
#[must_use]
pub fn service(code: u8, class: Option<u16>) -> Option<&'static str> {
    cip::service_name(code, class)
}

/// A service of the unconnected ports, and what a node says unasked.
#[must_use]
pub const fn unconnected_service(code: u8) -> Option<&'static str> {
    cip::unconnected_service_name(code)
}

/// A class.
#[must_use]
pub fn class(class: u16) -> Option<&'static str> {
    cip::class_name(class)
}

/// The attribute that a message is about.
#[must_use]
pub fn attribute(target: Target) -> Option<&'static cip::Attribute> {
    let attribute = u8::try_from(target.attribute?).ok()?;
    cip::attribute(target.class?, target.instance?, attribute)
}

/// A general status code.
#[must_use]
pub fn status(general: u8) -> &'static str {
    cip::status_name(general)
}
