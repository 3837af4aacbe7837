//! The commands, one a file.

mod approach;
mod attractors;
mod basin;
mod branch;
mod case;
mod catalogue;
mod contact_laws;
mod convergence;
mod explore;
mod fit;
mod generate;
mod lyapunov;
mod merge;
mod modes;
mod orbit;
mod paper;
mod schema;
mod simulate;
mod study;
mod sweep;
mod window;

use std::path::PathBuf;
use std::sync::Arc;

use clap::Subcommand;
use nanotap::case::Case;
use nanotap::case::physical::Catalogue;
use nanotap::model::cantilever::Cantilever;

use crate::arguments::CaseArguments;
use crate::failure::Failure;
use crate::output::Output;

/// Every command that there is.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    #[command(flatten)]
    Own(Own),
    #[command(flatten)]
    Study(study::Arguments),
}

/// The commands with a text of their own.
#[derive(Debug, Subcommand)]
pub(crate) enum Own {
    /// Check a case and show it resolved
    Case(case::Arguments),
    /// Mode shapes and frequencies, in free flight and in contact
    Modes(modes::Arguments),
    /// One run: its steady state, or how it gets there
    Simulate(simulate::Arguments),
    /// A periodic orbit by Newton, stable or not
    Orbit(orbit::Arguments),
    /// Every motion that coexists: a census from many seeded starts
    Attractors(attractors::Arguments),
    /// Periodic orbits followed in a parameter, stable and unstable
    Branch(branch::Arguments),
    /// Amplitude, phase, force and energy against the distance, both ways
    Approach(approach::Arguments),
    /// Parameters of lever and sample from measured curves
    Fit(fit::Arguments),
    /// How the motion changes with one or two parameters, from any number of starts
    Sweep(sweep::Arguments),
    /// The operating window over two parameters: where only one motion exists
    Window(window::Arguments),
    /// Basins of attraction on a slice of initial states
    Basin(basin::Arguments),
    /// Put together what several machines computed of one sweep or basin
    Merge(merge::Arguments),
    /// Lyapunov spectrum with error bars, and a Poincaré section
    Lyapunov(lyapunov::Arguments),
    /// The same motion with N = 1 … K modes: how many are enough
    Convergence(convergence::Arguments),
    /// The same lever and drive on every contact law: what difference the sample makes
    #[command(alias = "samples")]
    ContactLaws(contact_laws::Arguments),
    /// Turn the knobs of a case in a browser and see what the tip does
    Explore(explore::Arguments),
    /// Every figure and number of the paper, with verdicts and evidence
    Paper(paper::Arguments),
    /// The levers and materials that a case can name
    Catalogue(catalogue::Arguments),
    /// Shell completions and manual pages
    Generate(generate::Arguments),
    /// The JSON schema of what a study is asked for
    Schema(schema::Arguments),
}

/// Runs `command`.
pub(crate) fn run(command: &Command, output: &Output) -> Result<(), Failure> {
    let own = match command {
        Command::Own(own) => own,
        Command::Study(arguments) => return study::run(arguments, output),
    };
    match own {
        Own::Case(arguments) => case::run(arguments, output),
        Own::Modes(arguments) => modes::run(arguments, output),
        Own::Simulate(arguments) => simulate::run(arguments, output),
        Own::Orbit(arguments) => orbit::run(arguments, output),
        Own::Attractors(arguments) => attractors::run(arguments, output),
        Own::Branch(arguments) => branch::run(arguments, output),
        Own::Approach(arguments) => approach::run(arguments, output),
        Own::Fit(arguments) => fit::run(arguments, output),
        Own::Sweep(arguments) => sweep::run(arguments, output),
        Own::Window(arguments) => window::run(arguments, output),
        Own::Basin(arguments) => basin::run(arguments, output),
        Own::Merge(arguments) => merge::run(arguments, output),
        Own::Lyapunov(arguments) => lyapunov::run(arguments, output),
        Own::Convergence(arguments) => convergence::run(arguments, output),
        Own::ContactLaws(arguments) => contact_laws::run(arguments, output),
        Own::Explore(arguments) => explore::run(arguments, output),
        Own::Paper(arguments) => paper::run(arguments, output),
        Own::Catalogue(arguments) => catalogue::run(arguments, output),
        Own::Generate(arguments) => generate::run(arguments, output),
        Own::Schema(arguments) => schema::run(arguments),
    }
}

/// What the case is called in a heading: its file, or that it was typed.
pub(crate) fn title(arguments: &CaseArguments) -> String {
    arguments.file.as_ref().map_or_else(
        || "the case that was typed".to_owned(),
        |file| file.display().to_string(),
    )
}

/// The built-in catalogue and what these files add to it.
fn catalogue(files: &[PathBuf]) -> Result<Arc<Catalogue>, Failure> {
    let mut catalogue = Catalogue::shared();
    for path in files {
        Arc::make_mut(&mut catalogue).extend_from_file(path)?;
    }
    Ok(catalogue)
}

/// The case of the arguments, with the built-in catalogue and those that they add.
pub(crate) fn case_of(arguments: &CaseArguments) -> Result<Case, Failure> {
    let catalogue = catalogue(&arguments.catalogue)?;
    let case = Case::load(arguments.file.as_deref(), &arguments.set, &catalogue)?;
    Ok(case.called(&title(arguments)))
}

/// The dimensionless cantilever of a case, for `command`.
fn cantilever_of(case: &Case, command: &str) -> Result<Cantilever, Failure> {
    case.cantilever().cloned().ok_or_else(|| {
        Failure::input(
            format!(
                "{}: `{command}` needs a cantilever; this is an oscillator",
                case.title()
            ),
            "an oscillator has one degree of freedom and no beam modes",
        )
    })
}
