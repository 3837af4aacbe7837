//! What the studies share: the traits [`Study`] and [`DatasetStudy`], options and requests as JSON,
//! targets, and ranges of initial states.

#![cfg_attr(
    test,
    allow(
        clippy::disallowed_methods,
        reason = "references are the platform's own functions"
    )
)]

pub mod averaged_orbits;
mod free_motion;
pub mod in_si;
pub mod limits;
pub mod over;
pub mod request;
pub mod start_box;
pub mod target;
pub mod threads;
pub mod value;

use std::fmt::Debug;

use nanotap_case::Case;
use nanotap_case::document::CaseDocument;
use nanotap_case::physical::Remark;
use nanotap_dataset::{Schema, Store, StoreError, Work, WorkError};
use nanotap_dynamics::Control;
use nanotap_error::Error;
use nanotap_figures::Figure;
use nanotap_model::cantilever::Cantilever;
use nanotap_model::sample_law::SampleLaw;
use nanotap_observe::frame::Frame;
use schemars::JsonSchema;
use serde::Serialize;
use serde::de::DeserializeOwned;

pub use free_motion::FreeMotion;

/// A study whose report is a document.
pub trait Study {
    /// Name in every front end.
    const NAME: &'static str;
    /// Help text of one line.
    const ABOUT: &'static str;
    /// Options: what front ends show, check and pass on as JSON.
    type Options: Serialize + DeserializeOwned + JsonSchema;
    /// Report, which front ends print and write as JSON.
    type Report: Serialize + JsonSchema + Send + 'static;

    /// Noun for what the progress counts, in the plural.
    const COUNTED: &'static str = "steps";
    /// Whether the study chooses distances itself, so that none is solved for a setpoint.
    const ANY_DISTANCE: bool = false;
    /// Whether nothing of the report depends on the distance, so that its document lacks one that is
    /// left to a setpoint.
    const WITHOUT_DISTANCE: bool = false;
    /// Whether the tones of the drive may have any ratio, so that they never repeat together.
    const ANY_RATIO: bool = false;
    /// Whether the study has a figure, which its command draws with `--plot`.
    const HAS_FIGURE: bool = true;
    /// Whether the report of cancelled work holds the finished part, and states that it is a part.
    const PARTIAL: bool = false;

    /// The tables of a report on `case`, as front ends show them; files contain the first.
    fn frames<'a>(_case: &Case, _report: &'a Self::Report) -> Vec<Frame<'a>> {
        Vec::new()
    }

    /// The figure of a report on `case`, if it has one.
    fn figure(_case: &Case, _report: &Self::Report) -> Option<Figure> {
        None
    }

    /// What front ends say beside a report on `case`: where the model does not hold, what is missing, and what
    /// was assumed.
    fn remarks(_case: &Case, _report: &Self::Report) -> Vec<Remark> {
        Vec::new()
    }

    /// Computes the report of a `case` that `control` cancels: implements [`run`](Self::run).
    ///
    /// # Errors
    /// When an option is not valid, or the computation fails.
    fn compute(
        case: &Case,
        options: &Self::Options,
        control: &Control<'_>,
    ) -> Result<Self::Report, Error>;

    /// Computes the report of `case`. Once `control` cancels the work it ends soon, with the
    /// finished part where the report can hold it.
    ///
    /// # Errors
    /// When an option is not valid, the computation fails, or it was cancelled.
    fn run(
        case: &Case,
        options: &Self::Options,
        control: &Control<'_>,
    ) -> Result<Self::Report, Error> {
        if !Self::ANY_RATIO {
            case.repeats()?;
        }
        let report = Self::compute(&case.cancelled_by(control), options, control);
        if control.is_cancelled() && !(Self::PARTIAL && report.is_ok()) {
            return Err(Error::stopped());
        }
        report
    }
}

/// A study whose report is a dataset, computed chunk by chunk.
pub trait DatasetStudy {
    /// Name in every front end.
    const NAME: &'static str;
    /// Help text of one line.
    const ABOUT: &'static str;
    /// Noun for what the progress counts, in the plural.
    const COUNTED: &'static str;
    /// Kind of the datasets that are this study's alone.
    const KIND: &'static str = Self::NAME;
    /// Noun for what the progress of the plan counts, in the plural.
    const PLANNED: &'static str = "approaches to the setpoints";
    /// Options: what front ends show, check and pass on as JSON.
    type Options: Serialize + DeserializeOwned + JsonSchema;
    /// Summary of the finished dataset.
    type Report: Serialize + JsonSchema + Send;

