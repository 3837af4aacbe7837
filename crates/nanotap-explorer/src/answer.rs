//! What a request is answered that cannot be met.

use axum::Json;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use nanotap::{Error, ErrorKind};
use serde_json::{Value, json};

/// Why a request was not met, in the words of the terminal.
#[derive(Clone, Debug)]
pub(crate) struct Refusal(Error);

impl Refusal {
    /// Of anything that the library refuses with.
    pub(crate) fn of(error: impl Into<Error>) -> Self {
        Self(error.into())
    }

    /// What was asked for is not right, and what would be.
    pub(crate) fn input(message: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self(Error::input(message, remedy))
    }

    /// It was right, and the computation did not succeed.
    pub(crate) fn failed(message: impl Into<String>) -> Self {
        Self(Error::numerics(message))
    }

    /// As the page reads it.
    pub(crate) fn json(&self) -> Value {
        json!({ "error": self.0.to_string() })
    }
}

impl From<Error> for Refusal {
    fn from(error: Error) -> Self {
        Self(error)
    }
}

impl IntoResponse for Refusal {
    fn into_response(self) -> Response {
        let status = match self.0.kind {
            ErrorKind::BadInput | ErrorKind::Numerics => StatusCode::UNPROCESSABLE_ENTITY,
            ErrorKind::Files | ErrorKind::Stopped => StatusCode::INTERNAL_SERVER_ERROR,
        };
        (status, Json(self.json())).into_response()
    }
}
