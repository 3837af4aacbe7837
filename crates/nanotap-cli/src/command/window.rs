//! `nanotap window`: the operating window, where the lever taps with one motion only.
//!
//! "Window" is what people at the instrument call the range of setpoints and drives in which
//! imaging is stable.

use std::time::Instant;

use clap::Args;
use nanotap::case::Key;
use nanotap::figure::window::figure;
use nanotap::study::Computation as _;
use nanotap::study::window::{Condition, Window, WindowOptions};

use crate::arguments::{CaseArguments, PlotArgument};
use crate::dataset::{DatasetArguments, DatasetReport, derived_name};
use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::number;
use crate::output::Output;
use crate::request::Request;
use crate::table::{Align, Table};

/// The operating window over two parameters: where there is only one motion, and where a second
/// state, subharmonics or chaos threaten.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    case: CaseArguments,

    #[command(flatten)]
    request: Request<WindowOptions>,

    #[command(flatten)]
    dataset: DatasetArguments,
    #[command(flatten)]
    plot: PlotArgument,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let request = arguments.request.read()?;
    let begun = Instant::now();
    let names = request.over.names();
    let case = GivenCase::of(&arguments.case, output)?;
    let sweep = request.sweep(&case)?;
    let keys: Vec<Key> = sweep.over().iter().map(|over| over.key).collect();
    case.say_held(&keys, output);
    let name = derived_name(
        arguments.case.file.as_deref(),
        &[&["window"], names.as_slice()].concat(),
    );
    let plot = arguments.plot.plot.as_deref();
    let destination = arguments.dataset.destination(&name, plot)?;
    arguments.plot.check()?;
    let store = arguments.dataset.compute(
        &destination.store,
        sweep.schema(),
        ["window", "values"],
        output,
        |store, work| sweep.compute(store, work),
    )?;
    let seed = request.seed;
    let done = DatasetReport::of(&store, destination, plot, begun, seed, Window::kept, figure)?;
    output.study(&case, &done, |done| {
        let heading = format!(
            "{}: operating window over {} and {}, {} at each of {} points",
            case.title(),
            names[0],
            names[1],
            number::counted(request.starts, "start", "starts"),
            sweep.runs() / request.starts.max(1)
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
