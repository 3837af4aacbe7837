//! Errors of the library as Python's: bad input is a `ValueError`, what was right and did
//! not work out a `RuntimeError`, what the file system refused an `OSError`; each in the
//! library's own words, which the terminal shows too.

use nanotap::case::file::{CaseFileError, Place};
use nanotap::case::physical::CatalogueError;
use nanotap::case::physical_subject::VaryError;
use nanotap::case::subject::UnknownKey;
use nanotap::dataset::{StoreError, WorkError};
use nanotap::model::cantilever::CantileverError;
use nanotap::model::{FlowError, ModelError};
use nanotap::study::approach::ApproachError;
use nanotap::study::attractors::AttractorsError;
use nanotap::study::basin::BasinError;
use nanotap::study::branch::BranchError;
use nanotap::study::fixed_step::FixedStepError;
use nanotap::study::modes::ModeTableError;
use nanotap::study::orbit::OrbitError;
use nanotap::study::setpoint::SetpointError;
use nanotap::study::simulate::SimulateError;
use nanotap::study::start_box::SideError;
use nanotap::study::studied::ParameterValueError;
use nanotap::study::sweep::{OverError, SweepError};
use nanotap_figures::FigureError;
use nanotap_paper::PaperError;
use pyo3::PyErr;
use pyo3::exceptions::{PyOSError, PyRuntimeError, PyValueError};

/// Why something could not be done.
#[derive(Debug)]
pub(crate) enum Failure {
    /// What was asked for is not right.
    Input(String),
    /// It was right, and still did not work out.
    Failed(String),
    /// The file system refused.
    File(String),
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::Input(words) => PyValueError::new_err(words),
            Failure::Failed(words) => PyRuntimeError::new_err(words),
            Failure::File(words) => PyOSError::new_err(words),
        }
    }
}

/// Errors that are bad input whatever they say.
macro_rules! input {
    ($($error:ty),* $(,)?) => {$(
        impl From<$error> for Failure {
            fn from(error: $error) -> Self {
                Self::Input(error.to_string())
            }
        }
    )*};
}

input!(
    CantileverError,
    CatalogueError,
    OverError,
    ParameterValueError,
    SideError,
    SweepError,
    UnknownKey,
    VaryError,
);

impl From<CaseFileError> for Failure {
    /// As the error shows itself, less the terminal's `--set`: here a key was an argument.
    fn from(error: CaseFileError) -> Self {
        let lines = error.problems.iter().map(|problem| {
            let place = match (&problem.place, &error.source) {
                (Place::Span(span), Some(source)) => {
                    let (line, column) = source.line_and_column(span.start);
                    format!("{}:{line}:{column}: ", source.name)
                }
                (Place::Override(written), _) => format!("{written}: "),
                (_, Some(source)) => format!("{}: ", source.name),
                (_, None) => String::new(),
            };
            let help = problem.help.as_ref().map_or_else(String::new, |help| {
                format!("; {}", help.replace("--set ", ""))
            });
            let message = problem
                .message
                .replace("--set must say", "the keys must say");
            format!("{place}{message}{help}")
        });
        Self::Input(lines.collect::<Vec<_>>().join("\n"))
    }
}

impl From<ModelError> for Failure {
    fn from(error: ModelError) -> Self {
        match error {
            ModelError::Flow(FlowError::Resonance { .. })
            | ModelError::Case(_)
            | ModelError::Oscillator(_) => Self::Input(error.to_string()),
            ModelError::Physical(error) => (*error).into(),
            ModelError::Flow(_) => Self::Failed(error.to_string()),
        }
    }
}

impl From<ModeTableError> for Failure {
    fn from(error: ModeTableError) -> Self {
        match error {
            ModeTableError::Case(error) => error.into(),
            ModeTableError::Spectrum(error) => Self::Failed(error.to_string()),
        }
    }
}

impl From<FlowError> for Failure {
    fn from(error: FlowError) -> Self {
        Self::Failed(error.to_string())
    }
}

