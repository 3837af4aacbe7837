//! `nanotap lever`: levers of the catalogue compared on a sample.

use clap::Args;
use nanotap::case::physical::Kind;
use nanotap::observe::table::shown_phase;
use nanotap::study::lever::{LeverOptions, LeverReport, LeverRow, LeverStudy};

use crate::arguments::CaseArguments;
use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::page::paragraph;
use crate::request::Request;
use crate::table::{Align, Table};
use crate::threads::ThreadsArgument;
use crate::{number, progress, style};

/// Compare levers of the catalogue on the sample of a case, at its free amplitude and setpoint.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    case: CaseArguments,

    #[command(flatten)]
    request: Request<LeverOptions>,

    #[command(flatten)]
    threads: ThreadsArgument,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let request = arguments.request.read()?;
    let case = GivenCase::for_study(&arguments.case, true, output)?;
    let report = progress::study::<LeverStudy>(&case, &request, &arguments.threads)?;
    output.study(&case, &report, |report| text(&case, report))
}

fn text(case: &GivenCase, report: &LeverReport) -> String {
    let heading = format!(
        "{}: {} at A0 = {}, f/f0 = {}",
        case.title(),
        number::counted(report.levers.len(), "lever", "levers"),
        Kind::Length.format(report.free_amplitude),
        number::significant(report.frequency_ratio, 5)
    );
    let fits = !report.conditions.is_empty();
    let mut heads = vec![
        ("lever", Align::Left),
        ("k", Align::Point),
        ("f0", Align::Point),
        ("radius", Align::Point),
        ("F_max", Align::Point),
        ("indentation", Align::Point),
        ("regime", Align::Left),
        ("states", Align::Right),
        ("A", Align::Point),
        ("phase (°)", Align::Point),
        ("τ", Align::Point),
    ];
    if fits {
        heads.insert(1, ("fits", Align::Left));
    }
    let mut table = Table::new(heads);
    for row in &report.levers {
        let mut cells = cells(row);
        if fits {
            let word = if row.holds == Some(true) { "yes" } else { "no" };
            cells.insert(1, word.to_owned());
        }
        table.row(cells);
    }
    let mut text = format!("{}\n\n{}\n", style::bold(&heading), table.render());
    if fits {
        let holding = report.levers.iter().filter(|row| row.holds == Some(true));
        text.push_str(&paragraph(&format!(
            "{}: {} of {} fit; a condition must hold for every state found",
            report.conditions.join(" and "),
            holding.count(),
            report.levers.len()
        )));
    }
    if let Some(first) = report.levers.first() {
        text.push_str(&paragraph(&format!(
            "quality factor: {} (first lever: {}). τ = Q/(π f0) is the time constant of the amplitude",
            report.quality_factor_source,
            number::significant(first.quality_factor, 4)
        )));
    }
    for row in &report.levers {
        let budget = row.motion.as_ref().and_then(|motion| motion.budget.as_ref());
        if let Some(reason) = row.reason.as_ref() {
            text.push_str(&paragraph(&format!("{}: {reason}", row.lever)));
        } else if let Some(reason) = budget {
            text.push_str(&paragraph(&format!(
                "{}: other states may be missing: {reason}",
                row.lever
            )));
        }
    }
    text
}

fn cells(row: &LeverRow) -> Vec<String> {
    let shown = |kind: Kind, value: f64| {
        if value.is_finite() {
            kind.format_digits(value, 4)
        } else {
            String::new()
        }
    };
    let mut cells = vec![
        row.lever.clone(),
        shown(Kind::Stiffness, row.k),
        shown(Kind::Frequency, row.f0),
        shown(Kind::Length, row.tip_radius.unwrap_or(f64::NAN)),
    ];
    match &row.motion {
        Some(motion) => {
            let seen = &motion.physical.observables;
            cells.extend([
                shown(Kind::Force, seen.peak_force),
                shown(Kind::Length, seen.indentation),
                motion.regime.to_owned(),
                motion.states.to_string(),
                shown(Kind::Length, seen.first_harmonic),
                number::significant(shown_phase(seen.phase), 4),
            ]);
        }
        None => cells.extend(["", "", "not reached", "", "", ""].map(str::to_owned)),
    }
    cells.push(shown(Kind::Time, row.time_constant));
    cells
}
