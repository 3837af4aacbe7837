//! The packages to be published: every crate and the Python package, each built from its own
//! archive alone and tested in an empty environment.

use std::path::Path;
use std::process::Command;
use std::{fs, io};

use crate::process::{check, must, output, succeeds};
use crate::tally::Tally;
use crate::tools::{Environment, Workspace};
use crate::wheel::with_extension;

/// Test program for the installed Python package.
const TRIAL: &str = "\
import nanotap
found = nanotap.orbit(nanotap.Case.paper(omega=20.0))
assert found.period == 1 and found.stable, found
print('nanotap', nanotap.__version__, 'from its source archive:', found)";

/// Packages of this workspace that are not published as crates.
const UNPUBLISHED: [&str; 5] = [
    "xtask",
    "nanotap-book",
    "nanotap-bundle",
    "nanotap-python",
    "nanotap-web",
];

/// Packs every published crate and checks that the contents of the archives compile together.
///
/// # Errors
/// If a tool is missing, or the archives cannot be unpacked.
pub(crate) fn crates(workspace: &Workspace) -> Result<Tally, String> {
    let folder = workspace.target().join("packed");
    // Archives of an earlier state would be unpacked as well.
    let _ = fs::remove_dir_all(&folder);
    let mut command = workspace.cargo(&["package", "--workspace", "--locked"]);
    command.arg("--target-dir").arg(&folder);
    for own in UNPUBLISHED {
        command.args(["--exclude", own]);
    }
    // Uncommitted changes are packed too. Cargo would compile each archive by itself, and the
    // dependencies of some again with other features.
    command.args(["--allow-dirty", "--no-verify"]);
    if !succeeds(&workspace.root, &mut command)? {
        return Ok(Tally::check(false));
    }
    let sources = folder.join("sources");
    let failed = |error: io::Error| format!("cannot write {}: {error}", sources.display());
    fs::create_dir_all(&sources).map_err(failed)?;
    let mut members = Vec::new();
    for archive in with_extension(&folder.join("package"), "crate") {
        // As of now: all files of an archive have the same time, so that changed ones would look compiled.
        let mut unpack = Command::new("tar");
        unpack.arg("-xmzf").arg(&archive).arg("-C").arg(&sources);
        must(&folder, &mut unpack, "an archive cannot be unpacked")?;
        members.extend(
            archive
                .file_stem()
                .and_then(|name| name.to_str())
                .map(str::to_owned),
        );
    }
    fs::write(sources.join("Cargo.toml"), manifest(&members)).map_err(failed)?;
    fs::copy(
        workspace.root.join("Cargo.lock"),
        sources.join("Cargo.lock"),
    )
    .map_err(failed)?;
    // What clippy has checked of the dependencies is taken from there.
    let mut compile = workspace.cargo(&["check", "--workspace", "--release", "--target-dir"]);
    check(&sources, compile.arg(workspace.target()))
}

/// A workspace of unpacked archives, in which each takes the others from beside it.
fn manifest(members: &[String]) -> String {
    let quoted: Vec<String> = members.iter().map(|name| format!("{name:?}")).collect();
    let mut text = format!(
        "[workspace]\nresolver = \"3\"\nmembers = [{}]\n\n[patch.crates-io]\n",
        quoted.join(", ")
    );
    for folder in members {
        // The folder of a crate is its name and its version.
        let name = folder
            .rsplit_once('-')
            .map_or(folder.as_str(), |(name, _)| name);
        text.extend([name, " = { path = \"", folder, "\" }\n"]);
    }
    text
}

/// Removes what tells cargo that the crates of this workspace are compiled, from the folder of a profile.
/// All files of an archive have the same time, so that changed ones look current; dependencies stay.
fn forget_compiled(profile: &Path) {
    let Ok(known) = fs::read_dir(profile.join(".fingerprint")) else {
        return;
    };
    for one in known.flatten() {
        let name = one.file_name();
        let name = name.to_string_lossy();
        if name.starts_with("nanotap") || name.starts_with("afm-") {
            let _ = fs::remove_dir_all(one.path());
        }
    }
}

/// Packs the Python package's sources, installs the archive into an empty environment, and computes
/// an orbit there.
///
/// # Errors
/// If Python or maturin is missing.
pub(crate) fn python(workspace: &Workspace) -> Result<Tally, String> {
    let folder = workspace.target().join("sdist");
    // An archive of another version would be installed instead.
    for old in with_extension(&folder, "gz") {
        let _ = fs::remove_file(old);
    }
    let _ = fs::remove_dir_all(folder.join("environment"));
    let build = folder.join("build");
    forget_compiled(&build.join("release"));
    let mut pack = workspace.python_tool("maturin")?;
    pack.args(["sdist", "--out"]).arg(&folder);
    if !succeeds(&workspace.root, &mut pack)? {
        return Ok(Tally::check(false));
    }
    let archives = with_extension(&folder, "gz");
    let Some(archive) = archives.first() else {
        return Err(format!("no archive in {}", folder.display()));
    };
    let environment = Environment::empty(&workspace.root, folder.join("environment"))?;
    let mut install = environment.pip();
    // In a separate folder: cargo would take build outputs of the checkout for current.
    install
        .arg(archive)
        .env("CARGO_TARGET_DIR", build)
        .env("CARGO_PROFILE_RELEASE_OPT_LEVEL", "0")
        .env("CARGO_PROFILE_RELEASE_DEBUG", "false");
    if !succeeds(&workspace.root, &mut install)? {
        return Ok(Tally::check(false));
    }
    let mut trial = environment.program("python");
    // Outside of the checkout, whose own package would be found first.
    let printed = output(&folder, trial.args(["-c", TRIAL]));
    println!(
        "{}",
        printed
            .as_deref()
            .unwrap_or("the package does not run")
            .trim()
    );
    Ok(Tally::check(printed.is_some()))
}
