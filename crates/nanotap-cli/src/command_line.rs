//! What can be typed, as it was typed. Each command resolves its own arguments.

use clap::Parser;
use clap::builder::styling::{AnsiColor, Styles};

use crate::command::Command;

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

Exit codes: 0 done, 1 failed, 2 bad input.";

/// What an AFM cantilever does when its tip taps a sample: every motion, its
/// stability, and what an experimenter would measure in it.
#[derive(Debug, Parser)]
#[command(name = "nanotap", version, styles = STYLES, after_help = AFTER_HELP, max_term_width = 100)]
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

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    #[test]
    fn the_command_line_is_consistent() {
        super::Arguments::command().debug_assert();
    }
}
