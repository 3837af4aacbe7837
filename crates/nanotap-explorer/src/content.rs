//! Files that come with a request.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde::Deserialize;

use crate::api_error::ApiError;

/// The content of a file: a text, or the bytes of any file in base64.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
pub(crate) enum Content {
    Text(String),
    Bytes { base64: String },
}

impl Content {
    pub(crate) fn bytes(&self) -> Result<Vec<u8>, ApiError> {
        match self {
            Self::Text(text) => Ok(text.as_bytes().to_vec()),
            Self::Bytes { base64 } => STANDARD.decode(base64).map_err(|error| {
                ApiError::input(format!("the file is not base64: {error}"), "send it again")
            }),
        }
    }
}
