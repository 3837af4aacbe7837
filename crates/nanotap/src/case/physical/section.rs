//! Raw sections of a case file (key → text) read one quantity at a time.

use std::collections::BTreeMap;

use super::error::PhysicalError;
use super::quantity::Kind;
use crate::case::near_name::suggestion;

/// The keys of one section with their values as text.
pub type Section = BTreeMap<String, String>;

/// The sections of a physical case by name.
pub type Sections = BTreeMap<String, Section>;

/// One section under the keys it may have.
pub(crate) struct Reader<'a> {
    name: &'static str,
    entries: Option<&'a Section>,
}

impl<'a> Reader<'a> {
    /// The section called `name`, empty if absent; refuses keys not in `keys`.
    pub(crate) fn new(
        sections: &'a Sections,
        name: &'static str,
        keys: &[&str],
    ) -> Result<Self, PhysicalError> {
        let entries = sections.get(name);
        let unknown = entries
            .into_iter()
            .flat_map(BTreeMap::keys)
            .find(|key| !keys.contains(&key.as_str()));
        match unknown {
            None => Ok(Self { name, entries }),
            Some(key) => Err(PhysicalError::UnknownKey {
                section: name.to_owned(),
                key: key.clone(),
                suggestion: suggestion(key, keys),
            }),
        }
    }

    /// `section.key`, for messages.
    pub(crate) fn path(&self, key: &str) -> String {
        format!("{}.{key}", self.name)
    }

    /// The value of a key as text.
    pub(crate) fn text(&self, key: &str) -> Option<&'a str> {
        self.entries?.get(key).map(String::as_str)
    }

    /// A quantity in SI, any finite value.
    pub(crate) fn quantity(&self, key: &str, kind: Kind) -> Result<Option<f64>, PhysicalError> {
        self.text(key)
            .map(|text| {
                kind.parse(text).map_err(|source| PhysicalError::Quantity {
                    key: self.path(key),
                    source: Box::new(source),
                })
            })
            .transpose()
    }

    /// A quantity in SI that must be above zero.
    pub(crate) fn positive(&self, key: &str, kind: Kind) -> Result<Option<f64>, PhysicalError> {
        self.within(key, kind, |value| value > 0.0, "it must be above zero")
    }

    /// A quantity in SI that must not be negative.
    pub(crate) fn not_negative(&self, key: &str, kind: Kind) -> Result<Option<f64>, PhysicalError> {
        self.within(key, kind, |value| value >= 0.0, "it must not be negative")
    }

    /// A quantity in SI for which `allowed` holds.
    pub(crate) fn within(
        &self,
        key: &str,
        kind: Kind,
        allowed: impl Fn(f64) -> bool,
        reason: &str,
    ) -> Result<Option<f64>, PhysicalError> {
        match self.quantity(key, kind)? {
            Some(value) if !allowed(value) => Err(PhysicalError::impossible(
                self.path(key),
                self.text(key).unwrap_or_default(),
                reason,
            )),
            value => Ok(value),
        }
    }

    /// Refuses two keys that say the same thing.
    pub(crate) fn not_both(
        &self,
        first: &str,
        second: &str,
        reason: &str,
    ) -> Result<(), PhysicalError> {
        if self.text(first).is_some() && self.text(second).is_some() {
            return Err(PhysicalError::conflict(
                self.path(first),
                self.path(second),
                reason,
            ));
        }
        Ok(())
    }
}
