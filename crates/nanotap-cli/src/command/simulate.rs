//! `nanotap simulate`: one run.

use std::fmt::Write as _;

use clap::{Args, ValueEnum};
use nanotap::case::units::Units;
use nanotap::figure::motion::{fixed_step_figure, simulation_figure};
use nanotap::model::Model;
use nanotap::observe::PhysicalMotion;
use nanotap::study::fixed_step::{FixedStepOptions, FixedStepRun, Switching, fixed_step_run};
use nanotap::study::simulate::{
    Classification, SettleOptions, SimulateOptions, Simulation, simulate,
};
use serde::Serialize;

use crate::arguments::{CaseArguments, OutArgument, PlotArgument};
use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::motion;
use crate::output::Output;
use crate::table::{Align, Table};
use crate::{file, number, series, style};

/// One run: its steady state, or how it gets there.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    case: CaseArguments,

    /// Drive periods recorded
    #[arg(long, value_name = "P", default_value_t = 50)]
    periods: usize,

    /// Drive periods thrown away first; without it, as many as the motion is measured to
    /// need; 0: from the start
    #[arg(long, value_name = "T")]
    transient: Option<usize>,

    /// State at the start, drive phase 0: a1,…,aN,v1,…,vN (oscillator: x,v); without it, rest
    #[arg(long, value_name = "A1,…", value_delimiter = ',', allow_hyphen_values = true, value_parser = motion::parse_state)]
    state: Option<Vec<f64>>,

    /// How many of the last states at drive phase 0 to tell
    #[arg(long, value_name = "K", default_value_t = 1)]
    strobe: usize,

    /// Longest period looked for
    #[arg(long, value_name = "N", default_value_t = 64)]
    max_period: usize,

    /// Samples a drive period in --out
    #[arg(long, value_name = "S", default_value_t = 200)]
    resolution: usize,

    /// How the motion is computed
    #[arg(long, value_enum, default_value_t = Method::Exact)]
    method: Method,

    /// Of rk4: steps a drive period, in free flight and (after a comma) in contact
    #[arg(
        long,
        value_name = "FREE,CONTACT",
        value_delimiter = ',',
        num_args = 1,
        default_value = "200"
    )]
    steps: Vec<u32>,

    /// Of rk4: where within a step the regime is looked at
    #[arg(long, value_enum, default_value_t = Grid::Step)]
    switching: Grid,

    #[command(flatten)]
    out: OutArgument,
    #[command(flatten)]
    plot: PlotArgument,
}

/// How the motion is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Method {
    /// The exact flow: no time step, no contact missed
    Exact,
    /// The paper's method, to compare: Runge–Kutta steps that switch on their grid
    Rk4,
}

/// Where rk4 looks at the regime.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Grid {
    /// Once a step
    Step,
    /// At every stage of a step
    Stage,
}

/// The JSON document.
#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    run: &'a Simulation,
    #[serde(skip_serializing_if = "Option::is_none")]
    physical: Option<PhysicalMotion>,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    if arguments.resolution == 0 {
        return Err(Failure::input(
            "--resolution 0: nothing would be written",
            "give at least 1 sample a period",
        ));
    }
    if arguments.max_period == 0 {
        return Err(Failure::input(
            "--max-period 0: no motion has that period",
            "give at least 1",
        ));
    }
    if let Some(path) = &arguments.out.out {
        file::ending(path, &["csv"])?;
    }
    let studied = GivenCase::of(&arguments.case, output)?;
    let model = studied.model()?;
    let settle = SettleOptions {
        max_period: arguments.max_period,
        ..SettleOptions::default()
    };
    match arguments.method {
        Method::Exact => exact(arguments, &studied, &model, settle, output),
        Method::Rk4 => rk4(arguments, &studied, &model, settle, output),
    }
}

fn exact(
    arguments: &Arguments,
    studied: &GivenCase,
    model: &Model,
    settle: SettleOptions,
    output: &Output,
) -> Result<(), Failure> {
    let options = SimulateOptions {
        periods: arguments.periods,
        transient: arguments.transient,
        state: arguments.state.clone(),
        strobe: arguments.strobe,
        settle,
        ..SimulateOptions::default()
    };
    let run = simulate(model, &options)?;
    if let Some(path) = &arguments.out.out {
        series::write(
            path,
            model,
            &run.start,
            run.periods,
            arguments.resolution,
            &studied.units(),
        )?;
    }
    if let Some(path) = &arguments.plot.plot {
        simulation_figure(model, &run, &studied.units()).write(path)?;
    }
    motion::warn(&run.observables, "", output);
    let physical = studied
        .physical()
        .map(|resolved| PhysicalMotion::alone(&run.observables, None, resolved));
    let document = Document {
        run: &run,
        physical,
    };
    output.result(&document, |_| text(studied, model, &run))
}

