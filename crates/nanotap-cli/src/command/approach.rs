//! `nanotap approach`: amplitude, phase, force and energy against the distance, both ways.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use nanotap::case::physical::Kind;
use nanotap::case::units::Units;
use nanotap::study::Study;
use nanotap::study::approach::{ApproachReport, ApproachStudy};
use nanotap::study::frequency_modulation::ModulationReport;
use nanotap::study::simulate::Classification;
use serde::Serialize;

use crate::command::branch::PointsArgument;
use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::study_arguments::StudyArguments;
use crate::text_table::Table;
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
pub(super) fn print<S: Study<Report = ApproachReport>>(
    mut report: ApproachReport,
    case: &GivenCase,
    study: &StudyArguments<S>,
    points: PointsArgument,
    output: &Output,
) -> Result<(), Failure> {
    output.stopped(report.cancelled);
    output.remarks(&S::remarks(case, &report));
    study.write(case, &report)?;
    if let Some(branches) = &mut report.branches {
        points.shorten(branches, output);
    }
    let written = Written {
        path: study.out.out.clone(),
        report: &report,
    };
    output.study(case, &written, |_| text(case, &report))
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
    let step = step_of(report);
    let rows = (0..report.table.len()).step_by(step);
    let table = Table::of(&report.motion_table(units), rows);
    text.push_str(&thinned(&table, step, report));
    if !report.jumps.is_empty() {
        text.push_str(&(Table::all(&report.jump_table(units)).render() + "\n"));
    }
    let settles = !report
        .table
        .iter()
        .any(|p| p.classification == Classification::Transient);
    if report.hysteresis.is_empty() && settles && !report.cancelled {
        text.push_str(if report.compared {
            "  both ways show the same motions\n"
        } else {
            "  no difference between the ways was found, but some motions are chaotic or undecided\n"
        });
    }
    if let (Some(first), Some(last)) = (report.coexisting.first(), report.coexisting.last()) {
        let periods: BTreeSet<usize> = report.coexisting.iter().filter_map(|p| p.period).collect();
        let periods: Vec<String> = periods.iter().map(ToString::to_string).collect();
        let place = stretch([last, first].map(|p| shown(Kind::Length, p.gap)));
        text.push_str(&motion::paragraph(&format!(
            "{place} further motions attract that neither way met (period {}): --out and --plot \
             have them",
            periods.join(", ")
        )));
    }
    for interval in &report.hysteresis {
        text.push_str(&motion::paragraph(&format!(
            "hysteresis {}: the amplitudes of the two ways differ by up to {}",
            stretch([interval.near, interval.far].map(|gap| shown(Kind::Length, gap))),
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
        text.push_str(&Table::all(&report.bifurcation_table(units)).render());
    }
    if let Some(branches) = &report.branches {
        let at = |value| shown(Kind::Length, value);
        text.push_str(&super::branch::failures(branches, at));
    }
    let undecided = report.table.iter().filter_map(|p| {
        let (motion, gap) = (p.classification.name(), shown(Kind::Length, p.gap));
        Some(format!("{motion} at {gap}: {}", p.reason.as_deref()?))
    });
    // Both ways may be undecided for the same reason.
    let mut said = BTreeSet::new();
    for reason in undecided
        .filter(|reason| said.insert(reason.clone()))
        .take(2)
    {
        text.push_str(&motion::paragraph(&reason));
    }
    text
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
    let step = step_of(report);
    let rows = (0..report.table.len()).step_by(step).filter(|k| {
        let p = &report.table[*k];
        p.modulation.is_some() && p.observables.is_some()
    });
    let table = Table::of(&report.motion_table(*units), rows);
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
            "hysteresis {}: Δf/f0 of the two ways differs by up to {}",
            stretch([interval.near, interval.far].map(|gap| shown(Kind::Length, gap))),
            number::significant(interval.difference, 4)
        )));
    }
    text
}

/// A stretch of distances in words, which may be a single one.
fn stretch([near, far]: [String; 2]) -> String {
    if near == far {
        format!("at {near}")
    } else {
        format!("from {near} to {far}")
    }
}

fn energy(value: f64, units: &Units) -> String {
    number::quantity(units, Kind::Energy, value, [4, 4])
}
