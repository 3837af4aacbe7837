//! The two kinds of study: one reports in a document, the other computes a dataset.

use nanotap_dynamics::Control;
use schemars::JsonSchema;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

use crate::Error;
use crate::case::Case;
use crate::case::document::CaseDocument;
use crate::dataset::{Store, StoreError};
use crate::model::cantilever::Cantilever;
use crate::study::recipe::Recipe;

/// A study: what it is asked for, how it runs, what it reports.
pub trait Study {
    /// What every front end calls it.
    const NAME: &'static str;
    /// What it finds out, in a line.
    const ABOUT: &'static str;
    /// What it is asked for.
    type Request: Serialize + DeserializeOwned + JsonSchema;
    /// What it found.
    type Report: Serialize + JsonSchema + 'static;

    /// What its progress counts, in the plural.
    const COUNTED: &'static str = "steps";
    /// Whether it chooses the distance itself, so that none is solved for a setpoint.
    const ANY_DISTANCE: bool = false;

    /// Whether the report of work that was stopped holds what is finished, and says so.
    const PARTIAL: bool = false;

    /// Studies `case`: what [`run`](Self::run) does, whose `control` the case carries.
    ///
    /// # Errors
    /// When the request is not right, or the computation does not succeed.
    fn compute(
        case: &Case,
        request: &Self::Request,
        control: &Control<'_>,
    ) -> Result<Self::Report, Error>;

    /// Studies `case`. Once `control` cancels the work it ends soon, with what is finished where
    /// the report can hold that.
    ///
    /// # Errors
    /// When the request is not right, the computation does not succeed, or it was stopped.
    fn run(
        case: &Case,
        request: &Self::Request,
        control: &Control<'_>,
    ) -> Result<Self::Report, Error> {
        let report = Self::compute(&case.cancelled_by(control), request, control);
        if control.is_cancelled() && !(Self::PARTIAL && report.is_ok()) {
            return Err(Error::stopped());
        }
        report
    }
}

/// A study whose report is a dataset, computed chunk by chunk.
pub trait DatasetStudy {
    /// What every front end calls it.
    const NAME: &'static str;
    /// What it finds out, in a line.
    const ABOUT: &'static str;
    /// What its progress counts, in the plural.
    const COUNTED: &'static str;
    /// What it is asked for.
    type Request: Serialize + DeserializeOwned + JsonSchema;
    /// What its dataset comes to.
    type Report: Serialize + JsonSchema;

    /// What is to be computed of `case`: what [`recipe`](Self::recipe) gives, whose `control` the
    /// case carries.
    ///
    /// # Errors
    /// When the request is not right, or what must be known beforehand cannot be found.
    fn plan(case: &Case, request: &Self::Request, control: &Control<'_>) -> Result<Recipe, Error>;

    /// What is to be computed of `case`.
    ///
    /// # Errors
    /// When the request is not right, what must be known beforehand cannot be found, or the work
    /// was stopped.
    fn recipe(
        case: &Case,
        request: &Self::Request,
        control: &Control<'_>,
    ) -> Result<Recipe, Error> {
        let recipe = Self::plan(&case.cancelled_by(control), request, control);
        if control.is_cancelled() {
            return Err(Error::stopped());
        }
        recipe
    }

    /// What a finished dataset comes to.
    ///
    /// # Errors
    /// When a chunk is missing or damaged.
    fn report(store: &Store) -> Result<Self::Report, StoreError>;
}

/// A report with what it is of.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Document<'a, R: Serialize> {
    /// What was found.
    #[serde(flatten)]
    pub report: &'a R,
    /// The version of the program.
    pub version: &'static str,
    /// The case that was studied, as a document of its own.
    #[schemars(with = "Map<String, Value>")]
    pub case: CaseDocument,
}

impl<'a, R: Serialize> Document<'a, R> {
    /// Of a report on `case`.
    pub fn new(report: &'a R, case: &'a Case) -> Self {
        Self {
            report,
            version: env!("CARGO_PKG_VERSION"),
            case: CaseDocument::of(case),
        }
    }
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
