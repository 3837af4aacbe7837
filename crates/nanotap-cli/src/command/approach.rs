//! `nanotap approach`: amplitude, phase, force and energy against the distance, both ways.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use nanotap::case::physical::Kind;
use nanotap::case::units::Units;
use nanotap::figure::approach::approach_figure;
use nanotap::number::shortest;
use nanotap::observe::table::shown_phase;
use nanotap::observe::{ObservableSet, Observables, columns};
use nanotap::study::Study;
use nanotap::study::approach::{ApproachPoint, ApproachReport, ApproachStudy};
use nanotap::study::frequency_modulation::{COLUMNS, ModulatedColumn, ModulationReport};
use nanotap::study::simulate::Classification;
use serde::Serialize;

use crate::command::branch::PointsArgument;
use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::study_arguments::StudyArguments;
use crate::table::{Align, Table};
use crate::threads::ThreadsArgument;
use crate::{motion, number, progress, style};

/// Amplitude, phase, force and energy against the distance to the sample, both ways, with the
/// branches that coexist.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    study: StudyArguments<ApproachStudy>,
    #[command(flatten)]
    points: PointsArgument,
    #[command(flatten)]
    threads: ThreadsArgument,
}

/// The report, and the path of its table.
#[derive(Serialize)]
struct Written<'a> {
    /// Path of the table, if it was written to a file.
    path: Option<PathBuf>,
    #[serde(flatten)]
    report: &'a ApproachReport,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let study = &arguments.study;
    let (request, case) = study.read(output)?;
    let report = progress::study::<ApproachStudy>(&case, &request, &arguments.threads)?;
    print(report, &case, study, arguments.points, output)
}

/// Writes table and figure of a curve of distances and prints it.
pub(super) fn print<S: Study>(
    mut report: ApproachReport,
    case: &GivenCase,
    study: &StudyArguments<S>,
    points: PointsArgument,
    output: &Output,
) -> Result<(), Failure> {
    if report.cancelled {
        output.warning("stopped before it was done");
    }
    for limit in &report.limits {
        output.warning(limit);
    }
    if report.beam_clearance.is_some_and(|height| height <= 0.0) {
        output.warning(
            "at the nearest distance another part of the beam than the tip would pass through the \
             sample: the model does not hold there",
        );
    }
    study.out.write(|| csv(&report, &case.units()))?;
    study
        .plot
        .draw(|| approach_figure(&report, &case.units()))?;
    if let Some(branches) = &mut report.branches {
        points.shorten(branches, output);
    }
    let written = Written {
        path: study.out.out.clone(),
        report: &report,
    };
    output.study(case, &written, |_| text(case, &report))
}

/// The table as CSV: one row per distance in both directions, then the coexisting motions.
fn csv(report: &ApproachReport, units: &Units) -> String {
    let si = matches!(units, Units::Si(_));
    let distance = if si { "zc (m)" } else { report.parameter };
    let first = [
        "way",
        distance,
        "classification",
        "period",
        "spectral_radius",
    ];
    let mut header = first.map(str::to_owned).to_vec();
    header.extend(columns::columns(ObservableSet::COMMON, si));
    if report.modulation.is_some() {
        header.extend(COLUMNS.iter().map(|column| match si_of(column, units) {
            Some((kind, _)) => format!("{} ({})", column.name, kind.si_unit()),
            None => column.name.to_owned(),
        }));
    }
    let mut csv = header.join(",") + "\n";
    for p in report.table.iter().chain(&report.coexisting) {
        let mut row = vec![p.spectral_radius];
        row.extend(if si {
            columns::cells_in_si(ObservableSet::COMMON, p.physical.as_ref())
        } else {
            columns::cells(ObservableSet::COMMON, p.observables.as_ref())
        });
        if report.modulation.is_some() {
            row.extend(COLUMNS.iter().map(|column| {
                let unit = si_of(column, units).map_or(1.0, |(_, unit)| unit);
                Some(unit * (column.of)(p.modulation.as_ref()?)?)
            }));
        }
        let period = p.period.map_or_else(String::new, |n| n.to_string());
        let _ = write!(
            csv,
            "{},{},{},{period}",
            p.way.name(),
            shortest(p.zc.filter(|_| si).unwrap_or(p.gap)),
            p.classification.name()
        );
        for value in row {
            let _ = write!(csv, ",{}", value.map_or_else(String::new, shortest));
        }
        csv.push('\n');
    }
    csv
}

