//! `nanotap reconstruct`: force and dissipation from measured curves, without a contact law.

use std::path::PathBuf;

use clap::Args;
use nanotap::study::Study as _;
use nanotap::study::reconstruct::{ReconstructMethod, ReconstructReport, ReconstructStudy};

use crate::arguments::measured;
use crate::failure::Failure;
use crate::given_case::GivenCase;
use crate::output::Output;
use crate::study_arguments::StudyArguments;
use crate::text_table::Table;
use crate::threads::ThreadsArgument;
use crate::{number, progress, style};

/// Rows of the printed force curve.
const SHOWN: usize = 15;

/// Force and dissipation against distance from a measured curve.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    /// The measured curve (CSV or an instrument's file), its columns named as in `distance (nm)`,
    /// `amplitude (nm)`, `phase (deg)`, or `frequency_shift (Hz)`
    #[arg(value_name = "DATA")]
    data: PathBuf,

    #[command(flatten)]
    study: StudyArguments<ReconstructStudy>,

    /// A further measured curve of the same sample; may be repeated
    #[arg(long, value_name = "DATA")]
    also: Vec<PathBuf>,

    #[command(flatten)]
    threads: ThreadsArgument,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let (mut options, case) = arguments.study.read(output)?;
    options.data = measured(&arguments.data, &arguments.also, None, "reconstruct")?;
    let report = progress::study::<ReconstructStudy>(&case, &options, &arguments.threads)?;
    arguments.study.write(&case, &report)?;
    output.remarks(&ReconstructStudy::remarks(&case, &report));
    output.study(&case, &report, |report| text(&case, report))
}

fn text(case: &GivenCase, report: &ReconstructReport) -> String {
    let method = match report.method {
        ReconstructMethod::AmplitudeModulation => "amplitude and phase",
        ReconstructMethod::FrequencyModulation => "frequency shift",
    };
    let heading = format!(
        "{}: force from {method} of {}",
        case.title(),
        number::counted(report.rows.len(), "row", "rows")
    );
    let end = report.shown_rows();
    let rows = (0..end).step_by(end.div_ceil(SHOWN).max(1));
    let table = Table::of(&report.force_table(), rows);
    let mut text = format!("{}\n\n{}\n", style::bold(&heading), table.render());
    text.push('\n');
    text.push_str(&Table::all(&report.summary_table()).render());
    text
}
