//! Requests of the page and their answers, without a server: JSON in; JSON, a file, or lines of JSON
//! out.

use serde::de::DeserializeOwned;
use serde_json::Value;

use nanotap::control::Control;

use crate::api_error::ApiError;
use crate::{Explorer, census, export, figures, law, motion, preset, study};

/// A kind of request, by how long its answer may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Work {
    /// It follows a slider: milliseconds, and a newer request replaces it.
    Short,
    /// It may take minutes.
    Long,
    /// It may take minutes, and its answer comes in lines.
    Lines,
}

/// How a request ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It was answered.
    Answered,
    /// The request cannot be answered as it is.
    Refused,
    /// It was stopped.
    Stopped,
    /// Something else failed.
    Failed,
    /// There is no such request.
    Unknown,
}

/// The answer to a request.
#[derive(Clone, Debug)]
pub struct Answer {
    /// How the request ended; the bytes of a refusal are JSON, with the reason and the keys to correct.
    pub outcome: Outcome,
    /// The media type of the bytes.
    pub kind: &'static str,
    /// The content; empty if it came in lines.
    pub bytes: Vec<u8>,
}

/// Media types.
const JSON: &str = "application/json";
const LINES: &str = "application/x-ndjson";

impl Explorer {
    /// The kind of a request; `None` if there is no such request.
    pub fn work(path: &str) -> Option<Work> {
        Some(match path {
            "/api/about" | "/api/case" | "/api/motion" | "/api/law" | "/api/figure"
            | "/api/export" => Work::Short,
            "/api/attractors" => Work::Long,
            "/api/study" => Work::Lines,
            _ => return None,
        })
    }

    /// Answers a request: its path and its body. The lines of a streamed answer go to `line`, the
    /// reason of its refusal too.
    pub fn answer(
        &self,
        path: &str,
        body: &[u8],
        control: &Control<'_>,
        line: &(dyn Fn(Value) + Sync),
    ) -> Answer {
        let answer = match path {
            "/api/about" => Ok(json(&preset::about(self))),
            "/api/case" => export::shown(self).map(|text| ("application/toml", text.into_bytes())),
            "/api/motion" => read(body)
                .and_then(|request| motion::answer(self, &request, control))
                .map(|value| json(&value)),
            "/api/law" => read(body)
                .and_then(|request| law::changes(self, &request))
                .map(|value| json(&value)),
            "/api/attractors" => read(body)
                .and_then(|request| census::listed(self, &request, control))
                .map(|value| json(&value)),
            "/api/figure" => read(body).and_then(|wish| figures::redrawn(&wish)),
            "/api/export" => read(body).and_then(|wish| export::exported(self, &wish, control)),
            "/api/study" => {
                let studied =
                    read(body).and_then(|request| study::study(self, &request, control, line));
                if let Err(refusal) = studied {
                    line(refusal.json());
                }
                Ok((LINES, Vec::new()))
            }
            _ => {
                return Answer {
                    outcome: Outcome::Unknown,
                    kind: "text/plain",
                    bytes: b"the explorer has no such page".to_vec(),
                };
            }
        };
        match answer {
            Ok((kind, bytes)) => Answer {
                outcome: Outcome::Answered,
                kind,
                bytes,
            },
            Err(refusal) => Answer {
                outcome: refusal.outcome(),
                kind: JSON,
                bytes: refusal.json().to_string().into_bytes(),
            },
        }
    }
}

fn read<T: DeserializeOwned>(body: &[u8]) -> Result<T, ApiError> {
    serde_json::from_slice(body)
        .map_err(|error| ApiError::input(format!("not a request of the page: {error}"), ""))
}

fn json(value: &Value) -> (&'static str, Vec<u8>) {
    (JSON, value.to_string().into_bytes())
}