/// Quantity of a column and its SI unit, if it has one.
fn si_of(column: &ModulatedColumn, units: &Units) -> Option<(Kind, f64)> {
    column.kind.and_then(|kind| Some((kind, units.si(kind)?)))
}

/// Number of rows that a terminal shows in each direction.
const SHOWN: usize = 16;

/// Returns n if one distance in n is shown.
fn step_of(report: &ApproachReport) -> usize {
    (report.table.len() / (2 * SHOWN)).max(1)
}

/// Formats the table of one distance in `step`, with a line on those that are left out.
fn thinned(table: &Table, step: usize, report: &ApproachReport) -> String {
    let all = report.table.len();
    let left_out = if step > 1 {
        format!("  one in {step} of {all} distances (--out writes all)\n")
    } else {
        String::new()
    };
    table.render() + &left_out + "\n"
}

fn text(case: &GivenCase, report: &ApproachReport) -> String {
    let units = case.units();
    let shown = |kind: Kind, value: f64| number::quantity(&units, kind, value, [5, 4]);
    let heading = format!(
        "{}: {}, distances from {} to {} and back",
        case.title(),
        case.summary(),
        shown(Kind::Length, report.from),
        shown(Kind::Length, report.to)
    );
    let mut text = format!("{}\n\n", style::bold(&heading));
    if let Some(modulation) = &report.modulation {
        text.push_str(&modulated(report, modulation, &shown, &units));
        return text;
    }
    text.push_str(&motion::paragraph(&format!(
        "free: amplitude {}, {}; it touches from {} on",
        shown(Kind::Length, report.free_amplitude),
        motion::lag(report.free_phase, "the drive", 4),
        shown(Kind::Length, report.free_reach)
    )));
    let mut table = Table::new([
        ("way", Align::Left),
        ("distance", Align::Right),
        ("motion", Align::Left),
        ("A", Align::Right),
        ("A/A0", Align::Point),
        ("phase (°)", Align::Point),
        ("E_dis", Align::Right),
        ("F_max", Align::Right),
        ("contact (%)", Align::Point),
    ]);
    let step = step_of(report);
    let row = |p: &ApproachPoint| {
        let what = motion_of(p);
        let of = |value: &dyn Fn(&Observables) -> String| {
            p.observables.as_ref().map_or_else(String::new, value)
        };
        [
            p.way.name().to_owned(),
            shown(Kind::Length, p.gap),
            what,
            of(&|s| shown(Kind::Length, s.first_harmonic)),
            of(&|s| number::significant(s.first_harmonic / report.free_amplitude, 4)),
            of(&|s| number::significant(shown_phase(s.phase), 4)),
            of(&|s| energy(s.dissipation, &units)),
            of(&|s| shown(Kind::Force, s.peak_force)),
            of(&|s| number::significant(100.0 * s.contact_fraction, 3)),
        ]
    };
    for p in report.table.iter().step_by(step) {
        table.row(row(p));
    }
    text.push_str(&thinned(&table, step, report));
    text.push_str(&jumps(report, &shown));
    let settles = !report
        .table
        .iter()
        .any(|p| p.classification == Classification::Transient);
    if report.hysteresis.is_empty() && settles && !report.cancelled {
        text.push_str("  both ways show the same motions\n");
    }
    if let (Some(first), Some(last)) = (report.coexisting.first(), report.coexisting.last()) {
        let periods: BTreeSet<usize> = report.coexisting.iter().filter_map(|p| p.period).collect();
        let periods: Vec<String> = periods.iter().map(ToString::to_string).collect();
        let [near, far] = [last, first].map(|p| shown(Kind::Length, p.gap));
        let place = if near == far {
            format!("at {near}")
        } else {
            format!("from {near} to {far}")
        };
        text.push_str(&motion::paragraph(&format!(
            "{place} further motions attract that neither way met (period {}): --out and --plot \
             have them",
            periods.join(", ")
        )));
    }
    for interval in &report.hysteresis {
        text.push_str(&motion::paragraph(&format!(
            "hysteresis from {} to {}: the amplitudes of the two ways differ by up to {}",
            shown(Kind::Length, interval.near),
            shown(Kind::Length, interval.far),
            shown(Kind::Length, interval.difference)
        )));
    }
    if !report.returned && !report.cancelled {
        text.push_str(&motion::paragraph(
            "the retraction does not end in the motion in which the approach began: begin farther \
             away, with --from",
        ));
    }
    if let Some(branches) = &report.branches
        && !branches.bifurcations.is_empty()
    {
        let _ = writeln!(text, "\n  {}", style::bold("bifurcations of the branches"));
        let mut table = Table::new([
            ("", Align::Left),
            ("distance", Align::Right),
            ("period", Align::Right),
            ("A", Align::Right),
            ("phase (°)", Align::Point),
        ]);
        for b in &branches.bifurcations {
            table.row([
                b.kind.to_owned(),
                shown(Kind::Length, b.parameter),
                b.period.to_string(),
                shown(Kind::Length, b.observables.first_harmonic),
                number::significant(shown_phase(b.observables.phase), 4),
            ]);
        }
        text.push_str(&table.render());
    }
    if let Some(branches) = &report.branches {
        let at = |value| shown(Kind::Length, value);
        text.push_str(&super::branch::failures(branches, at));
    }
    for p in report.table.iter().filter(|p| p.reason.is_some()).take(2) {
        text.push_str(&motion::paragraph(&format!(
            "{} at {}: {}",
            p.classification.name(),
            shown(Kind::Length, p.gap),
            p.reason.as_deref().unwrap_or_default()
        )));
    }
    text
}

