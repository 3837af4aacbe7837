//! Requests of the page and their answers, without a server: JSON in; JSON, a file, or lines of JSON
//! out.

use serde::de::DeserializeOwned;
use serde_json::Value;

use nanotap::control::Control;

use crate::api_error::ApiError;
use crate::{
    Explorer, census, choice, curve, export, figures, force, law, motion, open, preset, states,
    study, upset,
};

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

/// Takes the lines of a streamed answer.
type Line<'a> = &'a (dyn Fn(Value) + Sync);
/// The media type and the content of an answer.
type Content = (&'static str, Vec<u8>);

/// A request that the page may send.
struct Request {
    path: &'static str,
    work: Work,
    answer: fn(&Explorer, &[u8], &Control<'_>, Line<'_>) -> Result<Content, ApiError>,
}

const REQUESTS: [Request; 15] = [
    Request {
        path: "/api/about",
        work: Work::Short,
        answer: |explorer, _, _, _| Ok(json(&preset::about(explorer))),
    },
    Request {
        path: "/api/case",
        work: Work::Short,
        answer: |explorer, _, _, _| Ok(("application/toml", export::shown(explorer)?.into_bytes())),
    },
    Request {
        path: "/api/open",
        work: Work::Short,
        answer: |_, body, _, _| Ok(("application/toml", open::opened(&read(body)?)?.into_bytes())),
    },
    Request {
        path: "/api/motion",
        work: Work::Short,
        answer: |explorer, body, control, _| {
            Ok(json(&motion::answer(explorer, &read(body)?, control)?))
        },
    },
    Request {
        path: "/api/law",
        work: Work::Short,
        answer: |explorer, body, _, _| Ok(json(&law::changes(explorer, &read(body)?)?)),
    },
    Request {
        path: "/api/force",
        work: Work::Short,
        answer: |explorer, body, _, _| Ok(json(&force::force(explorer, &read(body)?)?)),
    },
    Request {
        path: "/api/choice",
        work: Work::Short,
        answer: |explorer, body, _, _| Ok(json(&choice::changes(explorer, &read(body)?)?)),
    },
    Request {
        path: "/api/states",
        work: Work::Short,
        answer: |explorer, body, control, _| {
            Ok(json(&states::states(explorer, &read(body)?, control)?))
        },
    },
    Request {
        path: "/api/knock",
        work: Work::Long,
        answer: |explorer, body, control, _| {
            Ok(json(&upset::knock(explorer, &read(body)?, control)?))
        },
    },
    Request {
        path: "/api/margins",
        work: Work::Long,
        answer: |explorer, body, control, _| {
            Ok(json(&upset::margins(explorer, &read(body)?, control)?))
        },
    },
    Request {
        path: "/api/curve",
        work: Work::Lines,
        answer: |explorer, body, control, line| {
            Ok(in_lines(line, || {
                curve::curve(explorer, &read(body)?, control, line)
            }))
        },
    },
    Request {
        path: "/api/attractors",
        work: Work::Long,
        answer: |explorer, body, control, _| {
            Ok(json(&census::listed(explorer, &read(body)?, control)?))
        },
    },
    Request {
        path: "/api/study",
        work: Work::Lines,
        answer: |explorer, body, control, line| {
            Ok(in_lines(line, || {
                study::study(explorer, &read(body)?, control, line)
            }))
        },
    },
    Request {
        path: "/api/figure",
        work: Work::Short,
        answer: |_, body, _, _| figures::redrawn(&read(body)?),
    },
    Request {
        path: "/api/export",
        work: Work::Short,
        answer: |explorer, body, control, _| export::exported(explorer, &read(body)?, control),
    },
];

impl Explorer {
    /// The kind of a request; `None` if there is no such request.
    pub fn work(path: &str) -> Option<Work> {
        let request = REQUESTS.iter().find(|request| request.path == path)?;
        Some(request.work)
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
        let Some(request) = REQUESTS.iter().find(|request| request.path == path) else {
            return Answer {
                outcome: Outcome::Unknown,
                kind: "text/plain",
                bytes: b"the explorer has no such page".to_vec(),
            };
        };
        match (request.answer)(self, body, control, line) {
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

/// An answer in lines, of which the last is the reason if it was refused.
fn in_lines(line: Line<'_>, work: impl FnOnce() -> Result<(), ApiError>) -> Content {
    if let Err(refusal) = work() {
        line(refusal.json());
    }
    (LINES, Vec::new())
}

fn read<T: DeserializeOwned>(body: &[u8]) -> Result<T, ApiError> {
    serde_json::from_slice(body)
        .map_err(|error| ApiError::input(format!("not a request of the page: {error}"), ""))
}

fn json(value: &Value) -> Content {
    (JSON, value.to_string().into_bytes())
}
