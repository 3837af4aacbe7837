//! The commands, one per file, with their arguments.

mod approach;
mod attractors;
mod basin;
mod bimodal;
mod branch;
mod calibrate;
mod case;
mod catalogue;
mod contact_laws;
mod convergence;
mod explore;
mod files;
mod fit;
mod fm;
mod force_curve;
mod generate;
mod image_states;
mod lever;
mod lyapunov;
mod merge;
mod modes;
mod noise;
mod orbit;
mod paper;
mod reconstruct;
mod scan;
mod schema;
mod simulate;
mod study;
mod sweep;
mod window;

use std::ffi::OsString;

use clap::builder::styling::{AnsiColor, Styles};
use clap::{CommandFactory as _, FromArgMatches as _, Parser, Subcommand};

use crate::failure::Failure;
use crate::output::Output;

const STYLES: Styles = Styles::styled()
    .header(AnsiColor::Green.on_default().bold())
    .usage(AnsiColor::Green.on_default().bold())
    .literal(AnsiColor::Cyan.on_default().bold())
    .placeholder(AnsiColor::Cyan.on_default());

const AFTER_HELP: &str = "\
A case is a TOML file:

    [model]
    modes = 3
    alpha1 = 0.1    # tip_mass_ratio
    alpha2 = 0.1    # drive_amplitude
    alpha3 = 0.1    # beam_damping
    alpha4 = 20.0   # contact_stiffness
    alpha5 = 0.0    # gap
    alpha6 = 0.2    # contact_damping
    omega = 2.6     # drive_frequency

Exit codes: 0 done, 1 failed, 2 bad input, 130 stopped by Ctrl-C or SIGTERM (what is finished
is kept: reports of what was found so far, chunks of datasets).";

/// Dynamics of an AFM cantilever whose tip taps a sample: its motions, their stability, and the
/// quantities that an experiment measures.
#[derive(Debug, Parser)]
#[command(name = "nanotap", version, styles = STYLES, after_help = AFTER_HELP, max_term_width = 100)]
pub(crate) struct Arguments {
    /// Print one JSON document on standard output, and nothing else
    #[arg(long, global = true)]
    pub(crate) json: bool,

    /// Suppress notes and progress; warnings are still printed
    #[arg(long, short, global = true)]
    pub(crate) quiet: bool,

    /// Also replace files that nanotap did not write
    #[arg(long, global = true)]
    pub(crate) force: bool,

    #[command(subcommand)]
    pub(crate) command: Command,
}

/// Parses the command line of a program with this version, the program's name first.
pub(crate) fn parse(
    arguments: impl IntoIterator<Item = impl Into<OsString> + Clone>,
    version: &'static str,
) -> Result<Arguments, clap::Error> {
    let instructions = nanotap::model::vector_instructions();
    let mut command = Arguments::command()
        .version(version)
        .long_version(format!("{version}\nvector instructions: {instructions}"));
    let matches = command.try_get_matches_from_mut(arguments)?;
    Arguments::from_arg_matches(&matches).map_err(|error| error.format(&mut command))
}

/// Every command.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    #[command(flatten)]
    Own(Own),
    #[command(flatten)]
    Study(study::Arguments),
}

impl Command {
    /// Whether the command handles Ctrl-C itself.
    pub(crate) const fn listens_itself(&self) -> bool {
        matches!(self, Self::Own(Own::Explore(_)))
    }
}

/// The commands with a hand-written text.
#[derive(Debug, Subcommand)]
pub(crate) enum Own {
    /// Check a case and print it resolved
    Case(case::Arguments),
    /// Compute mode shapes and frequencies, in free flight and in contact
    Modes(modes::Arguments),
    /// Simulate a motion: its steady state or its transient
    Simulate(simulate::Arguments),
    /// Compute a periodic orbit by Newton's method, stable or not
    Orbit(orbit::Arguments),
    /// Find coexisting attractors by sampling initial states
    Attractors(attractors::Arguments),
    /// Follow periodic orbits in a parameter, stable and unstable
    Branch(branch::Arguments),
    /// Compute amplitude, phase, force and energy against the distance, both ways
    Approach(approach::Arguments),
    /// Compute frequency shift and excitation against the distance, both ways
    Fm(fm::Arguments),
    /// Compute a force curve at a finite speed, with its static branches
    ForceCurve(force_curve::Arguments),
    /// Compare levers of the catalogue on the sample of a case
    Lever(lever::Arguments),
    /// Compute thermal noise of amplitude and phase at a working point
    Noise(noise::Arguments),
    /// Follow two tones with their loops (AM–FM, FM–FM) against the distance
    Bimodal(bimodal::Arguments),
    /// Simulate a line or an image under feedback
    Scan(scan::Arguments),
    /// Assign each pixel of an image to a state of the lever, and correct its heights
    ImageStates(image_states::Arguments),
    /// List what the files of instruments hold
    Files(files::Arguments),
    /// Calibrate a lever from its thermal noise: k, Q, f0, sensitivity
    Calibrate(Box<calibrate::Arguments>),
    /// Fit parameters of lever and sample to measured curves
    Fit(fit::Arguments),
    /// Reconstruct force and dissipation against distance from a measured curve
    Reconstruct(reconstruct::Arguments),
    /// Sweep one or two parameters, from any number of initial states
    Sweep(sweep::Arguments),
    /// Map the operating window over two parameters: where only one motion exists
    Window(window::Arguments),
    /// Compute basins of attraction on a slice of initial states
    Basin(basin::Arguments),
    /// Merge partial datasets of a sweep or basin
    Merge(merge::Arguments),
    /// Compute the Lyapunov spectrum with error bars, and a Poincaré section
    Lyapunov(lyapunov::Arguments),
    /// Compare the motion with 1 to K modes: how many are enough
    Convergence(convergence::Arguments),
    /// Compare contact laws under the same lever and drive
    #[command(alias = "samples")]
    ContactLaws(contact_laws::Arguments),
    /// Change parameters of a case in a browser and see the motion
    Explore(explore::Arguments),
    /// Reproduce every figure and number of the paper, with verdicts and evidence
    Paper(paper::Arguments),
    /// List the levers and materials that a case can name
    Catalogue(catalogue::Arguments),
    /// Generate shell completions and manual pages
    Generate(generate::Arguments),
    /// Print the JSON schema of a study's options and report, or of a case
    Schema(schema::Arguments),
}

/// Runs a command with its arguments and prints its result.
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
        Own::Fm(arguments) => fm::run(arguments, output),
        Own::ForceCurve(arguments) => force_curve::run(arguments, output),
        Own::Lever(arguments) => lever::run(arguments, output),
        Own::Noise(arguments) => noise::run(arguments, output),
        Own::Bimodal(arguments) => bimodal::run(arguments, output),
        Own::Scan(arguments) => scan::run(arguments, output),
        Own::ImageStates(arguments) => image_states::run(arguments, output),
        Own::Files(arguments) => files::run(arguments, output),
        Own::Calibrate(arguments) => calibrate::run(arguments, output),
        Own::Fit(arguments) => fit::run(arguments, output),
        Own::Reconstruct(arguments) => reconstruct::run(arguments, output),
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

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    #[test]
    fn the_command_line_is_consistent() {
        super::Arguments::command().debug_assert();
    }
}
