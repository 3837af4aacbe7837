//! Arguments that commands share.

use std::path::PathBuf;

use clap::Args;

use nanotap::ErrorKind;
use nanotap::study::fit::Table;
use nanotap_figures::Figure;

use crate::failure::Failure;
use crate::file;

/// The case that a command works on.
#[derive(Args, Clone, Debug)]
pub(crate) struct CaseArguments {
    /// Case file (TOML); without one, set every required key with --set
    #[arg(value_name = "CASE")]
    pub(crate) file: Option<PathBuf>,

    /// Set a key of the case, as in omega=20 or sample.stiffness="20 N/m", or remove it, as in
    /// sample.modulus=; may be repeated
    #[arg(long, value_name = "KEY=VALUE", allow_hyphen_values = true)]
    pub(crate) set: Vec<String>,

    /// Additional levers and materials (TOML); may be repeated
    #[arg(long, value_name = "FILE")]
    pub(crate) catalogue: Vec<PathBuf>,

    /// Show a physical case in the model's units; numbers without a unit are then in them too
    #[arg(long)]
    pub(crate) model_units: bool,
}

/// Reads measured curves for `command`, of each file the first curve or the one with this number.
pub(crate) fn measured(
    first: &PathBuf,
    also: &[PathBuf],
    curve: Option<usize>,
    command: &str,
) -> Result<Vec<Table>, Failure> {
    let read = |path: &PathBuf| {
        if path.extension().is_some_and(|ending| ending == "toml") {
            return Err(Failure::input(
                format!("{}: expected a data file, got a case file", path.display()),
                format!("name the data first, then the case: nanotap {command} DATA CASE"),
            ));
        }
        // A file that cannot be read is bad input, as a case file is.
        let table = match curve {
            Some(number) => Table::read_curve(path, number),
            None => Table::read(path),
        };
        table.map_err(|error| Failure {
            kind: ErrorKind::BadInput,
            ..error
        })
    };
    std::iter::once(first).chain(also).map(read).collect()
}

/// Where data go.
#[derive(Args, Clone, Debug)]
pub(crate) struct OutArgument {
    /// Write the data to this file; the extension selects the format
    #[arg(long, value_name = "PATH")]
    pub(crate) out: Option<PathBuf>,
}

impl OutArgument {
    /// Checks that the path is that of a table that may be written, before anything is computed.
    pub(crate) fn check(&self) -> Result<(), Failure> {
        let path = self.out.as_deref();
        path.map_or(Ok(()), |path| file::claim(path, &["csv"]).map(drop))
    }

    /// Writes the table that `csv` makes, if `--out` was given.
    pub(crate) fn write(&self, csv: impl FnOnce() -> String) -> Result<(), Failure> {
        let path = self.out.as_deref();
        path.map_or(Ok(()), |path| file::write(path, csv().as_bytes()))
    }
}

/// Where a picture goes.
#[derive(Args, Clone, Debug)]
pub(crate) struct PlotArgument {
    /// Draw the result to this file (.svg, .png or .pdf)
    #[arg(long, value_name = "PATH")]
    pub(crate) plot: Option<PathBuf>,
}

impl PlotArgument {
    /// Checks that the path is that of a picture that may be written, before anything is computed.
    pub(crate) fn check(&self) -> Result<(), Failure> {
        let path = self.plot.as_deref();
        path.map_or(Ok(()), |path| {
            file::claim(path, &["svg", "png", "pdf"]).map(drop)
        })
    }

    /// Writes the figure that `figure` makes, if `--plot` was given.
    pub(crate) fn draw(&self, figure: impl FnOnce() -> Figure) -> Result<(), Failure> {
        if let Some(path) = &self.plot {
            file::draw(path, &figure())?;
        }
        Ok(())
    }
}
