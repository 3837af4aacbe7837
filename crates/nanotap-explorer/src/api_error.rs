//! Responses to requests that fail.

use axum::Json;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use nanotap::{Error, ErrorKind};
use serde_json::{Value, json};

/// The reason of a failed request, with the terminal's message.
#[derive(Clone, Debug)]
pub(crate) struct ApiError(Error);

impl ApiError {
    /// From any error of the library.
    pub(crate) fn of(error: impl Into<Error>) -> Self {
        Self(error.into())
    }

    /// The request is wrong; `remedy` says what would be right.
    pub(crate) fn input(message: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self(Error::input(message, remedy))
    }

    /// The request is right, but the computation failed.
    pub(crate) fn failed(message: impl Into<String>) -> Self {
        Self(Error::numerics(message))
    }

    /// The JSON that the page reads.
    pub(crate) fn json(&self) -> Value {
        json!({ "error": self.0.to_string() })
    }
}

impl From<Error> for ApiError {
    fn from(error: Error) -> Self {
        Self(error)
    }
}

impl IntoResponse for ApiError {
    fn into_response(self) -> Response {
        let status = match self.0.kind {
            ErrorKind::BadInput | ErrorKind::Numerics => StatusCode::UNPROCESSABLE_ENTITY,
            ErrorKind::Files | ErrorKind::Stopped => StatusCode::INTERNAL_SERVER_ERROR,
        };
        (status, Json(self.json())).into_response()
    }
}
