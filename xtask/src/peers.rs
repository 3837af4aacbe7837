//! `cargo xtask peers`: compares time and error of nanotap and general solvers.
//!
//! This prepares the environment and starts `peers/run.py`, which measures and writes
//! `docs/peers.md`. Programs that a machine cannot run are left out, with the reason.

use std::path::PathBuf;
use std::process::Command;

use crate::process::succeeds;
use crate::tools::{PYTHON, Workspace};

/// Runs the comparison; `options` are those of `peers/run.py`.
///
/// # Errors
/// If there is no Python, nanotap does not build, or the comparison fails.
pub(crate) fn run(workspace: &Workspace, options: &[String]) -> Result<(), String> {
    let asks_for_help = options
        .iter()
        .any(|o| matches!(o.as_str(), "-h" | "--help"));
    let python = if asks_for_help {
        PathBuf::from(PYTHON)
    } else {
        environment(workspace)?
    };
    let target = workspace.target();
    let mut command = Command::new(python);
    command
        .arg("peers/run.py")
        .arg("--build")
        .arg(target.join("peers"))
        .args(options)
        .env("CARGO", workspace.cargo_program())
        .env("NANOTAP_PEER", target.join("release/examples/peer"))
        .env("NANOTAP_LAW_PEER", target.join("release/examples/dmt_peer"));
    if !asks_for_help {
        for (package, example) in [("nanotap", "peer"), ("nanotap-volterra", "dmt_peer")] {
            let mut build = workspace.cargo(&["build", "--release", "--quiet"]);
            build.args(["--package", package, "--example", example]);
            if !succeeds(&workspace.root, &mut build)? {
                return Err("nanotap's own part could not be built".into());
            }
        }
    }
    if succeeds(&workspace.root, &mut command)? {
        Ok(())
    } else {
        Err("the comparison failed".into())
    }
}

/// The Python of `.venv-peers`, with those packages of `peers/requirements.txt` that can be
/// installed.
fn environment(workspace: &Workspace) -> Result<PathBuf, String> {
    let list = workspace.root.join("peers").join("requirements.txt");
    let wanted = std::fs::read_to_string(&list)
        .map_err(|error| format!("cannot read {}: {error}", list.display()))?;
    let folder = workspace.root.join(".venv-peers");
    let python = folder
        .join(if cfg!(windows) { "Scripts" } else { "bin" })
        .join("python");
    let stamp = folder.join("installed.txt");
    if std::fs::read_to_string(&stamp).is_ok_and(|installed| installed == wanted) {
        return Ok(python);
    }
    let mut create = Command::new(PYTHON);
    create.args(["-m", "venv", ".venv-peers"]);
    if !succeeds(&workspace.root, &mut create)? {
        return Err("python3 -m venv .venv-peers failed".into());
    }
    // One by one: a package that cannot be installed does not prevent the others.
    let packages = wanted
        .lines()
        .map(str::trim)
        .filter(|line| !line.is_empty() && !line.starts_with('#'));
    for package in packages {
        let mut install = Command::new(&python);
        install.args(["-m", "pip", "install", "--quiet"]);
        install.args([
            "--disable-pip-version-check",
            "--only-binary=:all:",
            package,
        ]);
        if !succeeds(&workspace.root, &mut install)? {
            println!("continuing without {package}");
        }
    }
    std::fs::write(&stamp, wanted)
        .map_err(|error| format!("cannot write {}: {error}", stamp.display()))?;
    Ok(python)
}
