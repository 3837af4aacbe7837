//! `nanotap convergence`: the same motion with N = 1 … K modes, and a verdict on enough.

use std::fmt::Write as _;

use nanotap::case::physical::Kind;
use nanotap::study::Study as _;
use nanotap::study::convergence::{Convergence, ConvergenceStudy};

use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::study_arguments::StudyArguments;
use crate::text_table::Table;
use crate::threads::ThreadsArgument;
use crate::{motion, number, progress, style};

/// Compare the motion with 1 to K modes: how many are enough.
pub(crate) type Arguments = StudyArguments<ConvergenceStudy>;

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let (request, case) = arguments.read(output)?;
    let result = progress::study::<ConvergenceStudy>(&case, &request, &ThreadsArgument::default())?;
    arguments.write(&case, &result)?;
    output.remarks(&ConvergenceStudy::remarks(&case, &result));
    output.study(&case, &result, |result| text(&case, result))
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
    let table = Table::all(&result.motion_table(units));
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
    let report = &result.readings;
    let _ = write!(
        text,
        "  {}\n{}\n  {}\n",
        style::bold("readings, and the share of each mode with the most modes"),
        Table::all(&result.reading_table(units)).render(),
        style::bold(&report.reading_verdict)
    );
    text
}
