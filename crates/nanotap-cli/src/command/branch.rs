//! `nanotap branch`: periodic orbits followed in a parameter, stable and unstable.

use std::fmt::Write as _;

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use nanotap::figure::branch::{PlottedQuantity, case_figure};
use nanotap::observe::time_series;
use nanotap::study::branch::{BranchOptions, BranchReport, BranchStudy};

use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::study_arguments::StudyArguments;
use crate::text_table::Table;
use crate::threads::ThreadsArgument;
use crate::{file, motion, number, progress, style};

/// Bytes of points of branches beyond which a document does not list all.
const LONGEST_DOCUMENT: usize = 900_000;

/// Periodic orbits followed in a parameter, stable and unstable, with their bifurcations.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    study: StudyArguments<BranchStudy>,

    /// Observable that --plot shows against the parameter
    #[arg(long, value_name = "OBSERVABLE", value_parser = shown())]
    show: Option<PlottedQuantity>,

    #[command(flatten)]
    points: PointsArgument,
    #[command(flatten)]
    threads: ThreadsArgument,
}

/// The names of what can be shown.
fn shown() -> impl TypedValueParser<Value = PlottedQuantity> {
    let choices =
        PlottedQuantity::choices().map(|(name, what)| PossibleValue::new(name).help(what));
    PossibleValuesParser::new(choices).try_map(|name| {
        PlottedQuantity::named(&name).ok_or_else(|| format!("unknown observable {name}"))
    })
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let (mut options, case) = arguments
        .study
        .read_varied(BranchOptions::first_value, output)?;
    case.note_constants(&[options.range(&case)?.key], output);
    if let Some(shown) = arguments.show.and_then(PlottedQuantity::observable) {
        options.observables = options.observables.with(shown);
    }
    let mut report = progress::study::<BranchStudy>(&case, &options, &arguments.threads)?;
    output.stopped(report.cancelled);
    let model = case.model()?;
    if let Some(path) = &arguments.study.out.out {
        let names = time_series::state_names(&model);
        let table = report.point_table(names, case.units());
        file::write(path, table.csv().as_bytes())?;
    }
    arguments
        .study
        .plot
        .draw(|| case_figure(&case, &report, arguments.show))?;
    arguments.points.shorten(&mut report, output);
    output.study(&case, &report, |report| text(&case, report))?;
    let cut = report.branches.iter().filter(|b| !b.complete).count();
    if cut > 0 && !report.cancelled {
        let what = number::counted(cut, "branch was", "branches were");
        return Err(Failure::numerics(format!("{what} cut before the end")));
    }
    Ok(())
}

/// How many points of branches a document lists.
#[derive(Args, Clone, Copy, Debug, Default)]
pub(crate) struct PointsArgument {
    /// List every point of the branches in the JSON document, whatever its length
    #[arg(long)]
    all_points: bool,
}

impl PointsArgument {
    /// Leaves points out of a document in which they would be longer than [`LONGEST_DOCUMENT`].
    pub(crate) fn shorten(self, report: &mut BranchReport, output: &Output) {
        if output.is_json() && !self.all_points {
            shorten(report, output);
        }
    }
}

fn shorten(report: &mut BranchReport, output: &Output) {
    let point = report.points.first();
    let bytes = point
        .and_then(|p| serde_json::to_string_pretty(p).ok())
        // Each line is indented by four spaces more.
        .map_or(0, |p| p.len() + 4 * p.lines().count());
    let step = (bytes * report.points.len()).div_ceil(LONGEST_DOCUMENT);
    if step > 1 {
        report.thin(step);
        output.note(&format!(
            "{} points of branches between those in the document are left out; --all-points lists them",
            report.points_left_out
        ));
    }
}

/// What could not be followed or measured, where it stands as `at` writes it.
pub(super) fn failures(report: &BranchReport, at: impl Fn(f64) -> String) -> String {
    let mut text = String::new();
    if !report.failures.is_empty() {
        let _ = writeln!(text, "\n  {}", style::bold("not followed"));
    }
    for failure in &report.failures {
        text.push_str(&motion::paragraph(&format!(
            "{} = {}: {}",
            report.parameter,
            at(failure.parameter),
            failure.reason
        )));
    }
    text
}

fn text(case: &GivenCase, report: &BranchReport) -> String {
    let shown = |value: f64, digits| {
        case.parameter_unit(report.key).map_or_else(
            || number::significant(value, digits),
            |unit| unit.kind.format_digits(unit.si * value, digits),
        )
    };
    let heading = format!(
        "{}: {} from {} to {}",
        case.title(),
        report.parameter,
        shown(report.from, 6),
        shown(report.to, 6)
    );
    let mut text = format!("{}\n\n", style::bold(&heading));
    let units = case.units();
    text.push_str(&Table::all(&report.branch_table(units)).render());
    text.push('\n');
    if report.bifurcations.is_empty() {
        text.push_str("  no bifurcation on the way\n");
    } else {
        let _ = writeln!(text, "  {}", style::bold("bifurcations"));
        text.push_str(&Table::all(&report.bifurcation_table(units)).render());
    }
    if !report.events.is_empty() {
        let _ = writeln!(text, "\n  {}", style::bold("events"));
        text.push_str(&Table::all(&report.event_table(units)).render());
    }
    if !report.attractors.is_empty() {
        let _ = writeln!(text, "\n  {}", style::bold("attractors of the census"));
        text.push_str(&Table::all(&report.attractor_table(units)).render());
    }
    if let Some(loci) = &report.loci {
        let _ = writeln!(
            text,
            "\n  {}",
            style::bold(&format!(
                "curves in {} and {}",
                report.parameter, loci.second
            ))
        );
        let second = case.parameter_unit(loci.key);
        text.push_str(&Table::all(&report.curve_table(second, units)).render());
    }
    text.push_str(&failures(report, |value| shown(value, 8)));
    text
}
