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

    /// Studies `case`.
    ///
    /// # Errors
    /// When the request is not right, or the computation does not succeed.
    fn run(
        case: &Case,
        request: &Self::Request,
        control: &Control<'_>,
    ) -> Result<Self::Report, Error>;
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

    /// What is to be computed of `case`.
    ///
    /// # Errors
    /// When the request is not right, or what must be known beforehand cannot be found.
    fn recipe(case: &Case, request: &Self::Request, control: &Control<'_>)
    -> Result<Recipe, Error>;

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
