//! `nanotap force-curve`: approach and retract at a finite speed.

use clap::Args;
use nanotap::case::physical::Kind;
use nanotap::study::Study as _;
use nanotap::study::approach::Way;
use nanotap::study::force_curve::{ForceCurveReport, ForceCurveStudy, StaticJump, Waveform};

use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::study_arguments::StudyArguments;
use crate::text_table::Table;
use crate::threads::ThreadsArgument;
use crate::{motion, progress, style};

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
    output.remarks(&ForceCurveStudy::remarks(&case, &report));
    arguments.study.write(&case, &report)?;
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
    let table = Table::record(&report.result_table());
    let mut text = format!("{}\n\n{}", style::bold(&heading), table.render());
    for jump in &report.statics.jumps {
        text.push_str(&motion::paragraph(&jump_text(jump)));
    }
    if !report.fits.is_empty() {
        let table = Table::all(&report.fit_table());
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
