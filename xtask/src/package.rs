//! What would be published: every crate and the Python package, each built from its own archive
//! alone and tried in an empty environment.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};

use crate::process::{output, succeeds};
use crate::tally::Tally;
use crate::tools::{Environment, Workspace};
use crate::wheel::with_extension;

/// What is asked of the installed Python package.
const TRIAL: &str = "\
import nanotap
found = nanotap.orbit(nanotap.Case.paper(omega=20.0))
assert found.period == 1 and found.stable, found
print('nanotap', nanotap.__version__, 'from its source archive:', found)";

/// Packs every crate that is published and compiles what was packed.
///
/// # Errors
/// When cargo cannot be started.
pub(crate) fn crates(workspace: &Workspace) -> Result<Tally, String> {
    let target = workspace.target().join("packed");
    forget(&target);
    let mut command = workspace.cargo(&["package", "--workspace", "--locked"]);
    command.arg("--target-dir").arg(&target);
    for own in ["xtask", "nanotap-book", "nanotap-python"] {
        command.args(["--exclude", own]);
    }
    // Whether it compiles, not how fast it runs; uncommitted work is packed as it stands.
    command.args(["--allow-dirty", "--config", "profile.dev.opt-level=0"]);
    command.args(["--config", "profile.dev.debug=0"]);
    Ok(Tally::check(succeeds(&workspace.root, &mut command)?))
}

/// Cargo takes a version for what never changes: what it unpacked and compiled of an earlier state
/// of the same version would stand in for what is packed now.
fn forget(target: &Path) {
    let _ = fs::remove_dir_all(target);
    let home = env::var_os("CARGO_HOME").map(PathBuf::from);
    let Some(home) = home.or_else(|| Some(env::home_dir()?.join(".cargo"))) else {
        return;
    };
    let Ok(registries) = fs::read_dir(home.join("registry/src")) else {
        return;
    };
    let registries = registries.flatten().filter(|registry| {
        // One that has no host is a folder, such as cargo makes of what it packs.
        registry.file_name().to_string_lossy().starts_with('-')
    });
    let unpacked = registries.filter_map(|registry| fs::read_dir(registry.path()).ok());
    for crate_ in unpacked.flatten().flatten() {
        if crate_.file_name().to_string_lossy().starts_with("nanotap") {
            let _ = fs::remove_dir_all(crate_.path());
        }
    }
}

/// Packs the Python package's sources, installs that archive into an empty environment, and
/// computes an orbit there.
///
/// # Errors
/// When Python or maturin is missing.
pub(crate) fn python(workspace: &Workspace) -> Result<Tally, String> {
    let folder = workspace.target().join("sdist");
    // An archive of another version would be installed in its place.
    let _ = fs::remove_dir_all(&folder);
    let mut pack = workspace.python_tool("maturin")?;
    pack.args([
        "sdist",
        "--manifest-path",
        "crates/nanotap-python/Cargo.toml",
    ]);
    pack.arg("--out").arg(&folder);
    if !succeeds(&workspace.root, &mut pack)? {
        return Ok(Tally::check(false));
    }
    let archives = with_extension(&folder, "gz");
    let Some(archive) = archives.first() else {
        return Err(format!("no archive in {}", folder.display()));
    };
    let environment = Environment::empty(&workspace.root, folder.join("environment"))?;
    let mut install = environment.program("python");
    install.args([
        "-m",
        "pip",
        "install",
        "--quiet",
        "--disable-pip-version-check",
    ]);
    // Into a folder of its own: files of an archive all have one time, by which cargo would take
    // what the checkout has built for them.
    install
        .arg(archive)
        .env("CARGO_TARGET_DIR", folder.join("build"))
        .env("CARGO_PROFILE_RELEASE_OPT_LEVEL", "0")
        .env("CARGO_PROFILE_RELEASE_DEBUG", "false");
    if !succeeds(&workspace.root, &mut install)? {
        return Ok(Tally::check(false));
    }
    let mut trial = environment.program("python");
    // Away from the checkout, whose own package would be found first.
    let said = output(&folder, trial.args(["-c", TRIAL]));
    println!(
        "{}",
        said.as_deref().unwrap_or("the package does not run").trim()
    );
    Ok(Tally::check(said.is_some()))
}