/// Smallest relative uncertainty of a distance that is shown.
const SHOWN_UNCERTAINTY: f64 = 1e-9;

/// Formats the table of the distances at which the motion jumps; empty if it does not.
fn jumps(report: &ApproachReport, shown: &dyn Fn(Kind, f64) -> String) -> String {
    if report.jumps.is_empty() {
        return String::new();
    }
    let mut table = Table::new([
        ("jump on", Align::Left),
        ("distance", Align::Right),
        ("at", Align::Left),
        ("from", Align::Left),
        ("A/A0", Align::Point),
        ("phase (°)", Align::Point),
        ("to", Align::Left),
        ("A/A0", Align::Point),
        ("phase (°)", Align::Point),
    ]);
    for jump in &report.jumps {
        let of = |p: &ApproachPoint| {
            let [ratio, phase] = p.observables.as_ref().map_or_else(Default::default, |s| {
                [
                    number::significant(s.first_harmonic / report.free_amplitude, 4),
                    number::significant(shown_phase(s.phase), 4),
                ]
            });
            [motion_of(p), ratio, phase]
        };
        let ([what, ratio, phase], [then, later, after]) = (of(&jump.before), of(&jump.after));
        let reason = if jump.uncertainty > SHOWN_UNCERTAINTY * jump.gap.abs() {
            let within = shown(Kind::Length, jump.uncertainty);
            format!("{} (within {within})", jump.reason)
        } else {
            jump.reason.clone()
        };
        table.row([
            jump.way.name().to_owned(),
            shown(Kind::Length, jump.gap),
            reason,
            what,
            ratio,
            phase,
            then,
            later,
            after,
        ]);
    }
    table.render() + "\n"
}

/// Name of the motion of a row: its period, or its classification.
fn motion_of(p: &ApproachPoint) -> String {
    p.period.map_or_else(
        || p.classification.name().to_owned(),
        |n| format!("period {n}"),
    )
}

