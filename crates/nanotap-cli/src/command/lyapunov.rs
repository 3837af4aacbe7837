//! `nanotap lyapunov`: Lyapunov spectrum and Poincaré section of any motion.

use nanotap::case::physical::Kind;
use nanotap::case::units::Units;
use nanotap::figure::attractors::section_figure;
use nanotap::model::Model;
use nanotap::observe::time_series;
use nanotap::study::lyapunov::{ExponentSource, LyapunovReport, LyapunovStudy};

use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::study_arguments::StudyArguments;
use crate::table::{Align, Table};
use crate::threads::ThreadsArgument;
use crate::{motion, number, progress, style};

/// Compute the Lyapunov spectrum with error bars, and a Poincaré section.
pub(crate) type Arguments = StudyArguments<LyapunovStudy>;

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let (mut request, case) = arguments.read(output)?;
    let model = case.model()?;
    let wanted = arguments.out.out.is_some() || arguments.plot.plot.is_some();
    if !wanted {
        request.points = 0;
    }
    let report = progress::study::<LyapunovStudy>(&case, &request, &ThreadsArgument::default())?;
    if wanted && report.section.is_empty() {
        output.warning("the section is empty: the motion begins no contact");
    }
    arguments
        .out
        .write(|| csv(&model, &report, &case.units()))?;
    arguments
        .plot
        .draw(|| section_figure(&model, &report, &case.units()))?;
    output.notes(&report.notes);
    output.study(&case, &report, |report| text(&case, report))
}

/// A row a point of the section.
fn csv(model: &Model, report: &LyapunovReport, units: &Units) -> String {
    let shown = [
        ("tip", Kind::Length),
        ("tip_rate", Kind::Velocity),
        ("gap_rate", Kind::Velocity),
    ];
    let mut header = vec!["phase_degrees".to_owned()];
    header.extend(shown.iter().map(|(name, kind)| units.column(name, *kind)));
    let names = time_series::state_names(model);
    header.extend(names.iter().map(|name| units.state_column(name)));
    let mut csv = header.join(",") + "\n";
    for p in &report.section {
        let speed = |value| units.scaled(Kind::Velocity, value);
        let tip = units.scaled(Kind::Length, p.tip);
        let cells = [360.0 * p.phase, tip, speed(p.tip_rate), speed(p.gap_rate)];
        csv.push_str(&number::row(cells.iter().chain(&p.state).copied()));
        csv.push('\n');
    }
    csv
}

fn text(case: &GivenCase, report: &LyapunovReport) -> String {
    let heading = format!("{}: {}", case.title(), case.summary());
    let mut table = Table::new([
        ("", Align::Right),
        ("exponent per drive period", Align::Point),
        ("± standard error", Align::Point),
    ]);
    for (k, (exponent, error)) in report.exponents.iter().zip(&report.errors).enumerate() {
        table.row([
            (k + 1).to_string(),
            number::significant(*exponent, 5),
            number::significant(*error, 2),
        ]);
    }
    let mut text = format!(
        "{}\n\n  {}\n{}\n{}\n",
        style::bold(&heading),
        style::bold(&motion::verdict(report.classification, report.period)),
        motion::paragraph(&report.evidence),
        table.render()
    );
    let source = match report.source {
        ExponentSource::Multipliers => format!(
            "from the multipliers of the closed orbit, ln|μ| over its period of {}",
            report.periods
        ),
        ExponentSource::Average => format!(
            "over {} drive periods after {}",
            report.periods, report.transient
        ),
        ExponentSource::Sticking => {
            "the motion sticks to the rigid stop, where neighbouring motions meet \
                                     exactly"
                .to_owned()
        }
    };
    text.push_str(&motion::paragraph(&format!(
        "{source}; their sum {}, from the trace of the equations and the time in \
         contact {}; Kaplan–Yorke dimension of the section {}",
        six_decimals(report.sum),
        six_decimals(report.sum_by_trace),
        number::significant(report.kaplan_yorke_dimension, 4),
    )));
    text
}

/// A number with six decimals; what is not finite in words.
fn six_decimals(value: f64) -> String {
    if value.is_finite() {
        format!("{value:.6}")
    } else {
        number::significant(value, 6)
    }
}
