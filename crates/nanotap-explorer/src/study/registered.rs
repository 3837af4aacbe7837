//! Studies of the registry that the page shows by their report alone.

use nanotap::case::Case;
use nanotap::figure::study::{dataset_figure, document_and_figure};
use nanotap::study::registry::{StudyEntry, study as study_named};
use nanotap_figures::Figure;
use serde_json::Value;

use super::{Stage, Studied};
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
        let options = self.options(entry);
        let request = Value::Object(options.clone());
        let (document, figure) = if entry.document.is_some() {
            self.counting(entry.counted, |control| {
                document_and_figure(entry, &case, request, control)
            })?
        } else {
            self.whole_dataset(entry, &case, request)?
        };
        let schema = (entry.report)();
        self.hand(Stage {
            figure,
            words: entry.about.to_owned(),
            studies: &[(name, &options)],
            tables: report::tables(&document, schema.as_value()),
            ..Stage::default()
        })
    }

    /// The summary and the figure of a study's dataset.
    pub(super) fn whole_dataset(
        &self,
        entry: &StudyEntry,
        case: &Case,
        request: Value,
    ) -> Result<(Value, Option<Figure>), ApiError> {
        self.counting(entry.counted, |control| {
            self.dataset(case, entry, request, control, |store| {
                let summary = entry.summary.map(|of| of(store)).transpose()?;
                let figure = dataset_figure(entry.name, store).map_err(ApiError::of)?;
                Ok((summary.unwrap_or_default(), figure))
            })
        })
    }
}
