//! Errors of cases, keys and values.

use super::file::CaseFileError;
use super::key::Key;
use super::quantity::QuantityError;
use nanotap_model::ModelError;
use nanotap_model::cantilever::CantileverError;
use nanotap_model::drive_form::RatioError;

/// Why a case has no model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CaseError {
    /// The quantities are invalid; points to their place.
    #[error(transparent)]
    Stated(#[from] Box<CaseFileError>),
    /// The numbers are invalid, or have no solution in closed form.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The tones of the drive never repeat together.
    #[error(transparent)]
    Tones(#[from] RatioError),
}

impl From<CantileverError> for CaseError {
    fn from(error: CantileverError) -> Self {
        Self::Model(error.into())
    }
}

/// How a quantity of a physical case is named.
pub(crate) const NAME_A_QUANTITY: &str =
    "name a quantity of the case file as section.key, as in drive.frequency";

/// A name that is not a key that can vary.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoSuchKey {
    /// The name is not a key of the case.
    #[error("no parameter `{given}` here: {hint}")]
    Unknown {
        /// Name as given.
        given: String,
        /// Suggestion of the most similar key, or the list of those that may be meant.
        hint: String,
    },
    /// A key that cannot vary.
    #[error("`{key}` cannot vary: {reason}")]
    Fixed {
        /// Key that cannot vary.
        key: Key,
        /// The reason, and the keys that can vary.
        reason: &'static str,
    },
}

/// Why the value of a key cannot be parsed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ValueOfKeyError {
    /// A value of a dimensionless case is not a number.
    #[error("{text}: not a number")]
    NotANumber {
        /// Value as given.
        text: String,
    },
    /// The text is not a quantity of the kind of the key.
    #[error("{text}: {key}: {error}")]
    Quantity {
        /// Key whose value was parsed.
        key: Key,
        /// Value as given.
        text: String,
        /// Error of parsing the quantity.
        error: Box<QuantityError>,
    },
    /// A number without a unit, which would be in SI, is one that no instrument has.
    #[error("{text}: {shown} without a unit; did you mean {meant}?")]
    Implausible {
        /// Value as given.
        text: String,
        /// Value in SI.
        shown: String,
        /// Value in a usual unit.
        meant: String,
    },
}

impl From<CaseError> for nanotap_error::Error {
    fn from(error: CaseError) -> Self {
        match error {
            CaseError::Stated(error) => (*error).into(),
            CaseError::Model(error) => error.into(),
            CaseError::Tones(error) => {
                let nearest = match &error {
                    RatioError::Irrational { nearest, .. } => format!(": {nearest}"),
                    _ => String::new(),
                };
                Self::input(
                    error.to_string(),
                    format!(
                        "take `bimodal`, whose two tones need no common period, or a ratio of whole \
                         numbers{nearest}"
                    ),
                )
            }
        }
    }
}

impl From<NoSuchKey> for nanotap_error::Error {
    fn from(error: NoSuchKey) -> Self {
        match error {
            NoSuchKey::Fixed { .. } => Self::input(error.to_string(), NAME_A_QUANTITY),
            NoSuchKey::Unknown { given, hint } => {
                Self::input(format!("no parameter `{given}` here"), hint)
            }
        }
    }
}

impl From<ValueOfKeyError> for nanotap_error::Error {
    fn from(error: ValueOfKeyError) -> Self {
        Self::input(
            error.to_string(),
            "give a number, or of a physical case a quantity with its unit",
        )
    }
}
