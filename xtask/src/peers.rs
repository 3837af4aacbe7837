//! `cargo xtask peers`: compares time and error of nanotap and general solvers.
//!
//! This prepares the environment and starts `peers/run.py`, which measures and writes
//! `docs/peers.md`. Programs that a machine cannot run are left out, with the reason.

use std::process::Command;

use crate::process::{check, must, succeeds};
use crate::tally::Tally;
use crate::tools::{Environment, PYTHON, Workspace};

/// Runs the comparison; `options` are those of `peers/run.py`.
///
/// # Errors
/// If there is no Python, or nanotap does not build.
pub(crate) fn run(workspace: &Workspace, options: &[String]) -> Result<Tally, String> {
    let help = options.iter().any(|o| ["-h", "--help"].contains(&&**o));
    let mut command = if help {
        Command::new(PYTHON)
    } else {
        for (package, example) in [("nanotap", "peer"), ("nanotap-volterra", "dmt_peer")] {
            let mut build = workspace.cargo(&["build", "--release", "--quiet"]);
            build.args(["--package", package, "--example", example]);
            let failure = format!("cannot build the example {example} of {package}");
            must(&workspace.root, &mut build, &failure)?;
        }
        environment(workspace)?.program("python")
    };
    let target = workspace.target();
    command
        .arg("peers/run.py")
        .arg("--build")
        .arg(target.join("peers"))
        .args(options)
        .env("CARGO", workspace.cargo_program())
        .env("NANOTAP_PEER", target.join("release/examples/peer"))
        .env("NANOTAP_LAW_PEER", target.join("release/examples/dmt_peer"));
    check(&workspace.root, &mut command)
}

/// `.venv-peers`, with those packages of `peers/requirements.txt` that can be installed.
fn environment(workspace: &Workspace) -> Result<Environment, String> {
    let root = &workspace.root;
    let list = root.join("peers").join("requirements.txt");
    Environment::with(
        root,
        root.join(".venv-peers"),
        &list,
        |environment, list| {
            // One by one: a package that cannot be installed does not prevent the others.
            let lines = list.lines().map(str::trim);
            for package in lines.filter(|line| !line.is_empty() && !line.starts_with('#')) {
                let mut install = environment.pip();
                if !succeeds(root, install.args(["--only-binary=:all:", package]))? {
                    println!("continuing without {package}");
                }
            }
            Ok(())
        },
    )
}
