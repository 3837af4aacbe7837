//! Studies of the registry that the page shows by their report alone.

use nanotap::Error;
use nanotap::control::Control;
use nanotap::study::Study as _;
use nanotap::study::registry::{Answer, DatasetPlan, StudyEntry, study as study_named};
use nanotap::study::simulate::SimulateStudy;
use serde_json::Value;

use super::{Stage, Studied, dataset};
use crate::api_error::ApiError;
use crate::forms;
use crate::motion_request::model_of;
use crate::report;

impl Studied<'_> {
    /// A study of the registry that has no tab with more than its options and its report.
    pub(super) fn any(&self, name: &str) -> Result<(), ApiError> {
        let entry = study_named(name).filter(|entry| forms::is_plain(entry));
        let entry = entry.ok_or_else(|| {
            let known: Vec<&str> = forms::plain_studies().map(|entry| entry.name).collect();
            ApiError::input(
                format!("expected a study, got `{name}`"),
                format!("there are {}", known.join(", ")),
            )
        })?;
        let case = self.request.case.any_distance(self.app)?;
        model_of(&case)?;
        if entry.name == SimulateStudy::NAME {
            self.field(forms::SIGNAL)?;
        }
        let options = self.options(entry);
        let request = Value::Object(options.clone());
        self.begins(entry.name, &options);
        let schema = (entry.report)();
        let answer = if entry.answer.is_some() {
            self.counting(entry.counted, |control| {
                entry.answer(&case, request, control)
            })?
        } else {
            let plan = |control: &Control<'_>| entry.plan(&case, request, control);
            self.whole_dataset(entry, plan)?
        };
        let document: Value = serde_json::from_str(&answer.document()?).map_err(Error::from)?;
        let frames = answer.frames();
        let mut tables = report::tables(&document, schema.as_value());
        if !frames.is_empty() {
            tables.truncate(1);
            let filled = frames.iter().filter(|frame| frame.rows > 0);
            tables.extend(filled.map(|frame| report::of_frame(frame.name, frame)));
        }
        self.hand(Stage {
            figure: answer.figure(),
            words: entry.about.to_owned(),
            remarks: answer.remarks(),
            studies: &[(name, &options)],
            tables,
            ..Stage::default()
        })
    }

    /// The summary of a study's dataset.
    pub(super) fn whole_dataset(
        &self,
        entry: &StudyEntry,
        plan: impl FnOnce(&Control<'_>) -> Result<DatasetPlan, Error>,
    ) -> Result<Box<dyn Answer>, ApiError> {
        let summarise = (entry.summary)
            .ok_or_else(|| ApiError::failed(format!("{} leaves no dataset", entry.name)))?;
        self.counting(entry.counted, |control| {
            dataset(&plan(control)?, control, |store| Ok(summarise(store)?))
        })
    }
}
