//! Source packages in which files of instruments are published, for the tests of several crates.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The folder of a source package, which is downloaded once; `None` if that fails.
pub(crate) fn package(name: &str, version: &str) -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("afm-files");
    let unpacked = format!("{name}-{version}");
    let package = folder.join(&unpacked);
    if package.is_dir() {
        return Some(package);
    }
    // Tests of other processes look for the same package: it appears in one step.
    let own = folder.join(std::process::id().to_string());
    fs::create_dir_all(&own).ok()?;
    let run = |command: &mut Command| {
        let status = command.current_dir(&own).status();
        status.is_ok_and(|of| of.success())
    };
    let is_unpacked = run(Command::new("python3")
        .args(["-m", "pip", "download", "--quiet", "--no-deps"])
        .args(["--retries", "1", "--timeout", "20", "--no-binary", ":all:"])
        .arg(format!("{name}=={version}")))
        && run(Command::new("tar")
            .arg("-xzf")
            .arg(format!("{unpacked}.tar.gz")));
    if is_unpacked {
        // It fails where another process was faster.
        let _ = fs::rename(own.join(&unpacked), &package);
    }
    let _ = fs::remove_dir_all(own);
    package.is_dir().then_some(package)
}
