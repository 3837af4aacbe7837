//! Why a physical case is refused.

use super::catalogue::CatalogueError;
use super::quantity::QuantityError;
use crate::model::cantilever::CantileverError;

/// A physical case that cannot be resolved. Keys are written `section.key`, as in a case file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PhysicalError {
    /// A section that physical cases do not have.
    #[error("unknown section [{section}]: {suggestion}")]
    UnknownSection {
        /// The section's name.
        section: String,
        /// The nearest valid name, or all of them.
        suggestion: String,
    },
    /// A key that the section does not have.
    #[error("unknown key {section}.{key}: {suggestion}")]
    UnknownKey {
        /// The section's name.
        section: String,
        /// The key.
        key: String,
        /// The nearest valid key, or all of them.
        suggestion: String,
    },
    /// A text that is not the quantity it should be.
    #[error("{key}: {source}")]
    Quantity {
        /// `section.key`.
        key: String,
        /// What was expected and what was given.
        source: Box<QuantityError>,
    },
    /// A quantity with an impossible value.
    #[error("{key} = {value}: {reason}")]
    Impossible {
        /// `section.key`.
        key: String,
        /// The value as given, or as computed where it was not given.
        value: String,
        /// What is wrong and what would be right.
        reason: String,
    },
    /// A quantity that cannot be done without.
    #[error("{key} is missing: {reason}")]
    Missing {
        /// `section.key`.
        key: String,
        /// What it is needed for, and what else would do.
        reason: String,
    },
    /// The same thing said twice.
    #[error("{first} and {second} cannot both be given: {reason}")]
    Conflict {
        /// `section.key`.
        first: String,
        /// `section.key`.
        second: String,
        /// Why not.
        reason: String,
    },
    /// A lever or a material that the catalogue does not have.
    #[error("{key} = \"{name}\": no such {what} in the catalogue; {suggestion}")]
    UnknownName {
        /// `section.key`.
        key: String,
        /// The name given.
        name: String,
        /// "lever" or "material".
        what: &'static str,
        /// The nearest name, or all of them.
        suggestion: String,
    },
    /// The catalogue itself is faulty.
    #[error(transparent)]
    Catalogue(#[from] CatalogueError),
    /// Dimensionless parameters beyond what the model takes.
    #[error("this physical case gives {0}")]
    Case(#[from] CantileverError),
}

impl PhysicalError {
    /// An impossible value with its reason.
    pub(crate) fn impossible(
        key: impl Into<String>,
        value: impl Into<String>,
        reason: impl Into<String>,
    ) -> Self {
        Self::Impossible {
            key: key.into(),
            value: value.into(),
            reason: reason.into(),
        }
    }

    /// A missing key with what it is needed for.
    pub(crate) fn missing(key: impl Into<String>, reason: impl Into<String>) -> Self {
        Self::Missing {
            key: key.into(),
            reason: reason.into(),
        }
    }

    /// Two keys that say the same thing.
    pub(crate) fn conflict(
        first: impl Into<String>,
        second: impl Into<String>,
        reason: impl Into<String>,
    ) -> Self {
        Self::Conflict {
            first: first.into(),
            second: second.into(),
            reason: reason.into(),
        }
    }

    /// The `section.key` that the user should look at, if it is one.
    pub fn key(&self) -> Option<String> {
        match self {
            Self::UnknownKey { section, key, .. } => Some(format!("{section}.{key}")),
            Self::Quantity { key, .. }
            | Self::Impossible { key, .. }
            | Self::Missing { key, .. }
            | Self::UnknownName { key, .. } => Some(key.clone()),
            Self::Conflict { first, .. } => Some(first.clone()),
            Self::UnknownSection { .. } | Self::Catalogue(_) | Self::Case(_) => None,
        }
    }
}
