//! Case files that the page opens, with the files that they name.

use std::collections::BTreeMap;

use nanotap::case::Case;
use nanotap::case::file::{Source, including};
use nanotap::case::input::MAX_CASE_BYTES;
use serde::Deserialize;

use crate::api_error::ApiError;
use crate::commands::CASE_FILE;
use crate::content::Content;

/// The text of a case file, and the contents of the files that it names.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Opened {
    text: String,
    #[serde(default)]
    files: BTreeMap<String, Content>,
}

/// The checked case as one text, with these files in it.
pub(crate) fn opened(request: &Opened) -> Result<String, ApiError> {
    let contents = request.files.iter();
    let contents = contents.map(|(name, content)| Ok((name.clone(), content.bytes()?)));
    let files = contents.collect::<Result<_, ApiError>>()?;
    let source = Source {
        name: CASE_FILE.into(),
        text: request.text.clone(),
    };
    let source = including(source, &files)?;
    if source.text.len() as u64 > MAX_CASE_BYTES {
        return Err(ApiError::input(
            format!(
                "the case and its files have more than {} MiB",
                MAX_CASE_BYTES >> 20
            ),
            "give smaller files, or open it with `nanotap explore case.toml`",
        ));
    }
    Case::parse(Some(source.clone()), &[])?;
    Ok(source.text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nanotap::control::Control;
    use nanotap::study::registry::study;
    use serde_json::json;

    const LEVER: &str = include_str!("../cases/scan-patch.toml");

    fn open(text: &str, files: &serde_json::Value) -> Result<String, String> {
        let request = serde_json::from_value(json!({ "text": text, "files": files })).unwrap();
        opened(&request).map_err(|error| error.json()["error"].to_string())
    }

    /// The lines of a scan.
    fn lines(case: &Case) -> serde_json::Value {
        let options = json!({
            "lines": 1, "pixels": 16, "periods": 500, "settle": 500,
            "setpoint": 0.9, "integral_gain": 600, "z0": "10.5 nm",
        });
        let document = study("scan")
            .unwrap()
            .document(case, options, &Control::default());
        let document: serde_json::Value = serde_json::from_str(&document.unwrap()).unwrap();
        document["lines"].clone()
    }

    #[test]
    fn a_profile_beside_a_case_is_the_one_in_it() {
        let (head, _) = LEVER.split_once("[scan]").unwrap();
        let named = format!("{head}[scan]\nsize = \"100 nm\"\nprofile = \"steps/step.csv\"\n");
        let given = format!("{head}[scan]\nsize = \"100 nm\"\nprofile = [0.0, 2e-9, 5e-9]\n");
        let refused = open(&named, &json!({})).unwrap_err();
        assert!(refused.contains("step.csv together with"), "{refused}");
        let text = open(&named, &json!({ "step.csv": "0\n2e-9\n5e-9\n" })).unwrap();
        let [named, given] = [text, given].map(|text| lines(&text.parse().unwrap()));
        assert!(named[0]["surface_rms"].as_f64().unwrap() > 1e-9, "{named}");
        assert_eq!(named, given);
    }
}
