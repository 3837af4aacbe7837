//! `nanotap branch`: periodic orbits followed in a parameter, stable and unstable.

use std::fmt::Write as _;

use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use nanotap::case::physical::Kind;
use nanotap::case::units::Units;
use nanotap::figure::branch::{Shown, case_figure};
use nanotap::number::shortest;
use nanotap::observe::{ObservableSet, columns, time_series};
use nanotap::study::branch::{AttractorShare, BranchReport, BranchStudy, PointReport};
use nanotap::study::orbit::spectral_radius;

use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::study_arguments::StudyArguments;
use crate::table::{Align, Table};
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
    show: Option<Shown>,

    #[command(flatten)]
    points: PointsArgument,
    #[command(flatten)]
    threads: ThreadsArgument,
}

/// The names of what can be shown.
fn shown() -> impl TypedValueParser<Value = Shown> {
    let choices = Shown::choices().map(|(name, what)| PossibleValue::new(name).help(what));
    PossibleValuesParser::new(choices)
        .try_map(|name| Shown::named(&name).ok_or_else(|| format!("unknown observable {name}")))
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let (mut options, case) = arguments.study.read(output)?;
    case.note_constants(&[options.range(&case)?.key], output);
    if let Some(shown) = arguments.show.and_then(Shown::observable) {
        options.observables = options.observables.with(shown);
    }
    let mut report = progress::study::<BranchStudy>(&case, &options, &arguments.threads)?;
    if report.cancelled {
        output.warning("stopped before it was done");
    }
    let model = case.model()?;
    if let Some(path) = &arguments.study.out.out {
        let names = time_series::state_names(&model);
        let table = csv(&report, options.observables, &names, &case.units());
        file::write(path, table.as_bytes())?;
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

/// A row a point, branch by branch; `kind` is empty but for bifurcations, which follow the
/// points of their branch.
fn csv(report: &BranchReport, observed: ObservableSet, names: &[String], units: &Units) -> String {
    let si = matches!(units, Units::Si(_));
    let key = report.key;
    let parameter = match key.kind() {
        kind if key.is_physical() && kind != Kind::Number => {
            format!("{key} ({})", kind.si_unit())
        }
        _ => key.path().to_owned(),
    };
    let first = [
        "branch",
        "kind",
        "period",
        &parameter,
        "stable",
        "spectral_radius",
    ];
    let mut header = first.map(str::to_owned).to_vec();
    header.extend(columns::columns(observed, si));
    header.extend(names.iter().map(|name| units.state_column(name)));
    let mut csv = header.join(",") + "\n";
    let mut row = |branch: usize, kind: &str, p: &PointReport| {
        let _ = write!(
            csv,
            "{branch},{kind},{},{},{},{}",
            p.period,
            shortest(p.parameter),
            p.stable,
            shortest(spectral_radius(&p.multipliers)),
        );
        let cells = if si {
            columns::cells_in_si(observed, p.physical.as_ref())
        } else {
            columns::cells(observed, Some(&p.observables))
        };
        for cell in cells.into_iter().chain(p.state.iter().copied().map(Some)) {
            let _ = write!(csv, ",{}", cell.map_or_else(String::new, shortest));
        }
        csv.push('\n');
    };
    for branch in 0..report.branches.len() {
        for p in report.points.iter().filter(|p| p.branch == branch) {
            row(branch, "", p);
        }
        for b in report.bifurcations.iter().filter(|b| b.branch == branch) {
            let point = PointReport {
                branch,
                period: b.period,
                parameter: b.parameter,
                parameter_si: b.parameter_si,
                state: b.state.clone(),
                multipliers: b.multipliers.clone(),
                stable: false,
                observables: b.observables,
                physical: b.physical.clone(),
            };
            row(branch, b.kind, &point);
        }
    }
    csv
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
    let of_key = |key, value: f64, digits| {
        case.parameter_unit(key).map_or_else(
            || number::significant(value, digits),
            |unit| unit.kind.format_digits(unit.si * value, digits),
        )
    };
    let shown = |value, digits| of_key(report.key, value, digits);
    let length = |value: f64| number::quantity(&case.units(), Kind::Length, value, [5, 5]);
    let heading = format!(
        "{}: {} from {} to {}",
        case.title(),
        report.parameter,
        shown(report.from, 6),
        shown(report.to, 6)
    );
    let mut text = format!("{}\n\n", style::bold(&heading));
    let mut table = Table::new([
        ("branch", Align::Right),
        ("period", Align::Right),
        ("from", Align::Right),
        ("points", Align::Right),
        ("stable", Align::Right),
        ("reaches", Align::Left),
        ("ends at", Align::Left),
    ]);
    for (k, branch) in report.branches.iter().enumerate() {
        let stable = report
            .points
            .iter()
            .filter(|p| p.branch == k && p.stable)
            .count();
        table.row([
            (k + 1).to_string(),
            branch.period.to_string(),
            branch
                .parent
                .map_or_else(String::new, |p| format!("branch {}", p + 1)),
            branch.points.to_string(),
            stable.to_string(),
            format!(
                "{} … {}",
                shown(branch.range[0], 6),
                shown(branch.range[1], 6)
            ),
            branch.end.clone(),
        ]);
    }
    text.push_str(&table.render());
    text.push('\n');
    if report.bifurcations.is_empty() {
        text.push_str("  no bifurcation on the way\n");
    } else {
        let _ = writeln!(text, "  {}", style::bold("bifurcations"));
        let mut table = Table::new([
            ("branch", Align::Right),
            ("", Align::Left),
            (report.parameter, Align::Left),
            ("period", Align::Right),
            ("tip", Align::Left),
            ("contact (%)", Align::Point),
            ("", Align::Left),
        ]);
        for b in &report.bifurcations {
            let pair = b.angle.map(|angle| format!("pair at {angle:.2}°"));
            let extra: Vec<String> = (b.criticality.map(str::to_owned).into_iter())
                .chain(pair)
                .collect();
            table.row([
                (b.branch + 1).to_string(),
                b.kind.to_owned(),
                shown(b.parameter, 10),
                b.period.to_string(),
                format!(
                    "{} … {}",
                    length(b.observables.tip_min),
                    length(b.observables.tip_max)
                ),
                number::significant(100.0 * b.observables.contact_fraction, 4),
                extra.join(", "),
            ]);
        }
        text.push_str(&table.render());
    }
    if !report.events.is_empty() {
        let _ = writeln!(text, "\n  {}", style::bold("events"));
        let mut table = Table::new([
            ("branch", Align::Right),
            ("", Align::Left),
            (report.parameter, Align::Left),
            ("period", Align::Right),
            ("", Align::Left),
        ]);
        for found in &report.events {
            let point = &found.point;
            table.row([
                (point.branch + 1).to_string(),
                found.event.clone(),
                shown(point.parameter, 10),
                point.period.to_string(),
                if point.stable { "stable" } else { "unstable" }.to_owned(),
            ]);
        }
        text.push_str(&table.render());
    }
    if !report.attractors.is_empty() {
        let _ = writeln!(text, "\n  {}", style::bold("attractors of the census"));
        text.push_str(&attractors(report, |value| shown(value, 6)));
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
        let mut table = Table::new([
            ("", Align::Left),
            ("period", Align::Right),
            ("points", Align::Right),
            (report.parameter, Align::Left),
            (loci.second, Align::Left),
            ("ends at", Align::Left),
        ]);
        let range = |key, values: &[f64]| {
            let low = values.iter().copied().fold(f64::INFINITY, f64::min);
            let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            format!("{} … {}", of_key(key, low, 6), of_key(key, high, 6))
        };
        for curve in &loci.curves {
            table.row([
                curve.event.clone().unwrap_or_else(|| curve.kind.to_owned()),
                curve.period.to_string(),
                curve.first.len().to_string(),
                range(report.key, &curve.first),
                range(loci.key, &curve.second),
                curve.ends.join("; "),
            ]);
        }
        text.push_str(&table.render());
    }
    text.push_str(&failures(report, |value| shown(value, 8)));
    text
}

/// A row an attractor: where it exists, and its least and greatest share. Motions that are not
/// joined from value to value count together.
fn attractors(report: &BranchReport, shown: impl Fn(f64) -> String) -> String {
    let mut table = Table::new([
        ("", Align::Right),
        ("motion", Align::Left),
        (report.parameter, Align::Left),
        ("share (%)", Align::Left),
    ]);
    let is_orbit = |one: &AttractorShare| one.period > 0;
    let mut groups: Vec<(Option<usize>, Vec<&AttractorShare>)> = Vec::new();
    for one in &report.attractors {
        let number = is_orbit(one).then_some(one.attractor);
        let same = |(of, all): &&mut (Option<usize>, Vec<&AttractorShare>)| {
            *of == number && (number.is_some() || all[0].classification == one.classification)
        };
        match groups.iter_mut().find(same) {
            Some((_, all)) => all.push(one),
            None => groups.push((number, vec![one])),
        }
    }
    for (number, all) in groups {
        let (first, last) = (all[0], all[all.len() - 1]);
        let low = all.iter().map(|one| one.share).fold(1.0, f64::min);
        let high = all.iter().map(|one| one.share).fold(0.0, f64::max);
        let motion = if is_orbit(first) {
            format!("period {}", first.period)
        } else {
            first.classification.to_owned()
        };
        let percent = |share: f64| number::significant(100.0 * share, 3);
        table.row([
            number.map_or_else(String::new, |number| (number + 1).to_string()),
            motion,
            if all.len() > 1 {
                format!("{} … {}", shown(first.parameter), shown(last.parameter))
            } else {
                shown(first.parameter)
            },
            if low < high {
                format!("{} … {}", percent(low), percent(high))
            } else {
                percent(low)
            },
        ]);
    }
    table.render()
}
