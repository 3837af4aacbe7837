//! `nanotap fm`: frequency shift and excitation against the distance, both ways.

use clap::Args;
use nanotap::study::frequency_modulation::FrequencyModulationStudy;

use super::approach;
use super::branch::PointsArgument;
use crate::failure::Failure;
use crate::output::Output;
use crate::progress;
use crate::study_arguments::StudyArguments;
use crate::threads::ThreadsArgument;

/// Frequency modulation against the distance to the sample, both ways: frequency shift, excitation,
/// dissipation and force, with amplitude and phase held.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    #[command(flatten)]
    study: StudyArguments<FrequencyModulationStudy>,
    #[command(flatten)]
    threads: ThreadsArgument,
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let study = &arguments.study;
    let (request, case) = study.read(output)?;
    let report = progress::study::<FrequencyModulationStudy>(&case, &request, &arguments.threads)?;
    approach::print(report, &case, study, PointsArgument::default(), output)
}
