//! `nanotap generate`: shell completions and manual pages, made from the command line itself.

use std::path::{Path, PathBuf};

use clap::{Args, CommandFactory as _, ValueEnum};
use clap_complete::Shell;
use clap_mangen::Man;
use schemars::JsonSchema;
use serde::Serialize;

use crate::failure::Failure;
use crate::file;
use crate::output::Output;

/// Generate shell completions and manual pages.
#[derive(Args, Debug)]
pub(crate) struct Arguments {
    /// Completions for this shell, or the manual pages
    #[arg(value_enum)]
    what: What,

    /// Folder for the manual pages, one per command, created if missing; without it, the main page
    /// goes to standard output
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum What {
    /// Completions, as in nanotap generate bash > ~/.local/share/bash-completion/completions/nanotap
    Bash,
    /// Completions, as in nanotap generate elvish >> ~/.config/elvish/rc.elv
    Elvish,
    /// Completions, as in nanotap generate fish > ~/.config/fish/completions/nanotap.fish
    Fish,
    /// Completions, as in nanotap generate powershell >> $PROFILE
    Powershell,
    /// Completions, as in nanotap generate zsh > ~/.zfunc/_nanotap
    Zsh,
    /// Manual pages, as in nanotap generate man --out ~/.local/share/man/man1
    Man,
}

/// The generated output: text, or files.
#[derive(Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(super) enum Made {
    /// Text for standard output, such as a completion script.
    Text(String),
    /// Paths of the manual pages that were written.
    Files(Vec<PathBuf>),
}

pub(crate) fn run(arguments: &Arguments, output: &Output) -> Result<(), Failure> {
    let made = match (arguments.what.shell(), &arguments.out) {
        (Some(shell), None) => Made::Text(completions(shell)),
        (None, None) => Made::Text(first_page()?),
        (None, Some(folder)) => Made::Files(pages(folder)?),
        (Some(_), Some(folder)) => {
            return Err(Failure::input(
                format!(
                    "--out {}: completions go to standard output",
                    folder.display()
                ),
                "omit --out and redirect the output where the shell looks for completions",
            ));
        }
    };
    output.result(&made, |made| match made {
        Made::Text(text) => text.clone(),
        Made::Files(files) => files.iter().fold(String::new(), |text, path| {
            text + &path.display().to_string() + "\n"
        }),
    })
}

impl What {
    /// The shell that is completed, if it is one.
    fn shell(self) -> Option<Shell> {
        match self {
            Self::Bash => Some(Shell::Bash),
            Self::Elvish => Some(Shell::Elvish),
            Self::Fish => Some(Shell::Fish),
            Self::Powershell => Some(Shell::PowerShell),
            Self::Zsh => Some(Shell::Zsh),
            Self::Man => None,
        }
    }
}

fn completions(shell: Shell) -> String {
    let mut text = Vec::new();
    let mut command = super::Arguments::command();
    clap_complete::generate(shell, &mut command, "nanotap", &mut text);
    String::from_utf8_lossy(&text).into_owned()
}

/// The command line, every command of it by its whole name, as in `nanotap-orbit`; the same on every
/// machine.
fn command() -> clap::Command {
    let mut command = super::Arguments::command().disable_help_subcommand(true);
    command.build();
    command
}

/// The manual page of the program.
fn first_page() -> Result<String, Failure> {
    let mut text = Vec::new();
    Man::new(command())
        .render(&mut text)
        .map_err(|error| Failure::numerics(format!("cannot make the manual page: {error}")))?;
    Ok(String::from_utf8_lossy(&text).into_owned())
}

/// Writes a page for the program and for each of its commands.
fn pages(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let refuse = |error| Failure::files(format!("cannot write to {}: {error}", folder.display()));
    std::fs::create_dir_all(folder).map_err(refuse)?;
    let whole = command();
    let shown = whole
        .get_subcommands()
        .filter(|command| !command.is_hide_set());
    std::iter::once(&whole)
        .chain(shown)
        .map(|command| {
            let page = Man::new(command.clone());
            file::claim(&folder.join(page.get_filename()), &["1"])?;
            Ok(page)
        })
        // None is written before all of them may be.
        .collect::<Result<Vec<_>, Failure>>()?
        .into_iter()
        .map(|page| page.generate_to(folder).map_err(refuse))
        .collect()
}
