//! Every study by name, from JSON to JSON: what the front ends iterate over.
//!
//! Input: a case, the options as JSON, a function called with the progress, a flag that cancels the
//! work. Output: a document as JSON. The entry has the schemas of options and document.
//!
//! ```
//! use std::sync::atomic::{AtomicUsize, Ordering};
//!
//! use nanotap::case::Case;
//! use nanotap::control::{CancelFlag, Control};
//! use nanotap::study::registry::study;
//! use serde_json::{Value, json};
//!
//! let words = ["alpha1=0.1", "alpha2=0.1", "alpha3=0.1", "alpha4=20", "alpha6=0.2", "omega=3"];
//! let case = Case::parse(None, &words.map(str::to_owned))?;
//! let attractors = study("attractors").expect("it is in the list");
//!
//! let (stop, done) = (CancelFlag::new(), AtomicUsize::new(0));
//! let count = |_: usize, _: usize| {
//!     done.fetch_add(1, Ordering::Relaxed);
//! };
//! let control = Control { cancel: Some(&stop), progress: Some(&count) };
//! let document = attractors.document(&case, json!({"starts": 8}), &control)?;
//!
//! let document: Value = serde_json::from_str(&document)?;
//! assert_eq!(document["starts"], 8);
//! assert_eq!(document["case"]["omega"], 3.0);
//! let refused = attractors.document(&case, json!({"startz": 8}), &control);
//! assert!(refused.unwrap_err().to_string().contains("starts"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A sweep, a window and basins leave a dataset, and so does a scan of independent lines: [`StudyEntry::plan`] gives what computes it
//! chunk by chunk. [`StudyEntry::answer`] gives the
//! report itself, with its document, its tables and its figure.

use std::sync::Arc;

use nanotap_dynamics::Control;
use nanotap_figures::Figure;
use schemars::Schema;
use serde_json::Value;

pub use crate::study::STUDIES;
use nanotap_case::Case;
use nanotap_case::physical::Remark;
use nanotap_dataset::Store;
use nanotap_error::Error;
use nanotap_fit::calibrate::CalibrateReport;
use nanotap_motions::setpoint::at_setpoint;
use nanotap_observe::frame::Frame;
pub use nanotap_study::DatasetPlan;
pub use nanotap_study::DatasetStudy;
pub use nanotap_study::Document;
pub use nanotap_study::Study;
use nanotap_study::request::{answer_schema, read, schema};

/// An entry of the registry: a study from JSON to JSON.
#[derive(Clone, Copy, Debug)]
pub struct StudyEntry {
    /// Name in every front end.
    pub name: &'static str,
    /// Help text of one line.
    pub about: &'static str,
    /// JSON schema of the options.
    pub request: fn() -> Schema,
    /// JSON schema of the document, or of the summary of the dataset.
    pub report: fn() -> Schema,
    /// What its progress counts, in the plural.
    pub counted: &'static str,
    /// Whether the report of cancelled work holds the finished part.
    pub partial: bool,
    /// Whether it has a figure, which its command draws with `--plot`.
    pub has_figure: bool,
    /// Whether it chooses distances itself under this request, so that none is solved for a setpoint.
    pub any_distance: fn(&Value) -> Result<bool, Error>,
    /// Runs it to its report, if that is a document.
    pub answer: Option<Run<Box<dyn Answer>>>,
    /// Plans what is to be computed into a dataset, if it leaves one.
    pub dataset: Option<Run<DatasetPlan>>,
    /// The summary of its finished dataset, if it leaves one.
    pub summary: Option<Summarise>,
    /// Kind of the datasets that are this study's alone.
    pub kind: Option<&'static str>,
}

/// What summarises a finished dataset and draws it.
pub type Summarise = fn(&Store) -> Result<Box<dyn Answer>, Error>;

/// What runs a study on a case, from the JSON of its request.
pub type Run<R> = fn(&Case, Value, &Control<'_>) -> Result<R, Error>;

/// The report of a study on a case.
pub trait Answer: Send {
    /// The JSON of the document.
    ///
    /// # Errors
    /// When a field cannot be written.
    fn document(&self) -> Result<String, Error>;

    /// The tables, as front ends show them; files contain the first.
    fn frames(&self) -> Vec<Frame<'_>>;

    /// The figure, if the study has one.
    fn figure(&self) -> Option<Figure>;

    /// What front ends say beside the report: where the model does not hold, what is missing, and what was
    /// assumed.
    fn remarks(&self) -> Vec<Remark>;
}

/// The report of a study on a case, for front ends that ask more of it than an [`Answer`] says.
#[derive(Debug)]
pub struct Answered<S: Study> {
    /// The case, at the distance at which it was studied.
    pub case: Arc<Case>,
    /// The report.
    pub report: S::Report,
}

impl<S: Study> Answer for Answered<S> {
    fn document(&self) -> Result<String, Error> {
        let document = Document::of::<S>(&self.report, &self.case);
        Ok(serde_json::to_string(&document)?)
    }

    fn frames(&self) -> Vec<Frame<'_>> {
        S::frames(&self.case, &self.report)
    }

    fn figure(&self) -> Option<Figure> {
        S::figure(&self.case, &self.report)
    }

    fn remarks(&self) -> Vec<Remark> {
        S::remarks(&self.case, &self.report)
    }
}

