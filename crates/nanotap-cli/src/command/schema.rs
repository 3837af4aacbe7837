//! `nanotap schema`: the JSON schemas of options and reports of studies, and of a case.

use clap::Args;
use nanotap::case::schema;
use nanotap::dataset::Merged;
use nanotap::files::FileList;
use nanotap::study::DatasetStudy;
use nanotap::study::calibrate::CalibrateReport;
use nanotap::study::fit::FitMap;
use nanotap::study::registry::{STUDIES, StudyEntry};
use nanotap::study::request::answer_schema;
use nanotap::study::scan::ScanLines;
use nanotap::study::setpoint::CaseReport;
use nanotap_paper::Document;
use schemars::Schema;
use serde_json::{Map, Value, json};

use super::catalogue::Listed;
use super::generate::Made;
use crate::failure::Failure;
use crate::output::{self, FailureDocument};

/// A document's name, description and schema.
type Described = (&'static str, &'static str, fn() -> Schema);

/// Documents that are not those of a study.
const COMMANDS: &[Described] = &[
    (
        "case-report",
        "The document of the command `case`",
        answer_schema::<CaseReport>,
    ),
    (
        "catalogue",
        "List the levers and materials that a case can name",
        answer_schema::<Listed<'static>>,
    ),
    (
        "files",
        "List what the files of instruments hold",
        answer_schema::<FileList>,
    ),
    (
        "calibrate",
        "Calibrate a lever from its thermal noise: k, Q, f0, sensitivity",
        answer_schema::<CalibrateReport>,
    ),
    (
        "merge",
        "Merge partial datasets of a sweep or basin",
        answer_schema::<Merged>,
    ),
    (
        "fit-map",
        "The document of `fit --pixels`",
        answer_schema::<<FitMap as DatasetStudy>::Report>,
    ),
    (
        "scan-lines",
        "The document of a `scan` whose lines go into a dataset",
        answer_schema::<<ScanLines as DatasetStudy>::Report>,
    ),
    (
        "paper",
        "The report on the figures and numbers of the paper",
        answer_schema::<Document<'static>>,
    ),
    (
        "generate",
        "Generate shell completions and manual pages",
        answer_schema::<Made>,
    ),
    (
        "failure",
        "The document of any command whose computation failed",
        answer_schema::<FailureDocument>,
    ),
];

/// The name of the schema of a case.
const CASE: &str = "case";

/// Print the JSON schema of a study's options and report, or of a case.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    /// A study, `case` for the keys of a case, or the document of another command; without it, all of
    /// them by name
    #[arg(value_name = "STUDY")]
    study: Option<String>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let mut all: Map<String, Value> = STUDIES
        .iter()
        .map(|entry| (entry.name.to_owned(), described(entry)))
        .collect();
    all.insert(CASE.to_owned(), schema::schema().to_value());
    for (name, about, report) in COMMANDS {
        let described = json!({ "name": name, "about": about, "report": report() });
        all.insert((*name).to_owned(), described);
    }
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
