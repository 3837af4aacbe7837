//! `nanotap sweep`: how the motion changes with one or two parameters.

use std::time::Instant;

use clap::{Args, ValueEnum};
use nanotap::case::physical::Kind;
use nanotap::case::{Case, Key};
use nanotap::study::sweep::{
    Follow, Over, Starts, Summary, Sweep, SweepOptions, figure, response_figure, summary,
};

use super::attractors::parse_side;
use crate::arguments::{CaseArguments, PlotArgument};
use crate::dataset::{DatasetArguments, DatasetReport, derived_name};
use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::table::{Align, Table};
use crate::{motion, number};

/// How the motion changes with one or two parameters, from any number of starts.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    case: CaseArguments,

    /// A parameter and its values, as in omega=2:4:400 (first, last, how many), or
    /// alpha4=1:1000:50:log in equal ratios; modes too; of a physical case also
    /// drive.frequency=60kHz:80kHz:200; once or twice
    #[arg(
        long,
        value_name = "KEY=FROM:TO:COUNT",
        required = true,
        allow_hyphen_values = true
    )]
    over: Vec<String>,

    /// Quasi-random starts at each value, spread over a box of states; without it, one start
    /// from rest
    #[arg(long, value_name = "S", conflicts_with = "state")]
    starts: Option<usize>,

    /// Seed of the starts
    #[arg(long, value_name = "K", default_value_t = 1)]
    seed: u64,

    /// A side of the box, as in a1=-1:1 or v2=-4:4; may be repeated; the other sides are
    /// derived from the linear response to the drive
    #[arg(long = "box", value_name = "COORDINATE=LOW:HIGH", allow_hyphen_values = true, value_parser = parse_side, requires = "starts")]
    sides: Vec<(String, f64, f64)>,

    /// Start from this state at drive phase 0: a1,…,aN,v1,…,vN (oscillator: x,v)
    #[arg(long, value_name = "A1,…", value_delimiter = ',', allow_hyphen_values = true, value_parser = motion::parse_state)]
    state: Option<Vec<f64>>,

    /// Start each value from the last state of the one before, along the first --over: up,
    /// down or both. A whole line is then one piece of work, lost when interrupted
    #[arg(long, value_name = "WAY")]
    follow: Option<Follow>,

    /// Drive periods recorded
    #[arg(long, value_name = "P", default_value_t = 100)]
    periods: usize,

    /// States kept, at the end of each of the last periods; without it, of every recorded one
    #[arg(long, value_name = "K")]
    strobe: Option<usize>,

    /// Drive periods thrown away first; without it, as many as the motion is measured to need
    #[arg(long, value_name = "T")]
    transient: Option<usize>,

    /// Longest period looked for
    #[arg(long, value_name = "N", default_value_t = 64)]
    max_period: usize,

    /// What --plot shows of one parameter; without it the response over drive.frequency, else
    /// the diagram
    #[arg(long, value_enum)]
    show: Option<Show>,

    #[command(flatten)]
    dataset: DatasetArguments,
    #[command(flatten)]
    plot: PlotArgument,
}

/// What a picture shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Show {
    /// Greatest deflection in each drive period: a bifurcation diagram
    Diagram,
    /// Amplitude and phase at the drive's frequency: a resonance curve
    Response,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let begun = Instant::now();
    let studied = GivenCase::of(&arguments.case, output)?;
    let sweep = Sweep::new(Case::clone(&studied), arguments.options(&studied)?)?;
    let keys: Vec<Key> = sweep.options().over.iter().map(|o| o.key).collect();
    studied.say_held(&keys, output);
    let names: Vec<&str> = keys.iter().map(|key| key.path()).collect();
    let name = derived_name(
        arguments.case.file.as_deref(),
        &[&["sweep"], names.as_slice()].concat(),
    );
    let dataset = &arguments.dataset;
    let destination = dataset.destination(&name, arguments.plot.plot.as_deref())?;
    if let Some(path) = &arguments.plot.plot {
        crate::file::ending(path, &["svg", "png", "pdf"])?;
    }
    let noun = if sweep.options().follow == Follow::Off {
        "values"
    } else {
        "lines"
    };
    let store = dataset.compute(
        &destination.store,
        sweep.schema(),
        noun,
        output,
        |store, work| sweep.compute(store, work),
    )?;
    let shown = arguments.show.unwrap_or_else(|| {
        // A resonance curve is what one sees of the drive's frequency.
        let key = sweep.options().over[0].key.name();
        if key.starts_with("drive.frequency") {
            Show::Response
        } else {
            Show::Diagram
        }
    });
    let drawn = match shown {
        Show::Diagram => figure,
        Show::Response => response_figure,
    };
    let plot = arguments.plot.plot.as_deref();
    let done = DatasetReport::of(&store, destination, plot, begun, summary, drawn)?;
    output.result(&done, |done| text(&studied, &sweep, done))
}

impl Arguments {
    fn options(&self, studied: &GivenCase) -> Result<SweepOptions, Failure> {
        let over = self
            .over
            .iter()
            .map(|given| Over::parse(given, studied))
            .collect::<Result<Vec<_>, _>>()?;
        let starts = match (self.starts, &self.state) {
            (Some(count), _) => Starts::Seeded {
                count,
                seed: self.seed,
                sides: self.sides.clone(),
            },
            (None, Some(state)) => Starts::Given(state.clone()),
            (None, None) => Starts::Rest,
        };
        Ok(SweepOptions {
            starts,
            follow: self.follow.unwrap_or_default(),
            periods: self.periods,
            strobe: self.strobe.unwrap_or(self.periods).min(self.periods),
            transient: self.transient,
            max_period: self.max_period,
            ..SweepOptions::new(over)
        })
    }
}

fn text(studied: &GivenCase, sweep: &Sweep, done: &DatasetReport<Summary>) -> String {
    let options = sweep.options();
    let ranges: Vec<String> = options
        .over
        .iter()
        .map(|over| {
            format!(
                "{} from {} to {} in {} values",
                over.key.name(),
                value(over, over.from),
                value(over, over.to),
                over.count
            )
        })
        .collect();
    let heading = format!(
        "{}: {}, {}",
        studied.title(),
        ranges.join(", "),
        number::counted(sweep.runs(), "run", "runs")
    );
    done.text(&heading, counts)
}

/// A value of a parameter in words.
fn value(over: &Over, value: f64) -> String {
    match over.key.kind() {
        Kind::Number => number::chosen(value),
        kind => kind.format(value),
    }
}

/// How many runs came to what.
fn counts(summary: &Summary) -> String {
    const SHOWN: usize = 12;
    let mut table = Table::new([
        ("motion", Align::Left),
        ("runs", Align::Right),
        ("%", Align::Point),
    ]);
    let mut row = |name: String, count: usize| {
        let part = 100.0 * count as f64 / summary.runs.max(1) as f64;
        table.row([name, count.to_string(), number::significant(part, 3)]);
    };
    for (name, count) in &summary.counts {
        if *count > 0 {
            row((*name).to_owned(), *count);
        }
        if *name == "periodic" {
            for (period, count) in summary.periods.iter().take(SHOWN) {
                row(format!("  period {period}"), *count);
            }
            if summary.periods.len() > SHOWN {
                let rest = summary.periods.values().skip(SHOWN).sum();
                row("  longer".to_owned(), rest);
            }
        }
    }
    table.render()
}
