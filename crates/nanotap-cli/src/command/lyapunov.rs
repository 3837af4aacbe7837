//! `nanotap lyapunov`: Lyapunov spectrum and Poincaré section of any motion.

use clap::{Args, ValueEnum};
use nanotap::figure::attractors::section_figure;
use nanotap::model::Model;
use nanotap::observe::time_series;
use nanotap::study::lyapunov::{LyapunovOptions, LyapunovReport, Section, lyapunov};

use crate::arguments::{CaseArguments, OutArgument, PlotArgument};
use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::table::{Align, Table};
use crate::{file, motion, number, style};

/// Lyapunov spectrum with error bars, and a Poincaré section.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    case: CaseArguments,

    /// Drive periods averaged over
    #[arg(long, value_name = "P", default_value_t = 20_000)]
    periods: usize,

    /// Drive periods thrown away first
    #[arg(long, value_name = "T", default_value_t = 1000)]
    transient: usize,

    /// State at the start, drive phase 0: a1,…,aN,v1,…,vN (oscillator: x,v); without it, rest
    #[arg(long, value_name = "A1,…", value_delimiter = ',', allow_hyphen_values = true, value_parser = motion::parse_state)]
    state: Option<Vec<f64>>,

    /// Where the section for --out and --plot is taken
    #[arg(long, value_enum, default_value_t = Cut::Phase)]
    section: Cut,

    /// Drive phase of the section in degrees
    #[arg(
        long,
        value_name = "DEGREES",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    phase: f64,

    /// Points of the section
    #[arg(long, value_name = "K", default_value_t = 5000)]
    points: usize,

    #[command(flatten)]
    out: OutArgument,
    #[command(flatten)]
    plot: PlotArgument,
}

/// Where a motion is cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Cut {
    /// Once a drive period, at --phase
    Phase,
    /// At the beginning of every contact
    Contact,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    if !arguments.phase.is_finite() {
        return Err(Failure::input(
            format!("--phase {}: no phase", arguments.phase),
            "give a drive phase in degrees, as in --phase 90",
        ));
    }
    if let Some(path) = &arguments.out.out {
        file::ending(path, &["csv"])?;
    }
    let studied = GivenCase::of(&arguments.case, output)?;
    let model = studied.model()?;
    let wanted = arguments.out.out.is_some() || arguments.plot.plot.is_some();
    let options = LyapunovOptions {
        transient: arguments.transient,
        state: arguments.state.clone(),
        periods: arguments.periods,
        section: match arguments.section {
            Cut::Phase => Section::Phase((arguments.phase / 360.0).rem_euclid(1.0)),
            Cut::Contact => Section::Contact,
        },
        points: if wanted { arguments.points } else { 0 },
        ..LyapunovOptions::default()
    };
    let report = lyapunov(&model, &options)?;
    if wanted && report.section.is_empty() {
        output.warning("the section is empty: the motion begins no contact");
    }
    if let Some(path) = &arguments.out.out {
        file::write(path, csv(&model, &report).as_bytes())?;
    }
    if let Some(path) = &arguments.plot.plot {
        section_figure(&model, &report, &studied.units()).write(path)?;
    }
    output.result(&report, |report| text(&studied, report))
}

/// A row a point of the section.
fn csv(model: &Model, report: &LyapunovReport) -> String {
    let names = time_series::state_names(model).join(",");
    let mut csv = format!("phase_degrees,tip,tip_rate,gap_rate,{names}\n");
    for p in &report.section {
        let cells = [360.0 * p.phase, p.tip, p.tip_rate, p.gap_rate];
        csv.push_str(&number::row(cells.iter().chain(&p.state).copied()));
        csv.push('\n');
    }
    csv
}

fn text(studied: &GivenCase, report: &LyapunovReport) -> String {
    let heading = format!("{}: {}", studied.title(), studied.summary());
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
    text.push_str(&motion::paragraph(&format!(
        "over {} drive periods after {}; their sum {:.6}, from the trace of the equations and the time in \
         contact {:.6}; Kaplan–Yorke dimension of the section {}",
        report.periods,
        report.transient,
        report.sum,
        report.sum_by_trace,
        number::significant(report.kaplan_yorke_dimension, 4),
    )));
    text
}
