//! `nanotap simulate`: a single motion.

use std::fmt::Write as _;

use nanotap::case::physical::Kind;
use nanotap::case::units::Units;
use nanotap::study::Study as _;
use nanotap::study::fixed_step::FixedStepRun;
use nanotap::study::one_shot::OneShot;
use nanotap::study::simulate::{
    Classification, SimulateOptions, SimulateReport, SimulateStudy, Simulation,
};

use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::motion;
use crate::output::Output;
use crate::study_arguments::StudyArguments;
use crate::text_table::{Align, Table};
use crate::threads::ThreadsArgument;
use crate::{number, progress, series, style};

/// Simulate a motion: its steady state or its transient.
pub(crate) type Arguments = StudyArguments<SimulateStudy>;

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let (mut request, case) = arguments.read(output)?;
    if let Some(signal) = &mut request.drive_signal {
        signal.read_file()?;
    }
    let model = case.model()?;
    let report = progress::study::<SimulateStudy>(&case, &request, &ThreadsArgument::default())?;
    let units = case.units();
    arguments.draw(&case, &report)?;
    let fixed = matches!(report, SimulateReport::FixedStep(_));
    if let Some(path) = arguments.out.out.as_ref().filter(|_| !fixed) {
        series::write(path, &model, &units, |row| {
            report.sample(&case, &request, usize::MAX, row)
        })?;
    }
    if let SimulateReport::FixedStep(run) = &report {
        arguments.out.write(|| run.curve_table(units).csv())?;
    }
    output.remarks(&SimulateStudy::remarks(&case, &report));
    output.study(&case, &report, |report| match report {
        SimulateReport::Exact(run) => text(&case, &run.motion, &request),
        SimulateReport::FixedStep(run) => rk4_text(&case, run),
        SimulateReport::OneShot(run) => one_shot_text(&case, &run.motion),
    })
}

fn text(case: &GivenCase, run: &Simulation, request: &SimulateOptions) -> String {
    let heading = format!("{}: {}", case.title(), case.summary());
    let mut text = format!("{}\n\n", style::bold(&heading));
    let _ = writeln!(
        text,
        "  {}",
        style::bold(&motion::verdict(run.classification, run.period))
    );
    text.push_str(&motion::paragraph(&run.evidence));
    if run.classification == Classification::Undecided {
        text.push_str(&motion::paragraph(
            "The following describes the recorded motion, which need not be the final one.",
        ));
    }
    // Far above rounding and what Newton leaves.
    if let Some(distance) = run.distance_to_orbit.filter(|d| *d > 1e-6) {
        let distance = number::significant(100.0 * distance, 2);
        text.push_str(&motion::paragraph(&if request.transient.is_some() {
            format!(
                "The following describes the transient, not yet the orbit: at its end the state is still \
                 {distance} % of the orbit's size away. Without --transient the orbit itself is shown."
            )
        } else {
            format!(
                "The following describes a run from the orbit whose rounding errors grow: at its end the \
                 state is {distance} % of the orbit's size away. `orbit` describes the orbit itself."
            )
        }));
    }
    if let Some(exponents) = &run.lyapunov {
        text.push_str(&motion::paragraph(&format!(
            "Lyapunov exponents per drive period: {}",
            motion::exponents(exponents, None)
        )));
    }
    let _ = writeln!(
        text,
        "\n  {} after {} of transient",
        number::counted(
            run.periods,
            "drive period recorded",
            "drive periods recorded"
        ),
        if run.transient == 0 {
            "none".into()
        } else {
            number::counted(run.transient, "period", "periods")
        },
    );
    text.push_str(&motion::observed(
        &run.observables,
        request.observables,
        case,
    ));
    if let Some(orbit) = &run.orbit {
        let pairs: Vec<[f64; 2]> = orbit.multipliers.iter().map(|m| [m.re, m.im]).collect();
        text.push('\n');
        text.push_str(&motion::multipliers(&pairs));
    }
    text.push('\n');
    text.push_str(&motion::paragraph(&format!(
        "{} contacts and releases; {} drive periods a second, {} evaluations of the gap a period",
        run.events.len() + run.events_left_out,
        number::significant(run.periods_per_second, 3),
        number::significant(run.evaluations_per_period, 3),
    )));
    text
}

