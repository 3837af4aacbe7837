//! `nanotap schema`: the JSON schemas of options and reports of studies, and of a case.

use clap::Args;
use nanotap::case::schema;
use nanotap::study::registry::{STUDIES, StudyEntry};
use serde_json::{Map, Value, json};

use crate::failure::Failure;
use crate::output;

/// The name of the schema of a case.
const CASE: &str = "case";

/// Print the JSON schema of a study's options and report, or of a case.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    /// A study, or `case` for the keys of a case; without it, all of them by name
    #[arg(value_name = "STUDY")]
    study: Option<String>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let mut all: Map<String, Value> = STUDIES
        .iter()
        .map(|entry| (entry.name.to_owned(), described(entry)))
        .collect();
    all.insert(CASE.to_owned(), schema::schema().to_value());
    let document = match &arguments.study {
        None => all.into(),
        Some(name) => all.remove(name).ok_or_else(|| {
            let known: Vec<&str> = all.keys().map(String::as_str).collect();
            Failure::input(
                format!("unknown study `{name}`"),
                format!("there are {}", known.join(", ")),
            )
        })?,
    };
    output::print(&format!("{document:#}\n"))
}

fn described(entry: &StudyEntry) -> Value {
    json!({
        "name": entry.name,
        "about": entry.about,
        "request": (entry.request)(),
        "report": (entry.report)(),
    })
}
