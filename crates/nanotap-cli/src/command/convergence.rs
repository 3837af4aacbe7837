//! `nanotap convergence`: the same motion with N = 1 … K modes, and a verdict on enough.

use std::fmt::Write as _;

use nanotap::case::physical::Kind;
use nanotap::case::units::Units;
use nanotap::figure::motion::convergence_figure;
use nanotap::observe::table::shown_phase;
use nanotap::study::convergence::{Convergence, ConvergenceStudy};

use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::study_arguments::StudyArguments;
use crate::table::{Align, Table};
use crate::threads::ThreadsArgument;
use crate::{motion, number, progress, style};

/// Compare the motion with 1 to K modes: how many are enough.
pub(crate) type Arguments = StudyArguments<ConvergenceStudy>;

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let (request, case) = arguments.read(output)?;
    let result = progress::study::<ConvergenceStudy>(&case, &request, &ThreadsArgument::default())?;
    arguments.out.write(|| csv(&result, &case.units()))?;
    arguments
        .plot
        .draw(|| convergence_figure(&result, &case.units()))?;
    output.notes(&result.notes);
    output.study(&case, &result, |result| text(&case, result))
}

fn csv(result: &Convergence, units: &Units) -> String {
    let [tip_max, tip_min] = ["tip_max", "tip_min"].map(|name| units.column(name, Kind::Length));
    let mut csv =
        format!("modes,difference,period,{tip_max},{tip_min},contact_fraction,spectral_radius\n");
    let length = |value: Option<f64>| value.map(|value| units.scaled(Kind::Length, value));
    let cell = |value: Option<f64>| value.map_or_else(String::new, |v| v.to_string());
    for (motion, difference) in result.motions.iter().zip(&result.difference) {
        let _ = writeln!(
            csv,
            "{},{},{},{},{},{},{}",
            motion.modes,
            cell(*difference),
            motion.period.map_or_else(String::new, |n| n.to_string()),
            cell(length(motion.tip_max)),
            cell(length(motion.tip_min)),
            cell(motion.contact_fraction),
            cell(motion.spectral_radius),
        );
    }
    csv
}

fn text(case: &GivenCase, result: &Convergence) -> String {
    let units = case.units();
    let heading = format!(
        "{}: how many modes at {}",
        case.title(),
        units.si(Kind::Frequency).map_or_else(
            || format!("Ω = {}", number::significant(case.omega(), 6)),
            |unit| Kind::Frequency.format_digits(unit * case.omega(), 6),
        )
    );
    let mut table = Table::new([
        ("modes", Align::Right),
        ("difference", Align::Point),
        ("motion", Align::Left),
        ("W max", Align::Point),
        ("W min", Align::Point),
        ("contact (%)", Align::Point),
        ("largest |μ|", Align::Point),
    ]);
    let digits =
        |value: Option<f64>, n| value.map_or_else(String::new, |v| number::significant(v, n));
    let length = |value: Option<f64>| {
        value.map_or_else(String::new, |v| {
            number::quantity(&units, Kind::Length, v, [6, 5])
        })
    };
    for (motion, difference) in result.motions.iter().zip(&result.difference) {
        let what = match (motion.period, &motion.reason) {
            (Some(n), _) => format!("period {n}"),
            (None, Some(_)) => "no orbit".to_owned(),
            (None, None) => motion.classification.name().to_owned(),
        };
        table.row([
            motion.modes.to_string(),
            digits(difference.filter(|d| *d > 0.0), 3),
            what,
            length(motion.tip_max),
            length(motion.tip_min),
            digits(motion.contact_fraction.map(|c| 100.0 * c), 4),
            digits(motion.spectral_radius, 6),
        ]);
    }
    let mut text = format!("{}\n\n{}\n", style::bold(&heading), table.render());
    text.push_str(&motion::paragraph(&format!(
        "difference: greatest of the tip deflection over the orbit to that with {} modes, as a part of its \
         amplitude",
        result.modes.len()
    )));
    for missing in result.motions.iter().filter(|m| m.reason.is_some()).take(1) {
        let reason = missing.reason.as_deref().unwrap_or_default();
        text.push_str(&motion::paragraph(&format!(
            "N = {}: {reason}",
            missing.modes
        )));
    }
    let _ = write!(text, "\n  {}\n\n", style::bold(&result.verdict));
    text.push_str(&readings(case, result));
    text
}

/// What an experimenter reads with each number of modes, and the part of each mode.
fn readings(case: &GivenCase, result: &Convergence) -> String {
    let units = case.units();
    let shown = |kind: Kind, value: f64| number::quantity(&units, kind, value, [5, 4]);
    let report = &result.readings;
    let mut table = Table::new([
        ("modes", Align::Right),
        ("A", Align::Right),
        ("phase (°)", Align::Point),
        ("E_dis", Align::Right),
        ("F_max", Align::Right),
        ("share of the mode: energy (%)", Align::Point),
        ("tip (%)", Align::Point),
        ("force (%)", Align::Point),
    ]);
    let percent = |part: f64| number::significant(100.0 * part, 3);
    for (k, reading) in report.readings.iter().enumerate() {
        let mut row = vec![(k + 1).to_string()];
        match reading {
            Some(r) => row.extend([
                shown(Kind::Length, r.first_harmonic),
                number::significant(shown_phase(r.phase), 5),
                shown(Kind::Energy, r.dissipation),
                shown(Kind::Force, r.peak_force),
            ]),
            None => row.extend(std::iter::repeat_n(String::new(), 4)),
        }
        if let Some(share) = report.mode_shares.get(k) {
            row.extend([percent(share.energy), percent(share.tip)]);
            row.extend(share.force.map(percent));
        }
        table.row(row);
    }
    format!(
        "  {}\n{}\n  {}\n",
        style::bold("readings, and the share of each mode with the most modes"),
        table.render(),
        style::bold(&report.reading_verdict)
    )
}
