//! What the objects of a station are called, and how their values read: by its maker, its profile,
//! or CIP.

use super::cip;
use super::eds::{Eds, Parameter};
use super::encoder::Profile;
use super::message::Target;
use core::fmt::{self, Write};

/// What is known of a station's objects: its profile, and its maker's description.
#[derive(Clone, Copy, Default)]
pub struct Names<'a> {
    /// The profile that is bound to it.
    pub profile: Option<Profile>,
    /// Its EDS.
    pub eds: Option<&'a Eds>,
}

impl<'a> Names<'a> {
    /// A class.
    #[must_use]
    pub fn class(&self, class: u16) -> Option<&'static str> {
        match self.profile {
            Some(profile) => profile.class_name(class),
            None => cip::class_name(class),
        }
    }

    /// What the attribute that a message is about is called: by its maker, its profile, or CIP.
    #[must_use]
    pub fn attribute_name(&self, target: Target) -> Option<&'a str> {
        match self.parameter(target) {
            Some(parameter) => Some(&parameter.name),
            None => self.attribute(target).map(|attribute| attribute.name),
        }
    }

    /// The value of an attribute, where its type is known and the data fits it.
    #[must_use]
    pub fn decode<'d>(&self, target: Target, data: &'d [u8]) -> Option<cip::Value<'d>> {
        match (self.attribute(target), self.parameter(target)) {
            (Some(attribute), _) => attribute.decode(data).ok(),
            (None, Some(parameter)) => parameter.kind.decode(data).ok(),
            (None, None) => None,
        }
    }

    /// Writes an attribute with its value in words.
    ///
    /// # Errors
    /// Only where `out` fails.
    pub fn say_value(
        &self,
        target: Target,
        value: cip::Value<'_>,
        out: &mut dyn Write,
    ) -> fmt::Result {
        if let Some(name) = self.attribute_name(target) {
            write!(out, "{name} ")?;
        }
        write!(out, "{}", self.in_words(target, value))
    }

    /// A value in words, where its maker, its profile or CIP has any.
    pub fn in_words<'v>(&self, target: Target, value: cip::Value<'v>) -> InWords<'a, 'v> {
        InWords { parameter: self.parameter(target), attribute: self.attribute(target), value }
    }

    fn attribute(&self, target: Target) -> Option<&'static cip::Attribute> {
        let attribute = u8::try_from(target.attribute?).ok()?;
        let (class, instance) = (target.class?, target.instance?);
        match self.profile {
            Some(profile) => profile.attribute(class, instance, attribute),
            None => cip::attribute(class, instance, attribute),
        }
    }

    fn parameter(&self, target: Target) -> Option<&'a Parameter> {
        let attribute = u8::try_from(target.attribute?).ok()?;
        self.eds?.parameter(target.class?, target.instance?, attribute)
    }
}

/// A value that is to be shown.
pub struct InWords<'a, 'v> {
    parameter: Option<&'a Parameter>,
    attribute: Option<&'static cip::Attribute>,
    value: cip::Value<'v>,
}

impl fmt::Display for InWords<'_, '_> {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.parameter, self.attribute) {
            (Some(parameter), _) => write!(out, "{}", parameter.in_words(self.value)),
            (None, Some(attribute)) => write!(out, "{}", attribute.in_words(self.value)),
            (None, None) => self.value.fmt(out),
        }
    }
}