    /// Whether the study chooses distances itself under these options, so that none is solved for a setpoint.
    fn any_distance(_: &Self::Options) -> bool {
        false
    }

    /// The tables of a summary, as front ends show them; without any, its fields.
    fn frames(_: &Self::Report) -> Vec<Frame<'_>> {
        Vec::new()
    }

    /// What front ends say beside a summary: where the model does not hold, what is missing, and what was
    /// assumed.
    fn remarks(_: &Self::Report) -> Vec<Remark> {
        Vec::new()
    }

    /// Plans the dataset of a `case` that `control` cancels: implements [`plan`](Self::plan).
    ///
    /// # Errors
    /// When an option is not valid, or a computation that the plan needs fails.
    fn prepare(
        case: &Case,
        options: &Self::Options,
        control: &Control<'_>,
    ) -> Result<DatasetPlan, Error>;

    /// Plans the dataset of `case`.
    ///
    /// # Errors
    /// When an option is not valid, a computation that the plan needs fails, or it was cancelled.
    fn plan(
        case: &Case,
        options: &Self::Options,
        control: &Control<'_>,
    ) -> Result<DatasetPlan, Error> {
        case.repeats()?;
        let plan = Self::prepare(&case.cancelled_by(control), options, control);
        if control.is_cancelled() {
            return Err(Error::stopped());
        }
        plan
    }

    /// Summarises a finished dataset.
    ///
    /// # Errors
    /// When a chunk is missing or damaged.
    fn report(store: &Store) -> Result<Self::Report, StoreError>;

    /// The figure of a finished dataset.
    ///
    /// # Errors
    /// When a chunk is missing or damaged.
    fn figure(store: &Store) -> Result<Figure, StoreError>;
}

/// The checked computation of a dataset: its chunks are pure functions of it.
pub type DatasetPlan = Box<dyn Computation>;

/// The computation of a dataset.
pub trait Computation: Debug + Send + Sync {
    /// Returns the schema of the dataset: its grid, variables and attributes.
    fn schema(&self) -> &Schema;

    /// Computes the missing chunks of `store`, which was made for the schema.
    ///
    /// # Errors
    /// When the work was cancelled (finished chunks stay), or the store fails.
    fn compute(&self, store: &Store, work: &Work<'_>) -> Result<(), WorkError>;

    /// Computes the files of one chunk on this thread: the same bytes as [`compute`](Self::compute)
    /// writes. `None` if cancelled, or if there is no such chunk.
    fn chunk_files(&self, chunk: usize, control: &Control<'_>) -> Option<Vec<Vec<u8>>>;
}

/// A report with its case.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Document<'a, R: Serialize> {
    /// Report of the study, whose fields come first in the document.
    #[serde(flatten)]
    pub report: &'a R,
    /// The version of the program.
    pub version: &'static str,
    /// Case on which the study was run.
    pub case: CaseDocument,
}

impl<'a, R: Serialize> Document<'a, R> {
    /// The document of a report on `case`.
    pub fn new(report: &'a R, case: &'a Case) -> Self {
        Self {
            report,
            version: env!("CARGO_PKG_VERSION"),
            case: CaseDocument::of(case),
        }
    }

    /// The document of the report of a study on `case`.
    pub fn of<S: Study<Report = R>>(report: &'a R, case: &'a Case) -> Self {
        let mut document = Self::new(report, case);
        if S::WITHOUT_DISTANCE {
            document.case = CaseDocument::at_any_distance(case);
        }
        document
    }
}

/// Refuses a force that depends on time, for `what`.
///
/// # Errors
/// When the case has an ac voltage.
pub fn without_signal(case: &Case, what: &str) -> Result<(), Error> {
    let law = case.cantilever().and_then(|lever| lever.law.as_ref());
    if law.is_some_and(SampleLaw::takes_signal) {
        return Err(Error::input(
            format!(
                "{what} needs a force that does not depend on time, and here the ac voltage changes it"
            ),
            "take the law electrostatic in place of electrostatic-ac, without ac_voltage",
        ));
    }
    Ok(())
}

/// The dimensionless cantilever of a case, for a study that needs one.
///
/// # Errors
/// When it is an oscillator.
pub fn cantilever<'a>(case: &'a Case, study: &str) -> Result<&'a Cantilever, Error> {
    case.cantilever().ok_or_else(|| {
        Error::input(
            format!(
                "{}: `{study}` needs a cantilever; this is an oscillator",
                case.title()
            ),
            "an oscillator has one degree of freedom and no beam modes",
        )
    })
}
