//! `nanotap lever`: levers of the catalogue compared on a sample.

use clap::Args;
use nanotap::case::physical::Kind;
use nanotap::study::lever::{LeverOptions, LeverReport, LeverStudy};

use crate::arguments::CaseArguments;
use crate::failure::{Failure, flag};
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::page::paragraph;
use crate::request::Request;
use crate::text_table::Table;
use crate::threads::ThreadsArgument;
use crate::{number, progress, style};

/// Compare levers of the catalogue on the sample of a case, at its free amplitude and setpoint.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    case: CaseArguments,

    #[command(flatten)]
    request: Request<LeverOptions>,

    #[command(flatten)]
    threads: ThreadsArgument,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let request = arguments.request.read()?;
    let case = GivenCase::for_study(&arguments.case, true, output)?;
    let report = progress::study::<LeverStudy>(&case, &request, &arguments.threads)?;
    output.study(&case, &report, |report| text(&case, report))
}

fn text(case: &GivenCase, report: &LeverReport) -> String {
    let heading = format!(
        "{}: {} at A0 = {}, f/f0 = {}",
        case.title(),
        number::counted(report.levers.len(), "lever", "levers"),
        Kind::Length.format(report.free_amplitude),
        number::significant(report.frequency_ratio, 5)
    );
    let fits = !report.conditions.is_empty();
    let table = Table::all(&report.lever_table());
    let mut text = format!("{}\n\n{}\n", style::bold(&heading), table.render());
    if fits {
        let holding = report.levers.iter().filter(|row| row.holds == Some(true));
        text.push_str(&paragraph(&format!(
            "{}: {} of {} fit; a condition must hold for every state found",
            report.conditions.join(" and "),
            holding.count(),
            report.levers.len()
        )));
    }
    for sentence in report.sentences(flag) {
        text.push_str(&paragraph(&sentence));
    }
    text
}
