//! `nanotap sweep`: how the motion changes with one or two parameters.

use clap::{Args, ValueEnum};
use nanotap::case::Key;
use nanotap::figure::sweep::{figure, response};
use nanotap::study::DatasetStudy as _;
use nanotap::study::sweep::{Follow, Over, Summary, SweepOptions, SweepStudy};

use crate::arguments::{CaseArguments, PlotArgument};
use crate::dataset::{DatasetArguments, DatasetReport, derived_name};
use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::number;
use crate::output::Output;
use crate::request::Request;
use crate::targets;
use crate::text_table::Table;

/// Sweep one or two parameters, from any number of initial states.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    case: CaseArguments,

    #[command(flatten)]
    request: Request<SweepOptions>,

    /// Kind of --plot; default: the response over drive.frequency or over two parameters of a
    /// physical case, else the diagram
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
    /// Largest deflection in each drive period: a bifurcation diagram; over two parameters a map of
    /// the motions
    Diagram,
    /// Amplitude and phase at the drive's frequency: a resonance curve; over two parameters also
    /// maps of amplitude, phase, peak force, dissipation and contact
    Response,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let options = arguments.request.read()?;
    let any_distance = options.over.solves_distance();
    let implied = options.over.first_values();
    let case = GivenCase::with_implied(&arguments.case, &implied, any_distance, output)?;
    let over = options.over.parse(&case)?;
    let keys: Vec<Key> = over.iter().map(|over| over.key).collect();
    case.note_constants(&keys, output);
    let names: Vec<&str> = keys.iter().map(|key| key.path()).collect();
    let name = derived_name(
        arguments.case.file.as_deref(),
        &[&["sweep"], names.as_slice()].concat(),
    );
    let noun = if options.follow == Follow::Off {
        "values"
    } else {
        "lines"
    };
    let shown = arguments.show.unwrap_or_else(|| {
        // A resonance curve is what one sees of the drive's frequency.
        let of_frequency = over[0].key.path().starts_with("drive.frequency");
        if of_frequency || (over.len() == 2 && case.physical().is_some()) {
            Show::Response
        } else {
            Show::Diagram
        }
    });
    let drawn = match shown {
        Show::Diagram => figure,
        Show::Response => response,
    };
    let done = arguments.dataset.run::<SweepStudy>(
        &case,
        &options,
        &name,
        noun,
        options.seed,
        &arguments.plot,
        drawn,
        output,
    )?;
    if let Some(summary) = &done.summary {
        output.remarks(&SweepStudy::remarks(summary));
    }
    output.study(&case, &done, |done| text(&case, &options, &over, done))
}

fn text(
    case: &GivenCase,
    options: &SweepOptions,
    over: &[Over],
    done: &DatasetReport<Summary>,
) -> String {
    let ranges: Vec<String> = over
        .iter()
        .map(|over| {
            format!(
                "{} from {} to {} in {} values",
                over.key.path(),
                targets::value(over, over.from),
                targets::value(over, over.to),
                over.count
            )
        })
        .collect();
    let heading = format!(
        "{}: {}, {}",
        case.title(),
        ranges.join(", "),
        number::counted(options.runs(over), "run", "runs")
    );
    done.text(&heading, |summary| {
        let targets = summary.targets.as_ref();
        let targets = targets.map(|found| targets::text(found, over));
        let unreached = targets::unreached(&summary.unreached, over);
        format!(
            "{}{unreached}{}",
            counts(summary),
            targets.unwrap_or_default()
        )
    })
}

/// Counts the runs by their result, in words.
fn counts(summary: &Summary) -> String {
    let table = Table::all(&summary.count_table());
    match summary.from_neighbours.len() {
        0 => table.render(),
        more => format!(
            "{}\n  {} that no start met, but to which those of neighbouring values lead\n",
            table.render(),
            number::counted(more, "further motion", "further motions"),
        ),
    }
}
