//! `nanotap basin`: basins of attraction on a slice of initial states.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use nanotap::study::basin::{Basin, BasinOptions, Shares, SliceRange, figure, shares};

use crate::arguments::{CaseArguments, PlotArgument};
use crate::dataset::{DatasetArguments, DatasetReport, derived_name};
use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::table::{Align, Table};
use crate::{file, motion, number, progress};

/// Basins of attraction on a two-dimensional slice of initial states.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    case: CaseArguments,

    /// The horizontal axis, as in a1=-1:1:200: entry of the state, first value, last value, how
    /// many (a1…aN, v1…vN; oscillator: x, v)
    #[arg(
        long,
        value_name = "ENTRY=FROM:TO:COUNT",
        required = true,
        allow_hyphen_values = true
    )]
    x: String,

    /// The vertical axis
    #[arg(
        long,
        value_name = "ENTRY=FROM:TO:COUNT",
        required = true,
        allow_hyphen_values = true
    )]
    y: String,

    /// The other entries of the state, in full: a1,…,aN,v1,…,vN; without it, 0
    #[arg(long, value_name = "A1,…", value_delimiter = ',', allow_hyphen_values = true, value_parser = motion::parse_state)]
    state: Option<Vec<f64>>,

    /// The attractors, from `nanotap attractors --json`; without it, a census in the slice
    /// finds them
    #[arg(long, value_name = "FILE", conflicts_with = "starts")]
    attractors: Option<PathBuf>,

    /// Starts of the census
    #[arg(long, value_name = "S", default_value_t = 64)]
    starts: usize,

    /// Seed of the census
    #[arg(long, value_name = "K", default_value_t = 1)]
    seed: u64,

    /// Drive periods after which a point is called unsettled
    #[arg(long, value_name = "P", default_value_t = 1000)]
    periods: usize,

    /// Longest period looked for
    #[arg(long, value_name = "N", default_value_t = 64)]
    max_period: usize,

    #[command(flatten)]
    dataset: DatasetArguments,
    #[command(flatten)]
    plot: PlotArgument,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let begun = Instant::now();
    let options = arguments.options()?;
    let studied = GivenCase::of(&arguments.case, output)?;
    let dataset = &arguments.dataset;
    let name = derived_name(
        arguments.case.file.as_deref(),
        &["basin", &options.x.name, &options.y.name],
    );
    let destination = dataset.destination(&name, arguments.plot.plot.as_deref())?;
    if let Some(path) = &arguments.plot.plot {
        file::ending(path, &["svg", "png", "pdf"])?;
    }
    let basin = progress::watched(output, "starts of the census", |control| {
        dataset
            .threads
            .install(|| Basin::new(&studied, &options, control))
    })???;
    let store = dataset.compute(
        &destination.store,
        basin.schema(),
        "rows",
        output,
        |store, work| basin.compute(store, work),
    )?;
    let plot = arguments.plot.plot.as_deref();
    let done = DatasetReport::of(&store, destination, plot, begun, shares, figure)?;
    output.result(&done, |done| text(&studied, &options, done))
}

impl Arguments {
    fn options(&self) -> Result<BasinOptions, Failure> {
        let range = |option: &str, given: &str| {
            SliceRange::parse(given).map_err(|error| {
                Failure::input(
                    format!("--{option} {error}"),
                    format!(
                        "write --{option} a1=-1:1:200: entry, first value, last value, how many"
                    ),
                )
            })
        };
        let attractors = self.attractors.as_deref().map(states).transpose()?;
        Ok(BasinOptions {
            state: self.state.clone(),
            attractors,
            starts: self.starts,
            seed: self.seed,
            periods: self.periods,
            max_period: self.max_period,
            ..BasinOptions::new(range("x", &self.x)?, range("y", &self.y)?)
        })
    }
}

/// The states on the attractors that a file of `nanotap attractors --json` names.
fn states(path: &Path) -> Result<Vec<Vec<f64>>, Failure> {
    let refuse = |why: String| {
        Failure::input(
            format!("{}: {why}", path.display()),
            "make it with `nanotap attractors CASE --json > FILE`",
        )
    };
    let text = std::fs::read_to_string(path).map_err(|error| refuse(error.to_string()))?;
    let document: serde_json::Value =
        serde_json::from_str(&text).map_err(|error| refuse(format!("it is no JSON: {error}")))?;
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

fn text(studied: &GivenCase, options: &BasinOptions, done: &DatasetReport<Shares>) -> String {
    let heading = format!(
        "{}: {}, {} by {} starts over {} and {}",
        studied.title(),
        studied.summary(),
        options.x.count,
        options.y.count,
        options.x.name,
        options.y.name
    );
    done.text(&heading, parts)
}

/// What part of the slice goes where.
fn parts(shares: &Shares) -> String {
    let mut table = Table::new([
        ("", Align::Right),
        ("attractor", Align::Left),
        ("starts (%)", Align::Point),
    ]);
    let percent = |part: f64| number::significant(100.0 * part, 4);
    for (k, attractor) in shares.attractors.iter().enumerate() {
        let name = attractor.period.map_or_else(
            || attractor.classification.clone(),
            |period| format!("period {period}"),
        );
        table.row([(k + 1).to_string(), name, percent(attractor.fraction)]);
    }
    for (name, part) in [
        ("none within the periods", shares.unsettled),
        ("left every bound", shares.unbounded),
        ("could not be followed", shares.failed),
    ] {
        if part > 0.0 {
            table.row([String::new(), name.to_owned(), percent(part)]);
        }
    }
    table.render()
}