/// Formats the set values and the results of frequency modulation.
fn modulated(
    report: &ApproachReport,
    modulation: &ModulationReport,
    shown: &dyn Fn(Kind, f64) -> String,
    units: &Units,
) -> String {
    let kept = match modulation.closest {
        Some(closest) => format!(
            "least distance {} (amplitude {} at first)",
            shown(Kind::Length, closest),
            shown(Kind::Length, modulation.amplitude)
        ),
        None => format!("amplitude {}", shown(Kind::Length, modulation.amplitude)),
    };
    let mut text = motion::paragraph(&format!(
        "frequency modulation: {kept}, {} are held; free: {}, {} lost in a period",
        motion::lag(modulation.phase, "the drive", 4),
        shown(Kind::Frequency, modulation.free_frequency),
        energy(modulation.free_loss, units),
    ));
    let mut table = Table::new([
        ("way", Align::Left),
        (
            if modulation.closest.is_some() {
                "A"
            } else {
                "distance"
            },
            Align::Right,
        ),
        ("Δf", Align::Right),
        ("Δf/f0", Align::Right),
        ("first order", Align::Right),
        ("drive/free", Align::Point),
        ("E_dis", Align::Right),
        ("F_max", Align::Right),
        ("contact (%)", Align::Point),
        ("open loop", Align::Left),
    ]);
    let step = step_of(report);
    for p in report.table.iter().step_by(step) {
        let (Some(found), Some(seen)) = (&p.modulation, &p.observables) else {
            continue;
        };
        table.row([
            p.way.name().to_owned(),
            shown(
                Kind::Length,
                modulation.closest.map_or(p.gap, |_| seen.first_harmonic),
            ),
            shown(Kind::Frequency, found.frequency_shift),
            number::significant(found.relative_shift, 5),
            found
                .first_order_shift
                .map_or_else(String::new, |shift| number::significant(shift, 5)),
            number::significant(found.drive_ratio, 5),
            energy(seen.dissipation, units),
            shown(Kind::Force, seen.peak_force),
            number::significant(100.0 * seen.contact_fraction, 3),
            p.orbit
                .as_ref()
                .map_or_else(String::new, |orbit| orbit.stability.name().to_owned()),
        ]);
    }
    text.push_str(&thinned(&table, step, report));
    text.push_str(&motion::paragraph(modulation.multipliers));
    for setpoint in modulation.setpoints.iter().flatten() {
        let shift = setpoint.modulation.map_or(f64::NAN, |m| m.frequency_shift);
        text.push_str(&motion::paragraph(&format!(
            "Δf = {} on {} at {}",
            shown(Kind::Frequency, shift),
            setpoint.way.name(),
            shown(Kind::Length, setpoint.gap)
        )));
    }
    if modulation.setpoints.as_ref().is_some_and(Vec::is_empty) {
        text.push_str(&motion::paragraph(
            "no distance of the curve has the requested frequency shift",
        ));
    }
    for jump in &modulation.jumps {
        text.push_str(&motion::paragraph(&format!(
            "on {} no orbit could be followed between {} and {}: the next is another one",
            jump.way.name(),
            shown(Kind::Length, jump.from),
            shown(Kind::Length, jump.to)
        )));
    }
    for ended in &modulation.ended {
        text.push_str(&motion::paragraph(&format!(
            "{} ends at {}: {}",
            ended.way.name(),
            shown(Kind::Length, ended.gap),
            ended.reason
        )));
    }
    for interval in &report.hysteresis {
        text.push_str(&motion::paragraph(&format!(
            "hysteresis from {} to {}: Δf/f0 of the two ways differs by up to {}",
            shown(Kind::Length, interval.near),
            shown(Kind::Length, interval.far),
            number::significant(interval.difference, 4)
        )));
    }
    text
}

fn energy(value: f64, units: &Units) -> String {
    number::quantity(units, Kind::Energy, value, [4, 4])
}
