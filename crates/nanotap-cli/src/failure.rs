//! Why a command could not be done, and how that is shown.

use std::process::ExitCode;

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};
use nanotap::case::file::{CaseFileError, Place, Problem, Source};
use nanotap::case::physical::CatalogueError;
use nanotap::model::cantilever::CantileverError;
use nanotap::model::{FlowError, ModelError};
use nanotap::study::attractors::AttractorsError;
use nanotap::study::branch::BranchError;
use nanotap::study::contact_laws::ComparisonError;
use nanotap::study::fixed_step::FixedStepError;
use nanotap::study::orbit::OrbitError;
use nanotap::study::simulate::SimulateError;
use nanotap_figures::FigureError;

use crate::style;

/// Why a command could not be done.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The case is not right: exit code 2.
    Case(CaseFileError),
    /// Something else that was asked for is not right: exit code 2. What is wrong, and
    /// what would be right.
    Request(String, String),
    /// It was right, and still did not work out: exit code 1.
    Failed(String),
}

impl Failure {
    /// Something asked for that is not right, and what would be.
    pub(crate) fn request(what: impl Into<String>, help: impl Into<String>) -> Self {
        Self::Request(what.into(), help.into())
    }

    /// Says on standard error what went wrong; returns the exit code.
    pub(crate) fn report(&self) -> ExitCode {
        let (text, code) = match self {
            Self::Case(error) => (drawn(error), 2),
            Self::Request(what, help) => (
                format!("{}\n  {}\n", style::error(what), style::help(help)),
                2,
            ),
            Self::Failed(what) => (format!("{}\n", style::error(what)), 1),
        };
        anstream::eprint!("{text}");
        ExitCode::from(code)
    }
}

impl From<CaseFileError> for Failure {
    fn from(error: CaseFileError) -> Self {
        Self::Case(error)
    }
}

impl From<CantileverError> for Failure {
    fn from(error: CantileverError) -> Self {
        Self::request(
            error.to_string(),
            "change it in the case file or with --set",
        )
    }
}

impl From<ModelError> for Failure {
    fn from(error: ModelError) -> Self {
        match error {
            ModelError::Case(error) => error.into(),
            ModelError::Oscillator(error) => Self::request(
                error.to_string(),
                "change it in the case file or with --set",
            ),
            ModelError::Physical(error) => Self::Case(*error),
            ModelError::Flow(error @ FlowError::Resonance { .. }) => Self::request(
                error.to_string(),
                "change it in the case file or with --set",
            ),
            ModelError::Flow(error) => Self::Failed(error.to_string()),
        }
    }
}

impl From<SimulateError> for Failure {
    fn from(error: SimulateError) -> Self {
        match error {
            SimulateError::State { .. } | SimulateError::StateValue { .. } => {
                Self::request(error.to_string(), "count the numbers after --state")
            }
            SimulateError::NoPeriods => {
                Self::request(error.to_string(), "give --periods 1 or more")
            }
            SimulateError::Flow(error) => Self::Failed(error.to_string()),
        }
    }
}

impl From<FixedStepError> for Failure {
    fn from(error: FixedStepError) -> Self {
        match error {
            FixedStepError::Simulate(SimulateError::Flow(FlowError::Shape { .. })) => {
                Self::request(error.to_string(), "give --steps 1 or more")
            }
            FixedStepError::Simulate(error) => error.into(),
            FixedStepError::Rigid => Self::request(
                error.to_string(),
                "leave --method away: the exact flow runs it",
            ),
            FixedStepError::Overflow { .. } => Self::Failed(error.to_string()),
        }
    }
}

impl From<OrbitError> for Failure {
    fn from(error: OrbitError) -> Self {
        match error {
            OrbitError::NoPeriod => Self::request(error.to_string(), "give --period 1 or more"),
            OrbitError::TooManyHarmonics { .. } => {
                Self::request(error.to_string(), "give fewer --harmonics")
            }
            OrbitError::Start(error) => error.into(),
            other => Self::Failed(other.to_string()),
        }
    }
}

