//! `nanotap window`: the operating window, where the lever taps with one motion only.
//!
//! "Window" is what people at the instrument call the range of setpoints and drives in which
//! imaging is stable.

use std::time::Instant;

use clap::Args;
use nanotap::case::{Case, Key};
use nanotap::dataset::StoreError;
use nanotap::study::sweep::{Over, Starts, Sweep, SweepOptions};
use nanotap::study::window::{Condition, Window};

use crate::arguments::{CaseArguments, PlotArgument};
use crate::dataset::{DatasetArguments, DatasetReport, derived_name};
use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::number;
use crate::output::Output;
use crate::table::{Align, Table};

/// The operating window over two parameters: where there is only one motion, and where a second
/// state, subharmonics or chaos threaten.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    case: CaseArguments,

    /// A parameter and its values, as in gap.tip=5nm:25nm:41, drive.free_amplitude=10nm:60nm:26 or
    /// omega=2:4:81; twice, the first is the horizontal axis
    #[arg(
        long,
        value_name = "KEY=FROM:TO:COUNT",
        required = true,
        allow_hyphen_values = true
    )]
    over: Vec<String>,

    /// Quasi-random starts of the census at each point
    #[arg(long, value_name = "S", default_value_t = 16)]
    starts: usize,

    /// Seed of the starts
    #[arg(long, value_name = "K", default_value_t = 1)]
    seed: u64,

    /// Longest period looked for
    #[arg(long, value_name = "N", default_value_t = 32)]
    max_period: usize,

    #[command(flatten)]
    dataset: DatasetArguments,
    #[command(flatten)]
    plot: PlotArgument,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let begun = Instant::now();
    let names: Vec<&str> = arguments
        .over
        .iter()
        .map(|over| over.split('=').next().unwrap_or_default().trim())
        .collect();
    if names.len() != 2 {
        return Err(Failure::input(
            format!("{} parameters make no window", names.len()),
            "give --over twice, as in --over gap.tip=5nm:25nm:41 --over drive.frequency=320kHz:340kHz:41",
        ));
    }
    let studied = GivenCase::of(&arguments.case, output)?;
    let over = arguments
        .over
        .iter()
        .map(|given| Over::parse(given, &studied))
        .collect::<Result<Vec<_>, _>>()?;
    let keys: Vec<Key> = over.iter().map(|over| over.key).collect();
    studied.say_held(&keys, output);
    let options = SweepOptions {
        starts: Starts::Seeded {
            count: arguments.starts,
            seed: arguments.seed,
            sides: Vec::new(),
        },
        // What a motion is counts, not its course.
        periods: 1,
        strobe: 1,
        max_period: arguments.max_period,
        ..SweepOptions::new(over)
    };
    let sweep = Sweep::new(Case::clone(&studied), options)?;
    let name = derived_name(
        arguments.case.file.as_deref(),
        &[&["window"], names.as_slice()].concat(),
    );
    let plot = arguments.plot.plot.as_deref();
    let destination = arguments.dataset.destination(&name, plot)?;
    if let Some(path) = plot {
        crate::file::ending(path, &["svg", "png", "pdf"])?;
    }
    let store = arguments.dataset.compute(
        &destination.store,
        sweep.schema(),
        "values",
        output,
        |store, work| sweep.compute(store, work),
    )?;
    let drawn = |store: &_| -> Result<_, StoreError> { Window::of(store)?.figure(store) };
    let done = DatasetReport::of(&store, destination, plot, begun, Window::of, drawn)?;
    output.result(&done, |done| {
        let heading = format!(
            "{}: operating window over {} and {}, {} at each of {} points",
            studied.title(),
            names[0],
            names[1],
            number::counted(arguments.starts, "start", "starts"),
            sweep.runs() / arguments.starts.max(1)
        );
        done.text(&heading, shares)
    })
}

/// What part of the points is what.
fn shares(window: &Window) -> String {
    let mut table = Table::new([("there is", Align::Left), ("points (%)", Align::Point)]);
    for condition in Condition::ALL {
        let share = window.shares.get(condition.name()).copied().unwrap_or(0.0);
        table.row([
            condition.words().to_owned(),
            number::significant(100.0 * share, 3),
        ]);
    }
    table.render()
}
