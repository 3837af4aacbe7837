//! Errors of physical cases.

use crate::key::Key;
use nanotap_model::cantilever::CantileverError;

/// Why a physical case is invalid.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PhysicalError {
    /// A quantity with an impossible value.
    #[error("{key} = {value}: {reason}")]
    Impossible {
        /// Key with the impossible value.
        key: Key,
        /// The value as given, or as computed where it was not given.
        value: String,
        /// What is wrong and which values are valid.
        reason: String,
    },
    /// A quantity that is needed is missing.
    #[error("{key} is missing: {reason}")]
    Missing {
        /// Key that is missing.
        key: Key,
        /// Why the quantity is needed, and its alternatives.
        reason: String,
    },
    /// A lever or material that is not in the catalogue.
    #[error("{key} = \"{name}\": no such {what} in the catalogue; {suggestion}")]
    UnknownName {
        /// Key of the name.
        key: Key,
        /// Name of the lever or material, as given.
        name: String,
        /// Kind of the entry: "lever" or "material".
        what: &'static str,
        /// The nearest name, or all of them.
        suggestion: String,
    },
    /// A dimensionless parameter outside its range, with the quantity that causes it.
    #[error("{}{error}", match .key {
        Some((key, value)) => format!("{key} = {value} makes "),
        None => "this physical case gives ".to_owned(),
    })]
    Model {
        /// The key that was stated, and its value.
        key: Option<(Key, String)>,
        /// What is wrong with the parameter.
        error: CantileverError,
    },
}

impl From<CantileverError> for PhysicalError {
    fn from(error: CantileverError) -> Self {
        Self::Model { key: None, error }
    }
}

impl PhysicalError {
    /// An impossible value with its reason.
    pub(crate) fn impossible(
        key: Key,
        value: impl Into<String>,
        reason: impl Into<String>,
    ) -> Self {
        Self::Impossible {
            key,
            value: value.into(),
            reason: reason.into(),
        }
    }

    /// A missing key with what it is needed for.
    pub(crate) fn missing(key: Key, reason: impl Into<String>) -> Self {
        Self::Missing {
            key,
            reason: reason.into(),
        }
    }

    /// The key to correct, if it is a single one.
    pub fn key(&self) -> Option<Key> {
        match self {
            Self::Impossible { key, .. }
            | Self::Missing { key, .. }
            | Self::UnknownName { key, .. } => Some(*key),
            Self::Model { key, .. } => key.as_ref().map(|(key, _)| *key),
        }
    }
}
