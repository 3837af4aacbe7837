//! `nanotap bimodal`: two tones with their loops against the distance.

use nanotap::case::physical::Kind;
use nanotap::frame::Frame;
use nanotap::study::bimodal::{BimodalPoint, BimodalReport, BimodalStudy};

use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::study_arguments::StudyArguments;
use crate::text_table::Table;
use crate::threads::ThreadsArgument;
use crate::{motion, number, progress, style};

/// Bimodal operation against the distance: amplitude, phase, frequency and drive of both tones as their
/// loops hold them (AM–FM by default), and what the usual formulas make of them. The frequencies need
/// no common period.
pub(crate) type Arguments = StudyArguments<BimodalStudy>;

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let (request, case) = arguments.read(output)?;
    let report = progress::study::<BimodalStudy>(&case, &request, &ThreadsArgument::default())?;
    arguments.write(&case, &report)?;
    output.study(&case, &report, |report| text(&case, report))
}

fn length(value: f64) -> String {
    Kind::Length.format_digits(value, 4)
}

fn text(case: &GivenCase, report: &BimodalReport) -> String {
    let heading = format!(
        "{}: {}, {}–{}",
        case.title(),
        case.summary(),
        report.loops[0].name(),
        report.loops[1].name()
    );
    let mut text = format!("{}\n\n", style::bold(&heading));
    text.push_str(&Table::all(&report.free_table()).render());
    text.push('\n');
    text.push_str(&Table::all(&report.point_table()).render());
    for jump in &report.jumps {
        text.push_str(&motion::paragraph(&format!(
            "Between {} and {} the motion jumps to another.",
            length(jump.from),
            length(jump.to)
        )));
    }
    if let Some(reason) = &report.ended {
        text.push_str(&motion::paragraph(reason));
    }
    if let Some((last, formulas)) = report.table.last().zip(report.formula_table()) {
        text.push('\n');
        text.push_str(&at(last, &formulas));
    }
    text
}

/// The last motion, and the values of the formulas.
fn at(point: &BimodalPoint, formulas: &Frame<'_>) -> String {
    format!(
        "  {}\n{}{}",
        style::bold(&format!("at {}", length(point.zc))),
        Table::all(formulas).render(),
        motion::paragraph(&format!(
            "A small disturbance at constant drives changes by {} in a period. The phases of the second \
             tone leave out {:.0e} of the motion.",
            number::significant(point.growth, 6),
            point.error
        ))
    )
}