impl From<SimulateError> for Failure {
    fn from(error: SimulateError) -> Self {
        match error {
            SimulateError::Flow(error) => error.into(),
            other => Self::Input(other.to_string()),
        }
    }
}

impl From<FixedStepError> for Failure {
    fn from(error: FixedStepError) -> Self {
        match error {
            FixedStepError::Simulate(SimulateError::Flow(FlowError::Shape { .. }))
            | FixedStepError::Rigid => Self::Input(error.to_string()),
            FixedStepError::Simulate(error) => error.into(),
            FixedStepError::Overflow { .. } => Self::Failed(error.to_string()),
        }
    }
}

impl From<OrbitError> for Failure {
    fn from(error: OrbitError) -> Self {
        match error {
            OrbitError::NoPeriod | OrbitError::TooManyHarmonics { .. } => {
                Self::Input(error.to_string())
            }
            OrbitError::Start(error) => error.into(),
            other => Self::Failed(other.to_string()),
        }
    }
}

impl From<AttractorsError> for Failure {
    fn from(error: AttractorsError) -> Self {
        match error {
            AttractorsError::Motion(error) => error.into(),
            AttractorsError::Orbit(error) => error.into(),
            other => Self::Input(other.to_string()),
        }
    }
}

impl From<BranchError> for Failure {
    fn from(error: BranchError) -> Self {
        match error {
            BranchError::Range { .. }
            | BranchError::Step { .. }
            | BranchError::SameParameter { .. }
            | BranchError::Model { .. }
            | BranchError::Start {
                error: OrbitError::Start(_) | OrbitError::NoPeriod,
                ..
            } => Self::Input(error.to_string()),
            other => Self::Failed(other.to_string()),
        }
    }
}

impl From<ApproachError> for Failure {
    fn from(error: ApproachError) -> Self {
        match error {
            ApproachError::Model(error) => error.into(),
            ApproachError::Branch(error) => error.into(),
            other => Self::Input(other.to_string()),
        }
    }
}

impl From<SetpointError> for Failure {
    fn from(error: SetpointError) -> Self {
        match error {
            SetpointError::Approach(error) => error.into(),
            SetpointError::None => Self::Input(error.to_string()),
            other => Self::Failed(other.to_string()),
        }
    }
}

impl From<BasinError> for Failure {
    fn from(error: BasinError) -> Self {
        match error {
            BasinError::State(error) => error.into(),
            BasinError::Model(error) => error.into(),
            BasinError::NoAttractor { .. } | BasinError::Cancelled => {
                Self::Failed(error.to_string())
            }
            other => Self::Input(other.to_string()),
        }
    }
}

impl From<StoreError> for Failure {
    fn from(error: StoreError) -> Self {
        match error {
            StoreError::Occupied { .. }
            | StoreError::Mismatch { .. }
            | StoreError::NotAStore { .. } => Self::Input(error.to_string()),
            StoreError::Io { .. } => Self::File(error.to_string()),
            other => Self::Failed(other.to_string()),
        }
    }
}

impl From<WorkError> for Failure {
    fn from(error: WorkError) -> Self {
        match error {
            WorkError::Store(error) => error.into(),
            stopped @ WorkError::Cancelled { .. } => Self::Failed(stopped.to_string()),
        }
    }
}

impl From<PaperError> for Failure {
    fn from(error: PaperError) -> Self {
        match error {
            PaperError::UnknownSection { .. } => Self::Input(error.to_string()),
            other => Self::Failed(other.to_string()),
        }
    }
}

impl From<FigureError> for Failure {
    fn from(error: FigureError) -> Self {
        match error {
            FigureError::UnknownEnding { .. } => Self::Input(error.to_string()),
            other => Self::Failed(other.to_string()),
        }
    }
}

impl From<serde_json::Error> for Failure {
    fn from(error: serde_json::Error) -> Self {
        Self::Failed(format!("no JSON of the result: {error}"))
    }
}
