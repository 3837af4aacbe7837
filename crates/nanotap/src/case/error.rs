//! Why a case has no model, a key is none, or a value cannot be read.

use super::file::CaseFileError;
use super::key::Key;
use super::quantity::QuantityError;
use crate::model::ModelError;
use crate::model::cantilever::CantileverError;

/// Why a case has no model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CaseError {
    /// Its quantities make no sense; points at the place where they were said.
    #[error(transparent)]
    Stated(#[from] Box<CaseFileError>),
    /// Its numbers make no sense, or cannot be solved in closed form.
    #[error(transparent)]
    Model(#[from] ModelError),
}

impl From<CantileverError> for CaseError {
    fn from(error: CantileverError) -> Self {
        Self::Model(error.into())
    }
}

/// A name that is no key that can vary.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoSuchKey {
    /// An unknown name.
    #[error("no parameter `{given}` here; there are {known}{hint}")]
    Unknown {
        /// What was asked for.
        given: String,
        /// What there is.
        known: String,
        /// The nearest one, as a question.
        hint: String,
    },
    /// A key that cannot vary.
    #[error("`{key}` cannot vary: {reason}")]
    Fixed {
        /// The key.
        key: Key,
        /// Why not, and what can.
        reason: &'static str,
    },
}

/// A value of a key that cannot be read.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ValueOfKeyError {
    /// Of a dimensionless case only numbers are taken.
    #[error("{text}: not a number")]
    NotANumber {
        /// What was given.
        text: String,
    },
    /// Not the quantity that the key is.
    #[error("{text}: {key}: {error}")]
    Quantity {
        /// The key.
        key: Key,
        /// What was given.
        text: String,
        /// Why.
        error: Box<QuantityError>,
    },
}

impl From<CaseError> for crate::Error {
    fn from(error: CaseError) -> Self {
        match error {
            CaseError::Stated(error) => (*error).into(),
            CaseError::Model(error) => error.into(),
        }
    }
}

impl From<NoSuchKey> for crate::Error {
    fn from(error: NoSuchKey) -> Self {
        let remedy = match &error {
            NoSuchKey::Fixed { .. } => {
                "name a quantity of the case file as section.key, as in drive.frequency"
            }
            NoSuchKey::Unknown { .. } => {
                "name a parameter of the dimensionless model, or a quantity of a physical case \
                 as section.key"
            }
        };
        Self::input(error.to_string(), remedy)
    }
}

impl From<ValueOfKeyError> for crate::Error {
    fn from(error: ValueOfKeyError) -> Self {
        Self::input(
            error.to_string(),
            "give a number, or of a physical case a quantity with its unit",
        )
    }
}
