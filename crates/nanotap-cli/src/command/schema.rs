//! `nanotap schema`: what a study is asked for, as JSON schema.

use clap::Args;
use nanotap::study::registry::{STUDIES, study};
use serde_json::{Map, Value, json};

use crate::failure::Failure;
use crate::output;

/// The JSON schema of what a study is asked for.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    /// The study; without it, all of them by name
    #[arg(value_name = "STUDY")]
    study: Option<String>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let document = match &arguments.study {
        Some(name) => {
            let entry = study(name).ok_or_else(|| {
                let known: Vec<&str> = STUDIES.iter().map(|entry| entry.name).collect();
                Failure::input(
                    format!("there is no study `{name}`"),
                    format!("there are {}", known.join(", ")),
                )
            })?;
            described(entry)
        }
        None => STUDIES
            .iter()
            .map(|entry| (entry.name.to_owned(), described(entry)))
            .collect::<Map<_, _>>()
            .into(),
    };
    output::print(&format!("{document:#}\n"))
}

fn described(entry: &nanotap::study::registry::StudyEntry) -> Value {
    json!({
        "name": entry.name,
        "about": entry.about,
        "request": (entry.request)(),
    })
}