/// The summary of a dataset.
struct Summarised<S: DatasetStudy> {
    report: S::Report,
    figure: Figure,
}

impl<S: DatasetStudy> Answer for Summarised<S> {
    fn document(&self) -> Result<String, Error> {
        Ok(serde_json::to_string(&self.report)?)
    }

    fn frames(&self) -> Vec<Frame<'_>> {
        S::frames(&self.report)
    }

    fn figure(&self) -> Option<Figure> {
        Some(self.figure.clone())
    }

    fn remarks(&self) -> Vec<Remark> {
        S::remarks(&self.report)
    }
}

impl Answer for CalibrateReport {
    fn document(&self) -> Result<String, Error> {
        Ok(serde_json::to_string(self)?)
    }

    fn frames(&self) -> Vec<Frame<'_>> {
        self.tables()
    }

    fn figure(&self) -> Option<Figure> {
        Some(self.figure())
    }

    fn remarks(&self) -> Vec<Remark> {
        self.remarks()
    }
}

impl StudyEntry {
    pub(super) const fn of<S: Study + 'static>() -> Self {
        Self {
            name: S::NAME,
            about: S::ABOUT,
            request: schema::<S::Options>,
            report: answer_schema::<Document<'static, S::Report>>,
            counted: S::COUNTED,
            partial: S::PARTIAL,
            has_figure: S::HAS_FIGURE,
            any_distance: |_| Ok(S::ANY_DISTANCE),
            answer: Some(|case, request, control| {
                let request = read::<S::Options>(request)?;
                let case = if S::ANY_DISTANCE {
                    case.clone()
                } else {
                    at_setpoint(case.clone(), control)?.0
                };
                let report = S::run(&case, &request, control)?;
                let case = Arc::new(case);
                Ok(Box::new(Answered::<S> { case, report }))
            }),
            dataset: None,
            summary: None,
            kind: None,
        }
    }

    /// The same study, whose report can be a dataset, too.
    pub(super) const fn or_dataset<S: DatasetStudy + 'static>(self) -> Self {
        let Self {
            any_distance,
            dataset,
            summary,
            kind,
            ..
        } = Self::dataset::<S>();
        Self {
            any_distance,
            dataset,
            summary,
            kind,
            ..self
        }
    }

    pub(super) const fn dataset<S: DatasetStudy + 'static>() -> Self {
        Self {
            name: S::NAME,
            about: S::ABOUT,
            request: schema::<S::Options>,
            report: answer_schema::<S::Report>,
            counted: S::COUNTED,
            partial: true,
            has_figure: true,
            any_distance: |request| {
                let request = read::<S::Options>(request.clone())?;
                Ok(S::any_distance(&request))
            },
            answer: None,
            dataset: Some(|case, request, control| {
                let request = read::<S::Options>(request)?;
                let case = if S::any_distance(&request) {
                    case.clone()
                } else {
                    at_setpoint(case.clone(), control)?.0
                };
                S::plan(&case, &request, control)
            }),
            summary: Some(|store| {
                let (report, figure) = (S::report(store)?, S::figure(store)?);
                Ok(Box::new(Summarised::<S> { report, figure }))
            }),
            kind: Some(S::KIND),
        }
    }

    /// Its report on a case.
    ///
    /// # Errors
    /// Those of the study; and when its report is a dataset.
    pub fn answer(
        &self,
        case: &Case,
        request: Value,
        control: &Control<'_>,
    ) -> Result<Box<dyn Answer>, Error> {
        let run = self.answer.ok_or_else(|| {
            Error::input(
                format!("{} leaves a dataset, not a document", self.name),
                "compute its plan into a folder",
            )
        })?;
        run(case, request, control)
    }

    /// The JSON of its document.
    ///
    /// # Errors
    /// Those of [`answer`](Self::answer).
    pub fn document(
        &self,
        case: &Case,
        request: Value,
        control: &Control<'_>,
    ) -> Result<String, Error> {
        self.answer(case, request, control)?.document()
    }

    /// What is to be computed into a dataset.
    ///
    /// # Errors
    /// Those of the study; and when its report is a document.
    pub fn plan(
        &self,
        case: &Case,
        request: Value,
        control: &Control<'_>,
    ) -> Result<DatasetPlan, Error> {
        let plan = self.dataset.ok_or_else(|| {
            Error::input(
                format!("{} leaves a document, not a dataset", self.name),
                "take its document",
            )
        })?;
        plan(case, request, control)
    }
}

/// The summary of a finished dataset by the study that left it.
///
/// # Errors
/// When no study leaves such a dataset, or a chunk is missing or damaged.
pub fn summarised(store: &Store) -> Result<Box<dyn Answer>, Error> {
    let kind = store.schema().attributes.get("kind");
    let kind = kind.and_then(Value::as_str);
    let entry = STUDIES
        .iter()
        .find(|study| kind.is_some() && study.kind == kind);
    let summarise = entry.and_then(|study| study.summary).ok_or_else(|| {
        Error::input(
            format!("`{}` holds no dataset of a study", store.path().display()),
            "give a dataset that nanotap computed",
        )
    })?;
    summarise(store)
}

/// The study that is called `name`.
pub fn study(name: &str) -> Option<&'static StudyEntry> {
    STUDIES.iter().find(|study| study.name == name)
}
