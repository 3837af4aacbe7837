//! `nanotap orbit`: a periodic orbit by Newton, stable or not.

use std::fmt::Write as _;

use clap::Args;
use nanotap::case::physical::Kind;
use nanotap::case::quantity::format_electronvolts;
use nanotap::case::units::Units;
use nanotap::figure::motion::orbit_figure;
use nanotap::model::Model;
use nanotap::observe::{ObservableSet, time_series};
use nanotap::study::Study as _;
use nanotap::study::orbit::{
    MAX_DETERMINANT_DEFECT, OrbitOptions, OrbitReport, OrbitStudy, harmonic_table,
};
use nanotap::study::upset::Knocks;

use crate::arguments::{CaseArguments, OutArgument, PlotArgument};
use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::motion;
use crate::output::Output;
use crate::request::Request;
use crate::text_table::{Align, Table};
use crate::threads::ThreadsArgument;
use crate::{file, number, progress, series, style};

/// Compute a periodic orbit by Newton's method, stable or not.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    case: CaseArguments,

    #[command(flatten)]
    request: Request<OrbitOptions>,

    /// Write the harmonics to this file (.csv)
    #[arg(long, value_name = "PATH")]
    harmonics_out: Option<std::path::PathBuf>,

    #[command(flatten)]
    out: OutArgument,
    #[command(flatten)]
    plot: PlotArgument,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let request = arguments.request.read()?;
    for path in arguments.out.out.iter().chain(&arguments.harmonics_out) {
        file::claim(path, &["csv"])?;
    }
    let case = GivenCase::of(&arguments.case, output)?;
    let model = case.model()?;
    let found = progress::study::<OrbitStudy>(&case, &request, &ThreadsArgument::default())?;
    let found = &found;
    for key in request.derivatives.iter().flat_map(|name| case.key(name)) {
        case.note_constants(&[key], output);
    }
    let orbit = &found.motion;
    if let Some(asked) = request.period.filter(|n| *n != orbit.period) {
        output.note(&format!(
            "requested an orbit of period {asked}; Newton converged to one that repeats every {}",
            number::counted(orbit.period, "period", "periods")
        ));
    }
    if let Some(path) = &arguments.out.out {
        series::write(path, &model, &case.units(), |row| {
            time_series::sample(&model, &orbit.state, orbit.period, request.resolution, row)
        })?;
    }
    if let Some(path) = &arguments.harmonics_out {
        let harmonics = harmonic_table(&orbit.spectrum, case.omega(), case.units());
        file::write(path, harmonics.csv().as_bytes())?;
    }
    arguments
        .plot
        .draw(|| orbit_figure(&model, orbit, &case.units()))?;
    output.remarks(&OrbitStudy::remarks(&case, found));
    output.study(&case, found, |found| {
        text(&case, &model, &found.motion, request.observables)
    })
}

/// Describes the smallest change of the tip's speed after which the motion leaves the orbit for
/// another.
fn upset(knocks: &Knocks, units: &Units) -> String {
    let speed = |value: f64| number::quantity(units, Kind::Velocity, value, [4, 4]);
    let apart = || number::significant(100.0 * (knocks.size_ratio - 1.0), 2);
    let Some(found) = &knocks.smallest else {
        return format!(
            "no knock on the tip was found that upsets it: {} were tried, at {} instants in sizes {} % \
             apart, with changes of the tip's speed of up to {}",
            knocks.smaller_tried,
            knocks.instants,
            apart(),
            speed(knocks.largest_tried)
        );
    };
    let way = if found.tip_speed > 0.0 {
        "away from the sample"
    } else {
        "towards the sample"
    };
    let size = match &found.physical {
        Some(knock) => format!(
            "an impulse of {} N s, {}",
            number::significant(knock.impulse.abs(), 3),
            format_electronvolts(knock.energy)
        ),
        None => format!(
            "an impulse of {}",
            number::significant(found.impulse.abs(), 4)
        ),
    };
    let mut motion = found.leads_to.name().to_owned();
    if let Some(period) = found.period {
        let _ = write!(motion, ", period {period}");
    }
    if let Some(amplitude) = found.first_harmonic {
        let _ = write!(
            motion,
            ", amplitude {}",
            number::quantity(units, Kind::Length, amplitude, [4, 4])
        );
    }
    format!(
        "the smallest knock found that upsets it changes the tip's speed by {} {way} ({size}) at {}° of \
         the drive, and another motion follows: {motion}; {} smaller ones were tried, at {} instants in \
         sizes {} % apart and around it, and upset nothing",
        speed(found.tip_speed.abs()),
        number::significant(found.drive_phase, 4),
        knocks.smaller_tried,
        knocks.instants,
        apart(),
    )
}

fn text(
    case: &GivenCase,
    model: &Model,
    orbit: &OrbitReport,
    chosen: Option<ObservableSet>,
) -> String {
    let units = case.units();
    let heading = format!("{}: {}", case.title(), case.summary());
    let mut text = format!("{}\n\n", style::bold(&heading));
    let verdict = format!("a period-{} orbit, {}", orbit.period, orbit.stability);
    let _ = writeln!(text, "  {}", style::bold(&verdict));
    if model.repetition() > 1 {
        text.push_str(&motion::paragraph(&format!(
            "the tones repeat after {} periods of the first, which are called a drive period here",
            model.repetition()
        )));
    }
    let defect = orbit.determinant_defect;
    let check = if defect <= MAX_DETERMINANT_DEFECT {
        format!("its multipliers agree with the trace formula to {defect:.1e}")
    } else if orbit.stability == "undecided" {
        format!(
            "its multipliers contradict the trace formula by {defect:.1e}, so that its stability is \
             undecided"
        )
    } else {
        "its smallest multiplier is lost in rounding, so that the trace formula does not check them"
            .to_owned()
    };
    text.push_str(&motion::paragraph(&format!(
        "Newton residual {:.1e}; error estimate {:.1e}; {check}",
        orbit.residual, orbit.error
    )));
    let heading = match units {
        Units::Si(_) if model.memory > 0 => {
            "state at drive phase 0, the sample's memory in the model's units"
        }
        _ => "state at drive phase 0",
    };
    let _ = writeln!(text, "\n  {}", style::bold(heading));
    let mut table = Table::new([("", Align::Left), ("", Align::Point)]);
    for (name, value) in time_series::state_names(model).iter().zip(&orbit.state) {
        let shown = match units.of_entry(name) {
            Some(_) => units.shown_entry(name, *value, 12),
            None => number::significant(*value, 12),
        };
        table.row([name.clone(), shown]);
    }
    text.push_str(&table.render());
    text.push('\n');
    text.push_str(&motion::observed(&orbit.observables, chosen, case));
    text.push('\n');
    text.push_str(&motion::spectrum(&orbit.spectrum, orbit.period, &units));
    text.push('\n');
    text.push_str(&motion::multipliers(&orbit.multipliers));
    if let Some(periods) = orbit.decay_periods {
        text.push_str(&motion::paragraph(&format!(
            "a small disturbance falls to 1/e in {} drive periods",
            number::significant(periods, 4)
        )));
    }
    if let Some(knocks) = &orbit.upset {
        text.push_str(&motion::paragraph(&upset(knocks, &units)));
    }
    if let Some(proof) = &orbit.proof {
        text.push('\n');
        text.push_str(&motion::proof(proof, model));
    }
    for (key, derivative) in &orbit.derivatives {
        text.push('\n');
        text.push_str(&motion::derivative(key, derivative, model.beam.is_some()));
    }
    text
}