fn one_shot_text(case: &GivenCase, run: &OneShot) -> String {
    let units = case.units();
    let heading = format!("{}: {}", case.title(), case.summary());
    let mut text = format!("{}\n\n", style::bold(&heading));
    let _ = writeln!(text, "  {}", style::bold(&run.drive_signal));
    text.push_str(&motion::paragraph(&run.evidence));
    let (seen, shown) = (&run.observables, |kind, value, digits| {
        number::quantity(&units, kind, value, [digits, 4])
    });
    let mut table = Table::new([("", Align::Left); 3]);
    let mut row = |what: &str, value: String, note: &str| {
        table.row([what.to_owned(), value, note.to_owned()]);
    };
    let range = |kind, ends| number::range(&units, kind, ends, [6, 4]);
    row(
        "tip deflection W",
        range(Kind::Length, [seen.tip_min, seen.tip_max]),
        "",
    );
    row("gap", range(Kind::Length, seen.gap_range), "");
    if let Some((first, last)) = run.first_contact.zip(run.last_contact) {
        let times = format!(
            "at {} to {} drive periods from the beginning of the signal",
            number::significant(first, 5),
            number::significant(last, 5)
        );
        row("contacts", run.contacts.to_string(), &times);
        let greatest = "largest at which a contact begins";
        row(
            "impact speed",
            shown(Kind::Velocity, seen.impact_speed, 5),
            greatest,
        );
        let depth = "largest depth below the surface at rest";
        row(
            "indentation",
            shown(Kind::Length, seen.indentation, 5),
            depth,
        );
    } else {
        row("contacts", "none".to_owned(), "");
    }
    row(
        "force on the tip",
        range(Kind::Force, [seen.least_force, seen.peak_force]),
        "negative where the sample attracts",
    );
    let energies = [
        (
            "work of the drive",
            seen.energy_balance.drive_work,
            "over the whole run",
        ),
        ("lost in the lever", seen.energy_balance.beam_damping, ""),
        ("lost in the sample", seen.energy_balance.sample_damping, ""),
    ];
    for (what, energy, note) in energies {
        row(
            what,
            shown(Kind::Energy, seen.energy_balance.resolved(energy), 5),
            note,
        );
    }
    text + "\n" + &table.render()
}

fn rk4_text(case: &GivenCase, run: &FixedStepRun) -> String {
    let units: Units = case.units();
    let heading = format!(
        "{}: {}, Runge–Kutta with {} steps a period in flight and {} in contact",
        case.title(),
        case.summary(),
        run.steps[0],
        run.steps[1]
    );
    let mut table = Table::new([("", Align::Left), ("", Align::Left)]);
    let apparent = run.apparent_period.map_or_else(
        || {
            format!(
                "none up to {} (nearest return {:.1e} of its size)",
                run.longest_apparent, run.closure
            )
        },
        |n| format!("{n} (repeats to {:.1e} of its size)", run.closure),
    );
    table.row(["apparent period", &apparent]);
    table.row([
        "tip deflection",
        &format!(
            "{} … {}",
            number::significant(run.tip_min, 6),
            number::significant(run.tip_max, 6)
        ),
    ]);
    let amplitude = number::quantity(&units, Kind::Length, run.amplitude, [6, 4]);
    table.row(["amplitude", &amplitude]);
    table.row([
        "contact",
        &format!(
            "{} % of the time",
            number::significant(100.0 * run.contact_fraction, 4)
        ),
    ]);
    format!(
        "{}\n\n{}\n  {}\n{}",
        style::bold(&heading),
        table.render(),
        style::bold(&format!(
            "exact flow from its final state: {}",
            motion::verdict(run.exact.classification, run.exact.period)
        )),
        motion::paragraph(&run.exact.evidence),
    )
}
