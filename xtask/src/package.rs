//! The packages to be published: every crate and the Python package, each built from its own
//! archive alone and tested in an empty environment.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};

use crate::process::{check, output, succeeds};
use crate::tally::Tally;
use crate::tools::{Environment, Workspace};
use crate::wheel::with_extension;

/// Test program for the installed Python package.
const TRIAL: &str = "\
import nanotap
found = nanotap.orbit(nanotap.Case.paper(omega=20.0))
assert found.period == 1 and found.stable, found
print('nanotap', nanotap.__version__, 'from its source archive:', found)";

/// Packs every published crate and compiles the archives.
///
/// # Errors
/// If cargo cannot be started.
pub(crate) fn crates(workspace: &Workspace) -> Result<Tally, String> {
    let target = workspace.target().join("packed");
    forget(&target);
    let mut command = workspace.cargo(&["package", "--workspace", "--locked"]);
    command.arg("--target-dir").arg(&target);
    for own in [
        "xtask",
        "nanotap-book",
        "nanotap-bundle",
        "nanotap-python",
        "nanotap-web",
    ] {
        command.args(["--exclude", own]);
    }
    // The build tests compilation, not speed; uncommitted changes are packed too.
    command.args(["--allow-dirty", "--config", "profile.dev.opt-level=0"]);
    command.args(["--config", "profile.dev.debug=0"]);
    check(&workspace.root, &mut command)
}

/// Whether a crate, or what cargo made of it, is one of this workspace by its name.
fn is_own(name: &str) -> bool {
    name.starts_with("nanotap") || name.starts_with("afm-")
}

/// Removes what tells cargo that the crates of this workspace are compiled, from the folder of a profile.
/// All files of an archive have the same time, so that changed ones look current; dependencies stay.
fn forget_compiled(profile: &Path) {
    let Ok(known) = fs::read_dir(profile.join(".fingerprint")) else {
        return;
    };
    for one in known.flatten() {
        if is_own(&one.file_name().to_string_lossy()) {
            let _ = fs::remove_dir_all(one.path());
        }
    }
}

/// Cargo assumes that a version never changes: files unpacked and compiled from an earlier state of
/// the same version would be used instead of the new ones.
fn forget(target: &Path) {
    let _ = fs::remove_dir_all(target.join("package"));
    forget_compiled(&target.join("debug"));
    let home = env::var_os("CARGO_HOME").map(PathBuf::from);
    let Some(home) = home.or_else(|| Some(env::home_dir()?.join(".cargo"))) else {
        return;
    };
    let Ok(registries) = fs::read_dir(home.join("registry/src")) else {
        return;
    };
    let registries = registries.flatten().filter(|registry| {
        // A source without a host is a folder, such as cargo makes of packed crates.
        registry.file_name().to_string_lossy().starts_with('-')
    });
    let unpacked = registries.filter_map(|registry| fs::read_dir(registry.path()).ok());
    for crate_ in unpacked.flatten().flatten() {
        if is_own(&crate_.file_name().to_string_lossy()) {
            let _ = fs::remove_dir_all(crate_.path());
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
