//! What can be typed, as it was typed: the commands, one a file, which resolve their own arguments.

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
mod reconstruct;
mod schema;
mod simulate;
mod study;
mod sweep;
mod window;

use clap::builder::styling::{AnsiColor, Styles};
use clap::{Parser, Subcommand};

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

/// What an AFM cantilever does when its tip taps a sample: every motion, its
/// stability, and what an experimenter would measure in it.
#[derive(Debug, Parser)]
#[command(name = "nanotap", version, long_version = long_version(), styles = STYLES, after_help = AFTER_HELP, max_term_width = 100)]
pub(crate) struct Arguments {
    /// Print one JSON document on standard output, and nothing else there
    #[arg(long, global = true)]
    pub(crate) json: bool,

    /// Leave out notes and progress; what puts the result in doubt is said all the same
    #[arg(long, short, global = true)]
    pub(crate) quiet: bool,

    /// Replace files that nanotap did not write, too
    #[arg(long, global = true)]
    pub(crate) force: bool,

    #[command(subcommand)]
    pub(crate) command: Command,
}

/// The version, and what the speed of this machine depends on.
fn long_version() -> String {
    let version = env!("CARGO_PKG_VERSION");
    let instructions = nanotap::model::vector_instructions();
    format!("{version}\nvector instructions: {instructions}")
}

/// Every command that there is.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    #[command(flatten)]
    Own(Own),
    #[command(flatten)]
    Study(study::Arguments),
}

impl Command {
    /// Whether it hears Ctrl-C by itself.
    pub(crate) const fn listens_itself(&self) -> bool {
        matches!(self, Self::Own(Own::Explore(_)))
    }
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
    /// Force and dissipation against distance from a measured curve
    Reconstruct(reconstruct::Arguments),
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
