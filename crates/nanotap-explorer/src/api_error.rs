//! Responses to requests that fail.

use nanotap::case::CaseError;
use nanotap::case::file::CaseFileError;
use nanotap::error::ErrorPlace;
use nanotap::{Error, ErrorKind};
use serde_json::{Value, json};

use crate::answers::Outcome;

/// The reason of a failed request, with the terminal's message.
#[derive(Clone, Debug)]
pub(crate) struct ApiError {
    error: Error,
    /// The keys of the case, and the fields of the request, to correct.
    keys: Vec<String>,
}

impl ApiError {
    /// From any error of the library.
    pub(crate) fn of(error: impl Into<Error>) -> Self {
        let mut error = error.into();
        // The page has no lines of a file; and a word that was refused names its key.
        error.source = None;
        for problem in &mut error.problems {
            if let ErrorPlace::Override(written) = &problem.place {
                let twice = format!("{}: ", key_of(written));
                if let Some(rest) = problem.message.strip_prefix(&twice) {
                    problem.message = rest.to_owned();
                }
            }
        }
        let named = error
            .problems
            .iter()
            .filter_map(|problem| match &problem.place {
                ErrorPlace::Option(name) => Some(name.clone()),
                ErrorPlace::Override(written) => Some(key_of(written).to_owned()),
                _ => None,
            });
        let keys = named.collect();
        Self { error, keys }
    }

    /// The request is wrong; `remedy` says what would be right.
    pub(crate) fn input(message: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::of(Error::input(message, remedy))
    }

    /// The request is right, but the computation failed.
    pub(crate) fn failed(message: impl Into<String>) -> Self {
        Self::of(Error::numerics(message))
    }

    /// The same, about a key or a field in addition.
    pub(crate) fn about(mut self, key: &str) -> Self {
        self.keys.push(key.to_owned());
        self
    }

    /// How the request ended.
    pub(crate) const fn outcome(&self) -> Outcome {
        match self.error.kind {
            ErrorKind::BadInput | ErrorKind::Numerics => Outcome::Refused,
            ErrorKind::Files => Outcome::Failed,
            ErrorKind::Stopped => Outcome::Stopped,
        }
    }

    /// What is wrong, in words.
    pub(crate) fn message(&self) -> String {
        self.error.to_string()
    }

    /// The JSON that the page reads.
    pub(crate) fn json(&self) -> Value {
        json!({ "error": self.message(), "keys": self.keys })
    }
}

/// The key of a `key=value` word.
pub(crate) fn key_of(word: &str) -> &str {
    word.split('=').next().unwrap_or_default().trim()
}

impl From<Error> for ApiError {
    fn from(error: Error) -> Self {
        Self::of(error)
    }
}

impl From<CaseFileError> for ApiError {
    fn from(error: CaseFileError) -> Self {
        let keys = error.problems.iter().filter_map(|problem| problem.key);
        let keys: Vec<String> = keys.map(str::to_owned).collect();
        let mut of = Self::of(error);
        for key in keys {
            if !of.keys.contains(&key) {
                of.keys.push(key);
            }
        }
        of
    }
}

impl From<CaseError> for ApiError {
    fn from(error: CaseError) -> Self {
        match error {
            CaseError::Stated(error) => (*error).into(),
            error @ (CaseError::Model(_) | CaseError::Tones(_)) => Self::of(error),
        }
    }
}
