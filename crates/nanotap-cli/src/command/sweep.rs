//! `nanotap sweep`: how the motion changes with one or two parameters.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use nanotap::sweep::{
    Follow, Over, OverError, Starts, Summary, Sweep, SweepError, SweepOptions, figure, summary,
};
use serde::Serialize;

use super::attractors::parse_side;
use crate::arguments::{CaseArguments, PlotArgument};
use crate::dataset::{DatasetArguments, derived_name, write_table};
use crate::failure::Failure;
use crate::output::Output;
use crate::studied::Studied;
use crate::table::{Align, Table};
use crate::{motion, number, style};

/// How the motion changes with one or two parameters, from any number of starts.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    case: CaseArguments,

    /// A parameter and its values, as in omega=2:4:400 (first, last, how many), or
    /// alpha4=1:1000:50:log in equal ratios; modes too; once or twice
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

    #[command(flatten)]
    dataset: DatasetArguments,
    #[command(flatten)]
    plot: PlotArgument,
}

/// The JSON document.
#[derive(Serialize)]
struct Document {
    /// The dataset.
    path: PathBuf,
    /// Its chunks, and how many of them are finished.
    chunks: usize,
    finished: usize,
    /// What the runs came to, once all are done.
    #[serde(flatten)]
    summary: Option<Summary>,
    /// What this command took.
    seconds: f64,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let begun = Instant::now();
    let studied = Studied::of(&arguments.case, output)?;
    let sweep = Sweep::new(studied.subject.clone(), arguments.options(&studied)?)?;
    let names: Vec<&str> = sweep.options().over.iter().map(|o| o.key.name()).collect();
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
    let missing = store.missing();
    let summary = (missing == 0).then(|| summary(&store)).transpose()?;
    if let Some(path) = &destination.table {
        write_table(&store, path)?;
    }
    if let Some(path) = &arguments.plot.plot {
        figure(&store)?.write(path)?;
    }
    let document = Document {
        path: destination.store,
        chunks: store.chunks(),
        finished: store.chunks() - missing,
        summary,
        seconds: begun.elapsed().as_secs_f64(),
    };
    output.result(&document, |document| text(&studied, &sweep, document))
}

impl Arguments {
    fn options(&self, studied: &Studied) -> Result<SweepOptions, Failure> {
        let over = self
            .over
            .iter()
            .map(|given| Over::parse(given, &studied.subject))
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

fn text(studied: &Studied, sweep: &Sweep, document: &Document) -> String {
    let options = sweep.options();
    let ranges: Vec<String> = options
        .over
        .iter()
        .map(|over| {
            format!(
                "{} from {} to {} in {} values",
                over.key.name(),
                number::chosen(over.from),
                number::chosen(over.to),
                over.count
            )
        })
        .collect();
    let heading = format!(
        "{}: {}, {}",
        studied.title,
        ranges.join(", "),
        number::counted(sweep.runs(), "run", "runs")
    );
    let mut text = format!("{}\n\n", style::bold(&heading));
    if let Some(summary) = &document.summary {
        text.push_str(&counts(summary));
    } else {
        let _ = writeln!(
            text,
            "  {} of {} chunks are finished",
            document.finished, document.chunks
        );
    }
    let _ = writeln!(
        text,
        "\n  {} in {} s",
        document.path.display(),
        number::significant(document.seconds, 3)
    );
    text
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

impl From<OverError> for Failure {
    fn from(error: OverError) -> Self {
        Self::request(
            format!("--over {error}"),
            "write --over omega=2:4:400: parameter, first value, last value, how many",
        )
    }
}

impl From<SweepError> for Failure {
    fn from(error: SweepError) -> Self {
        let help = match &error {
            SweepError::Count { .. } | SweepError::Twice { .. } | SweepError::Range { .. } => {
                "change --over"
            }
            SweepError::Model { .. } => "keep --over where the model makes sense",
            SweepError::Start(_) => "count the numbers after --state",
            SweepError::Box(_) => "name coordinates as in --box a1=-1:1",
            SweepError::StateWithModes => "leave --state away: every run starts from rest",
            SweepError::Zero { .. } => "give 1 or more",
            SweepError::TooMuch { .. } => "take less at a time",
        };
        Self::request(error.to_string(), help)
    }
}
