//! `nanotap force-curve`: approach and retract at a finite speed.

use clap::Args;
use nanotap::case::physical::Kind;
use nanotap::figure::force_curve::force_curve_figure;
use nanotap::study::approach::Way;
use nanotap::study::force_curve::{
    ForceCurveReport, ForceCurveStudy, StaticJump, Waveform, points_csv,
};

use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::study_arguments::StudyArguments;
use crate::table::{Align, Table};
use crate::threads::ThreadsArgument;
use crate::{motion, number, progress, style};

/// A force curve at a finite speed: snap-in, contact, pull-off and ringing, with the branches on
/// which the lever would rest, adhesion, work, indentation and the moduli of contact fits.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    study: StudyArguments<ForceCurveStudy>,
    #[command(flatten)]
    threads: ThreadsArgument,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let (request, case) = arguments.study.read(output)?;
    let report = progress::study::<ForceCurveStudy>(&case, &request, &arguments.threads)?;
    for warning in &report.warnings {
        output.warning(warning);
    }
    arguments.study.out.write(|| points_csv(&report))?;
    arguments.study.plot.draw(|| force_curve_figure(&report))?;
    output.study(&case, &report, |report| text(&case, report))
}

fn in_units(kind: Kind, value: f64) -> String {
    kind.format_digits(value, 5)
}

fn text(case: &GivenCase, report: &ForceCurveReport) -> String {
    let length = |z: f64| in_units(Kind::Length, z);
    let how = match report.waveform {
        Waveform::Ramp => format!("at {}", in_units(Kind::Velocity, report.speed)),
        Waveform::Cosine => format!(
            "as a cosine of {}",
            in_units(Kind::Frequency, 1.0 / report.duration)
        ),
    };
    let heading = format!(
        "{}: force curve from {} to {} {how}",
        case.title(),
        length(report.from),
        length(report.to),
    );
    let none = || "none".to_owned();
    let summary = &report.summary;
    let energy = |value: f64| in_units(Kind::Energy, value);
    let mut table = Table::new([("", Align::Left), ("", Align::Left), ("", Align::Left)]);
    let mut row = |name: &str, value: String, meaning: &str| {
        table.row([name.to_owned(), value, meaning.to_owned()]);
    };
    row(
        "contact begins",
        summary.contact_begin.map_or_else(none, length),
        "distance at which the tip first touches on the approach",
    );
    row(
        "contact ends",
        summary.contact_end.map_or_else(none, length),
        "distance at which the tip last touches on the retract",
    );
    row("peak force", in_units(Kind::Force, summary.peak_force), "");
    row(
        "adhesion force",
        in_units(Kind::Force, summary.adhesion_force),
        "minus the lowest force of the retract",
    );
    if let Some(point) = &report.statics.pull_off {
        row(
            "  at rest",
            in_units(Kind::Force, -point.force),
            "the same without inertia, until the lever jumps off",
        );
    }
    row(
        "indentation",
        length(summary.indentation),
        "minus the least separation",
    );
    row(
        "work of adhesion",
        energy(summary.adhesion_energy),
        "area between the retract and zero force where the sample attracts",
    );
    row(
        "energy lost",
        energy(summary.energy_lost),
        "area between approach and retract",
    );
    row(
        "  in the sample",
        energy(summary.dissipation),
        "the rest rings down in the lever",
    );
    let mut text = format!("{}\n\n{}", style::bold(&heading), table.render());
    for jump in &report.statics.jumps {
        text.push_str(&motion::paragraph(&jump_text(jump)));
    }
    if !report.fits.is_empty() {
        let mut table = Table::new([
            ("fit of the unloading", Align::Left),
            ("E*", Align::Left),
            ("E of the sample", Align::Left),
            ("rms (pm)", Align::Point),
        ]);
        for fit in &report.fits {
            table.row([
                fit.model.name().to_owned(),
                in_units(Kind::Pressure, fit.reduced_modulus),
                fit.modulus
                    .map_or_else(none, |e| in_units(Kind::Pressure, e)),
                number::significant(1e12 * fit.residual, 3),
            ]);
        }
        if let Some(reduced) = report.reduced_modulus {
            table.row([
                "of the case".to_owned(),
                in_units(Kind::Pressure, reduced),
                report
                    .modulus
                    .map_or_else(none, |e| in_units(Kind::Pressure, e)),
                String::new(),
            ]);
        }
        text.push('\n');
        text.push_str(&table.render());
    }
    text
}

fn jump_text(jump: &StaticJump) -> String {
    let length = |z: f64| in_units(Kind::Length, z);
    let way = match jump.way {
        Way::Retract => "retract",
        _ => "approach",
    };
    let before = &jump.before;
    let after = jump.after.as_ref().map_or_else(
        || "and finds no other rest".to_owned(),
        |rest| {
            format!(
                "to {} under {}",
                length(rest.separation),
                in_units(Kind::Force, rest.force)
            )
        },
    );
    format!(
        "at rest the lever jumps on the {way} at the distance {} from a separation of {} under {} \
         {after}",
        length(before.distance),
        length(before.separation),
        in_units(Kind::Force, before.force),
    )
}