fn text(studied: &GivenCase, model: &Model, run: &Simulation) -> String {
    let units = studied.units();
    let heading = format!("{}: {}", studied.title(), studied.summary());
    let mut text = format!("{}\n\n", style::bold(&heading));
    let _ = writeln!(
        text,
        "  {}",
        style::bold(&motion::verdict(run.classification, run.period))
    );
    text.push_str(&motion::paragraph(&run.evidence));
    if run.classification == Classification::Undecided {
        text.push_str(&motion::paragraph(
            "What follows is what was recorded; it need not be what remains in the end.",
        ));
    }
    // Far above rounding and what Newton leaves.
    if let Some(distance) = run.distance_to_orbit.filter(|d| *d > 1e-6) {
        text.push_str(&motion::paragraph(&format!(
            "What follows is the way there, not yet the orbit: at its end the state is still {} % of the orbit's \
             size away. Without --transient the orbit itself is shown.",
            number::significant(100.0 * distance, 2)
        )));
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
    text.push_str(&motion::observables(
        &run.observables,
        &units,
        model.beam.is_some(),
    ));
    text.push('\n');
    text.push_str(&motion::energy(&run.observables, &units));
    if let Some(orbit) = &run.orbit {
        let pairs: Vec<[f64; 2]> = orbit.multipliers.iter().map(|m| [m.re, m.im]).collect();
        text.push('\n');
        text.push_str(&motion::multipliers(&pairs));
    }
    text.push('\n');
    text.push_str(&motion::paragraph(&format!(
        "{} contacts and releases; {} drive periods a second, {} evaluations of the gap a period",
        run.events.len(),
        number::significant(run.periods_per_second, 3),
        number::significant(run.evaluations_per_period, 3),
    )));
    text
}

fn rk4(
    arguments: &Arguments,
    studied: &GivenCase,
    model: &Model,
    settle: SettleOptions,
    output: &Output,
) -> Result<(), Failure> {
    let steps = match arguments.steps[..] {
        [both] => [both, both],
        [free, contact] => [free, contact],
        _ => {
            return Err(Failure::input(
                format!("--steps has {} numbers", arguments.steps.len()),
                "give the steps a drive period in free flight and in contact: --steps 200,400",
            ));
        }
    };
    let default = FixedStepOptions::default();
    let options = FixedStepOptions {
        periods: arguments.periods,
        transient: arguments.transient.unwrap_or(default.transient),
        state: arguments.state.clone(),
        strobe: arguments.strobe,
        steps,
        switching: match arguments.switching {
            Grid::Step => Switching::EveryStep,
            Grid::Stage => Switching::EveryStage,
        },
        settle,
    };
    let run = fixed_step_run(model, &options)?;
    if let Some(path) = &arguments.out.out {
        file::write(path, curve(&run).as_bytes())?;
    }
    if let Some(path) = &arguments.plot.plot {
        fixed_step_figure(model, &run, &studied.units()).write(path)?;
    }
    output.note(
        "rk4 is the paper's own method, kept to show what a time step does; nothing it says is certified",
    );
    output.result(&run, |run| rk4_text(studied, run))
}

/// Time, tip displacement and its rate at every step.
fn curve(run: &FixedStepRun) -> String {
    let mut csv = String::from("tau,tip,tip_rate\n");
    for point in &run.curve {
        csv.push_str(&number::row(*point));
        csv.push('\n');
    }
    csv
}

fn rk4_text(studied: &GivenCase, run: &FixedStepRun) -> String {
    let units: Units = studied.units();
    let heading = format!(
        "{}: {}, Runge–Kutta with {} steps a period in flight and {} in contact",
        studied.title(),
        studied.summary(),
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
    if let Some(unit) = units.si(nanotap::case::physical::Kind::Length) {
        let metres = nanotap::case::physical::Kind::Length;
        table.row(["amplitude", &metres.format(unit * run.amplitude)]);
    } else {
        table.row(["amplitude", &number::significant(run.amplitude, 6)]);
    }
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
            "the exact flow from where it ended: {}",
            motion::verdict(run.exact.classification, run.exact.period)
        )),
        motion::paragraph(&run.exact.evidence),
    )
}
