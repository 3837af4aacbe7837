//! `nanotap lever`: levers of the catalogue compared on a sample.

use clap::Args;
use nanotap::case::physical::Kind;
use nanotap::study::lever::{LeverOptions, LeverReport, LeverStudy, QualityFactorSource};

use crate::arguments::CaseArguments;
use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::page::paragraph;
use crate::request::Request;
use crate::text_table::Table;
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
    let table = Table::all(&report.lever_table());
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
    text.push_str(&paragraph(
        "states: stable motions found on the way of a slowly moved lever to the setpoint; `nanotap \
         attractors` samples initial states and may find more",
    ));
    text.push_str(&paragraph(&quality_factors(report)));
    // Levers with the same reason share a sentence.
    let mut reasons: Vec<(String, Vec<&str>)> = Vec::new();
    for row in &report.levers {
        let budget = row
            .motion
            .as_ref()
            .and_then(|motion| motion.budget.as_ref());
        let reason = match (&row.reason, budget) {
            (Some(reason), _) => reason.clone(),
            (None, Some(budget)) => format!("other states may be missing: {budget}"),
            (None, None) => continue,
        };
        match reasons.iter_mut().find(|(other, _)| *other == reason) {
            Some((_, levers)) => levers.push(&row.lever),
            None => reasons.push((reason, vec![&row.lever])),
        }
    }
    for (reason, levers) in reasons {
        text.push_str(&paragraph(&format!("{}: {reason}", levers.join(", "))));
    }
    text
}

/// Where the quality factors come from.
fn quality_factors(report: &LeverReport) -> String {
    let source = match report.quality_factor_source {
        QualityFactorSource::Air => "of each lever in air, by its dimensions (Sader 1998)",
        QualityFactorSource::Fluid => {
            "of each lever in the fluid of the case, by its dimensions (Sader 1998)"
        }
        QualityFactorSource::Case => "that of the case for every lever",
    };
    let mut text = format!("Q: {source}; τ = Q/(π f0) is the time constant of the amplitude");
    let known = report.levers.iter().filter_map(|row| {
        let air = row.quality_factor_in_air?;
        Some((
            row,
            air,
            (air / row.quality_factor).max(row.quality_factor / air),
        ))
    });
    if report.quality_factor_source == QualityFactorSource::Case
        && let Some((row, air, _)) = known.max_by(|a, b| a.2.total_cmp(&b.2))
    {
        let hint = format!(
            ". In air the dimensions of {} give Q = {}; --quality-factor air computes that of each lever",
            row.lever,
            number::significant(air, 3)
        );
        text.push_str(&hint);
    }
    text
}
