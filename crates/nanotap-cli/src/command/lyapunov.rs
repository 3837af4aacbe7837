//! `nanotap lyapunov`: Lyapunov spectrum and Poincaré section of any motion.

use nanotap::study::Study as _;
use nanotap::study::lyapunov::{ExponentSource, LyapunovReport, LyapunovStudy};

use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::study_arguments::StudyArguments;
use crate::text_table::Table;
use crate::threads::ThreadsArgument;
use crate::{motion, number, progress, style};

/// Compute the Lyapunov spectrum with error bars, and a Poincaré section.
pub(crate) type Arguments = StudyArguments<LyapunovStudy>;

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let (mut request, case) = arguments.read(output)?;
    case.model()?;
    let wanted = arguments.out.out.is_some() || arguments.plot.plot.is_some();
    if !wanted {
        request.points = 0;
    }
    let report = progress::study::<LyapunovStudy>(&case, &request, &ThreadsArgument::default())?;
    if wanted && report.section.is_empty() {
        output.warning("the section is empty: the motion begins no contact");
    }
    arguments.write(&case, &report)?;
    output.remarks(&LyapunovStudy::remarks(&case, &report));
    output.study(&case, &report, |report| text(&case, report))
}

fn text(case: &GivenCase, report: &LyapunovReport) -> String {
    let heading = format!("{}: {}", case.title(), case.summary());
    let table = Table::all(&report.exponent_table());
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
