//! What can be typed, as it was typed. Each command resolves its own arguments.

use std::path::PathBuf;

use clap::builder::styling::{AnsiColor, Styles};
use clap::{Args, Parser};

use nanotap_figures::Figure;

use crate::command::Command;
use crate::failure::Failure;
use crate::file;

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

/// The case that a command works on.
#[derive(Args, Clone, Debug)]
pub(crate) struct CaseArguments {
    /// The case file (TOML); without one, --set must say all that has no default
    #[arg(value_name = "CASE")]
    pub(crate) file: Option<PathBuf>,

    /// Set a key of the case, as in omega=20 or sample.stiffness="20 N/m", or take it away, as in
    /// sample.modulus=; may be repeated
    #[arg(long, value_name = "KEY=VALUE", allow_hyphen_values = true)]
    pub(crate) set: Vec<String>,

    /// Levers and materials beside the built-in ones (TOML); may be repeated
    #[arg(long, value_name = "FILE")]
    pub(crate) catalogue: Vec<PathBuf>,
}

/// Where data go.
#[derive(Args, Clone, Debug)]
pub(crate) struct OutArgument {
    /// Write the data to this file; its ending decides the format
    #[arg(long, value_name = "PATH")]
    pub(crate) out: Option<PathBuf>,
}

impl OutArgument {
    /// Refuses what is not a table's name, before anything is computed.
    pub(crate) fn check(&self) -> Result<(), Failure> {
        let path = self.out.as_deref();
        path.map_or(Ok(()), |path| file::claim(path, &["csv"]).map(drop))
    }

    /// Writes the table that `csv` makes, where one is wanted.
    pub(crate) fn write(&self, csv: impl FnOnce() -> String) -> Result<(), Failure> {
        let path = self.out.as_deref();
        path.map_or(Ok(()), |path| file::write(path, csv().as_bytes()))
    }
}

/// Where a picture goes.
#[derive(Args, Clone, Debug)]
pub(crate) struct PlotArgument {
    /// Draw the result into this file (.svg, .png or .pdf)
    #[arg(long, value_name = "PATH")]
    pub(crate) plot: Option<PathBuf>,
}

impl PlotArgument {
    /// Refuses what is not a picture's name, before anything is computed.
    pub(crate) fn check(&self) -> Result<(), Failure> {
        let path = self.plot.as_deref();
        path.map_or(Ok(()), |path| {
            file::claim(path, &["svg", "png", "pdf"]).map(drop)
        })
    }

    /// Writes the figure that `figure` makes, where one is wanted.
    pub(crate) fn draw(&self, figure: impl FnOnce() -> Figure) -> Result<(), Failure> {
        if let Some(path) = &self.plot {
            file::draw(path, &figure())?;
        }
        Ok(())
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