impl From<ComparisonError> for Failure {
    fn from(error: ComparisonError) -> Self {
        match error {
            ComparisonError::Arm { .. } => {
                Self::request(error.to_string(), "give --arm a stiffness above 0")
            }
            ComparisonError::Model(error) => error.into(),
            ComparisonError::Orbit(error) => error.into(),
            ComparisonError::Branch(error) => error.into(),
        }
    }
}

impl From<AttractorsError> for Failure {
    fn from(error: AttractorsError) -> Self {
        match error {
            AttractorsError::NoStarts => {
                Self::request(error.to_string(), "give --starts 1 or more")
            }
            AttractorsError::TooManyStarts { .. } => {
                Self::request(error.to_string(), "give fewer --starts")
            }
            AttractorsError::Box(_) | AttractorsError::Dimension { .. } => {
                Self::request(error.to_string(), "change it with --box")
            }
            AttractorsError::Motion(error) => error.into(),
            AttractorsError::Orbit(error) => error.into(),
        }
    }
}

impl From<BranchError> for Failure {
    fn from(error: BranchError) -> Self {
        match error {
            BranchError::Range { .. } => Self::request(error.to_string(), "change --from or --to"),
            BranchError::Step { .. } => Self::request(error.to_string(), "give --max-step 0.01"),
            BranchError::SameParameter { .. } => {
                Self::request(error.to_string(), "change --second or --parameter")
            }
            BranchError::Model { .. } => Self::request(
                error.to_string(),
                "keep --from, --to and --second where the model makes sense",
            ),
            BranchError::Start {
                error: OrbitError::Start(_) | OrbitError::NoPeriod,
                ..
            } => Self::request(error.to_string(), "change --state or --period"),
            BranchError::Start { .. } | BranchError::NoSeeds { .. } => Self::Failed(format!(
                "{error}; start elsewhere with --from, or say --state near an orbit"
            )),
            other => Self::Failed(other.to_string()),
        }
    }
}

impl From<FigureError> for Failure {
    fn from(error: FigureError) -> Self {
        match error {
            FigureError::UnknownEnding { path } => Self::request(
                format!(
                    "{}: the ending says no format that can be drawn",
                    path.display()
                ),
                "end the name in .svg, .png or .pdf",
            ),
            other => Self::Failed(other.to_string()),
        }
    }
}

impl From<CatalogueError> for Failure {
    fn from(error: CatalogueError) -> Self {
        Self::request(
            error.to_string(),
            "mend the catalogue, or leave --catalogue away",
        )
    }
}

/// All problems of a case, each with the line of the file that it stands in.
fn drawn(error: &CaseFileError) -> String {
    let renderer = Renderer::styled();
    let drawn: Vec<String> = error
        .problems
        .iter()
        .map(|problem| {
            let title = Level::ERROR.primary_title(title(problem, error.source.as_ref()));
            let group = match (&problem.place, &error.source) {
                (Place::Span(span), Some(source)) => {
                    let label = (!problem.label.is_empty()).then_some(problem.label.as_str());
                    let annotation = AnnotationKind::Primary.span(span.clone()).label(label);
                    let snippet = Snippet::source(&source.text)
                        .path(&source.name)
                        .annotation(annotation);
                    title.element(snippet)
                }
                _ => Group::with_title(title),
            };
            // What stands under the place in the file already need not be said again.
            let shown = matches!(problem.place, Place::Span(_)) && error.source.is_some();
            let help = problem
                .help
                .as_ref()
                .filter(|help| !shown || **help != problem.label);
            let group = match help {
                Some(help) => group.element(Level::HELP.message(help.as_str())),
                None => group,
            };
            renderer.render(&[group])
        })
        .collect();
    format!("{}\n", drawn.join("\n\n"))
}

fn title(problem: &Problem, source: Option<&Source>) -> String {
    match (&problem.place, source) {
        (Place::Override(written), _) => format!("--set {written}: {}", problem.message),
        (Place::Whole, Some(source)) => format!("{}: {}", source.name, problem.message),
        _ => problem.message.clone(),
    }
}
