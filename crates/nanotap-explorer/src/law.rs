//! Another contact law: what must be left away with it, and what it needs in addition.

use nanotap::case::{Key, Value as Written};
use serde::Deserialize;
use serde_json::{Map, Value, json};

use crate::Explorer;
use crate::api_error::ApiError;
use crate::preset::CaseSpec;

/// A law as requested by the page: its name, or names with + between them.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct LawRequest {
    case: CaseSpec,
    law: String,
    /// The changes of the case when it last had this law: their values return.
    #[serde(default)]
    former: Option<Vec<String>>,
}

/// The keys to set, empty where the law does not take them, and a sentence that says which.
pub(crate) fn changes(app: &Explorer, request: &LawRequest) -> Result<Value, ApiError> {
    let case = request.case.any_distance(app)?;
    let key = if case.is_physical() {
        Key::SampleLaw
    } else {
        Key::Contact
    };
    let about = |error: nanotap::Error| ApiError::of(error).about(key.path());
    let preset = request.case.preset(app)?;
    let former = request.former.clone();
    let former = former.and_then(|set| request.case.with_set(set).any_distance(app).ok());
    let (base, origin) = match former {
        Some(former) => (former, "as before"),
        None => (
            nanotap::case::Case::parse(Some(preset.source()), &preset.set)?,
            "a usual value",
        ),
    };
    let change = case.law_change(&request.law, &base).map_err(about)?;
    let mut set = Map::new();
    set.insert(key.path().into(), change.law.clone().into());
    let mut words = Vec::new();
    for key in &change.dropped {
        set.insert(key.path().into(), "".into());
        words.push(format!("without {key}"));
    }
    for (key, value) in &change.added {
        let text = value.text();
        let shown = match value {
            Written::Table(_) | Written::Arms(_) | Written::LeverModes(_) => "rows to begin with",
            _ => &text,
        };
        words.push(format!("with {key} = {shown}, {origin}"));
        set.insert(key.path().into(), text.into());
    }
    let words = match words.as_slice() {
        [] => String::new(),
        _ => format!("{}: {}.", change.law, words.join("; ")),
    };
    Ok(json!({ "set": set, "words": words }))
}
