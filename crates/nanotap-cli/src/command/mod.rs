//! The commands, one a file.

mod case;

use clap::Subcommand;
use nanotap::case::Case;
use nanotap::case_file::CaseFile;

use crate::arguments::CaseArguments;
use crate::failure::Failure;
use crate::output::Output;

/// Every command that there is.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Check a case and show it resolved
    Case(case::Arguments),
}

/// Runs `command`.
pub(crate) fn run(command: &Command, output: &Output) -> Result<(), Failure> {
    match command {
        Command::Case(arguments) => case::run(arguments, output),
    }
}

/// The case file that the arguments name, with what they set.
fn case_file(arguments: &CaseArguments) -> Result<CaseFile, Failure> {
    Ok(CaseFile::load(arguments.file.as_deref(), &arguments.set)?)
}

/// What the case is called in a heading: its file, or that it was typed.
fn title(arguments: &CaseArguments) -> String {
    arguments.file.as_ref().map_or_else(
        || "the case that was typed".to_owned(),
        |file| file.display().to_string(),
    )
}

/// The cantilever that the arguments describe.
fn cantilever(arguments: &CaseArguments, command: &str) -> Result<Case, Failure> {
    match case_file(arguments)? {
        CaseFile::Dimensionless(case) => Ok(case),
        CaseFile::Oscillator(_) => Err(Failure::request(
            format!(
                "{}: `{command}` needs a cantilever; this is an oscillator",
                title(arguments)
            ),
            "an oscillator has one degree of freedom and no beam modes",
        )),
        CaseFile::Physical(_) => Err(physical_not_yet(arguments)),
    }
}

fn physical_not_yet(arguments: &CaseArguments) -> Failure {
    Failure::Failed(format!(
        "{}: its keys are right, but physical units are not resolved by this version; \
         give alpha1 … alpha6 and omega under [model]",
        title(arguments)
    ))
}
