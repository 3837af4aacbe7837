//! `nanotap basin`: basins of attraction on a slice of initial states.

use std::path::{Path, PathBuf};

use clap::Args;
use nanotap::figure::basin::figure;
use nanotap::input::{self, MAX_DOCUMENT_BYTES, Origin};
use nanotap::study::DatasetStudy as _;
use nanotap::study::basin::{BasinOptions, BasinStudy, Shares, SliceRange};

use crate::arguments::{CaseArguments, PlotArgument};
use crate::dataset::{DatasetArguments, DatasetReport, derived_name};
use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::request::Request;
use crate::text_table::Table;

/// Compute basins of attraction on a two-dimensional slice of initial states.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    case: CaseArguments,

    /// The attractors, from `nanotap attractors --json`; default: found by sampling the slice
    #[arg(long, value_name = "FILE", conflicts_with = "starts")]
    attractors: Option<PathBuf>,

    #[command(flatten)]
    request: Request<BasinOptions>,

    #[command(flatten)]
    dataset: DatasetArguments,
    #[command(flatten)]
    plot: PlotArgument,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let mut options = arguments.request.read()?;
    options.attractors = arguments.attractors.as_deref().map(states).transpose()?;
    let case = GivenCase::of(&arguments.case, output)?;
    let axes = options.axes(&case.units())?;
    let name = derived_name(
        arguments.case.file.as_deref(),
        &["basin", &axes[0].name, &axes[1].name],
    );
    let done = arguments.dataset.run::<BasinStudy>(
        &case,
        &options,
        &name,
        BasinStudy::COUNTED,
        options.seed,
        &arguments.plot,
        figure,
        output,
    )?;
    output.study(&case, &done, |done| text(&case, &axes, done))
}

/// The states on the attractors that a file of `nanotap attractors --json` names.
fn states(path: &Path) -> Result<Vec<Vec<f64>>, Failure> {
    let refuse = |why: String| {
        Failure::input(
            format!("{}: {why}", path.display()),
            "make it with `nanotap attractors CASE --json > FILE`",
        )
    };
    let text = input::text(path, MAX_DOCUMENT_BYTES, Origin::User)
        .map_err(|error| refuse(error.fault.to_string()))?;
    let document: serde_json::Value =
        serde_json::from_str(&text).map_err(|error| refuse(format!("not JSON: {error}")))?;
    let list = document["attractors"]
        .as_array()
        .filter(|list| !list.is_empty())
        .ok_or_else(|| refuse("it has no list `attractors`".into()))?;
    list.iter()
        .enumerate()
        .map(|(k, attractor)| {
            let numbers = attractor["state"].as_array().map(|state| {
                state
                    .iter()
                    .map(serde_json::Value::as_f64)
                    .collect::<Option<Vec<_>>>()
            });
            numbers
                .flatten()
                .ok_or_else(|| refuse(format!("attractor {} has no `state`", k + 1)))
        })
        .collect()
}

fn text(case: &GivenCase, [x, y]: &[SliceRange; 2], done: &DatasetReport<Shares>) -> String {
    let heading = format!(
        "{}: {}, {} by {} starts over {} and {}",
        case.title(),
        case.summary(),
        x.count,
        y.count,
        x.name,
        y.name
    );
    done.text(&heading, |shares| {
        Table::all(&shares.share_table()).render()
    })
}
