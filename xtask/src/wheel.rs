//! The Python package: built as a wheel, and installed for the tests.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::process::must;
use crate::tools::{Environment, PYTHON, Workspace};

/// Builds the wheel and leaves it as the only one in `target/wheels`.
///
/// # Errors
/// If the tools are missing or the build fails.
pub(crate) fn build(workspace: &Workspace) -> Result<PathBuf, String> {
    let folder = workspace.root.join("target").join("wheels");
    fs::create_dir_all(&folder)
        .map_err(|error| format!("cannot make {}: {error}", folder.display()))?;
    for old in with_extension(&folder, "whl") {
        // A wheel that cannot be removed is reported below.
        let _ = fs::remove_file(old);
    }
    must(
        &workspace.root,
        &mut maturin(workspace, &folder)?,
        "the wheel could not be built",
    )?;
    match with_extension(&folder, "whl").as_slice() {
        [wheel] => Ok(wheel.clone()),
        found => Err(format!(
            "{} wheels in {} where one is expected",
            found.len(),
            folder.display()
        )),
    }
}

/// Prepares the call of maturin that builds the wheel into `folder`.
///
/// # Errors
/// If maturin is missing and cannot be installed.
pub(crate) fn maturin(workspace: &Workspace, folder: &Path) -> Result<Command, String> {
    let mut command = workspace.python_tool("maturin")?;
    command.args(["build", "--release", "--locked"]);
    command.args(["--interpreter", PYTHON, "--out"]).arg(folder);
    Ok(command)
}

/// The files in `folder` whose names end in `.extension`.
pub(crate) fn with_extension(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let Ok(listing) = fs::read_dir(folder) else {
        return Vec::new();
    };
    listing
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|ending| ending == extension))
        .collect()
}

/// An environment with the wheel of this checkout and the packages that the tests need. It is kept
/// from run to run; only the wheel is installed anew.
///
/// # Errors
/// If the wheel cannot be built or installed.
pub(crate) fn installed(workspace: &Workspace) -> Result<Environment, String> {
    let wheel = build(workspace)?;
    let list = workspace.root.join("xtask").join("test-requirements.txt");
    let environment = Environment::ensured(
        &workspace.root,
        workspace.root.join("target").join("python-tests"),
        &list,
    )?;
    let mut command = environment.pip();
    command.args(["--force-reinstall", "--no-deps"]).arg(&wheel);
    must(
        &workspace.root,
        &mut command,
        "the wheel could not be installed",
    )?;
    Ok(environment)
}
